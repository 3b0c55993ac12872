//! Hollows that a visual hull covers.

use crate::command::{softras, succeeds};

/// No outline shows a mug's hollow, and its visual hull covers it.
#[test]
fn a_hollow_is_found_by_the_light_in_it() {
    let folder = tempfile::tempdir().unwrap();
    let fit = |extra: &[&str], out: &str| {
        let views = ["--from", "mug", "--views", "12", "--size", "64", "--color", "--iterations", "1"];
        let output = softras(folder.path(), &[&["fit", "-o", out], &views[..], extra].concat());
        assert!(output.status.success());
        let iou = succeeds(folder.path(), &["iou", "mug", out]);
        (String::from_utf8(output.stderr).unwrap(), iou.trim().parse::<f64>().unwrap())
    };
    let (told, iou) = fit(&[], "mug_fit.obj");
    assert!(told.contains("covers 1 hollow") && iou > 0.75, "{iou}: {told}");
    // Where the light is unknown there is nothing to tell it by.
    let (told, iou) = fit(&["--shading", "none"], "hull.obj");
    assert!(!told.contains("hollow") && iou < 0.6, "{iou}: {told}");
}
