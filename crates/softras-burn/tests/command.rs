//! The command as a user runs it: data, training that is interrupted and resumed, a mesh of a picture, the table.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::process::{Command, Output};
use std::time::{Duration, Instant};

const PROGRAM: &str = env!("CARGO_BIN_EXE_softras-reconstruct");

fn run(folder: &Path, line: &str) -> Output {
    Command::new(PROGRAM).current_dir(folder).args(line.split_whitespace()).output().unwrap()
}

fn succeeds(folder: &Path, line: &str) -> String {
    let output = run(folder, line);
    assert!(output.status.success(), "{line}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

fn fails(folder: &Path, line: &str) -> String {
    let output = run(folder, line);
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(matches!(output.status.code(), Some(1 | 2)), "{line}: {:?} {error}", output.status);
    assert!(error.contains("error:") && !error.contains("panicked"), "{line}: {error}");
    error
}

fn make(folder: &Path) {
    succeeds(folder, "data -o data --families lamp,sofa --train 2 --val 1 --test 1");
}

const SMALL: &str = "--width 2 --pairs 2 --every 2";

#[test]
fn from_data_to_a_mesh_and_the_table() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    make(folder);
    succeeds(folder, &format!("train data -o whole --steps 4 {SMALL}"));
    let curve = std::fs::read_to_string(folder.join("whole/curve.csv")).unwrap();
    assert_eq!(curve.lines().count(), 5, "{curve}");

    let network = "--network whole/best.checkpoint";
    let table =
        "evaluate data --network a=whole/best.checkpoint --views 2 --sheet s.png --example p.png --curves c.svg";
    let table = succeeds(folder, table);
    assert!(table.contains("| a |") && table.contains("retrieval by silhouette"), "{table}");
    let sheet = image::open(folder.join("s.png")).unwrap();
    assert_eq!([sheet.width(), sheet.height()], [6 * 64, 2 * 64]);
    assert!(std::fs::read_to_string(folder.join("c.svg")).unwrap().contains("IoU of silhouettes"));

    succeeds(folder, &format!("predict p.png {network} -o mesh.obj"));
    let mesh = std::fs::read_to_string(folder.join("mesh.obj")).unwrap();
    assert_eq!(mesh.lines().filter(|line| line.starts_with("v ")).count(), 642);
    // A vertex colour follows each position.
    assert!(mesh.lines().filter(|line| line.starts_with("v ")).all(|line| line.split(' ').count() == 7));

    image::RgbaImage::new(32, 64).save(folder.join("narrow.png")).unwrap();
    assert!(fails(folder, &format!("predict narrow.png {network} -o mesh.obj")).contains("32 by 64"));
    assert!(fails(folder, &format!("predict p.png {network} -o mesh.stl")).contains("mesh.stl"));
    assert!(fails(folder, "predict p.png --network p.png -o mesh.obj").contains("not a checkpoint"));
    assert!(fails(folder, "train data -o x --classes ship").contains("ship_train_images.npz"));
    assert!(fails(folder, "train data -o x --steps 0").contains("steps = 0"));
    assert!(fails(folder, "data -o x --families ship").contains("no family \"ship\""));
    assert!(fails(folder, "data -o x --shard 2/2").contains("I below N"));
    std::fs::write(folder.join("data/sofa_test_voxels.npz"), b"PK").unwrap();
    assert!(fails(folder, "evaluate data").contains("sofa_test_voxels.npz"));
}

#[test]
fn meshes_of_a_folder_become_sets() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    assert!(fails(folder, "data -o data --class thing --meshes .").contains("no mesh file"));
    std::fs::create_dir(folder.join("meshes")).unwrap();
    for i in 0..10 {
        let mesh = softras_burn::reconstruct::families::object("bed", i).unwrap().unwrap();
        softras::obj::write_obj(&mesh, &folder.join(format!("meshes/{i}.obj"))).unwrap();
    }
    std::fs::write(folder.join("meshes/broken.obj"), "f 1 2 3").unwrap();
    let output = run(folder, "data -o data --class thing --meshes meshes");
    let told = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success() && told.contains("left out") && told.contains("broken.obj"), "{told}");
    let table = succeeds(folder, "evaluate data --views 1");
    assert!(table.contains("| method | thing | mean |"), "{table}");
}

#[cfg(unix)]
#[test]
fn ctrl_c_keeps_what_was_learned() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    make(folder);
    let line = format!("train data -o run --steps 100000 {SMALL}");
    let mut command = Command::new(PROGRAM);
    command.current_dir(folder).args(line.split_whitespace()).stderr(std::process::Stdio::null());
    let mut child = command.spawn().unwrap();
    let start = Instant::now();
    while !folder.join("run/curve.csv").exists() {
        assert!(start.elapsed() < Duration::from_secs(120), "no checkpoint was written");
        std::thread::sleep(Duration::from_millis(50));
    }
    let interrupted = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(interrupted.success() && child.wait().unwrap().success());
    let lines = || std::fs::read_to_string(folder.join("run/curve.csv")).unwrap().lines().count();
    let before = lines();
    assert!(before > 2);
    assert!(folder.join("run/best.checkpoint").exists());

    // The file system takes no more than 20 KiB a file: the checkpoints that are there stay whole.
    let whole = std::fs::read(folder.join("run/last.checkpoint")).unwrap();
    let line = format!("{PROGRAM} train data -o run --every 2 --resume run/last.checkpoint");
    let limited = format!("trap '' XFSZ; ulimit -f 20; exec {line}");
    let output = Command::new("bash").current_dir(folder).args(["-c", &limited]).output().unwrap();
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(!output.status.success() && error.contains("last.checkpoint"), "{error}");
    assert_eq!(std::fs::read(folder.join("run/last.checkpoint")).unwrap(), whole);
    assert_eq!(lines(), before);
}
