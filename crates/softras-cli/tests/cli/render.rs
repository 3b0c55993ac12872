//! Tests of the command `softras render`.

use super::command::tier;
use super::{fails, numpy, succeeds};
use exr::prelude::ReadChannels;
use exr::prelude::{ReadLayers, ReadSpecificChannel};
use image::RgbaImage;
use std::fs;
use std::path::Path;

/// A red triangle on the right, a blue one on the left, a green one above; all face +z.
const COMPASS: &str = "\
v 0.3 -0.2 0 1 0 0\nv 1 -0.2 0 1 0 0\nv 0.65 0.3 0 1 0 0\n\
v -1 -0.2 0 0 0 1\nv -0.3 -0.2 0 0 0 1\nv -0.65 0.3 0 0 0 1\n\
v -0.3 0.4 0 0 1 0\nv 0.3 0.4 0 0 1 0\nv 0 1 0 0 1 0\n\
f 1 2 3\nf 4 5 6\nf 7 8 9\n";
const FRONT: [&str; 6] = ["--azimuth", "180", "--elevation", "0", "--unlit", "--size"];

fn compass() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("compass.obj"), COMPASS).unwrap();
    folder
}

fn render(folder: &Path, out: &str, extra: &[&str]) -> String {
    let said = succeeds(folder, &[&["render", "compass.obj", "-o", out], extra].concat());
    let left_over = fs::read_dir(folder).unwrap().any(|f| f.unwrap().path().extension().is_some_and(|e| e == "part"));
    assert!(!left_over);
    said
}

fn picture(path: &Path) -> RgbaImage {
    image::open(path).unwrap().into_rgba8()
}

/// The mean column and row, as parts of the picture, of the pixels that are mostly one channel.
fn place(picture: &RgbaImage, channel: usize) -> (f64, f64) {
    let (mut column, mut row, mut count) = (0.0, 0.0, 0.0);
    for (x, y, pixel) in picture.enumerate_pixels() {
        let others = (0..3).filter(|k| *k != channel).map(|k| pixel.0[k]).max().unwrap();
        if pixel.0[3] > 128 && pixel.0[channel] > 200 && others < 50 {
            (column, row, count) = (column + f64::from(x), row + f64::from(y), count + 1.0);
        }
    }
    assert!(count > 20.0, "channel {channel} is nowhere");
    (column / count / f64::from(picture.width()), row / count / f64::from(picture.height()))
}

#[test]
fn pictures_are_not_mirrored_and_have_their_top_row_first() {
    let folder = compass();
    render(folder.path(), "a.png", &[&FRONT[..], &["96x64"]].concat());
    let picture = picture(&folder.path().join("a.png"));
    assert_eq!(picture.dimensions(), (96, 64));
    let [red, green, blue] = [0, 1, 2].map(|channel| place(&picture, channel));
    assert!(red.0 > 0.55 && blue.0 < 0.45 && (green.0 - 0.5).abs() < 0.05, "{red:?} {green:?} {blue:?}");
    assert!(green.1 < red.1 && green.1 < blue.1, "{red:?} {green:?} {blue:?}");
}

#[test]
fn without_background_a_picture_is_transparent_and_with_one_it_is_opaque() {
    let folder = compass();
    render(folder.path(), "clear.png", &[&FRONT[..], &["64"]].concat());
    let clear = picture(&folder.path().join("clear.png"));
    assert_eq!(clear.get_pixel(0, 0).0[3], 0);
    // Straight alpha: where a triangle half covers a pixel its colour is still full.
    let edges: Vec<_> = clear.pixels().filter(|p| (30..200).contains(&p.0[3])).collect();
    assert!(edges.len() > 10 && edges.iter().all(|p| *p.0[..3].iter().max().unwrap() > 200), "{edges:?}");
    render(folder.path(), "solid.png", &[&FRONT[..], &["64", "--background", "#336699"]].concat());
    let solid = picture(&folder.path().join("solid.png"));
    assert_eq!(image::open(folder.path().join("solid.png")).unwrap().color(), image::ColorType::Rgb8);
    assert_eq!(solid.get_pixel(0, 0).0, [0x33, 0x66, 0x99, 255]);
    // A mesh's number becomes the byte of the curve it is written with.
    render(folder.path(), "raw.png", &[&FRONT[..], &["64", "--background", "0.5,0.5,0.5", "--raw"]].concat());
    assert_eq!(picture(&folder.path().join("raw.png")).get_pixel(0, 0).0, [128, 128, 128, 255]);
}

