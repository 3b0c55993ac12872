//! Tests of cut-outs and transparent materials in `softras render`.

use super::{fails, succeeds};
use image::{Rgba, RgbaImage};
use std::fmt::Write;
use std::fs;
use std::path::Path;

/// Rectangles that face +z: the name of the material, the range of x, and z. y runs from -1 to 1, and UVs from 0 to 1.
fn rectangles(all: &[(&str, [f32; 2], f32)]) -> String {
    let mut obj = String::from("mtllib a.mtl\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n");
    for (i, (material, [left, right], z)) in all.iter().enumerate() {
        let first = 4 * i;
        let [a, b, c, d] = [1, 2, 3, 4].map(|corner| first + corner);
        writeln!(obj, "v {left} -1 {z}\nv {right} -1 {z}\nv {right} 1 {z}\nv {left} 1 {z}").unwrap();
        writeln!(obj, "usemtl {material}\nf {a}/1 {b}/2 {c}/3 {d}/4").unwrap();
    }
    obj
}

/// Seen from +z without perspective or light, numbers as they are.
const VIEW: [&str; 10] =
    ["--azimuth", "180", "--elevation", "0", "--unlit", "--raw", "--alpha", "solid", "--size", "120x60"];

fn render(folder: &Path, extra: &[&str]) -> RgbaImage {
    succeeds(folder, &[&["render", "a.obj", "-o", "a.png"], &VIEW[..], extra].concat());
    image::open(folder.join("a.png")).unwrap().into_rgba8()
}

/// The pixel in the middle row at a place between -2 and 2, the ends of the mesh.
fn at(picture: &RgbaImage, x: f32) -> [u8; 4] {
    picture.get_pixel((60.0 + 60.0 * 0.9 * x / 2.0) as u32, 30).0
}

#[track_caller]
fn assert_near(found: [u8; 4], expected: [u8; 4]) {
    let differences = found.iter().zip(expected).map(|(a, b)| a.abs_diff(b));
    assert!(differences.clone().all(|d| d <= 3), "{found:?}, expected {expected:?}");
}

/// A pane before the wall is blended over it, a pane behind it is hidden, and beside it a pane is as transparent as it is.
#[test]
fn transparent_materials_are_blended_by_depth() {
    let folder = tempfile::tempdir().unwrap();
    let wall = [("wall", [-1.0, 1.0], 0.0), ("pane", [0.0, 2.0], 0.1), ("other", [-2.0, 0.0], -0.1)];
    fs::write(folder.path().join("a.obj"), rectangles(&wall)).unwrap();
    let mtl = "newmtl wall\nKd 1 0 0\nnewmtl pane\nKd 0 0 1\nd 0.3\nnewmtl other\nKd 0 1 0\nTr 0.4\n";
    fs::write(folder.path().join("a.mtl"), mtl).unwrap();
    let picture = render(folder.path(), &[]);
    // Both layers in bands are the picture again.
    let arguments = ["render", "a.obj", "-o", "bands.png", "--json", "--memory", "500K"];
    let said = succeeds(folder.path(), &[&arguments[..], &VIEW[..]].concat());
    let report: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert!(report["bands"].as_u64().unwrap() > 1, "{report}");
    let bands = image::open(folder.path().join("bands.png")).unwrap().into_rgba8();
    assert!(picture.as_raw().iter().zip(bands.as_raw()).all(|(a, b)| a.abs_diff(*b) <= 1));
    assert_near(at(&picture, -1.5), [0, 255, 0, 153]);
    assert_near(at(&picture, -0.5), [255, 0, 0, 255]);
    assert_near(at(&picture, 0.5), [179, 0, 77, 255]);
    assert_near(at(&picture, 1.5), [0, 0, 255, 77]);
    // Over a background, and with the paper's weighted one, it is the same.
    for mode in ["composite", "weighted"] {
        let alpha = if mode == "weighted" { "model" } else { "solid" };
        let extra = ["--background", "1,1,1", "--background-mode", mode, "--alpha", alpha, "--samples", "2"];
        let arguments = [&["render", "a.obj", "-o", "a.png"], &VIEW[..6], &["--size", "120x60"], &extra].concat();
        succeeds(folder.path(), &arguments);
        let picture = image::open(folder.path().join("a.png")).unwrap().into_rgba8();
        assert_near(at(&picture, -1.5), [102, 255, 102, 255]);
        assert_near(at(&picture, 0.5), [179, 0, 77, 255]);
        assert_near(at(&picture, 1.5), [179, 179, 255, 255]);
    }
    // A pane of full opacity is no layer.
    fs::write(folder.path().join("a.mtl"), mtl.replace("d 0.3", "d 1").replace("Tr 0.4", "Tr 0")).unwrap();
    assert_near(at(&render(folder.path(), &[]), 0.5), [0, 0, 255, 255]);
    // `iou` knows no layers: with --strict it refuses a transparent material.
    fs::write(folder.path().join("a.mtl"), mtl).unwrap();
    let bare = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl pane\nf 1 2 3\n";
    fs::write(folder.path().join("a.obj"), bare).unwrap();
    fails(folder.path(), &["iou", "a.obj", "a.obj", "--strict"], 1, &["drawn opaque"]);
}

