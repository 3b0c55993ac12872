//! Tests of pictures in bands and views in batches, where a limit of memory does not hold them at once.

use super::{fails, numpy, succeeds, words};
use serde_json::Value;
use std::path::Path;

/// The pixels' bytes of a picture.
fn bytes(path: &Path) -> Vec<u8> {
    image::open(path).unwrap().into_rgba8().into_raw()
}

/// How many bytes differ, and by how much at most.
fn difference(a: &[u8], b: &[u8]) -> (usize, u8) {
    assert_eq!(a.len(), b.len());
    let differences = || a.iter().zip(b).map(|(a, b)| a.abs_diff(*b));
    (differences().filter(|d| *d > 0).count(), differences().max().unwrap())
}

/// Every output and format, with several samples a pixel, with alpha that depends on neighbours, and of both projections.
#[test]
fn a_picture_in_bands_is_the_whole_picture() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let outputs = ["color", "depth", "normal", "silhouette"];
    for (name, memory, extra) in [
        ("a", ["3M", "1M"], &["--size", "250x230"][..]),
        ("b", ["500K"; 2], &["--size", "200", "--orthographic", "fit", "--sigma", "1e-4", "--background", "#ffffff"]),
    ] {
        let render = |file: &str, more: &[&str]| {
            let arguments = ["render", "cube", "-o", file, "--output", "color,depth,normal,silhouette", "--json"];
            let said = succeeds(folder, &[&arguments[..], extra, more].concat());
            let report: Value = serde_json::from_str(&said).unwrap();
            assert_eq!(report["frames"], 1);
            report
        };
        let whole = render(&format!("{name}.png"), &[]);
        let bands = render(&format!("{name}_bands.png"), &["--memory", memory[0]]);
        assert!(whole["bands"] == 1 && bands["bands"].as_u64().unwrap() > 2, "{whole} {bands}");
        assert_eq!(whole["settings"], bands["settings"]);
        for output in outputs {
            let [whole, bands] = [name.to_string(), format!("{name}_bands")]
                .map(|file| bytes(&folder.join(format!("{file}_{output}.png"))));
            let (count, most) = difference(&whole, &bands);
            // Where two faces meet, gamma magnifies the rounding of their depths.
            assert!(
                most <= 3 && count < whole.len() / 1000,
                "{name} {output}: {count} of {} differ by {most}",
                whole.len()
            );
        }
        render(&format!("{name}.npy"), &["--samples", "1"]);
        render(&format!("{name}_bands.npy"), &["--samples", "1", "--memory", memory[1]]);
        for output in outputs {
            let [whole, bands] = [name.to_string(), format!("{name}_bands")]
                .map(|file| numpy::read_one(&folder.join(format!("{file}_{output}.npy"))).1);
            // Where a triangle's influence ends, rounding decides whether it is cut, which changes a value by about tau, 1e-4;
            // where two faces meet, gamma magnifies the rounding of their depths.
            let apart = |least: f64| whole.iter().zip(&bands).filter(|(a, b)| (**a - **b).abs() >= least).count();
            let (jumps, errors) = (apart(2e-5), apart(2e-2));
            assert!(
                whole.len() == bands.len() && jumps < whole.len() / 100 && errors == 0,
                "{name} {output}: {jumps} {errors}"
            );
        }
    }
    // An animation's frames are in bands as well.
    let turn = ["render", "cube", "--turntable", "3", "--size", "200", "-o"];
    succeeds(folder, &[&turn[..], &["whole.png"]].concat());
    succeeds(folder, &[&turn[..], &["bands.png", "--memory", "3M"]].concat());
    let (count, most) = difference(&bytes(&folder.join("whole.png")), &bytes(&folder.join("bands.png")));
    assert!(most <= 3 && count < 100, "{count} differ by {most}");
    // A limit of memory in which not even four rows can be rendered is an error.
    let little = ["render", "cube", "-o", "o.png", "--size", "4000x4", "--memory", "500K"];
    fails(folder, &little, 1, &["out of memory", "allow more"]);
}

/// Views are rendered and fitted in batches with the same results.
#[test]
fn a_fit_in_batches_is_the_whole_fit() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let losses = |more: &[&str]| -> Vec<f64> {
        let fit =
            "fit --from cube --views 6 --size 32 --subdivisions 2 --iterations 4 --color -o o.obj --json log.json";
        succeeds(folder, &[&words(fit)[..], more].concat());
        let log: Value = serde_json::from_slice(&std::fs::read(folder.join("log.json")).unwrap()).unwrap();
        log["loss"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
    };
    let (whole, parts) = (losses(&[]), losses(&["--memory", "1M"]));
    assert!(whole.len() == 4 && whole.iter().zip(&parts).all(|(a, b)| (a - b).abs() < 1e-5), "{whole:?} {parts:?}");
    assert_ne!(losses(&["--views-per-step", "2"]), whole);
}
