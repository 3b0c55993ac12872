//! Pictures and cameras that `fit --write-views` writes are read again.

use crate::command::{fails, succeeds, words};
use serde_json::{Value, json};
use std::fs;
use std::path::Path;

fn read(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

/// The losses of a fit of some steps that begins with the fish itself.
fn fitted(folder: &Path, source: &[&str]) -> Vec<f64> {
    let rest = "--template fish --iterations 3 -o out.obj --json log.json";
    succeeds(folder, &[&["fit"], source, &words(rest)[..]].concat());
    let log = read(&folder.join("log.json"));
    log["silhouette_loss"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

fn close(a: &[f64], b: &[f64], by: f64) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < by)
}

#[test]
fn written_views_are_read_again() {
    let folder = tempfile::tempdir().unwrap();
    let made = ["--from", "fish", "--views", "4", "--size", "48"];
    let plain = fitted(folder.path(), &made);
    let written = fitted(folder.path(), &[&made[..], &["--write-views", "photos"]].concat());
    assert!(close(&plain, &written, 1e-5), "{plain:?} {written:?}");

    // The pictures have 256 steps, and near and far come from the cameras in place of the mesh.
    let from_list = fitted(folder.path(), &["--views", "photos"]);
    assert!(close(&plain[..1], &from_list[..1], 1e-3), "{plain:?} {from_list:?}");
    // A lens a hundredth off is told apart by far more.
    let path = folder.path().join("photos/cameras.json");
    let mut list = read(&path);
    list[0]["intrinsics"][0][2] = json!(24.5);
    fs::write(path, list.to_string()).unwrap();
    let from_off = fitted(folder.path(), &["--views", "photos"]);
    assert!(!close(&from_list[..1], &from_off[..1], 1e-5), "{from_list:?} {from_off:?}");
}

#[test]
fn views_are_written_only_where_they_replace_no_input() {
    let folder = tempfile::tempdir().unwrap();
    let fit = ["fit", "--from", "cube", "--views", "2", "--size", "8", "--iterations", "1", "-o", "o.obj"];
    fails(folder.path(), &[&fit[..], &["--json", "v/view_001.png", "--write-views", "v"]].concat(), 2, &["twice"]);
    fs::write(folder.path().join("file"), "").unwrap();
    fails(folder.path(), &[&fit[..], &["--write-views", "file"]].concat(), 1, &["file"]);
    fails(folder.path(), &["fit", "--views", "v", "--write-views", "w", "-o", "o.obj"], 2, &["--from"]);
    fails(folder.path(), &words("fit --from none.obj --write-views w -o o.obj"), 1, &["none.obj"]);
    assert!(!folder.path().join("w").exists());
}
