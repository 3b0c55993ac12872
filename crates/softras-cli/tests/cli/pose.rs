//! Tests of the command `softras pose`.

use super::{fails, succeeds, words};
use serde_json::Value;

#[test]
fn a_pose_is_found_from_a_picture() {
    let folder = tempfile::tempdir().unwrap();
    let render = "render cube -o target.png --frame sphere --unlit --size 32 --azimuth 250 --elevation -10";
    succeeds(folder.path(), &words(render));
    let pose = "pose --mesh cube --image target.png --json -o posed.obj";
    let report: Value = serde_json::from_str(&succeeds(folder.path(), &words(pose))).unwrap();
    assert!(report["loss"].as_f64().unwrap() < 0.02 && report["confidence"].as_f64().unwrap() > 0.5, "{report}");
    // Seen from where the fit looked from, the posed cube is the target again.
    let look = "grad posed.obj --target target.png -o grad.png --json --blur 2 --gamma 0.01 --unlit";
    let near: Value = serde_json::from_str(&succeeds(folder.path(), &words(look))).unwrap();
    let far = look.replace("posed.obj", "cube");
    let far: Value = serde_json::from_str(&succeeds(folder.path(), &words(&far))).unwrap();
    let [near, far] = [near, far].map(|report| report["loss"].as_f64().unwrap());
    assert!(near < 0.3 * far, "{near} against {far} unposed");
}

#[test]
fn a_pose_is_refined_from_where_the_mesh_is() {
    let folder = tempfile::tempdir().unwrap();
    let run = |line: &str| succeeds(folder.path(), &words(line));
    let pose = |line: &str| -> Value { serde_json::from_str(&run(&format!("pose --json {line}"))).unwrap() };
    run("mesh fish -o fish.obj");
    run("render fish.obj -o target.png --frame sphere --unlit --size 48 --azimuth 130 --elevation 25");
    // The camera of the command turns by 15 degrees of azimuth and 5 of elevation from there.
    let refined = pose("--mesh fish.obj --image target.png -o posed.obj --init --no-translation");
    let [iou, color] = ["silhouette_iou", "color_difference"].map(|key| refined[key].as_f64().unwrap());
    assert!(iou > 0.9 && color < 0.2, "{refined}");
    let degrees = refined["degrees"].as_f64().unwrap();
    assert!((10.0..=20.0).contains(&degrees), "{refined}");
    assert!(refined["confidence"].is_null() && refined["equally_good"].as_array().unwrap().len() == 1, "{refined}");
    // The posed mesh is seen by the same camera: there is nothing left to turn.
    let again = pose("--mesh posed.obj --image target.png --init --no-translation");
    assert!(again["degrees"].as_f64().unwrap() < 1.0, "{again}");
    assert!(again["loss"].as_f64().unwrap() < 1.05 * refined["loss"].as_f64().unwrap(), "{again} after {refined}");
    // Beyond half a turn is less than half a turn about the opposite axis.
    let behind = pose("--mesh fish.obj --image target.png --init 0,1,0,350 --no-translation --iterations 1");
    assert!(behind["degrees"].as_f64().unwrap() < 20.0 && behind["axis"][1].as_f64().unwrap() < 0.0, "{behind}");
    let one = "pose --mesh fish.obj --image target.png --init --no-translation --iterations 1";
    assert!(run(one).contains("confidence unknown"));
    // Far from 0 the posed mesh stays there, and is as exact.
    let text = std::fs::read_to_string(folder.path().join("fish.obj")).unwrap();
    let moved = |line: &str| match line.strip_prefix("v ").map(|rest| rest.split_once(' ').unwrap()) {
        Some((x, rest)) => format!("v {} {rest}\n", x.parse::<f64>().unwrap() + 5e5),
        None => format!("{line}\n"),
    };
    std::fs::write(folder.path().join("far.obj"), text.lines().map(moved).collect::<String>()).unwrap();
    pose("--mesh far.obj --image target.png -o there.obj --init --no-translation");
    let there = pose("--mesh there.obj --image target.png --init --no-translation --iterations 1");
    assert!(there["silhouette_iou"].as_f64().unwrap() > 0.9, "{there}");
    let text = std::fs::read_to_string(folder.path().join("there.obj")).unwrap();
    assert!(text.lines().any(|line| line.starts_with("v 500000.") || line.starts_with("v 499999.")));
    fails(folder.path(), &["pose", "--mesh", "a", "--image", "b", "--init", "0,0,0,5"], 2, &["--init", "no length"]);
}