/// Panes behind one another, before and behind a wall, and through one another; some of them with textures.
#[test]
fn panes_are_blended_with_all_that_lies_behind_them() {
    let folder = tempfile::tempdir().unwrap();
    let glass = "newmtl red\nKd 1 0 0\nd 0.5\nnewmtl green\nKd 0 1 0\nd 0.5\nnewmtl blue\nKd 0 0 1\nd 0.5\nnewmtl wall\nKd 0 0 0\n";
    let picture = glass.to_owned() + "newmtl film\nmap_Kd film.png\n";
    RgbaImage::from_pixel(4, 4, Rgba([0, 0, 255, 102])).save(folder.path().join("film.png")).unwrap();
    let (all, white) = ([-2.0, 2.0], ["--background", "1,1,1"]);
    let drawn = |scene: &[(&str, [f32; 2], f32)], extra: &[&str]| {
        fs::write(folder.path().join("a.obj"), rectangles(scene)).unwrap();
        render(folder.path(), &[&white, extra].concat())
    };
    fs::write(folder.path().join("a.mtl"), glass).unwrap();
    let panes = [("red", all, 0.2), ("blue", [-2.0, 0.0], 0.0), ("green", all, 0.1), ("wall", [1.0, 2.0], 0.15)];
    for extra in [&[][..], &["--sigma", "1e-6"], &["--orthographic", "fit"]] {
        let picture = drawn(&panes, extra);
        assert_near(at(&picture, -1.0), [160, 96, 64, 255]);
        assert_near(at(&picture, 0.5), [191, 128, 64, 255]);
        assert_near(at(&picture, 1.5), [128, 0, 0, 255]);
    }
    // Where a texture has the opacity.
    fs::write(folder.path().join("a.mtl"), picture).unwrap();
    let film = drawn(&[("red", all, 0.1), ("film", all, 0.2), ("film", [-2.0, 0.0], 0.3)], &[]);
    assert_near(at(&film, -1.0), [92, 46, 209, 255]);
    assert_near(at(&film, 1.0), [153, 76, 178, 255]);
    // Two panes that cross: each is the front on one side.
    let crossing = "mtllib a.mtl\nv -2 -1 -1\nv 2 -1 1\nv 2 1 1\nv -2 1 -1\nv -2 -1 1\nv 2 -1 -1\nv 2 1 -1\nv -2 1 1\n\
                    usemtl red\nf 1 2 3 4\nusemtl blue\nf 5 6 7 8\n";
    fs::write(folder.path().join("a.obj"), crossing).unwrap();
    let crossing = render(folder.path(), &white);
    assert_near(at(&crossing, -1.0), [128, 64, 191, 255]);
    assert_near(at(&crossing, 1.0), [191, 64, 128, 255]);
    // Triangles that have no layer of their own are noted.
    let many: Vec<_> = (0..18).map(|i| ("red", all, 0.1 * i as f32)).collect();
    fs::write(folder.path().join("a.obj"), rectangles(&many)).unwrap();
    let said = super::softras(folder.path(), &["render", "a.obj", "-o", "a.png", "--azimuth", "180"]);
    assert!(String::from_utf8_lossy(&said.stderr).contains("4 transparent triangles lie behind 16 others"));
}

/// A leaf before a wall: the wall shows where the leaf's texture is cut out, in every image.
#[test]
fn leaves_are_cut_out_by_their_textures() {
    let folder = tempfile::tempdir().unwrap();
    let scene = [("wall", [-2.0, 0.0], 0.0), ("leaf", [-2.0, 2.0], 0.1)];
    fs::write(folder.path().join("a.obj"), rectangles(&scene)).unwrap();
    fs::write(folder.path().join("a.mtl"), "newmtl wall\nKd 1 0 0\nnewmtl leaf\nmap_Kd leaf.png\n").unwrap();
    // Cut out in every other eighth of the width; v is up and runs along the image's rows.
    let leaf = RgbaImage::from_fn(64, 64, |x, _| Rgba([0, 255, 0, if x / 8 % 2 == 0 { 0 } else { 255 }]));
    leaf.save(folder.path().join("leaf.png")).unwrap();
    let picture = render(folder.path(), &[]);
    let eighth = |i: f32| -2.0 + (i + 0.5) * 0.5;
    for (i, expected) in [
        (0.0, [255, 0, 0, 255]),
        (1.0, [0, 255, 0, 255]),
        (2.0, [255, 0, 0, 255]),
        (3.0, [0, 255, 0, 255]),
        (5.0, [0, 255, 0, 255]),
        (7.0, [0, 255, 0, 255]),
    ] {
        assert_near(at(&picture, eighth(i)), expected);
    }
    // Without a wall behind there is nothing.
    assert_eq!([4.0, 6.0].map(|i| at(&picture, eighth(i))[3]), [0, 0]);
    let silhouette = render(folder.path(), &["--output", "silhouette"]);
    assert_eq!([4.0, 5.0, 6.0, 7.0].map(|i| at(&silhouette, eighth(i))[0]), [0, 255, 0, 255]);
    // The hard modes count from a half on.
    let hard = ["--color-mode", "hard", "--silhouette-mode", "hard", "--alpha", "model"];
    succeeds(folder.path(), &[&["render", "a.obj", "-o", "a.png"], &VIEW[..6], &["--size", "120x60"], &hard].concat());
    let hard = image::open(folder.path().join("a.png")).unwrap().into_rgba8();
    assert_eq!([0.0, 1.0, 4.0, 5.0].map(|i| at(&hard, eighth(i))[3]), [255, 255, 0, 255]);
    assert_near(at(&hard, eighth(0.0)), [255, 0, 0, 255]);
}