#[test]
fn a_sign_hides_the_wall_behind_it_in_a_scene_of_any_size() {
    let folder = tempfile::tempdir().unwrap();
    let quad = |[x, y, z]: [f32; 3], [w, h]: [f32; 2], color: &str| {
        [[0.0, 0.0], [w, 0.0], [w, h], [0.0, h]].map(|[u, v]| format!("v {} {} {z} {color}\n", x + u, y + v)).concat()
    };
    let floor = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(|[x, z]| format!("v {} 0 {} 1 0 0\n", 5000 * x, 5000 * z));
    let (wall, sign) = (quad([-5.0, 0.0, 0.0], [10.0, 10.0], "1 0 0"), quad([-2.0, 3.0, 0.2], [4.0, 4.0], "0 0 1"));
    let obj = floor.concat() + &wall + &sign + "f 4 3 2 1\nf 5 6 7 8\nf 9 10 11 12\n";
    std::fs::write(folder.path().join("sign.obj"), obj).unwrap();
    // From afar, and from nearer than a thousandth of the scene.
    for eye in ["0,6,40", "0,5,6"] {
        let view = ["--size", "96", "--unlit", "--eye", eye, "--look-at", "0,5,0"];
        succeeds(folder.path(), &[&["render", "sign.obj", "-o", "sign.png"], &view[..]].concat());
        assert_eq!(picture(&folder.path().join("sign.png")).get_pixel(48, 48).0[..3], [0, 0, 255], "{eye}");
    }
}

/// Small triangles before a wall cover what they cover, at any number of samples, and soft ones more.
#[test]
fn specks_are_not_drawn_fat() {
    let folder = tempfile::tempdir().unwrap();
    let mut obj = String::from("v -1 -1 0 1 1 1\nv 1 -1 0 1 1 1\nv 1 1 0 1 1 1\nv -1 1 0 1 1 1\nf 1 2 3 4\n");
    // 40 × 40 triangles of 4 % of their cells' area.
    for i in 0..1600 {
        let [x, y] = [i % 40, i / 40].map(|k| f64::from(k) / 20.0 - 0.975);
        obj +=
            &format!("v {x} {y} 0.1 0 0 0\nv {} {y} 0.1 0 0 0\nv {x} {} 0.1 0 0 0\nf -3 -2 -1\n", x + 0.02, y + 0.01);
    }
    fs::write(folder.path().join("specks.obj"), obj).unwrap();
    let dark = |extra: &[&str]| {
        let view =
            ["--eye", "0,0,5", "--look-at", "0,0,0", "--orthographic", "0.95", "--unlit", "--raw", "--size", "64"];
        succeeds(folder.path(), &[&["render", "specks.obj", "-o", "a.png"], &view[..], extra].concat());
        let picture = picture(&folder.path().join("a.png"));
        1.0 - picture.pixels().map(|p| f64::from(p.0[0]) / 255.0).sum::<f64>() / (64.0 * 64.0)
    };
    let share = 0.04;
    for extra in [&[][..], &["--samples", "8"], &["--shading", "flat"]] {
        assert!((dark(extra) - share).abs() < 0.01, "{} of {share}", dark(extra));
    }
    assert!(dark(&["--sigma", "1e-5"]) > 2.0 * share);
}

