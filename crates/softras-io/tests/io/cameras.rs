//! Sets of pictures as programs write them: in every format of cameras, what a picture shows is where its camera projects it.

use super::numpy::Npz;
use glam::{DMat3, DMat4, DQuat, DVec3};
use image::{DynamicImage, ImageEncoder, Rgb, RgbImage, codecs::jpeg::JpegEncoder};
use serde_json::{Value, json};
use softras_io::{Budget, Views, ViewsOptions};
use std::{fs, path::Path};

/// Columns and rows of the pictures as their cameras have them.
const SIZE: [u32; 2] = [96, 72];
/// The middle of a ball.
const BALL: DVec3 = DVec3::new(0.25, -0.2, 0.3);
/// OpenCV's k1, k2, p1, p2.
const BEND: [f64; 4] = [0.2, -0.05, 0.01, -0.02];

const FORMATS: [&str; 8] =
    ["list", "list fov", "transforms", "transforms angle", "colmap txt", "colmap bin", "npz", "par"];

/// How a set is made.
#[derive(Clone, Copy, Default, Debug)]
struct Set {
    is_rounded: bool,
    is_mirrored: bool,
    is_bent: bool,
    is_off_center: bool,
    /// EXIF's orientation; 0 for none.
    exif: u8,
    has_missing: bool,
    is_reversed: bool,
    is_upper_case: bool,
}

/// A camera in OpenCV's axes.
struct Pose {
    turn: DMat3,
    shift: DVec3,
}

impl Set {
    /// Whether a format can have it.
    fn fits(&self, format: &str) -> bool {
        let by_angle = format == "list fov" || format == "transforms angle";
        let bends = ["transforms", "colmap txt", "colmap bin"].contains(&format);
        let mirrors = !format.starts_with("colmap");
        // The archive goes by the order of the numbers in names.
        let names = format != "npz";
        !(self.is_off_center && by_angle
            || self.is_bent && !bends
            || self.is_mirrored && !mirrors
            || self.is_reversed && !names)
    }

    /// fx, fy, cx, cy.
    fn lens(&self) -> [f64; 4] {
        if self.is_off_center { [110.0, 118.0, 44.0, 39.0] } else { [110.0, 110.0, 48.0, 36.0] }
    }

    fn poses(&self) -> Vec<Pose> {
        let one = |i: usize| {
            let angle = 2.2 * i as f64 + 0.4;
            let eye = DVec3::new(4.0 * angle.sin(), 1.0 - 0.7 * i as f64, 4.0 * angle.cos());
            let forward = -eye.normalize();
            let right = forward.cross(DVec3::Y).normalize();
            let turn = DMat3::from_cols(right, forward.cross(right), forward).transpose();
            let mirror = DVec3::new(if self.is_mirrored { -1.0 } else { 1.0 }, 1.0, 1.0);
            Pose { turn: turn * DMat3::from_diagonal(mirror), shift: turn * -eye }
        };
        (0..4).map(one).collect()
    }

    fn ball(&self) -> DVec3 {
        if self.is_mirrored { BALL * DVec3::new(-1.0, 1.0, 1.0) } else { BALL }
    }

    /// The ball as a camera shows it, and darker things beside it so that no other orientation shows the same.
    fn picture(&self, pose: &Pose) -> RgbImage {
        let [fx, fy, cx, cy] = self.lens();
        let [x, y, z] = (pose.turn * self.ball() + pose.shift).to_array();
        let (x, y) = (x / z, y / z);
        let [k1, k2, p1, p2] = if self.is_bent { BEND } else { [0.0; 4] };
        let square = x * x + y * y;
        let radial = 1.0 + k1 * square + k2 * square * square;
        let bent = [
            x * radial + 2.0 * p1 * x * y + p2 * (square + 2.0 * x * x),
            y * radial + p1 * (square + 2.0 * y * y) + 2.0 * p2 * x * y,
        ];
        let [column, row] = [fx * bent[0] + cx, fy * bent[1] + cy];
        RgbImage::from_fn(SIZE[0], SIZE[1], |x, y| {
            let far = (f64::from(x) + 0.5 - column).hypot(f64::from(y) + 0.5 - row);
            Rgb([if far < 6.0 { 220 } else { 0 }; 3])
        })
    }

