//! Tests of memory: what little files ask for is counted before it is taken, and a lack of memory is an error.

use super::command::tier;
use super::hostile::{bounded, refused};
use super::numpy::{self, Npz};
use super::succeeds;
use std::{fs, path::Path, process::Command};

/// Half a gigabyte of zeros under a key of a checkpoint that nobody asks for is not even read; asked for, it is refused.
#[cfg(target_os = "linux")]
#[test]
fn large_arrays_are_read_only_when_they_are_needed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("c.npz");
    let fit = "fit --from cube --views 2 --size 8 --subdivisions 0 --iterations 2 -o o.obj --checkpoint c.npz";
    let resume: Vec<&str> = fit.split_whitespace().chain(["--resume"]).collect();
    succeeds(folder.path(), &resume);
    let keys = ["steps", "values", "mean", "square", "colors", "color_mean", "color_square", "positions", "triangles"];
    let original: Vec<Vec<f64>> = keys.iter().map(|key| numpy::read(&path, key).1).collect();
    let zeros = vec![0u8; 1 << 29];
    let with_zeros = |large: &str| {
        let others = keys.iter().zip(&original).filter(|(key, _)| **key != large);
        let npz = others.fold(Npz::deflated(), |npz, (key, numbers)| npz.f64(key, &[numbers.len()], numbers));
        npz.raw(large, "|u1", &[1 << 29], &zeros).write(&path);
        assert!(fs::metadata(&path).unwrap().len() < 1 << 20);
    };
    with_zeros("junk");
    let (output, peak) = bounded(folder.path(), &resume);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(peak < 1 << 29, "{} MiB", peak >> 20);
    with_zeros("square");
    refused(folder.path(), &resume, &["c.npz", "`square`", "--memory"]);
}

fn large_picture(path: &Path) {
    image::GrayImage::new(8192, 8192).save(path).unwrap();
    assert!(fs::metadata(path).unwrap().len() < 1 << 20);
}

/// Pictures are counted before one is decoded.
#[test]
fn pictures_out_of_proportion_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    large_picture(&folder.path().join("a.png"));
    let entry = r#"{"file":"a.png","distance":3,"elevation":0,"azimuth":0}"#;
    fs::write(folder.path().join("cameras.json"), format!("[{}]", [entry; 8].join(","))).unwrap();
    succeeds(folder.path(), &["mesh", "cube", "-o", "cube.obj"]);
    refused(folder.path(), &["fit", "--views", ".", "-o", "o.obj"], &["8 pictures", "allow 1595M with --memory"]);
    refused(folder.path(), &["grad", "cube.obj", "--target", "a.png", "-o", "o.png"], &["a.png", "--memory"]);
    refused(folder.path(), &["pose", "--mesh", "cube.obj", "--image", "a.png"], &["a.png", "--memory"]);
}

/// Every command that reads meshes counts them, and with them their materials and textures.
#[test]
fn meshes_are_counted_by_every_command() {
    let folder = tempfile::tempdir().unwrap();
    succeeds(folder.path(), &["mesh", "fish", "-o", "fish.obj"]);
    image::RgbaImage::new(8, 8).save(folder.path().join("a.png")).unwrap();
    for arguments in [
        &["render", "fish.obj", "-o", "o.png"][..],
        &["iou", "fish.obj", "fish.obj"],
        &["bench", "fish.obj"],
        &["grad", "fish.obj", "--target", "a.png", "-o", "o.png"],
        &["pose", "--mesh", "fish.obj", "--image", "a.png"],
        &["fit", "--from", "fish.obj", "-o", "o.obj"],
        &["fit", "--from", "fish.obj", "--template", "fish.obj", "-o", "o.obj"],
    ] {
        let little = [arguments, &["--memory", "1M"]].concat();
        refused(folder.path(), &little, &["fish.obj", "MiB of memory", "--memory"]);
    }
    // Room for one mesh of two, and for a mesh but not for its texture.
    let iou = ["iou", "fish.obj", "fish.obj", "--memory"];
    let bytes = fs::metadata(folder.path().join("fish.obj")).unwrap().len();
    let (one, two) = ((24 * bytes + (1 << 16)).to_string(), "1G");
    refused(folder.path(), &[&iou[..], &[&one]].concat(), &["fish.obj", "--memory"]);
    succeeds(folder.path(), &[&iou[..], &[two]].concat());
    let render = ["render", "fish.obj", "-o", "o.png", "--size", "8", "--strict", "--memory"];
    refused(folder.path(), &[&render[..], &[&one]].concat(), &["fish_texture.png", "pixels"]);
    succeeds(folder.path(), &[&render[..], &[two]].concat());
}

/// Whatever memory the system allows a process, a mesh is read or refused: no allocation that a file decides ends the process.
#[cfg(target_os = "linux")]
#[test]
fn a_mesh_is_read_or_refused_in_any_memory() {
    use std::fmt::Write;
    let folder = tempfile::tempdir().unwrap();
    let (mut text, side) = (String::new(), 300);
    (0..side * side).for_each(|i| writeln!(text, "v {} {} {}", i / side, i % side, i % 7).unwrap());
    for corner in (1..side * (side - 1)).filter(|i| i % side != 0) {
        writeln!(text, "f {corner} {} {} {}", corner + 1, corner + side + 1, corner + side).unwrap();
    }
    fs::write(folder.path().join("grid.obj"), text).unwrap();
    let (mut read, mut refused) = (0, 0);
    for kibibytes in (17_500..55_000).step_by(tier(5_000, 2_500)) {
        let iou = |mesh: &str| {
            let limited = format!("ulimit -v {kibibytes}; exec \"$0\" iou {mesh} {mesh} --resolution 8");
            let mut command = Command::new("sh");
            command.args(["-c", &limited, env!("CARGO_BIN_EXE_softras")]).current_dir(folder.path()).output().unwrap()
        };
        // Without memory for the program and its arguments no file is read.
        if iou("missing.obj").status.code() != Some(1) {
            continue;
        }
        let output = iou("grid.obj");
        let errors = String::from_utf8_lossy(&output.stderr);
        match output.status.code() {
            Some(0) => read += 1,
            Some(1) if errors.contains("error: ") => refused += 1,
            code => panic!("{kibibytes} KiB: {code:?} {errors}"),
        }
    }
    assert!(read > 1 && refused > 1, "{read} {refused}");
}
