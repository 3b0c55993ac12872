//! Points project as each format's documentation says.
#![allow(clippy::unwrap_used)]

use super::*;
use std::fs;

const SIZE: (u32, u32) = (60, 40);
const POINTS: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [0.3, -0.2, 0.1], [-0.4, 0.1, 0.5], [0.2, 0.6, -0.3]];

/// Column and row by the camera.
fn by_camera(camera: &Camera, p: [f64; 3]) -> [f64; 2] {
    let [column, row, _] = camera.project(p.into(), SIZE).unwrap();
    [column, row]
}

/// Column and row of a point in OpenCV's camera axes.
fn by_intrinsics([x, y, z]: [f64; 3], [fx, fy, cx, cy]: [f64; 4]) -> [f64; 2] {
    [fx * x / z + cx, fy * y / z + cy]
}

#[track_caller]
fn assert_close(a: [f64; 2], b: [f64; 2]) {
    assert!((a[0] - b[0]).abs() < 1e-9 && (a[1] - b[1]).abs() < 1e-9, "{a:?} {b:?}");
}

fn cameras(files: &[(&str, &str)]) -> Result<Vec<Camera>> {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        fs::write(folder.path().join(name), text).unwrap();
    }
    let (path, views) = read(folder.path(), None, 30.0, &mut Vec::new())?;
    views.iter().map(|view| view.camera(&path, SIZE)).collect()
}

/// A rotation about an oblique axis, its rows, and a translation that puts the points before the camera.
fn pose() -> ([f64; 4], [[f64; 3]; 3], [f64; 3]) {
    let (half, axis) = (0.4f64, [1.0 / 3.0, 2.0 / 3.0, -2.0 / 3.0]);
    let [w, x, y, z] = [half.cos(), axis[0] * half.sin(), axis[1] * half.sin(), axis[2] * half.sin()];
    // COLMAP's own formula for the matrix of a quaternion.
    let rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ];
    ([w, x, y, z], rows, [0.1, -0.2, 4.0])
}

fn in_camera(p: [f64; 3]) -> [f64; 3] {
    let (_, rows, t) = pose();
    [0, 1, 2].map(|i| rows[i][0] * p[0] + rows[i][1] * p[1] + rows[i][2] * p[2] + t[i])
}

/// Rows of world to camera, and of its inverse (Rᵀ, -Rᵀ t) with the camera's axes times `signs`.
fn matrices(signs: [f64; 3]) -> [String; 2] {
    let (_, r, t) = pose();
    let row = |i: usize| format!("[{}, {}, {}, {}]", r[i][0], r[i][1], r[i][2], t[i]);
    let forth = format!("[{}, {}, {}, [0, 0, 0, 1]]", row(0), row(1), row(2));
    let eye = [0, 1, 2].map(|i| -(0..3).map(|k| r[k][i] * t[k]).sum::<f64>());
    let column =
        |i: usize| format!("[{}, {}, {}, {}]", signs[0] * r[0][i], signs[1] * r[1][i], signs[2] * r[2][i], eye[i]);
    [forth, format!("[{}, {}, {}, [0, 0, 0, 1]]", column(0), column(1), column(2))]
}

const LENS: [f64; 4] = [50.0, 55.0, 28.0, 23.0];

#[test]
fn points_project_by_intrinsics_and_matrices() {
    let [forth, back] = matrices([1.0; 3]);
    let lens = "\"intrinsics\": [[50, 0, 28], [0, 55, 23], [0, 0, 1]]";
    let list = format!(
        r#"[{{"file": "a.png", {lens}, "world_to_camera": {forth}}}, {{"file": "a.png", {lens}, "camera_to_world": {back}}},
            {{"file": "a.png", "fov": 40, "world_to_camera": {forth}}}]"#
    );
    let cameras = cameras(&[("cameras.json", &list)]).unwrap();
    let focal = 20.0 / 20f64.to_radians().tan();
    for p in POINTS {
        for camera in &cameras[..2] {
            assert_close(by_camera(camera, p), by_intrinsics(in_camera(p), LENS));
        }
        assert_close(by_camera(&cameras[2], p), by_intrinsics(in_camera(p), [focal, focal, 30.0, 20.0]));
    }
}

