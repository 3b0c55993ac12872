//! Folders of pictures with cameras.

use softras::glam::DVec3;
use softras::{Camera, Image, Projection};
use softras_io::{Budget, Views, ViewsOptions};
use std::path::Path;

/// Two views of 48² of a grey disc that lies at the upper left.
fn discs() -> Views {
    let at = |i: usize| ((i % 48) as f64 - 15.0, (i / 48 % 48) as f64 - 13.0);
    let masks: Vec<f32> = (0..2 * 48 * 48).map(at).map(|(x, y)| f32::from(x.hypot(y) < 9.0)).collect();
    let image = |channels, data| Some(Image { batch: 2, height: 48, width: 48, channels, data });
    let eyes = [DVec3::new(0.0, 1.0, -4.0), DVec3::new(3.0, 0.0, -2.0)];
    let lens = Projection::Perspective { fov_y: 0.6 };
    Views {
        cameras: eyes.map(|eye| Camera::look_at(eye, DVec3::ZERO, DVec3::Y, lens).unwrap()).to_vec(),
        color: image(3, masks.iter().flat_map(|mask| [0.25 * mask; 3]).collect()),
        silhouette: image(1, masks),
        ..Views::default()
    }
}

/// Cuts columns and rows from the right and below.
fn cut(path: &Path, width: u32, height: u32) {
    image::open(path).unwrap().crop_imm(0, 0, width, height).save(path).unwrap();
}

fn read(folder: &Path) -> (Views, Vec<String>) {
    let (views, _, notes) = Views::open_with(folder, &ViewsOptions::default(), &Budget::new(None)).unwrap();
    (views, notes)
}

/// Where a point is seen.
fn seen(camera: &Camera) -> [f64; 3] {
    camera.project(DVec3::new(0.3, -0.2, 0.4), (48, 48)).unwrap()
}

