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