/// NeRF's rays through a pixel position: ((column - cx) / fl_x, -(row - cy) / fl_y, -1) in the camera's axes.
#[test]
fn points_project_by_transforms() {
    // x right, y up, z backward: two of OpenCV's axes turned round.
    let [_, back] = matrices([1.0, -1.0, -1.0]);
    let frame = |extra: &str| format!(r#"{{"file_path": "./images/a", {extra} "transform_matrix": {back}}}"#);
    let by_pixels = format!(
        r#"{{"fl_x": 50, "fl_y": 55, "cx": 28, "cy": 23, "w": 60, "h": 40, "k1": 0, "camera_model": "OPENCV", "aabb_scale": 4,
            "frames": [{}, {}]}}"#,
        frame(""),
        frame("\"fl_x\": 70, \"fl_y\": 70, \"sharpness\": 3.5,")
    );
    let [far, near] = ["\"rotation\": 0.01,", "\"camera_angle_x\": 0.6,"].map(frame);
    let by_angle = format!(r#"{{"camera_angle_x": 0.8, "frames": [{far}, {near}]}}"#);
    // The synthetic scenes of NeRF have a file for the views to learn from, one to validate and one to test with.
    let pixels = cameras(&[("transforms_test.json", "{}"), ("transforms_train.json", &by_pixels)]).unwrap();
    let angle = cameras(&[("transforms.json", &by_angle)]).unwrap();
    let focal = [0.4f64, 0.3].map(|half| 30.0 / half.tan());
    for p in POINTS {
        assert_close(by_camera(&pixels[0], p), by_intrinsics(in_camera(p), LENS));
        assert_close(by_camera(&pixels[1], p), by_intrinsics(in_camera(p), [70.0, 70.0, 28.0, 23.0]));
        for (camera, f) in angle.iter().zip(focal) {
            assert_close(by_camera(camera, p), by_intrinsics(in_camera(p), [f, f, 30.0, 20.0]));
        }
    }
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("transforms.json"), by_angle).unwrap();
    assert_eq!(read(folder.path(), None, 30.0, &mut Vec::new()).unwrap().1[0].file, Path::new("./images/a.png"));
}

fn images(camera: u32) -> String {
    let ([w, x, y, z], _, [a, b, c]) = pose();
    format!(
        "# comment\n1 {w} {x} {y} {z} {a} {b} {c} {camera} a picture.png\n10.5 3 -1 7 8 2\n\
         2 {w} {x} {y} {z} {a} {b} {c} {camera} b.png\n\n"
    )
}

#[test]
fn points_project_by_colmap() {
    for model in ["PINHOLE 60 40 50 55 28 23", "OPENCV 60 40 50 55 28 23 0 0 0 0"] {
        let list = format!("# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n\n7 {model}\n");
        let cameras = cameras(&[("cameras.txt", &list), ("images.txt", &images(7))]).unwrap();
        assert_eq!(cameras.len(), 2);
        for p in POINTS {
            assert_close(by_camera(&cameras[1], p), by_intrinsics(in_camera(p), LENS));
        }
    }
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("cameras.txt"), "7 SIMPLE_PINHOLE 60 40 50 30 20").unwrap();
    fs::write(folder.path().join("images.txt"), images(7)).unwrap();
    let (_, views) = read(folder.path(), Some(&folder.path().join("cameras.txt")), 30.0, &mut Vec::new()).unwrap();
    assert_eq!([&views[0].file, &views[1].file], [Path::new("a picture.png"), Path::new("b.png")]);
}

/// The camera's place in the world.
fn eye() -> [f64; 3] {
    let (_, r, t) = pose();
    [0, 1, 2].map(|i| -(0..3).map(|k| r[k][i] * t[k]).sum::<f64>())
}

/// A .npy file of doubles.
fn npy(shape: &str, values: &[f64]) -> Vec<u8> {
    let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({shape}), }}");
    let mut bytes = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    bytes.extend(format!("{header:<117}\n").bytes());
    bytes.extend(values.iter().flat_map(|x| x.to_le_bytes()));
    bytes
}

