//! Tests of the command `softras bench`.

use super::{fails, softras, words};
use serde_json::Value;

/// The promise of `softras check` to a device.
const IMAGE_ERROR: f64 = 1e-4;
const GRADIENT_ERROR: f64 = 1e-3;

/// Whether the numbers of a row are there and agree.
fn check(row: &Value) {
    let number = |key: &str| row[key].as_f64().filter(|x| x.is_finite()).unwrap_or_else(|| panic!("{key}: {row}"));
    for key in ["median_ms", "device_ms", "pairs_needed", "pairs_evaluated", "faces", "size"] {
        assert!(number(key) > 0.0, "{key}: {row}");
    }
    let most = if row["pass"] == "backward" { GRADIENT_ERROR } else { IMAGE_ERROR };
    assert!(number("max_error") <= most, "{row}");
    assert!(number("pairs_evaluated") >= number("pairs_needed"), "{row}");
}

#[test]
fn a_quick_run_gives_rows_that_can_be_compared() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["bench", "torus", "--quick", "--modes", "color+silhouette,silhouette,hard,to-camera", "--json"];
    let output = softras(folder.path(), &[&arguments[..], &["rows.json"]].concat());
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{errors}");
    let rows: Value = serde_json::from_slice(&std::fs::read(folder.path().join("rows.json")).unwrap()).unwrap();
    let rows = rows.as_array().unwrap();
    assert_eq!(rows.len(), 12);
    for row in rows {
        check(row);
        assert_eq!((row["scene"].as_str(), row["faces"].as_u64()), (Some("torus"), Some(4096)));
        for key in ["device", "driver", "version"] {
            assert!(row[key].as_str().is_some_and(|text| !text.is_empty()), "{key}: {row}");
        }
        for (key, value) in [("sigma", 1e-4), ("gamma", 1e-4), ("tau", 1e-4)] {
            assert_eq!(row[key].as_f64(), Some(value));
        }
        let share = row["of_full"].as_f64();
        assert_eq!(share.is_some_and(|share| share > 0.0), row["mode"] != "color+silhouette", "{row}");
        let stages = row["stages_ms"].as_object().unwrap();
        assert_eq!(stages.contains_key("backward"), row["pass"] != "forward", "{row}");
        assert_eq!(stages.contains_key("forward"), row["pass"] != "backward", "{row}");
    }
    for three in rows.chunks(3) {
        let [forward, backward, frame] = [0, 1, 2].map(|pass| three[pass]["dispatches"].as_u64().unwrap());
        assert!(forward > 0 && backward > 0 && forward + backward == frame, "{three:?}");
    }
    // The table has the same rows under its heads.
    let text = String::from_utf8(output.stdout).unwrap();
    assert_eq!(text.lines().filter(|line| line.starts_with("torus ")).count(), 12, "{text}");
    // An error that tau makes is no error of the device: it is in the JSON, where it has a name, and not in the table.
    let head = text.lines().find(|line| line.starts_with("scene ")).unwrap();
    assert!(head.trim_end().ends_with(" error") && !head.contains("untrunc"), "{head}");
    assert!(rows.iter().all(|row| row.get("max_error_untruncated").is_some()));
    // The pairs that a frame needs do not depend on the images that are drawn from them.
    let needed = |mode: &str| rows.iter().find(|row| row["mode"] == mode).map(|row| row["pairs_needed"].clone());
    assert_eq!(needed("color+silhouette"), needed("silhouette"));
    assert!(needed("hard").unwrap().as_u64() < needed("silhouette").unwrap().as_u64());
}

#[test]
fn nonsense_is_refused_before_any_work() {
    let folder = tempfile::tempdir().unwrap();
    for (line, code, part) in [
        ("bench --size 0", 2, "--size"),
        ("bench --modes hazy", 2, "color+silhouette"),
        ("bench --tau 0.6", 1, "tau"),
        ("bench --json nowhere/rows.json", 1, "folder"),
        ("bench missing.obj", 1, "missing.obj"),
    ] {
        fails(folder.path(), &words(line), code, &[part]);
    }
}