/// Two faces in one place, back to back, are each seen from their side, also where they are cut into other triangles. Materials
/// that are single-sided are seen from the front, unless both sides are asked for.
#[test]
fn each_side_shows_its_own_face() {
    let folder = tempfile::tempdir().unwrap();
    let at_center = |mesh: &str, extra: &[&str]| {
        let view = ["--look-at", "0,0,0", "--unlit", "--size", "64"];
        succeeds(folder.path(), &[&["render", mesh, "-o", "a.png"], &view[..], extra].concat());
        picture(&folder.path().join("a.png")).get_pixel(28, 32).0
    };
    let obj = "mtllib a.mtl\nv -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nusemtl front\nf 1 2 3 4\nusemtl back\nf 4 3 2 1\n";
    fs::write(folder.path().join("a.obj"), obj).unwrap();
    fs::write(folder.path().join("a.mtl"), "newmtl front\nKd 1 0 0\nnewmtl back\nKd 0 0 1\n").unwrap();
    for extra in [&[][..], &["--orthographic", "2"]] {
        assert_eq!(at_center("a.obj", &[&["--eye", "0,1,5"], extra].concat()), [255, 0, 0, 255], "{extra:?}");
        assert_eq!(at_center("a.obj", &[&["--eye", "0,1,-5"], extra].concat()), [0, 0, 255, 255], "{extra:?}");
    }
    // A red quad before a green one, by a node that mirrors it too.
    let floats = |all: &[f32]| all.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let mut bytes = floats(&[-1.0, -1.0, 0.0, 1.0, -1.0, 0.0, 1.0, 1.0, 0.0, -1.0, 1.0, 0.0]);
    bytes.extend([0, 1, 2, 0, 2, 3]);
    fs::write(folder.path().join("quad.bin"), bytes).unwrap();
    let mesh = |material: u32| serde_json::json!({ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1, "material": material }] });
    let material = |color: [f32; 4], double: bool| serde_json::json!({ "pbrMetallicRoughness": { "baseColorFactor": color }, "doubleSided": double });
    for (scale, double, [front, back]) in [
        ([1, 1, 1], false, [[255, 0, 0, 255], [0; 4]]),
        ([-1, 1, 1], false, [[255, 0, 0, 255], [0; 4]]),
        ([1, 1, -1], false, [[0, 255, 0, 255], [255, 0, 0, 255]]),
        ([1, 1, -1], true, [[255, 0, 0, 255]; 2]),
    ] {
        let root = serde_json::json!({
            "asset": { "version": "2.0" },
            "nodes": [{ "mesh": 0, "scale": scale }, { "mesh": 1, "translation": [0, 0, -0.5] }],
            "meshes": [mesh(0), mesh(1)],
            "materials": [material([1.0, 0.0, 0.0, 1.0], double), material([0.0, 1.0, 0.0, 1.0], true)],
            "accessors": [
                { "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3" },
                { "bufferView": 1, "componentType": 5121, "count": 6, "type": "SCALAR" },
            ],
            "bufferViews": [{ "buffer": 0, "byteLength": 48 }, { "buffer": 0, "byteOffset": 48, "byteLength": 6 }],
            "buffers": [{ "uri": "quad.bin", "byteLength": 54 }],
        });
        fs::write(folder.path().join("a.gltf"), root.to_string()).unwrap();
        assert_eq!(at_center("a.gltf", &["--eye", "0,0,5"]), front, "{scale:?}");
        assert_eq!(at_center("a.gltf", &["--eye", "0,0,-0.4"]), back, "{scale:?}");
        assert_eq!(at_center("a.gltf", &["--eye", "0,0,5", "--faces", "both"]), [255, 0, 0, 255]);
    }
    // `grad` draws the mesh alone: with --strict it refuses single-sided materials.
    let strict = ["grad", "a.gltf", "--target", "a.png", "-o", "b.png", "--strict"];
    fs::write(
        folder.path().join("a.gltf"),
        fs::read_to_string(folder.path().join("a.gltf")).unwrap().replace("true", "false"),
    )
    .unwrap();
    fails(folder.path(), &strict, 1, &["single-sided", "doubleSided"]);
}

/// A surface that is seen from behind is lit from the side that is seen; a wall of mixed winding has one grey.
#[test]
fn light_falls_on_the_side_that_is_seen() {
    let folder = tempfile::tempdir().unwrap();
    let leaf = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\n";
    let (plain, given) = ("f 1 2 3\nf 1 4 3\n", "vn 0 0 1\nf 1//1 2//1 3//1\nf 1//1 4//1 3//1\n");
    for (faces, shading) in [(plain, "smooth"), (plain, "flat"), (given, "smooth"), (given, "flat")] {
        fs::write(folder.path().join("a.obj"), leaf.to_owned() + faces).unwrap();
        for (eye, light, grey) in
            [("0,0,5", "0,0,1", 255), ("0,0,5", "0,0,-1", 97), ("0,0,-5", "0,0,-1", 255), ("0,0,-5", "0,0,1", 97)]
        {
            let view = ["--eye", eye, "--look-at", "0,0,0", "--light", light, "--shading", shading, "--size", "32"];
            succeeds(folder.path(), &[&["render", "a.obj", "-o", "a.png"], &view[..]].concat());
            let picture = picture(&folder.path().join("a.png"));
            let greys: Vec<u8> = picture.pixels().filter(|p| p.0[3] == 255).map(|p| p.0[0]).collect();
            assert!(
                greys.len() > 100 && greys.iter().all(|g| g.abs_diff(grey) <= 1),
                "{eye} {light} {shading} {greys:?}"
            );
        }
    }
}