#[test]
fn points_project_by_poses_in_files_of_numbers() {
    let ((_, r, _), eye) = (pose(), eye());
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let camera = |file: &str| {
        let (path, views) = read(folder.path(), Some(&at(file)), 30.0, &mut Vec::new()).unwrap();
        assert_eq!(views.len(), 2);
        let mut view = views[1].clone();
        view.scale_to(SIZE);
        view.camera(&path, SIZE).unwrap()
    };
    let assert_seen = |camera: &Camera, lens: [f64; 4]| {
        POINTS.iter().for_each(|&p| assert_close(by_camera(camera, p), by_intrinsics(in_camera(p), lens)));
    };
    for name in ["a.png", "b.png", "b_mask.png"] {
        fs::write(at(name), "").unwrap();
    }
    // A picture of half the size that is said.
    let hwf = [80.0, 120.0, 110.0];
    let row = [0, 1, 2].map(|i| [r[1][i], r[0][i], -r[2][i], eye[i], hwf[i]]).concat();
    let rows = [&row[..], &[1.0, 9.0], &row, &[1.0, 9.0]].concat();
    fs::write(at("poses_bounds.npy"), npy("2, 17", &rows)).unwrap();
    assert_seen(&camera("poses_bounds.npy"), [55.0, 55.0, 30.0, 20.0]);
    fs::write(at("poses_bounds.npy"), npy("1, 17", &rows[..17])).unwrap();
    let refused = read(folder.path(), None, 30.0, &mut Vec::new()).unwrap_err().to_string();
    assert!(refused.contains("1 poses for 2 pictures"), "{refused}");

    fs::create_dir(at("pose")).unwrap();
    let pose = [0, 1, 2].map(|i| format!("{} {} {} {}\n", r[0][i], r[1][i], r[2][i], eye[i])).concat() + "0 0 0 1\n";
    ["pose/a.txt", "pose/b.txt"].iter().for_each(|name| fs::write(at(name), &pose).unwrap());
    for (text, lens) in [
        ("50 0 28 0\n0 55 23 0\n0 0 1 0\n0 0 0 1\n", LENS),
        ("50 0 28\n0 55 23\n0 0 1\n", LENS),
        ("110. 58. 42. 0.\n0. 0. 0.\n1.\n1.\n80 120\n", [55.0, 55.0, 29.0, 21.0]),
    ] {
        fs::write(at("intrinsics.txt"), text).unwrap();
        assert_seen(&camera("intrinsics.txt"), lens);
    }
    fs::write(at("pose/b.txt"), "1 2 3").unwrap();
    let refused = read(folder.path(), Some(&at("intrinsics.txt")), 30.0, &mut Vec::new()).unwrap_err().to_string();
    assert!(refused.contains("b.txt: not 16 numbers"), "{refused}");

    let rotation = [0, 1, 2].map(|i| [r[0][i], r[1][i], r[2][i]]);
    let splat = format!(
        r#"[{{"id": 0, "img_name": "b", "width": 120, "height": 80, "position": {eye:?}, "rotation": {rotation:?}, "fy": 100, "fx": 110}}]"#
    );
    fs::write(at("cameras.json"), &splat).unwrap();
    fs::write(at("intrinsics.txt"), "1").unwrap();
    let (path, mut views) = read(folder.path(), None, 30.0, &mut Vec::new()).unwrap();
    assert_eq!(views[0].scale_to(SIZE), Some((120, 80)));
    assert_seen(&views[0].camera(&path, SIZE).unwrap(), [55.0, 50.0, 30.0, 20.0]);

    // A file whose pictures are elsewhere does not hide the next one.
    fs::write(at("cameras.json"), splat.replace("\"b\"", "\"absent\"")).unwrap();
    fs::write(at("poses_bounds.npy"), npy("2, 17", &rows)).unwrap();
    let mut notes = Vec::new();
    let (path, _) = read(folder.path(), None, 30.0, &mut notes).unwrap();
    assert!(path.ends_with("poses_bounds.npy") && notes.len() == 1, "{path:?} {notes:?}");
    assert!(notes[0].contains("cameras.json is left out: none of its pictures is there"), "{notes:?}");
}