#[test]
fn pictures_of_several_sizes_are_those_of_one_size() {
    let folder = tempfile::tempdir().unwrap();
    discs().save(folder.path()).unwrap();
    let (whole, notes) = read(folder.path());
    assert_eq!(notes, Vec::<String>::new());
    let first = folder.path().join("view_000.png");
    cut(&first, 30, 40);
    let (views, notes) = read(folder.path());
    assert!(notes.len() == 1 && notes[0].contains("all become 48×48"), "{notes:?}");
    assert!(views.silhouette == whole.silhouette && views.color == whole.color);
    assert_eq!(views.cameras.iter().map(seen).collect::<Vec<_>>(), whole.cameras.iter().map(seen).collect::<Vec<_>>());
    // Cameras that are written from them go with the pictures.
    views.save_cameras(&folder.path().join("cameras.json")).unwrap();
    assert_eq!(read(folder.path()).0.cameras, views.cameras);

    // A lens in degrees is that of the picture's own height.
    let entry =
        |file: &str| format!(r#"{{"file": "{file}", "distance": 4, "elevation": 10, "azimuth": 0, "fov": 40}}"#);
    let list = format!("[{}, {}]", entry("view_000.png"), entry("view_001.png"));
    std::fs::write(folder.path().join("cameras.json"), list).unwrap();
    let cameras = read(folder.path()).0.cameras;
    let own = cameras[1].project(DVec3::new(0.3, -0.2, 0.4), (30, 40)).unwrap();
    assert!(seen(&cameras[0]).iter().zip(own).all(|(a, b)| (a - b).abs() < 1e-9));

    // Where its border cuts the object, the object does not end there.
    cut(&first, 20, 40);
    let (views, notes) = read(folder.path());
    assert!(views.cameras.len() == 1 && views.names == ["view_001.png"], "{:?}", views.names);
    assert!(notes.iter().any(|note| note.contains("view_000.png: left out")), "{notes:?}");
}

#[test]
fn some_views_come_in_the_order_that_is_asked_for() {
    let mut all = discs();
    all.silhouette.as_mut().unwrap().data[..48 * 48].fill(0.0);
    for some in [&[1, 0][..], &[1, 1], &[0, 1], &[1]] {
        let found = all.some(some);
        let expected: Vec<_> = some.iter().map(|view| seen(&all.cameras[*view])).collect();
        assert_eq!(found.cameras.iter().map(seen).collect::<Vec<_>>(), expected, "{some:?}");
        let is_black = |view: &usize| *view == 0;
        let masks = found.silhouette.as_ref().unwrap().data.chunks(48 * 48);
        assert!(masks.map(|mask| mask.iter().all(|x| *x == 0.0)).eq(some.iter().map(is_black)), "{some:?}");
    }
}

/// A transforms.json for some pictures, whose cameras do not matter.
fn transforms(folder: &Path, names: &[&str], more: &str) {
    let frame = |name: &&str| {
        format!(
            r#"{{"file_path": "{name}", "transform_matrix": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 3], [0, 0, 0, 1]]{more}}}"#
        )
    };
    let frames: Vec<String> = names.iter().map(frame).collect();
    let text = format!(r#"{{"camera_angle_x": 0.6, "frames": [{}]}}"#, frames.join(", "));
    std::fs::write(folder.join("transforms.json"), text).unwrap();
}

/// Pictures and masks that go together by their order do so by the numbers in their names.
#[test]
fn the_second_picture_is_not_the_eleventh() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: String| folder.path().join(name);
    std::fs::create_dir_all(at("masks".into())).unwrap();
    let names: Vec<String> = (0..12).map(|i| format!("image_{i}.png")).collect();
    transforms(folder.path(), &names.iter().map(String::as_str).collect::<Vec<_>>(), "");
    let is_object = |x: u32, y: u32, i: u32| (4..12).contains(&x) && (4..6 + i).contains(&y);
    for i in 0..12 {
        image::RgbImage::from_pixel(24, 24, image::Rgb([90; 3])).save(at(names[i as usize].clone())).unwrap();
        let mask = image::GrayImage::from_fn(24, 24, |x, y| image::Luma([if is_object(x, y, i) { 255 } else { 0 }]));
        mask.save(at(format!("masks/cut-{i:03}.png"))).unwrap();
    }
    let rows = |options: &ViewsOptions, path: &Path| {
        let (views, _, notes) = Views::open_with(path, options, &Budget::new(None)).unwrap();
        assert!(notes.iter().any(|note| note.contains("in the order of the numbers in their names")), "{notes:?}");
        let masks = views.silhouette.unwrap();
        masks.data.chunks(24 * 24).map(|mask| mask.iter().sum::<f32>() / 8.0 - 2.0).collect::<Vec<_>>()
    };
    let expected: Vec<f32> = (0..12).map(|i| i as f32).collect();
    assert_eq!(rows(&ViewsOptions::default(), folder.path()), expected);
    // The file of cameras stands for its folder.
    assert_eq!(rows(&ViewsOptions::default(), &at("transforms.json".into())), expected);
    // The same in a folder that is named.
    std::fs::rename(at("masks".into()), at("cut".into())).unwrap();
    let named = ViewsOptions { masks: Some(at("cut".into())), ..ViewsOptions::default() };
    assert_eq!(rows(&named, folder.path()), expected);
    std::fs::remove_file(at("cut/cut-003.png".into())).unwrap();
    let refused = Views::open_with(folder.path(), &named, &Budget::new(None)).unwrap_err().to_string();
    assert!(refused.contains("as many masks as pictures"), "{refused}");
}

/// A camera of a picture that was made smaller later goes with it; one of other proportions is refused.
#[test]
fn a_picture_of_half_the_size_has_its_camera() {
    let folder = tempfile::tempdir().unwrap();
    let of = |w: u32, h: u32, focal: f64| {
        let lens = format!(
            r#", "w": {w}, "h": {h}, "fl_x": {focal}, "fl_y": {focal}, "cx": {}, "cy": {}"#,
            20 * w / 48,
            16 * h / 36
        );
        transforms(folder.path(), &["a.png"], &lens);
        Views::open_with(folder.path(), &ViewsOptions::default(), &Budget::new(None))
    };
    let cutout = |x, y| image::Rgba([90, 90, 90, if is_object(x, y) { 255 } else { 0 }]);
    image::RgbaImage::from_fn(48, 36, cutout).save(folder.path().join("a.png")).unwrap();
    let (whole, _, notes) = of(48, 36, 60.0).unwrap();
    assert_eq!(notes, Vec::<String>::new());
    let (scaled, _, notes) = of(96, 72, 120.0).unwrap();
    assert_eq!(scaled.cameras, whole.cameras);
    assert_eq!(notes, ["a.png: its camera, of 96×72 pixels, is scaled to the picture's 48×36"]);
    assert!(of(36, 48, 60.0).unwrap_err().to_string().contains("is 48×36 pixels, and not 36×48"));
}

/// Whether a pixel of 48×36 shows the object: an ellipse off the middle, so that no turn of it looks like another.
fn is_object(x: u32, y: u32) -> bool {
    ((f64::from(x) - 18.0) / 13.0).hypot((f64::from(y) - 15.0) / 8.0) < 1.0
}

fn silhouette(views: &Views) -> Vec<bool> {
    views.silhouette.as_ref().unwrap().data.iter().map(|x| *x > 0.5).collect()
}

fn truth() -> Vec<bool> {
    (0..36).flat_map(|y| (0..48).map(move |x| is_object(x, y))).collect()
}

#[test]
fn masks_are_read_wherever_and_however_programs_write_them() {
    use image::{DynamicImage, GrayImage, ImageBuffer, Luma, LumaA, Rgb, RgbImage, Rgba, RgbaImage};
    fn by<T>(x: u32, y: u32, object: T, other: T) -> T {
        if is_object(x, y) { object } else { other }
    }
    let grey =
        |object: u8, other: u8| DynamicImage::from(GrayImage::from_fn(48, 36, |x, y| Luma([by(x, y, object, other)])));
    let small = || ImageBuffer::<Luma<u16>, Vec<u16>>::from_fn(48, 36, |x, y| Luma([by(x, y, 1u16, 0)]));
    let kinds: Vec<(&str, DynamicImage)> = vec![
        ("0 and 255", grey(255, 0)),
        ("0 and 1", grey(1, 0)),
        ("a class", grey(17, 0)),
        ("a largest value below 255", grey(180, 0)),
        ("16 bits", small().into()),
        ("colours", RgbImage::from_fn(48, 36, |x, y| Rgb(by(x, y, [128, 0, 0], [0; 3]))).into()),
        ("alpha of white", RgbaImage::from_fn(48, 36, |x, y| Rgba([255, 255, 255, by(x, y, 255, 0)])).into()),
        ("alpha of grey", ImageBuffer::from_fn(48, 36, |x, y| LumaA([40u8, by(x, y, 255, 0)])).into()),
        ("a cut-out", RgbaImage::from_fn(48, 36, |x, y| Rgba([9, x as u8, 30, by(x, y, 255, 0)])).into()),
    ];
    // A picture without a background of its own.
    let room = RgbImage::from_fn(48, 36, |x, y| Rgb([(97 * x + 31 * y) as u8, (x * y) as u8, 90]));
    let set = |places: &[(&str, &DynamicImage)], more: &str| {
        let folder = tempfile::tempdir().unwrap();
        for picture in ["a.jpg", "b.jpg"] {
            room.save(folder.path().join(picture)).unwrap();
        }
        for (place, mask) in places {
            let path = folder.path().join(place);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            mask.save(path).unwrap();
        }
        transforms(folder.path(), &["a.jpg", "b.jpg"], more);
        folder
    };
    for (kind, mask) in &kinds {
        let folder = set(&[("masks/a.png", mask), ("masks/b.png", mask)], "");
        let (views, notes) = read(folder.path());
        assert_eq!(silhouette(&views), [truth(), truth()].concat(), "{kind}: {notes:?}");
    }
    let mask = &kinds[0].1;
    for [a, b] in [
        ["mask/a.png", "mask/b.png"],
        ["silhouettes/A.PNG", "silhouettes/B.PNG"],
        ["masks/a.jpg.png", "masks/b.jpg.png"],
        ["a_mask.png", "b_mask.png"],
        ["a.jpg.png", "b.jpg.png"],
        ["mask/000.png", "mask/001.png"],
    ] {
        let folder = set(&[(a, mask), (b, mask)], "");
        let (views, notes) = read(folder.path());
        assert_eq!(silhouette(&views), [truth(), truth()].concat(), "{a}: {notes:?}");
        assert!(notes[0].starts_with("a.jpg and 1 more: silhouettes are the masks in") || notes.len() > 1, "{notes:?}");
    }
    // A folder that is given, and one that has no mask of these pictures.
    let folder = set(&[("cut/a.png", mask), ("cut/b.png", mask), ("masks/a.png", &grey(0, 255))], "");
    let given = |name: &str| ViewsOptions { masks: Some(folder.path().join(name)), ..ViewsOptions::default() };
    let views = Views::open_with(folder.path(), &given("cut"), &Budget::new(None)).unwrap().0;
    assert_eq!(silhouette(&views)[..48 * 36], truth());
    let error = Views::open_with(folder.path(), &given("none"), &Budget::new(None)).unwrap_err().to_string();
    assert!(error.contains("no mask of any picture") && error.contains("NAME.jpg.png"), "{error}");
    // Without any, nothing tells the object.
    let folder = set(&[], "");
    let error = Views::open(folder.path()).unwrap_err().to_string();
    assert!(error.contains("2 of 2 pictures are all object") && error.contains("rembg"), "{error}");
}

/// A picture and its mask are turned alike: a mask of the stored size as its picture is, and a mask that was made of the turned
/// picture back.
#[test]
fn masks_lie_as_their_pictures_do() {
    use image::{DynamicImage, GrayImage, Luma, Rgb, RgbImage};
    let mask = DynamicImage::from(GrayImage::from_fn(48, 36, |x, y| Luma([255 * u8::from(is_object(x, y))])));
    let color = |x: u32, y: u32| if is_object(x, y) { [240, (8 * y) as u8, 60] } else { [40, 160, (5 * x + y) as u8] };
    let room = RgbImage::from_fn(48, 36, |x, y| Rgb(color(x, y)));
    let turned = [mask.rotate180(), mask.rotate90(), mask.rotate270()];
    let kinds = [(1, &mask), (3, &mask), (6, &mask), (8, &mask), (3, &turned[0]), (6, &turned[1]), (8, &turned[2])];
    for (exif, mask) in kinds {
        let folder = tempfile::tempdir().unwrap();
        crate::cameras::write_jpeg(&folder.path().join("a.jpg"), room.clone(), exif, false);
        mask.save(folder.path().join("m.png")).unwrap();
        transforms(folder.path(), &["a.jpg"], r#", "mask_path": "m.png""#);
        let (views, notes) = read(folder.path());
        assert_eq!(silhouette(&views), truth(), "{exif}: {notes:?}");
        let color = views.color.unwrap();
        let shown = room.pixels().map(|pixel| pixel.0[1] > 100).zip(truth()).map(|(x, inside)| inside && x);
        let same = color.data.chunks_exact(3).map(|pixel| pixel[1] > 0.127).zip(shown).filter(|(a, b)| a == b).count();
        assert!(same > 48 * 36 * 95 / 100, "{exif}: {same}");
    }
}

#[test]
fn plain_backgrounds_of_any_colour_are_cut_away() {
    use image::{Rgb, RgbImage};
    use softras_check::random::Random;
    let mut random = Random::new(3);
    // A disc of several colours with a hole, before a background of a colour, with noise and darker corners, cut by the border or not.
    let mut picture = |ground: [f64; 3], noise: f64, corners: f64, middle: f64| {
        let is_inside = move |x: u32, y: u32| (9.0..40.0).contains(&(f64::from(x) - middle).hypot(f64::from(y) - 60.0));
        let image = RgbImage::from_fn(160, 120, |x, y| {
            let dark = 1.0 - corners * ((f64::from(x) - 80.0) / 100.0).hypot((f64::from(y) - 60.0) / 100.0).powi(2);
            let object = [200.0 - f64::from(x), 60.0, 40.0 + f64::from(y)];
            let color = if is_inside(x, y) { object } else { ground.map(|g| g * dark) };
            Rgb(color.map(|c| {
                (c + noise * (random.range(0.0, 1.0) + random.range(0.0, 1.0) - 1.0)).round().clamp(0.0, 255.0) as u8
            }))
        });
        (image, is_inside)
    };
    let folder = tempfile::tempdir().unwrap();
    let grounds = [[0.0; 3], [255.0; 3], [40.0, 70.0, 190.0], [20.0, 200.0, 60.0], [150.0, 140.0, 130.0]];
    for ground in grounds {
        for (noise, corners) in [(0.0, 0.0), (12.0, 0.0), (0.0, 0.4), (12.0, 0.4)] {
            for ending in ["png", "jpg", "ppm"] {
                let name = format!("a.{ending}");
                let (image, is_inside) = picture(ground, noise, corners, 30.0);
                image.save(folder.path().join(&name)).unwrap();
                transforms(folder.path(), &[&name], "");
                let (views, notes) = read(folder.path());
                let truth = (0..120).flat_map(|y| (0..160).map(move |x| (x, y))).map(|(x, y)| is_inside(x, y));
                let both: Vec<(bool, bool)> = silhouette(&views).into_iter().zip(truth).collect();
                let count = |f: fn(&&(bool, bool)) -> bool| both.iter().filter(f).count() as f64;
                let iou = count(|(a, b)| *a && *b) / count(|(a, b)| *a || *b);
                assert!(iou > 0.97, "{ground:?}, noise {noise}, corners {corners}, {ending}: {iou}, {notes:?}");
                std::fs::remove_file(folder.path().join(&name)).unwrap();
            }
        }
    }
}

#[test]
fn soft_shadows_on_bright_paper_are_cut_away_and_light_stripes_are_not() {
    use image::{Rgb, RgbImage};
    use softras_check::random::Random;
    let mut random = Random::new(7);
    let folder = tempfile::tempdir().unwrap();
    let is_disc = |x: u32, y: u32| (f64::from(x) - 150.0).hypot(f64::from(y) - 110.0) < 60.0;
    for shadow in [0.0, 0.15] {
        for ending in ["png", "jpg"] {
            let mut color = |x: u32, y: u32| {
                let away = (f64::from(x) - 170.0).powi(2) + (f64::from(y) - 160.0).powi(2);
                let light = 1.0 - shadow * (-away / 1800.0).exp();
                let color = match (is_disc(x, y), (100..125).contains(&y)) {
                    (true, true) => [214.0, 212.0, 206.0],
                    (true, false) => [190.0, 90.0, 40.0],
                    _ => [228.0, 226.0, 220.0].map(|paper| light * paper),
                };
                Rgb(color.map(|x| (x + random.range(-2.0, 2.0)).round() as u8))
            };
            let name = format!("a.{ending}");
            RgbImage::from_fn(320, 240, &mut color).save(folder.path().join(&name)).unwrap();
            transforms(folder.path(), &[&name], "");
            let (views, notes) = read(folder.path());
            let truth = (0..240).flat_map(|y| (0..320).map(move |x| is_disc(x, y)));
            let wrong = silhouette(&views).into_iter().zip(truth).filter(|(a, b)| a != b).count();
            assert!(wrong < 300, "shadow {shadow}, {ending}: {wrong} of 11310 pixels are wrong, {notes:?}");
            std::fs::remove_file(folder.path().join(&name)).unwrap();
        }
    }
}

#[test]
fn a_second_surface_at_the_border_is_cut_away_and_shadows_are_kept() {
    use image::{Rgb, RgbImage};
    use softras_check::random::Random;
    let mut random = Random::new(5);
    let folder = tempfile::tempdir().unwrap();
    // A disc before a wall, on a cloth that takes the left side, lit less towards its corner. The disc has a shadow as dark as the cloth.
    let is_disc = |x: u32, y: u32| (f64::from(x) - 84.0).hypot(f64::from(y) - 60.0) < 38.0;
    let is_shadow = |x: u32, y: u32| (f64::from(x) - 100.0).hypot(f64::from(y) - 50.0) < 9.0;
    let is_cut = |x: u32, y: u32| x > 80 && (45..75).contains(&y);
    for (wall, cloth, disc, shadow) in
        [(1.0, 40.0, 190.0, 30.0), (120.0, 155.0, 250.0, 150.0), (250.0, 215.0, 60.0, 215.0)]
    {
        for (ending, cut) in [("png", false), ("png", true), ("jpg", false)] {
            let mut color = |x: u32, y: u32| {
                let object = disc + 0.2 * (f64::from(y) - 60.0);
                let lit = 1.0 - 0.3 * f64::from(y) / 120.0;
                let ground = if x < 50 { wall + lit * (cloth - wall) } else { wall };
                let value = match (is_disc(x, y) || cut && is_cut(x, y), is_shadow(x, y)) {
                    (true, true) => shadow,
                    (true, false) => object,
                    _ => ground,
                };
                Rgb([1.0, 0.95, 0.9]
                    .map(|tint| (value * tint + random.range(-1.5, 1.5)).round().clamp(0.0, 255.0) as u8))
            };
            let name = format!("a.{ending}");
            RgbImage::from_fn(160, 120, &mut color).save(folder.path().join(&name)).unwrap();
            transforms(folder.path(), &[&name], "");
            let (views, notes) = read(folder.path());
            let truth = (0..120).flat_map(|y| (0..160).map(move |x| is_disc(x, y) || cut && is_cut(x, y)));
            let wrong = silhouette(&views).into_iter().zip(truth).filter(|(a, b)| a != b).count();
            // Beside a lit wall, a format that changes pixels hides what differs by as little as this shadow.
            let most = if ending == "jpg" && wall > 1.0 { 380 } else { 120 };
            assert!(wrong < most, "wall {wall}, {ending}, cut {cut}: {wrong} pixels are wrong, {notes:?}");
            assert!(notes.iter().any(|note| note.contains("another surface at the border")), "{notes:?}");
            std::fs::remove_file(folder.path().join(&name)).unwrap();
        }
    }
}

#[test]
fn dark_surfaces_before_black_are_no_background_in_a_format_that_changes_pixels() {
    use image::{Rgb, RgbImage};
    // A bright disc with a dark fin.
    let is_disc = |x: u32, y: u32| (f64::from(x) - 70.0).hypot(f64::from(y) - 60.0) < 30.0;
    let is_fin = |x: u32, y: u32| (95..135).contains(&x) && (50..72).contains(&y);
    let color = |x: u32, y: u32| match (is_disc(x, y), is_fin(x, y)) {
        (true, _) => [230, 140, 40],
        (_, true) => [18, 18, 22],
        _ => [0; 3],
    };
    let folder = tempfile::tempdir().unwrap();
    RgbImage::from_fn(160, 120, |x, y| Rgb(color(x, y))).save(folder.path().join("a.jpg")).unwrap();
    transforms(folder.path(), &["a.jpg"], "");
    let found = silhouette(&read(folder.path()).0);
    let truth = (0..120).flat_map(|y| (0..160).map(move |x| is_disc(x, y) || is_fin(x, y)));
    let wrong = found.into_iter().zip(truth).filter(|(a, b)| a != b).count();
    assert!(wrong < 80, "{wrong} of 160×120 pixels are wrong");
}

#[test]
fn numbers_of_arrays_are_what_their_type_and_range_say() {
    use softras_io::npy;
    let folder = tempfile::tempdir().unwrap();
    let (images, cameras) = (folder.path().join("i.npy"), folder.path().join("c.npy"));
    std::fs::write(&cameras, npy::write(&[2, 3], npy::Data::F64(&[3.0, 0.0, 0.0, 3.0, 0.0, 90.0]))).unwrap();
    let options = ViewsOptions { cameras: Some(cameras), ..ViewsOptions::default() };
    let read = |bytes: Vec<u8>| {
        std::fs::write(&images, bytes).unwrap();
        Views::open_with(&images, &options, &Budget::new(None)).map(|(views, ..)| views)
    };
    let truth: Vec<bool> = [truth(), truth()].concat();
    let of = |object: f64| truth.iter().map(|inside| if *inside { object } else { 0.0 }).collect::<Vec<f64>>();
    let bytes = |values: Vec<f64>| values.into_iter().map(|x| x as u8).collect::<Vec<u8>>();
    for object in [1.0, 3.0, 255.0] {
        for data in [npy::Data::U8(&bytes(of(object))), npy::Data::F64(&of(object))] {
            assert_eq!(silhouette(&read(npy::write(&[2, 36, 48], data)).unwrap()), truth, "{object}");
        }
    }
    for (object, of_all) in [(1e5, "100000.0"), (-1.0, "-1.0"), (1.5, "1.5")] {
        let error = read(npy::write(&[2, 36, 48], npy::Data::F64(&of(object)))).unwrap_err().to_string();
        assert!(error.contains(of_all) && error.contains("0 to 1"), "{error}");
    }
    // A colour in bytes, the same as a share of 255, and as linear light times alpha.
    let linear = |x: f64| if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055f64).powf(2.4) };
    let rgba = |f: &dyn Fn([f64; 4]) -> [f64; 4]| {
        truth.iter().flat_map(|inside| f(if *inside { [0.8, 0.4, 0.2, 0.6] } else { [0.0; 4] })).collect::<Vec<f64>>()
    };
    let shape = [2, 36, 48, 4];
    let as_bytes = read(npy::write(&shape, npy::Data::U8(&bytes(rgba(&|p| p.map(|x| 255.0 * x)))))).unwrap();
    let as_shares = read(npy::write(&shape, npy::Data::F64(&rgba(&|p| p)))).unwrap();
    let times = |[r, g, b, a]: [f64; 4]| [a * linear(r), a * linear(g), a * linear(b), a];
    let as_light = read(npy::write(&shape, npy::Data::F64(&rgba(&times)))).unwrap();
    for other in [as_shares, as_light] {
        let off = |a: Option<&Image>, b: Option<&Image>| {
            let pairs = a.unwrap().data.iter().zip(&b.unwrap().data);
            pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
        };
        assert!(off(as_bytes.color.as_ref(), other.color.as_ref()) < 0.01);
        assert!(off(as_bytes.silhouette.as_ref(), other.silhouette.as_ref()) < 0.01);
    }
}

