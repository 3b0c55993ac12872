//! Tests of `softras fit --benchmark`.

use super::{fails, succeeds};
use serde_json::Value;

/// The rows of the table that the command writes as JSON, and what it prints.
fn benchmark(folder: &std::path::Path, extra: &[&str]) -> (Vec<Value>, String) {
    let small = ["fit", "--views", "6", "--size", "32", "--iterations", "3", "--json", "table.json", "--benchmark"];
    let said = succeeds(folder, &[&small[..], extra].concat());
    let table = std::fs::read_to_string(folder.join("table.json")).unwrap();
    let table: Value = serde_json::from_str(&table).unwrap();
    assert_eq!((table["views"].as_u64(), &table["size"]), (Some(6), &serde_json::json!([32, 32])), "{table}");
    (table["rows"].as_array().unwrap().clone(), said)
}

#[test]
fn the_table_of_fits_has_every_mesh_and_method() {
    let folder = tempfile::tempdir().unwrap();
    let texts = |rows: &[Value], key: &str| -> Vec<String> {
        rows.iter().map(|row| row[key].as_str().unwrap().to_string()).collect()
    };
    let (rows, said) = benchmark(folder.path(), &[]);
    let made = ["torus", "double-torus", "mug", "chair"];
    assert_eq!(texts(&rows, "mesh"), made.map(|name| [name; 2]).concat());
    assert_eq!(texts(&rows, "method"), ["fit", "hull alone"].repeat(4));
    let genus: Vec<u64> = rows.iter().map(|row| row["true_genus"].as_u64().unwrap()).collect();
    assert_eq!(genus, [1, 1, 2, 2, 1, 1, 0, 0]);
    for row in &rows {
        let number = |key: &str| row[key].as_f64().unwrap();
        assert!(number("iou_3d") > 0.4 && number("chamfer") < 0.1 && number("seconds") > 0.0, "{row}");
    }
    // The printed table is the same one: a line for each row, below two of the heading.
    let lines: Vec<&str> = said.lines().collect();
    assert_eq!(lines.len(), 10, "{said}");
    for (line, row) in lines[2..].iter().zip(&rows) {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        assert_eq!(cells[1..3], [row["mesh"].as_str().unwrap(), row["method"].as_str().unwrap()], "{line}");
        assert_eq!(cells[3], format!("{:.3}", row["iou_3d"].as_f64().unwrap()), "{line}");
    }
}

#[test]
fn a_given_mesh_is_compared_with_every_baseline() {
    let folder = tempfile::tempdir().unwrap();
    let torus = softras::shapes::torus(0.8, 0.35, 20, 10).unwrap();
    softras::obj::write_obj(&torus, &folder.path().join("ring.obj")).unwrap();
    let (rows, _) = benchmark(folder.path(), &["ring.obj", "--baselines"]);
    let methods: Vec<&str> = rows.iter().map(|row| row["method"].as_str().unwrap()).collect();
    let without = ["without the schedule", "without softness", "without regularisers", "without colours"];
    let all = [&["fit", "hull alone", "from a sphere"], &without[..], &["hard, image-space differences"]].concat();
    assert_eq!(methods, all);
    assert!(rows.iter().all(|row| row["mesh"] == "ring" && row["true_genus"] == 1), "{rows:?}");
    // A sphere has no hole, and what has no hole is farther from a ring.
    let of = |method: &str, key: &str| rows[methods.iter().position(|m| *m == method).unwrap()][key].as_f64().unwrap();
    assert_eq!((of("fit", "genus"), of("from a sphere", "genus")), (1.0, 0.0));
    assert!(of("fit", "iou_3d") > of("from a sphere", "iou_3d") + 0.05, "{rows:?}");
    assert!(of("fit", "chamfer") < of("from a sphere", "chamfer"), "{rows:?}");
    fails(folder.path(), &["fit", "--benchmark", "none.obj"], 1, &["none.obj"]);
    fails(folder.path(), &["fit", "--benchmark", "-o", "out.obj"], 2, &["--benchmark", "--out"]);
    fails(folder.path(), &["fit", "--benchmark", "ring.obj", "--json", "ring.obj"], 2, &["ring.obj", "overwrite"]);
}
