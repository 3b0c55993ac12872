//! Pictures and cameras that `fit --write-views` writes are read again, in each of the formats of cameras.

use crate::command::{fails, succeeds};
use serde_json::{Value, json};
use std::fs;
use std::path::Path;

fn read(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

/// The losses of a fit of some steps that begins with the fish itself.
fn fitted(folder: &Path, source: &[&str]) -> Vec<f64> {
    let rest = "--template fish.obj --iterations 3 -o out.obj --json log.json";
    succeeds(folder, &[&["fit"], source, &rest.split_whitespace().collect::<Vec<_>>()[..]].concat());
    let log = read(&folder.join("log.json"));
    log["silhouette_loss"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

fn close(a: &[f64], b: &[f64], by: f64) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < by)
}

/// The pose of an entry as rows, and its lens.
fn parts(entry: &Value) -> ([[f64; 4]; 3], [f64; 4]) {
    let number = |key: &str, i: usize, j: usize| entry[key][i][j].as_f64().unwrap();
    let row = |i: usize| [0, 1, 2, 3].map(|j| number("world_to_camera", i, j));
    let lens = |i: usize, j: usize| number("intrinsics", i, j);
    ([row(0), row(1), row(2)], [lens(0, 0), lens(1, 1), lens(0, 2), lens(1, 2)])
}

/// The same cameras as NeRF has them: to the world, with y up and z backward.
fn transforms(entries: &[Value]) -> Value {
    let frame = |entry: &Value| {
        let (r, _) = parts(entry);
        let eye = [0, 1, 2].map(|i| -(0..3).map(|k| r[k][i] * r[k][3]).sum::<f64>());
        let row = |i: usize| json!([r[0][i], -r[1][i], -r[2][i], eye[i]]);
        json!({ "file_path": entry["file"], "transform_matrix": [row(0), row(1), row(2), [0, 0, 0, 1]] })
    };
    let [fx, fy, cx, cy] = parts(&entries[0]).1;
    json!({ "fl_x": fx, "fl_y": fy, "cx": cx, "cy": cy, "frames": entries.iter().map(frame).collect::<Vec<_>>() })
}

/// The quaternion (w, x, y, z) of a rotation.
fn quaternion(r: &[[f64; 4]; 3]) -> [f64; 4] {
    // One of the four is at least a half; it is found by its square, the others by what they have in common with it.
    let squares = [
        1.0 + r[0][0] + r[1][1] + r[2][2],
        1.0 + r[0][0] - r[1][1] - r[2][2],
        1.0 - r[0][0] + r[1][1] - r[2][2],
        1.0 - r[0][0] - r[1][1] + r[2][2],
    ];
    let (yz, zx, xy) = (r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]);
    let (sx, sy, sz) = (r[1][2] + r[2][1], r[0][2] + r[2][0], r[0][1] + r[1][0]);
    let products =
        [[squares[0], yz, zx, xy], [yz, squares[1], sz, sy], [zx, sz, squares[2], sx], [xy, sy, sx, squares[3]]];
    let largest = (0..4).max_by(|&a, &b| squares[a].total_cmp(&squares[b])).unwrap();
    products[largest].map(|product| product / (2.0 * squares[largest].sqrt()))
}

fn colmap(entries: &[Value], size: u32) -> (String, String) {
    let [fx, fy, cx, cy] = parts(&entries[0]).1;
    let mut images = String::from("# written by a test\n");
    for (i, entry) in entries.iter().enumerate() {
        let (r, _) = parts(entry);
        let [w, x, y, z] = quaternion(&r);
        let [a, b, c] = [r[0][3], r[1][3], r[2][3]];
        images += &format!("{i} {w} {x} {y} {z} {a} {b} {c} 1 {}\n\n", entry["file"].as_str().unwrap());
    }
    (format!("1 PINHOLE {size} {size} {fx} {fy} {cx} {cy}\n"), images)
}

#[test]
fn written_views_are_read_again_in_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    succeeds(folder.path(), &["mesh", "fish", "-o", "fish.obj"]);
    let made = ["--from", "fish.obj", "--views", "4", "--size", "48"];
    let plain = fitted(folder.path(), &made);
    let written = fitted(folder.path(), &[&made[..], &["--write-views", "photos"]].concat());
    assert!(close(&plain, &written, 1e-5), "{plain:?} {written:?}");

    // The pictures have 256 steps, and near and far come from the cameras in place of the mesh.
    let from_list = fitted(folder.path(), &["--views", "photos"]);
    assert!(close(&plain[..1], &from_list[..1], 1e-3), "{plain:?} {from_list:?}");
    // A lens a hundredth off is told apart by far more than the formats below.
    let list = read(&at("photos/cameras.json"));
    let entries = list.as_array().unwrap().clone();
    let mut off = entries.clone();
    off[0]["intrinsics"][0][2] = json!(24.5);
    fs::write(at("photos/cameras.json"), Value::from(off).to_string()).unwrap();
    let from_off = fitted(folder.path(), &["--views", "photos"]);
    assert!(!close(&from_list[..1], &from_off[..1], 1e-5), "{from_list:?} {from_off:?}");

    fs::remove_file(at("photos/cameras.json")).unwrap();
    fs::write(at("photos/transforms.json"), transforms(&entries).to_string()).unwrap();
    let from_nerf = fitted(folder.path(), &["--views", "photos"]);
    assert!(close(&from_list[..1], &from_nerf[..1], 1e-6), "{from_list:?} {from_nerf:?}");

    fs::remove_file(at("photos/transforms.json")).unwrap();
    let (cameras, images) = colmap(&entries, 48);
    fs::create_dir(at("sparse")).unwrap();
    fs::write(at("sparse/cameras.txt"), cameras).unwrap();
    fs::write(at("sparse/images.txt"), images).unwrap();
    let from_colmap = fitted(folder.path(), &["--views", "photos", "--cameras", "sparse/images.txt"]);
    assert!(close(&from_list[..1], &from_colmap[..1], 1e-6), "{from_list:?} {from_colmap:?}");
}

#[test]
fn views_are_written_only_where_they_replace_no_input() {
    let folder = tempfile::tempdir().unwrap();
    succeeds(folder.path(), &["mesh", "cube", "-o", "cube.obj"]);
    let fit = ["fit", "--from", "cube.obj", "--views", "2", "--size", "8", "--iterations", "1", "-o", "o.obj"];
    fails(folder.path(), &[&fit[..], &["--json", "v/view_001.png", "--write-views", "v"]].concat(), 2, &["twice"]);
    fails(folder.path(), &[&fit[..], &["--write-views", "cube.obj"]].concat(), 1, &["cube.obj"]);
    fails(folder.path(), &["fit", "--views", "v", "--write-views", "w", "-o", "o.obj"], 2, &["--from"]);
}
