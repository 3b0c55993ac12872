//! Tests of the command `softras pose`.

use super::{fails, succeeds};
use serde_json::{Value, json};

#[test]
fn a_pose_is_found_from_a_picture() {
    let folder = tempfile::tempdir().unwrap();
    succeeds(folder.path(), &["mesh", "cube", "-o", "cube.obj"]);
    let render = "render cube.obj -o target.png --frame sphere --unlit --size 32 --azimuth 250 --elevation -10";
    succeeds(folder.path(), &render.split_whitespace().collect::<Vec<_>>());
    let pose = "pose --mesh cube.obj --image target.png --json --baselines -o posed.obj";
    let report: Value =
        serde_json::from_str(&succeeds(folder.path(), &pose.split_whitespace().collect::<Vec<_>>())).unwrap();
    assert!(report["loss"].as_f64().unwrap() < 0.02 && report["confidence"].as_f64().unwrap() > 0.5, "{report}");
    let baselines = report["baselines"].as_array().unwrap();
    assert_eq!(baselines.len(), 2);
    let least = 0.9 * report["loss"].as_f64().unwrap();
    assert!(baselines.iter().all(|b| b["loss"].as_f64().unwrap() >= least), "{report}");
    // Seen from where the fit looked from, the posed cube is the target again.
    let look = "grad posed.obj --target target.png -o grad.png --json --blur 2 --gamma 0.01 --unlit";
    let near: Value =
        serde_json::from_str(&succeeds(folder.path(), &look.split_whitespace().collect::<Vec<_>>())).unwrap();
    let far = look.replace("posed", "cube");
    let far: Value =
        serde_json::from_str(&succeeds(folder.path(), &far.split_whitespace().collect::<Vec<_>>())).unwrap();
    let [near, far] = [near, far].map(|report| report["loss"].as_f64().unwrap());
    assert!(near < 0.3 * far, "{near} against {far} unposed");
}

#[test]
fn a_pose_is_refined_from_where_the_mesh_is() {
    let folder = tempfile::tempdir().unwrap();
    let run = |line: &str| succeeds(folder.path(), &line.split_whitespace().collect::<Vec<_>>());
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
    fails(folder.path(), &["pose", "--mesh", "a", "--image", "b", "--init", "0,0,0,5"], 2, &["--init", "no length"]);
}

/// The mean over a landscape's cells of how far each is from the mean of those left and right, above and below of it, in
/// parts of white: large where there are steps.
fn roughness(picture: &image::RgbImage, panel: u32) -> f64 {
    const CELLS: u32 = 61;
    const CELL: u32 = 4;
    const MARGIN: u32 = 6;
    // What the names and numbers of a panel's axes take on the left, above and on the right.
    const EDGES: [u32; 3] = [30, 12, 12];
    let value = |column: u32, row: u32| {
        let first = MARGIN + panel * (EDGES[0] + CELLS * CELL + EDGES[2] + MARGIN) + EDGES[0];
        let (x, y) = (first + column * CELL, MARGIN + EDGES[1] + row * CELL);
        picture.get_pixel(x, y).0.map(f64::from).iter().sum::<f64>() / 765.0
    };
    let bend = |column: u32, row: u32| {
        let (across, up) =
            (value(column - 1, row) + value(column + 1, row), value(column, row - 1) + value(column, row + 1));
        (value(column, row) - 0.25 * (across + up)).abs()
    };
    let inner = 1..CELLS - 1;
    let all: Vec<f64> = inner.clone().flat_map(|row| inner.clone().map(move |column| bend(column, row))).collect();
    all.iter().sum::<f64>() / all.len() as f64
}

#[test]
fn the_search_is_measured_on_any_mesh() {
    let folder = tempfile::tempdir().unwrap();
    let run = |line: &str| succeeds(folder.path(), &line.split_whitespace().collect::<Vec<_>>());
    run("mesh fish -o fish.obj");
    let report: Value = serde_json::from_str(&run("pose --benchmark fish.obj --trials 1 --json")).unwrap();
    let fish = &report["meshes"][0];
    assert_eq!((&fish["mesh"], &fish["pictures"], &fish["within_2_degrees"]), (&json!("fish"), &json!(1), &json!(1)));
    assert!(fish["degrees"].as_array().unwrap().iter().all(|d| d.as_f64().unwrap() < 2.0), "{report}");
    // One start and one step do not get there.
    let table = run("pose --benchmark fish.obj fish.obj --trials 1 --starts 1 --iterations 1");
    let rows: Vec<Vec<&str>> = table.lines().skip(1).map(|line| line.split_whitespace().collect()).collect();
    assert_eq!(rows.len(), 2, "{table}");
    assert!(rows.iter().all(|row| row[..3] == ["fish", "1", "0"]), "{table}");
    fails(folder.path(), &["pose", "--benchmark", "fish.obj", "--landscape", "l.png"], 2, &["--landscape"]);
}

#[test]
fn the_benchmark_reports_every_method_and_draws_its_landscape() {
    let folder = tempfile::tempdir().unwrap();
    let run = "pose --benchmark --trials 3 --starts 4 --iterations 20 --json";
    let report: Value =
        serde_json::from_str(&succeeds(folder.path(), &run.split_whitespace().collect::<Vec<_>>())).unwrap();
    let methods = report["methods"].as_array().unwrap();
    assert_eq!(methods.len(), 11);
    assert!(methods.iter().all(|m| (0.0..=180.0).contains(&m["median_degrees"].as_f64().unwrap())), "{report}");
    // What the schedule, the blur and long first steps are for, with the paper's plain colours.
    let run = "pose --benchmark --trials 20 --starts 1 --seed 101 --json";
    let report: Value =
        serde_json::from_str(&succeeds(folder.path(), &run.split_whitespace().collect::<Vec<_>>())).unwrap();
    let within = |name: &str| {
        let methods = report["methods"].as_array().unwrap();
        methods.iter().find(|m| m["method"] == name).unwrap()["within_5_degrees"].as_u64().unwrap()
    };
    let hard = within("hard, image-space finite differences");
    let soft = within("soft, sigma-gamma schedule, coarse to fine");
    assert!(soft >= 11 && soft > hard + 3, "{report}");
    // The loss over two angles: ragged where it is sharp, smooth where it is soft.
    let run = "pose --benchmark --trials 1 --starts 1 --iterations 1 --landscape landscape.png";
    succeeds(folder.path(), &run.split_whitespace().collect::<Vec<_>>());
    let picture = image::open(folder.path().join("landscape.png")).unwrap().into_rgb8();
    let [sharp, soft] = [0, 1].map(|panel| roughness(&picture, panel));
    assert!(soft < 0.6 * sharp, "{soft} beside {sharp}");
    let fails_with = |arguments: &str, part: &str| {
        fails(folder.path(), &arguments.split_whitespace().collect::<Vec<_>>(), 2, &[part]);
    };
    fails_with("pose --mesh x.obj", "--image");
    fails_with("pose --benchmark --mesh x.obj", "cannot be used with");
    fails_with("fit --from x.obj --views many -o out.obj", "number of views");
}