/// Whether a pixel and all others within three pixels of it are covered.
fn is_inside(covered: &RgbaImage, column: u32, row: u32) -> bool {
    let around = |at: u32, end: u32| at.saturating_sub(3)..(at + 4).min(end);
    around(row, covered.height()).all(|r| around(column, covered.width()).all(|c| covered.get_pixel(c, r).0[0] > 127))
}

#[test]
fn closed_meshes_are_opaque_inside_unless_the_models_values_are_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let drawn = |mesh: &str, extra: &[&str]| {
        succeeds(folder.path(), &[&["render", mesh, "-o", "a.png"], extra].concat());
        picture(&folder.path().join("a.png"))
    };
    // With how many inner pixels are below 255 by the model, at least; a cube's far faces cover almost all of its edges.
    let meshes = [("fish", "256", 1000), ("torus", "201x255", 1000), ("icosphere", "128", 300), ("cube", "255", 1)];
    for (name, size, least) in meshes.into_iter().step_by(tier(3, 1)) {
        let extra = ["--size", size, "--samples", "1", "--output", "silhouette", "--silhouette-mode", "hard"];
        let covered = drawn(name, &extra);
        // A setting of the model asks for it.
        let solid = drawn(name, &["--size", size, "--gamma", "4e-6"]);
        let inside: Vec<(u32, u32)> =
            covered.enumerate_pixels().map(|(c, r, _)| (c, r)).filter(|(c, r)| is_inside(&covered, *c, *r)).collect();
        assert!(inside.len() > 3000, "{name}: {}", inside.len());
        let below = |picture: &RgbaImage| inside.iter().filter(|(c, r)| picture.get_pixel(*c, *r).0[3] < 255).count();
        assert_eq!([below(&solid), below(&drawn(name, &["--size", size]))], [0; 2], "{name}");
        // The outline stays soft, and colours are those of the model.
        assert!(solid.pixels().filter(|p| (1..255).contains(&p.0[3])).count() > 200, "{name}");
        for option in [&["--alpha", "model"][..], &["--gamma", "4e-6", "--raw"]] {
            assert!(below(&drawn(name, &[&["--size", size], option].concat())) >= least, "{name} {option:?}");
        }
        let model = drawn(name, &["--size", size, "--alpha", "model"]);
        let grounded = drawn(name, &["--size", size, "--gamma", "4e-6", "--background", "#000080"]);
        for (c, r) in inside {
            let [a, b, d] = [&solid, &model, &grounded].map(|picture| picture.get_pixel(c, r).0);
            // Samples of the model count by their alpha.
            assert!((0..3).all(|k| a[k].abs_diff(b[k]) <= 12 && a[k].abs_diff(d[k]) <= 1), "{name} {a:?} {b:?} {d:?}");
        }
    }
    let sum = ["render", "cube.obj", "-o", "a.png", "--alpha", "solid", "--silhouette-mode", "sum"];
    fails(folder.path(), &sum, 2, &["--silhouette-mode product"]);
}

