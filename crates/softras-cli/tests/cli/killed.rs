//! Tests of written files: old or new whenever the command is killed. That every command writes so is seen in `full`.

use super::{softras, succeeds};
use std::{
    fs,
    path::Path,
    process::{Child, Command, Stdio},
    thread,
    time::Instant,
};

fn start(folder: &Path, arguments: &[&str]) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_softras"));
    command.current_dir(folder).args(arguments).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}

/// Kills the command at `times` moments, spread over a little more than the time that it takes.
#[track_caller]
fn is_old_or_new(folder: &Path, file: &str, arguments: &[&str], times: u32) {
    let path = folder.join(file);
    let begin = Instant::now();
    succeeds(folder, arguments);
    let whole = begin.elapsed();
    let new = fs::read(&path).unwrap();
    let old = b"the old file".to_vec();
    assert!(new.len() > 64 && new != old);
    let mut kept = 0;
    for i in 0..times {
        fs::write(&path, &old).unwrap();
        let mut child = start(folder, arguments);
        thread::sleep(whole * i / (times - 1) * 5 / 4);
        child.kill().unwrap();
        child.wait().unwrap();
        let is = fs::read(&path).unwrap();
        assert!(is == old || is == new, "killed at {i} of {times}: {} bytes of {}", is.len(), new.len());
        kept += u32::from(is == old);
    }
    assert!(kept > 0, "never killed in time");
    // Temporary files that killed runs left behind do not disturb later runs.
    assert!(softras(folder, arguments).status.success());
    assert_eq!(fs::read(&path).unwrap(), new);
}

#[test]
fn a_mesh_is_the_old_or_the_new_one() {
    let folder = tempfile::tempdir().unwrap();
    is_old_or_new(folder.path(), "fish.obj", &["mesh", "fish", "-o", "fish.obj"], 40);
}

#[test]
fn a_picture_is_the_old_or_the_new_one() {
    let folder = tempfile::tempdir().unwrap();
    is_old_or_new(folder.path(), "cube.png", &["render", "cube", "-o", "cube.png", "--size", "64"], 4);
}