    /// Writes the pictures and their cameras, and returns their names in the order in which they are read.
    fn write(&self, folder: &Path, format: &str) -> Vec<String> {
        let poses = self.poses();
        // Their order is that of the numbers, in which 10 follows 9.
        let name = |i: usize| format!("p{}_{i}.jpg", i + 8);
        for (i, pose) in poses.iter().enumerate().filter(|(i, _)| !(self.has_missing && *i == 1)) {
            let name = if self.is_upper_case { name(i).to_uppercase() } else { name(i) };
            write_jpeg(&folder.join(name), self.picture(pose), self.exif, format.starts_with("list"));
        }
        let mut order: Vec<usize> = (0..poses.len()).collect();
        if self.is_reversed {
            order.reverse();
        }
        self.write_cameras(folder, format, &order.iter().map(|&i| (name(i), &poses[i])).collect::<Vec<_>>());
        order.retain(|i| !(self.has_missing && *i == 1));
        order.into_iter().map(|i| if self.is_upper_case { name(i).to_uppercase() } else { name(i) }).collect()
    }

    /// A number with the digits that the set has.
    fn digits(&self, x: f64) -> f64 {
        if self.is_rounded { f64::from(x as f32) } else { x }
    }

    fn rows(&self, matrix: DMat4) -> Value {
        json!((0..4).map(|i| matrix.row(i).to_array().map(|x| self.digits(x))).collect::<Vec<_>>())
    }

    fn write_cameras(&self, folder: &Path, format: &str, views: &[(String, &Pose)]) {
        let [fx, fy, cx, cy] = self.lens();
        let [k1, k2, p1, p2] = if self.is_bent { BEND } else { [0.0; 4] };
        let (width, height) = (f64::from(SIZE[0]), f64::from(SIZE[1]));
        let angle = |side: f64, focal: f64| self.digits(2.0 * (0.5 * side / focal).atan());
        let k = [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]];
        let pose = |pose: &Pose| DMat4::from_translation(pose.shift) * DMat4::from_mat3(pose.turn);
        let entry = |(name, view): &(String, &Pose)| {
            let to_view = pose(view);
            let back = to_view.inverse();
            match format {
                "list" => json!({ "file": name, "intrinsics": k, "world_to_camera": self.rows(to_view) }),
                "list fov" => {
                    json!({ "file": name, "fov": angle(height, fy).to_degrees(), "camera_to_world": self.rows(back) })
                }
                // OpenGL's axes: y up and z backward.
                _ => {
                    let back = back * DMat4::from_scale(DVec3::new(1.0, -1.0, -1.0));
                    json!({ "file_path": format!("./{name}"), "transform_matrix": self.rows(back) })
                }
            }
        };
        let entries = || views.iter().map(entry).collect::<Vec<_>>();
        let write = |name: &str, bytes: Vec<u8>| fs::write(folder.join(name), bytes).unwrap();
        let text = |numbers: &[f64]| numbers.iter().map(|x| format!(" {}", self.digits(*x))).collect::<String>();
        match format {
            "list" | "list fov" => write("cameras.json", json!(entries()).to_string().into()),
            "transforms" => {
                let set = json!({ "w": SIZE[0], "h": SIZE[1], "fl_x": fx, "fl_y": fy, "cx": cx, "cy": cy, "k1": k1,
                    "k2": k2, "p1": p1, "p2": p2, "frames": entries() });
                write("transforms.json", set.to_string().into());
            }
            "transforms angle" => {
                let set = json!({ "camera_angle_x": angle(width, fx), "camera_angle_y": angle(height, fy), "frames": entries() });
                write("transforms.json", set.to_string().into());
            }
            "colmap txt" => {
                let lens = text(&[fx, fy, cx, cy, k1, k2, p1, p2]);
                write("cameras.txt", format!("7 OPENCV {} {}{lens}\n", SIZE[0], SIZE[1]).into());
                let line = |(i, (name, view)): (usize, &(String, &Pose))| {
                    format!("{i}{} 7 {name}\n\n", text(&quaternion(view)))
                };
                write("images.txt", views.iter().enumerate().map(line).collect::<String>().into());
            }
            "colmap bin" => {
                let floats =
                    |values: &[f64]| values.iter().flat_map(|x| self.digits(*x).to_le_bytes()).collect::<Vec<u8>>();
                let mut cameras = [&1u64.to_le_bytes()[..], &7i32.to_le_bytes(), &4i32.to_le_bytes()].concat();
                cameras.extend(SIZE.map(u64::from).iter().flat_map(|x| x.to_le_bytes()));
                cameras.extend(floats(&[fx, fy, cx, cy, k1, k2, p1, p2]));
                let mut images = (views.len() as u64).to_le_bytes().to_vec();
                for (name, view) in views {
                    images.extend([&1i32.to_le_bytes()[..], &floats(&quaternion(view)), &7i32.to_le_bytes()].concat());
                    images.extend([name.as_bytes(), &[0], &0u64.to_le_bytes()].concat());
                }
                // As COLMAP's automatic reconstruction lays them.
                fs::create_dir_all(folder.join("sparse/0")).unwrap();
                write("sparse/0/cameras.bin", cameras);
                write("sparse/0/images.bin", images);
            }
            "npz" => {
                let k = DMat4::from_mat3(DMat3::from_cols_array_2d(&k).transpose());
                let add = |npz: Npz, (i, (_, view)): (usize, &(String, &Pose))| {
                    // A projection matrix may have any scale and sign.
                    let p = -2.5 * (k * pose(view)).transpose();
                    let values = p.to_cols_array().map(|x| self.digits(x));
                    let values32 = values.map(|x| x as f32);
                    let key = format!("world_mat_{i}");
                    if self.is_rounded { npz.f32(&key, &[4, 4], &values32) } else { npz.f64(&key, &[4, 4], &values) }
                };
                views.iter().enumerate().fold(Npz::stored(), add).write(&folder.join("cameras.npz"));
            }
            _ => {
                let line = |(name, view): &(String, &Pose)| {
                    let rows = view.turn.transpose().to_cols_array();
                    format!("{name}{}{}{}\n", text(k.as_flattened()), text(&rows), text(&view.shift.to_array()))
                };
                let lines: String = views.iter().map(line).collect();
                write("ball_par.txt", format!("{}\n{lines}", views.len()).into());
            }
        }
    }
}