/// A fit reads crops: each around its object, without specks, and within the picture where the border cuts the object.
#[test]
fn pictures_are_cropped_to_their_objects() {
    use image::{Rgba, RgbaImage};
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, size: [u32; 2], middle: [f64; 2], speck: bool| {
        let is_inside = |x: u32, y: u32| (f64::from(x) - middle[0]).hypot(f64::from(y) - middle[1]) < 40.0;
        let is_speck = |x: u32, y: u32| speck && x < 2 && y < 2;
        let pixel = |x, y| Rgba([200, 90, 10, 255 * u8::from(is_inside(x, y) || is_speck(x, y))]);
        RgbaImage::from_fn(size[0], size[1], pixel).save(folder.path().join(name)).unwrap();
    };
    write("a.png", [400, 300], [200.0, 150.0], false);
    write("b.png", [400, 300], [120.0, 100.0], true);
    write("c.png", [400, 300], [30.0, 150.0], false);
    write("d.png", [300, 400], [150.0, 150.0], false);
    let read = |names: &[&str], crop: u32| {
        transforms(folder.path(), names, "");
        let options = ViewsOptions { crop, detail: 256, ..ViewsOptions::default() };
        let (views, _, notes) = Views::open_with(folder.path(), &options, &Budget::new(None)).unwrap();
        (views, notes)
    };
    let (views, notes) = read(&["a.png", "b.png", "c.png", "d.png"], 64);
    let mask = views.silhouette.as_ref().unwrap();
    assert_eq!((mask.width, mask.height), (64, 64));
    assert!(notes.iter().any(|note| note.contains("cuts the object in 1 of 4")), "{notes:?}");
    // The disc of 80 pixels takes 1 / 1.25 of a crop; what the border cuts off of one is not known.
    for view in [0, 1, 3] {
        let row = &mask.view(view)[32 * 64..33 * 64];
        let inside = row.iter().filter(|x| **x > 0.5).count();
        assert!((51..=52).contains(&inside) && row[0] == 0.0 && row[63] == 0.0, "{view}: {inside}");
    }
    assert!(mask.view(2)[32 * 64] == 1.0 && mask.view(2)[32 * 64 + 63] == 0.0);
    // A crop's camera shows a point where the picture's camera does.
    let point = DVec3::new(0.1, -0.05, 0.2);
    let whole = read(&["b.png"], 0).0.cameras[0].project(point, (400, 300)).unwrap();
    let part = views.cameras[1].project(point, (64, 64)).unwrap();
    let corner = [120.0 - 50.0, 100.0 - 50.0];
    for k in 0..2 {
        assert!((part[k] / 64.0 * 100.0 + corner[k] - whole[k]).abs() < 1.0, "{part:?} {whole:?}");
    }
    let photograph = &views.photographs[1];
    let own = photograph.camera(&views.cameras[1]).unwrap().project(point, photograph.size()).unwrap();
    assert_eq!((photograph.whole, photograph.size()), ((400, 300), (79, 79)));
    assert!((own[0] + 81.0 - whole[0]).abs() < 1e-9 && photograph.pixel(40, 40)[3] == 1.0);
    // Most of a memory that is too small is said to be enough.
    let options = ViewsOptions { crop: 64, ..ViewsOptions::default() };
    let least = |memory: u64| Views::open_with(folder.path(), &options, &Budget::new(Some(memory))).map(|_| ());
    let error = least(1 << 20).unwrap_err().to_string();
    let megabytes: u64 = error.split("allow ").nth(1).unwrap().split('M').next().unwrap().parse().unwrap();
    assert!(least(megabytes << 20).is_ok() && least((megabytes - 1) << 20).is_err(), "{error}");
}