#[test]
fn exr_and_npy_hold_the_same_numbers() {
    let folder = compass();
    let outputs = ["24x16", "--output", "color,depth,silhouette,normal", "-o", "a.npy"];
    let said = render(folder.path(), "a.exr", &[&FRONT[..], &outputs].concat());
    assert_eq!(said.lines().count(), 8, "{said}");
    let npy = |name: &str| {
        let (shape, values) = numpy::read_one(&folder.path().join(name));
        (shape, values.into_iter().map(|x| x as f32).collect::<Vec<_>>())
    };
    let (shape, color) = npy("a_color.npy");
    assert_eq!(shape, [16, 24, 4]);
    let exr = exr::prelude::read_first_rgba_layer_from_file(
        folder.path().join("a_color.exr"),
        |size, _| vec![[0f32; 4]; size.area()],
        |pixels, at, (r, g, b, a): (f32, f32, f32, f32)| pixels[at.1 * 24 + at.0] = [r, g, b, a],
    );
    assert_eq!(exr.unwrap().layer_data.channel_data.pixels.concat(), color);
    let (shape, depth) = npy("a_depth.npy");
    assert_eq!(shape, [16, 24, 1]);
    let z = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .specific_channels()
        .required("Z")
        .collect_pixels(
            |size, _| vec![0f32; size.area()],
            |pixels: &mut Vec<f32>, at, (z,): (f32,)| pixels[at.1 * 24 + at.0] = z,
        )
        .first_valid_layer()
        .all_attributes()
        .from_file(folder.path().join("a_depth.exr"));
    assert_eq!(z.unwrap().layer_data.channel_data.pixels, depth);
    assert_eq!(npy("a_silhouette.npy").0, [16, 24, 1]);
    // Every triangle faces +z, and the silhouette multiplies its normal.
    let (normal, alpha) = (npy("a_normal.npy").1, npy("a_silhouette.npy").1);
    let worst = normal.chunks_exact(3).zip(&alpha).map(|(n, a)| (n[2] - a).abs().max(n[0].abs())).fold(0.0, f32::max);
    assert!(worst < 1e-3, "{worst}");
}

#[test]
fn depth_and_normal_pictures_are_for_the_eye() {
    let folder = compass();
    let said = render(folder.path(), "a.png", &[&FRONT[..], &["48", "--output", "depth,normal,silhouette"]].concat());
    assert!(said.contains("a_depth.png") && said.contains("white is depth"), "{said}");
    let normal = picture(&folder.path().join("a_normal.png"));
    let facing = normal.pixels().filter(|p| p.0[3] > 250).collect::<Vec<_>>();
    assert!(!facing.is_empty());
    assert!(facing.iter().all(|p| p.0[0].abs_diff(128) < 3 && p.0[1].abs_diff(128) < 3 && p.0[2] > 252), "{facing:?}");
    assert!(picture(&folder.path().join("a_silhouette.png")).pixels().all(|p| p.0[3] == 255 && p.0[0] == p.0[1]));
}

#[test]
fn turntables_and_sweeps() {
    let folder = compass();
    let frames = |name: &str| {
        let mut decoder =
            gif::DecodeOptions::new().read_info(fs::File::open(folder.path().join(name)).unwrap()).unwrap();
        let mut delays = Vec::new();
        while let Some(frame) = decoder.read_next_frame().unwrap() {
            delays.push(frame.delay);
        }
        assert_eq!((decoder.width(), decoder.height()), (40, 30));
        assert_eq!(decoder.repeat(), gif::Repeat::Infinite);
        delays
    };
    render(folder.path(), "turn.gif", &["--turntable", "5", "--size", "40x30"]);
    assert_eq!(frames("turn.gif"), [4; 5], "25 frames a second");
    let sweep = ["--sweep", "sigma=1e-5..1e-2:4", "--size", "40x30"];
    let json: serde_json::Value =
        serde_json::from_str(&render(folder.path(), "s.png", &[&sweep[..], &["--json"]].concat())).unwrap();
    assert_eq!(json["samples"], 4);
    let said = render(folder.path(), "sweep.gif", &[&sweep[..], &["-o", "s.png"]].concat());
    assert!(said.contains("1e-5, 1e-4, 1e-3, 1e-2"), "{said}");
    assert_eq!(frames("sweep.gif").len(), 6, "there and back");
    let sheet = picture(&folder.path().join("s.png"));
    assert!(sheet.width() > 80 && sheet.height() > 60 && sheet.pixels().all(|p| p.0[3] == 255));
}

#[test]
fn programs_get_json() {
    let folder = compass();
    let json = render(folder.path(), "a.png", &["--json", "--size", "32", "--samples", "2", "--gamma", "1e-3"]);
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["settings"]["width"], 64);
    assert_eq!(json["settings"]["gamma"], 1e-3);
    assert_eq!(json["samples"], 2);
    assert_eq!(json["mesh"]["triangles"], 3);
    assert_eq!(json["files"][0]["path"], "a.png");
    assert!(json["device"].as_str().is_some_and(|d| !d.is_empty()));
    assert!(json["total_milliseconds"].as_f64().unwrap() > 0.0);
    assert!(json["timings"].as_array().unwrap().iter().all(|t| t["stage"].is_string()));
}

