//! Whenever the command is killed, the file that it writes is the old one or the new one.

use super::{softras, succeeds};
use std::{
    fs,
    path::Path,
    process::{Child, Command, Stdio},
    thread,
    time::{Duration, Instant},
};

fn start(folder: &Path, arguments: &[&str]) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_softras"));
    command.current_dir(folder).args(arguments).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}

/// Kills the command at `times` moments spread over how long it takes, and a little later.
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
    // What a killed run left beside the file is in nobody's way.
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
    succeeds(folder.path(), &["mesh", "cube", "-o", "cube.obj"]);
    is_old_or_new(folder.path(), "cube.png", &["render", "cube.obj", "-o", "cube.png", "--size", "64"], 4);
}

/// A file that is written where it stands would be seen half: what the two tests above rely on.
#[test]
fn a_file_written_in_place_is_seen_half() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("half");
    let bytes = vec![7u8; 1 << 20];
    let halves = thread::scope(|scope| {
        let writer = scope.spawn(|| {
            for _ in 0..50 {
                use std::io::Write;
                let mut file = fs::File::create(&path).unwrap();
                bytes.chunks(4096).for_each(|chunk| file.write_all(chunk).unwrap());
                thread::sleep(Duration::from_millis(1));
            }
        });
        let mut halves = 0;
        while !writer.is_finished() {
            halves += u32::from(fs::read(&path).is_ok_and(|seen| seen.len() != bytes.len()));
        }
        halves
    });
    assert!(halves > 0);
}