/// (w, x, y, z) and the translation.
fn quaternion(pose: &Pose) -> [f64; 7] {
    let [x, y, z, w] = DQuat::from_mat3(&pose.turn).to_array();
    let [a, b, c] = pose.shift.to_array();
    [w, x, y, z, a, b, c]
}

/// Writes a JPEG file with an orientation. Where its camera is that of the turned picture, it is stored so that this is what is shown.
pub fn write_jpeg(path: &Path, picture: RgbImage, exif: u8, is_turned: bool) {
    let picture = DynamicImage::from(picture);
    let picture = match exif {
        3 if is_turned => picture.rotate180(),
        6 if is_turned => picture.rotate270(),
        8 if is_turned => picture.rotate90(),
        _ => picture,
    };
    let mut bytes = Vec::new();
    let mut encoder = JpegEncoder::new_with_quality(&mut bytes, 95);
    if exif > 0 {
        let chunk =
            [b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0".as_slice(), &[exif, 0, 0, 0, 0, 0, 0, 0]].concat();
        encoder.set_exif_metadata(chunk).unwrap();
    }
    encoder.write_image(picture.as_bytes(), picture.width(), picture.height(), image::ExtendedColorType::Rgb8).unwrap();
    fs::write(path, bytes).unwrap();
}

fn read(folder: &Path) -> softras::Result<(Views, Vec<String>)> {
    Views::open_with(folder, &ViewsOptions::default(), &Budget::new(None)).map(|(views, _, notes)| (views, notes))
}

/// The mean place of a view's silhouette.
fn middle(views: &Views, view: usize) -> [f64; 2] {
    let silhouette = views.silhouette.as_ref().unwrap();
    let mut sums = [0.0; 3];
    for (i, alpha) in silhouette.view(view).iter().enumerate() {
        let (column, row) = (i % silhouette.width, i / silhouette.width);
        let place = [column as f64 + 0.5, row as f64 + 0.5, 1.0];
        sums.iter_mut().zip(place).for_each(|(sum, x)| *sum += f64::from(*alpha) * x);
    }
    [sums[0] / sums[2], sums[1] / sums[2]]
}

#[test]
fn pictures_show_things_where_their_cameras_project_them() {
    let plain = Set::default();
    let mut sets = vec![
        plain,
        Set { is_rounded: true, is_off_center: true, ..plain },
        Set { is_mirrored: true, ..plain },
        Set { is_mirrored: true, is_rounded: true, is_off_center: true, ..plain },
        Set { is_bent: true, is_off_center: true, ..plain },
        Set { has_missing: true, ..plain },
        Set { is_reversed: true, is_off_center: true, ..plain },
        Set { is_upper_case: true, ..plain },
    ];
    sets.extend([1, 3, 6, 8].map(|exif| Set { exif, is_off_center: true, ..plain }));
    sets.extend([3, 6, 8].map(|exif| Set { exif, is_bent: true, is_rounded: true, has_missing: true, ..plain }));
    sets.extend([3, 6].map(|exif| Set { exif, ..plain }));
    for (set, format) in sets.iter().flat_map(|set| FORMATS.map(|format| (set, format))) {
        if !set.fits(format) {
            continue;
        }
        let folder = tempfile::tempdir().unwrap();
        let names = set.write(folder.path(), format);
        let (views, notes) = read(folder.path()).unwrap_or_else(|error| panic!("{format}, {set:?}: {error}"));
        assert_eq!(views.names, names, "{format}, {set:?}");
        for (view, camera) in views.cameras.iter().enumerate() {
            let [column, row, _] = camera.project(set.ball(), (SIZE[0], SIZE[1])).unwrap();
            let [x, y] = middle(&views, view);
            assert!((x - column).hypot(y - row) < 0.3, "{format}, {set:?}: {x}, {y} for {column}, {row}; {notes:?}");
        }
        assert_eq!(notes.iter().any(|note| note.contains("world is mirrored")), set.is_mirrored, "{notes:?}");
        assert_eq!(notes.iter().any(|note| note.contains("not found: left out")), set.has_missing && format != "npz");
    }
}

#[test]
fn what_no_set_has_is_refused() {
    // One camera that mirrors among others.
    let folder = tempfile::tempdir().unwrap();
    let set = Set::default();
    let (poses, mirrored) = (set.poses(), Set { is_mirrored: true, ..set }.poses());
    set.write(folder.path(), "par");
    let views: Vec<_> = (0..4).map(|i| (format!("p{i}.jpg"), if i == 2 { &mirrored[i] } else { &poses[i] })).collect();
    set.write_cameras(folder.path(), "par", &views);
    let error = read(folder.path()).unwrap_err().to_string();
    assert!(error.contains("picture 2: mirrors the world, as 1 of 4"), "{error}");
    // No picture at all.
    let folder = tempfile::tempdir().unwrap();
    set.write_cameras(folder.path(), "par", &views[..2]);
    let error = read(folder.path()).unwrap_err().to_string();
    assert!(error.contains("none of its 2 pictures is there: p0.jpg"), "{error}");
}

#[test]
fn pictures_that_were_turned_after_their_cameras_are_told_of() {
    let set = Set { is_off_center: true, ..Set::default() };
    for format in ["list", "par", "npz"] {
        let folder = tempfile::tempdir().unwrap();
        let names = set.write(folder.path(), format);
        let told = || read(folder.path()).unwrap().1.into_iter().find(|note| note.contains("was the picture turned"));
        assert_eq!(told(), None, "{format}");
        for name in &names {
            let path = folder.path().join(name);
            let picture = image::open(&path).unwrap().into_rgb8();
            write_jpeg(&path, image::imageops::rotate90(&picture), 0, false);
        }
        let [width, height] = SIZE;
        let expected = format!(
            "p8_0.jpg and 3 more: the camera is one of {width}×{height} pixels: was the picture turned after it?"
        );
        assert_eq!(told(), Some(expected), "{format}");
    }
}