#[test]
fn smooth_shading_keeps_edges() {
    let folder = tempfile::tempdir().unwrap();
    let corner = |i: u32| format!("v {} {} {}\n", i & 1, i >> 1 & 1, i >> 2 & 1);
    let faces = "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";
    fs::write(folder.path().join("box.obj"), (0..8).map(corner).collect::<String>() + faces).unwrap();
    let shaded = |extra: &[&str]| {
        let line = [&["render", "box.obj", "-o", "a.png", "--size", "32", "--background", "#808080"], extra].concat();
        succeeds(folder.path(), &line);
        picture(&folder.path().join("a.png"))
    };
    let worst = |a: &RgbaImage, b: &RgbaImage| a.iter().zip(b.iter()).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
    let flat = shaded(&["--shading", "flat"]);
    // A box is one of flat faces, though its faces share their vertices.
    assert!(worst(&shaded(&[]), &flat) <= 1);
    assert!(worst(&shaded(&["--crease", "180"]), &flat) > 20);
    // Normals of the file take the place of the triangles', and --crease that of the file's.
    let sign = |i: u32, bit: u32| if i >> bit & 1 == 0 { -1 } else { 1 };
    let normals: String = (0..8).map(|i| format!("vn {} {} {}\n", sign(i, 0), sign(i, 1), sign(i, 2))).collect();
    let slashed = (1..=8).fold(faces.to_owned(), |text, i| text.replace(&format!(" {i}"), &format!(" {i}//{i}")));
    fs::write(folder.path().join("box.obj"), (0..8).map(corner).collect::<String>() + &normals + &slashed).unwrap();
    assert!(worst(&shaded(&[]), &flat) > 20);
    assert!(worst(&shaded(&["--crease", "40"]), &flat) <= 1);
    fails(folder.path(), &["render", "box.obj", "-o", "a.png", "--crease", "200"], 2, &["--crease", "180"]);
}

#[test]
fn a_mesh_that_stands_on_z_is_drawn_so_with_a_note() {
    let folder = tempfile::tempdir().unwrap();
    let pyramid = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nv 0 0 2\nf 4 3 2 1\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n";
    fs::write(folder.path().join("a.obj"), pyramid).unwrap();
    let drawn = |extra: &[&str]| {
        let line = [&["render", "a.obj", "-o", "a.png", "--size", "32"], extra].concat();
        let output = super::softras(folder.path(), &line);
        assert!(output.status.success());
        (picture(&folder.path().join("a.png")), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let (guessed, said) = drawn(&[]);
    assert!(said.contains("z is taken to be up") && said.contains("--up 0,1,0"), "{said}");
    let (given, said) = drawn(&["--up", "0,0,1"]);
    assert!(guessed == given && !said.contains("note"), "{said}");
    assert!(!drawn(&["--frame", "sphere"]).1.contains("note"));
    let (lying, said) = drawn(&["--up", "0,1,0"]);
    assert!(guessed != lying && !said.contains("note"), "{said}");
}

#[test]
fn the_faces_of_a_white_box_part() {
    let folder = tempfile::tempdir().unwrap();
    succeeds(folder.path(), &["mesh", "cube", "-o", "cube.obj"]);
    let white: String = fs::read_to_string(folder.path().join("cube.obj"))
        .unwrap()
        .lines()
        .filter(|line| line.starts_with("v ") || line.starts_with("f "))
        .map(|line| line.split(' ').map(|w| w.split('/').next().unwrap()).take(4).collect::<Vec<_>>().join(" ") + "\n")
        .collect();
    fs::write(folder.path().join("white.obj"), white).unwrap();
    succeeds(folder.path(), &["render", "white.obj", "-o", "a.png", "--size", "96"]);
    let mut shades = [0u32; 256];
    picture(&folder.path().join("a.png")).pixels().filter(|p| p.0[3] == 255).for_each(|p| shades[p.0[0] as usize] += 1);
    let faces: Vec<usize> = (0..256).filter(|&shade| shades[shade] > 200).collect();
    assert!(faces.len() == 3 && faces.windows(2).all(|pair| pair[1] - pair[0] > 25), "{faces:?}");
    assert!(faces[2] < 250, "{faces:?}");
}