/// A picture may be smaller or larger than its camera says, by the same factor along both sides.
#[test]
fn cameras_are_scaled_to_their_pictures() {
    let [_, back] = matrices([1.0, -1.0, -1.0]);
    let lens = |w: u32, h: u32| {
        format!("\"fl_x\": 100, \"fl_y\": 110, \"cx\": 56, \"cy\": 46, \"w\": {w}, \"h\": {h}, \"near\": 1,")
    };
    let file = |lens: &str| {
        let folder = tempfile::tempdir().unwrap();
        let frames = format!(r#"[{{"file_path": "a", "transform_matrix": {back}, "timestamp": 1.5}}]"#);
        fs::write(folder.path().join("transforms.json"), format!(r#"{{{lens} "frames": {frames}}}"#)).unwrap();
        let mut notes = Vec::new();
        let (path, views) = read(folder.path(), None, 30.0, &mut notes).unwrap();
        assert!(notes.len() == 1 && notes[0].ends_with("fields that are not used: near, timestamp"), "{notes:?}");
        (path, views[0].clone())
    };
    let (path, mut view) = file(&lens(120, 80));
    assert_eq!((view.scale_to(SIZE), view.scale_to(SIZE)), (Some((120, 80)), None));
    let camera = view.camera(&path, SIZE).unwrap();
    POINTS.iter().for_each(|&p| assert_close(by_camera(&camera, p), by_intrinsics(in_camera(p), LENS)));
    // A side that was rounded to whole pixels.
    assert_eq!(file(&lens(121, 80)).1.scale_to(SIZE), Some((121, 80)));
    assert_eq!(file(&lens(124, 80)).1.scale_to(SIZE), None);
    assert_eq!(file(&lens(80, 120)).1.scale_to(SIZE), None);
}

#[test]
fn a_file_of_cameras_stands_for_the_folder_of_its_pictures() {
    for (file, folder) in [
        ("a/transforms.json", Some("a")),
        ("a/0/transforms.json", Some("a/0")),
        ("transforms.json", Some("")),
        ("a/ball_par.txt", Some("a")),
        ("a/poses_bounds.npy", Some("a")),
        ("a/sparse/0/images.bin", Some("a")),
        ("a/colmap/sparse/0/cameras.txt", Some("a")),
        ("a/pictures.npy", None),
        ("a/0.png", None),
        ("a", None),
    ] {
        assert_eq!(folder_of(Path::new(file)), folder.map(Path::new), "{file}");
    }
}

#[test]
fn a_folder_without_cameras_is_told_what_it_has() {
    let folder = tempfile::tempdir().unwrap();
    let below = folder.path().join("photos/images");
    fs::create_dir_all(&below).unwrap();
    let refused = || read(&below, None, 30.0, &mut Vec::new()).unwrap_err().to_string();
    assert!(refused().contains("not found: write it"), "{}", refused());
    fs::write(below.join("cameras.sfm"), "{}").unwrap();
    assert!(refused().contains("cameras.sfm (Meshroom) is not read: write it"), "{}", refused());
    fs::create_dir_all(folder.path().join("photos/sparse/0")).unwrap();
    fs::write(folder.path().join("photos/sparse/0/images.txt"), "").unwrap();
    assert!(refused().contains("give the folder that has images.txt: "), "{}", refused());
}

#[test]
fn what_is_written_is_read_again() {
    let eyes = [[0.0, 1.0, 3.0], [2.0, -1.0, 1.0]];
    let mut made = eyes.map(|eye| Camera::look_at(eye.into(), DVec3::ZERO, DVec3::Y, perspective(0.6)).unwrap());
    let off_center = Projection::Pinhole { fx: 50.0, fy: 52.0, cx: 31.0, cy: 18.0 };
    made[1] = Camera::from_matrix(made[1].matrix(), off_center).unwrap();
    let image = |channels: usize, pixel: fn(usize) -> f32| {
        let (width, height) = (SIZE.0 as usize, SIZE.1 as usize);
        let data = (0..2 * width * height * channels).map(pixel).collect();
        softras::Image { batch: 2, height, width, channels, data }
    };
    let folder = tempfile::tempdir().unwrap();
    // Half covered by linear 0.5: sRGB's byte 188.
    crate::output::write_files(&files(folder.path(), &made, &image(1, |_| 0.5), &image(3, |_| 0.25)).unwrap()).unwrap();
    let (path, views) = read(folder.path(), None, 30.0, &mut Vec::new()).unwrap();
    for (view, made) in views.iter().zip(&made) {
        let camera = view.camera(&path, SIZE).unwrap();
        assert_eq!(camera, *made);
        let picture = image::open(folder.path().join(&view.file)).unwrap().into_rgba8();
        assert!(picture.dimensions() == SIZE && picture.pixels().all(|p| p.0 == [188, 188, 188, 128]));
    }
    assert_eq!(names(folder.path(), 2).iter().filter(|name| name.exists()).count(), 3);
}

#[test]
fn malformed_files_are_refused_by_their_place() {
    let [forth, back] = matrices([1.0, -1.0, -1.0]);
    let scaled = forth.replacen("[[", "[[2", 1);
    let list = |fields: String| vec![("cameras.json", format!(r#"[{{"file": "a.png", {fields}}}]"#))];
    let nerf = |top: &str, frame: &str| {
        let frames = format!(r#"[{{"file_path": "a", "transform_matrix": {back}{frame}}}]"#);
        vec![("transforms.json", format!(r#"{{{top} "frames": {frames}}}"#))]
    };
    let colmap = |cameras: &str, images: String| vec![("cameras.txt", cameras.to_string()), ("images.txt", images)];
    let good = "7 PINHOLE 60 40 50 55 28 23";
    let cases: Vec<(Vec<(&str, String)>, &str)> = vec![
        (
            list(format!("\"world_to_camera\": {forth}, \"eye\": [0, 0, 3]")),
            "camera 0 has no position, or more than one",
        ),
        (list(format!("\"world_to_camera\": {scaled}")), "world_to_camera: the upper left 3×3 part"),
        (list("\"world_to_camera\": [[1, 0, 0, 0]]".into()), "at [0].world_to_camera: "),
        (list(format!("\"camera_to_world\": {}", back.replace("1]]", "2]]"))), "the last row must be"),
        (list("\"eye\": [0, 0, 3], \"intrinsics\": [[50, 0, 30], [1, 50, 20], [0, 0, 1]]".into()), "of another form"),
        (
            list("\"eye\": [0, 0, 3], \"intrinsics\": [[0, 0, 30], [0, 50, 20], [0, 0, 1]]".into()),
            "focal lengths above 0",
        ),
        (list("\"eye\": [0, 0, 3], \"fov\": 30, \"intrinsics\": [[9, 0, 3], [0, 9, 3], [0, 0, 1]]".into()), "and fov"),
        (list("\"eye\": [0, 0, 4], \"target\": [1, 2]".into()), "at [0].target: "),
        (list("\"eye\": [0, 0, 4], \"fovy\": 60".into()), "at [0].fovy: unknown field"),
        (list("\"eye\": [0, 0, 4], \"fov\": 1e300".into()), "camera 0: camera: fov_y"),
        (list("\"distance\": 3, \"elevation\": 0, \"azimuth\": 0, \"up\": [0, 1, 0]".into()), "give eye"),
        (nerf("", ", \"fl\": 3"), "no focal length, and fields that are not known: fl"),
        (nerf("\"fl_x\": \"50\",", ""), "at fl_x: invalid type: string"),
        (nerf("\"k3\": 0.1,", ""), "distortion"),
        (nerf("\"is_fisheye\": true,", ""), "distortion"),
        (nerf("", ", \"is_fisheye\": true"), "distortion"),
        (nerf("\"mask_path\": \"a\",", ""), "outside of `frames`"),
        (nerf("", ", \"frames\": [{}]"), "frames within a frame"),
        (nerf("\"fl_x\": 50,", ""), "without a principal point"),
        (nerf("\"camera_angle_x\": 3.2,", ""), "frames[0]: camera_angle_x"),
        (nerf("\"w\": 65, \"h\": 40,", ""), "is 60×40 pixels, and not 65×40"),
        (vec![("transforms.json", "{\"frames\": []}".into())], "without cameras"),
        (colmap("7 PINHOLE 60 40 50 55 28", images(7)), "cameras.txt:1: 4 numbers are expected"),
        (colmap("7 FOV 60 40 50 55 28 23 1", images(7)), "camera model that is not read"),
        (colmap(&format!("{good}\n{good}"), images(7)), "cameras.txt:2: camera 7 again"),
        (colmap(good, images(8)), "images.txt:2: camera 8 is not in the file of cameras"),
        (colmap(good, "1 1 0 0 0 0 0 4 7\n".into()), "images.txt:1: a picture needs ten words"),
        (colmap(good, "1 2 0 0 0 0 0 4 7 a.png\n".into()), "another length than 1"),
        (colmap(good, "1 1 0 0 nan 0 0 4 7 a.png\n".into()), "7 numbers are expected"),
        (colmap(good, "x".repeat(20_000)), "more than 16384 bytes"),
        (
            vec![("a_par.txt", "2\na.png 1 0 0 0 1 0 0 0 1 1 0 0 0 1 0 0 0 1 0 0 4\n".to_string())],
            "1 pictures, but the first line",
        ),
        (colmap("7 PINHOLE 61 40 50 55 28 23", images(7)), "is 60×40 pixels, and not 61×40"),
    ];
    for (files, part) in cases {
        let files: Vec<(&str, &str)> = files.iter().map(|(name, text)| (*name, text.as_str())).collect();
        let error = cameras(&files).map_or_else(|error| error.to_string(), |_| "no error".into());
        assert!(error.contains(part), "{files:?}\n{error}\n{part}");
    }
}

const K: [f64; 5] = [50.0, 55.0, 28.0, 23.0, 0.7];

/// The column and the row of a point by K (R | t) of [`pose`] and [`K`].
fn by_k(p: [f64; 3]) -> [f64; 2] {
    let (_, rows, t) = pose();
    let [x, y, z]: [f64; 3] = std::array::from_fn(|i| (0..3).map(|k| rows[i][k] * p[k]).sum::<f64>() + t[i]);
    let [fx, fy, cx, cy, skew] = K;
    [(fx * x + skew * y) / z + cx, fy * y / z + cy]
}

#[test]
fn points_project_by_matrices_with_skew() {
    let (_, rows, t) = pose();
    let [fx, fy, cx, cy, skew] = K;
    let k = [[fx, skew, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]];
    let words = k.iter().chain(&rows).flatten().chain(&t).map(|x| x.to_string()).collect::<Vec<_>>().join(" ");
    let intrinsics = serde_json::json!([{ "file": "a.png", "intrinsics": k, "world_to_camera": [
        [rows[0][0], rows[0][1], rows[0][2], t[0]], [rows[1][0], rows[1][1], rows[1][2], t[1]],
        [rows[2][0], rows[2][1], rows[2][2], t[2]], [0, 0, 0, 1]] }]);
    let header = format!("name{}", " k".repeat(21));
    let lists = ["1\n".to_string(), String::new(), header + "\n"]
        .map(|first| ("thing_par.txt", format!("{first}a.png {words}\n")));
    let lists = lists.into_iter().chain([("cameras.json", intrinsics.to_string())]);
    for (name, text) in lists {
        let camera = cameras(&[(name, &text)]).unwrap()[0];
        let size = (SIZE.0 as usize, SIZE.1 as usize);
        let written = String::from_utf8(super::cameras(&["a.png".into()], &[camera], size)).unwrap();
        let again = cameras(&[("cameras.json", &written)]).unwrap()[0];
        for point in POINTS {
            assert_close(by_camera(&camera, point), by_k(point));
            assert_close(by_camera(&again, point), by_k(point));
        }
    }
    // P of any scale and sign, of the pictures in the order of their names.
    let folder = tempfile::tempdir().unwrap();
    let product = |i: usize, j: usize| (0..3).map(|m| k[i][m] * if j < 3 { rows[m][j] } else { t[m] }).sum::<f64>();
    let p: Vec<f64> = (0..16).map(|i| if i < 12 { -3.0 * product(i / 4, i % 4) } else { f64::from(i == 15) }).collect();
    for picture in ["b.png", "a.png"] {
        fs::write(folder.path().join(picture), "").unwrap();
    }
    let mats = ["world_mat_0", "world_mat_1"].map(|key| (key, vec![4, 4], crate::npy::Data::F64(&p)));
    crate::npz::write(&folder.path().join("cameras.npz"), &mats).unwrap();
    let (path, views) = read(folder.path(), None, 30.0, &mut Vec::new()).unwrap();
    fs::remove_file(folder.path().join("b.png")).unwrap();
    assert!(read(folder.path(), None, 30.0, &mut Vec::new()).unwrap_err().to_string().contains("only 1 pictures"));
    assert_eq!(views[0].file, Path::new("a.png"));
    let camera = views[1].camera(&path, SIZE).unwrap();
    POINTS.iter().for_each(|p| assert_close(by_camera(&camera, *p), by_k(*p)));
}

#[test]
fn binary_models_of_colmap_are_those_of_text() {
    let folder = tempfile::tempdir().unwrap();
    let (q, _, t) = pose();
    let floats = |values: &[f64]| values.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let mut cameras_file = [&1u64.to_le_bytes()[..], &7i32.to_le_bytes(), &4i32.to_le_bytes()].concat();
    cameras_file.extend([60u64, 40].iter().flat_map(|x| x.to_le_bytes()));
    cameras_file.extend(floats(&[50.0, 55.0, 28.0, 23.0, 0.1, 0.0, 0.01, 0.0]));
    let mut images = 2u64.to_le_bytes().to_vec();
    for name in ["a.png", "b c.png"] {
        images.extend([&1i32.to_le_bytes()[..], &floats(&q), &floats(&t), &7i32.to_le_bytes()].concat());
        images.extend([name.as_bytes(), &[0], &3u64.to_le_bytes(), &[7; 72]].concat());
    }
    fs::create_dir(folder.path().join("sparse")).unwrap();
    fs::write(folder.path().join("sparse/cameras.bin"), cameras_file).unwrap();
    fs::write(folder.path().join("sparse/images.bin"), &images).unwrap();
    let text = cameras(&[
        ("cameras.txt", "7 PINHOLE 60 40 50 55 28 23"),
        (
            "images.txt",
            &format!("1 {} {} 7 a.png\n", q.map(|x| x.to_string()).join(" "), t.map(|x| x.to_string()).join(" ")),
        ),
    ]);
    // The folder of the model.
    let (path, views) = read(folder.path(), Some(&folder.path().join("sparse")), 30.0, &mut Vec::new()).unwrap();
    assert_eq!(views.iter().map(|view| view.file.to_str().unwrap()).collect::<Vec<_>>(), ["a.png", "b c.png"]);
    let camera = views[1].camera(&path, SIZE).unwrap();
    POINTS.iter().for_each(|p| assert_close(by_camera(&camera, *p), by_camera(&text.as_ref().unwrap()[0], *p)));
    assert_eq!(views[0].bend, Some([0.1, 0.0, 0.01, 0.0]));
    // OpenCV's formula at x = 1/2, y = 1/5 by hand.
    let [column, row] = views[0].bent([50.0 * 0.5 + 28.0, 55.0 * 0.2 + 23.0]);
    assert_close([column, row], [50.0 * (0.5 * 1.029 + 0.002) + 28.0, 55.0 * (0.2 * 1.029 + 0.01 * 0.37) + 23.0]);
    for end in (0..images.len()).step_by(7) {
        fs::write(folder.path().join("sparse/images.bin"), &images[..end]).unwrap();
        assert!(
            read(folder.path(), Some(&folder.path().join("sparse")), 30.0, &mut Vec::new()).is_err(),
            "{end} bytes"
        );
    }
    let error =
        read(folder.path(), Some(&folder.path().join("sparse")), 30.0, &mut Vec::new()).unwrap_err().to_string();
    assert!(error.contains("images.bin") && error.contains("colmap model_converter"), "{error}");
}

#[test]
fn arrays_of_another_convention_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("c.npy");
    let read = |axes: [f64; 3]| {
        let view = DMat4::from_scale(DVec3::from(axes)).to_cols_array();
        fs::write(&path, crate::npy::write(&[1, 4, 4], crate::npy::Data::F64(&view))).unwrap();
        crate::views::arrays::read_cameras(&path, 30.0, &crate::Budget::new(None))
    };
    assert!(read([1.0, 1.0, -1.0]).is_ok_and(|cameras| cameras.len() == 1));
    // With y down as well, and with z backward as well.
    for axes in [[1.0, -1.0, -1.0], [1.0, 1.0, 1.0]] {
        let error = read(axes).unwrap_err().to_string();
        assert!(error.contains("camera 0 mirrors") && error.contains("negate row 1 (OpenCV)"), "{error}");
    }
}
