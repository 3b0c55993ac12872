//! `softras fit` and the holes of what it fits: found by the hull, told where they are covered, and cut while it runs.

use crate::command::{fails, softras, succeeds, words};
use serde_json::Value;
use std::io::BufRead;

fn json(path: &std::path::Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// From eight views on a fit begins with the hull, which has the torus's hole; a sphere has not, and that is told.
#[test]
fn a_fit_begins_with_the_hull_and_tells_what_it_has_not_found() {
    let folder = tempfile::tempdir().unwrap();
    softras_io::save(&softras::shapes::torus(1.0, 0.4, 32, 16).unwrap(), &folder.path().join("torus.obj")).unwrap();
    let run = |extra: &str| {
        let fit = format!("fit --from torus.obj --views 8 --size 32 --iterations 3 -o out.obj --json log.json {extra}");
        let output = softras(folder.path(), &words(&fit));
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        let log = json(&folder.path().join("log.json"));
        (String::from_utf8(output.stderr).unwrap(), log["final"].clone())
    };
    let (said, found) = run("");
    assert!(!said.contains("covers a hole"), "{said}");
    assert_eq!((found["parts"].as_u64(), found["genus"].as_u64()), (Some(1), Some(1)), "{found}");
    assert!(found["iou_3d"].as_f64().unwrap() > 0.85, "{found}");
    let official = ["fit", "--from", "torus.obj", "--template", "hull", "--preset", "official", "-o", "o.obj"];
    fails(folder.path(), &official, 2, &["--template hull", "official"]);
    let (said, found) = run("--template sphere --keep-topology");
    assert!(said.contains("covers a hole that is seen in view"), "{said}");
    assert_eq!(found["genus"].as_u64(), Some(0), "{found}");
}

/// A sphere around a torus covers its hole until the mesh is cut anew to the silhouettes; and a checkpoint knows the new mesh.
#[test]
fn a_hole_that_the_mesh_covers_is_cut_while_the_fit_runs() {
    let folder = tempfile::tempdir().unwrap();
    let run = |extra: &str| {
        let fit = format!("fit --from torus --views 12 --size 48 --iterations 60 -o out.obj --json log.json {extra}");
        let output = softras(folder.path(), &words(&fit));
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(0), "{said}");
        let mesh = std::fs::read_to_string(folder.path().join("out.obj")).unwrap();
        (said, json(&folder.path().join("log.json"))["final"].clone(), mesh)
    };
    let iou = |found: &Value| found["iou_3d"].as_f64().unwrap();
    let (said, kept, _) = run("--template sphere --keep-topology");
    assert!(!said.contains("cut anew"), "{said}");
    assert_eq!(kept["genus"].as_u64(), Some(0));
    let (said, cut, _) = run("--template sphere --checkpoint fit.npz");
    assert!(said.contains("step 18: the mesh covers a hole that is seen in view"), "{said}");
    assert!(said.contains("it was cut anew to the silhouettes, and is now 1 part of genus 1 (mask IoU 0."), "{said}");
    assert_eq!((cut["parts"].as_u64(), cut["genus"].as_u64()), (Some(1), Some(1)), "{said}");
    assert!(iou(&cut) > iou(&kept) + 0.1, "{} and {}", iou(&cut), iou(&kept));
    assert_eq!(cut["covered_holes_in_views"].as_array().map(Vec::len), Some(0));
    let (_, resumed, _) = run("--template sphere --checkpoint fit.npz --resume");
    assert_eq!(resumed["genus"].as_u64(), Some(1));
    // A fit that begins with the hole is not cut anew: it gives the same bits with --keep-topology.
    let (said, _, hull) = run("");
    assert!(!said.contains("cut anew"), "{said}");
    assert_eq!(run("--keep-topology").2, hull);
}

/// The mesh that has the mug's handle is farther from the outlines than the one that covers its hole, and nearer to all else of the
/// pictures after a few steps.
#[test]
fn a_cut_that_loses_outlines_at_first_is_kept_where_its_loss_falls_lower() {
    let folder = tempfile::tempdir().unwrap();
    let fit = "fit --from mug --template sphere --color --views 12 --size 48 --iterations 200 -o out.obj";
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_softras"))
        .current_dir(folder.path())
        .args(fit.split_whitespace())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = std::io::BufReader::new(child.stderr.take().unwrap()).lines().map_while(Result::ok);
    let said = lines.find(|line| line.contains("step 60:")).unwrap_or_default();
    // The test does not wait for the steps after the cut.
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(said.contains("is now 1 part of genus 1 (mask IoU"), "{said}");
    let after = |what: &str| said.split(what).nth(1).unwrap()[..6].parse::<f64>().unwrap_or_else(|_| panic!("{said}"));
    assert!(after("mask IoU ") < after("before "), "{said}");
    assert!(after("after 10 steps loss ") < after("uncut "), "{said}");
}
