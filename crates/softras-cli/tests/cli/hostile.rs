//! Tests of input that means harm: little files that ask for much, files that never end, text that gives the terminal
//! orders, and outputs that cannot be written.

use super::command::tier;
use super::numpy::{self, Npz};
use super::{softras, succeeds, words};
use std::{
    fs,
    path::Path,
    process::{Command, Output, Stdio},
    time::{Duration, Instant},
};

/// The most processor time that a command may take over a file of less than a megabyte, and the most memory. On an idle
/// machine it is half of this time at most.
const PATIENCE: f64 = 20.0;
const MEMORY: u64 = 1 << 30;
/// The longest that a command may take whatever else this machine does.
const ENDLESS: Duration = Duration::from_secs(300);

/// Runs the command, which must end in time, and returns what came of it and the most memory that it had.
#[track_caller]
pub fn bounded(folder: &Path, arguments: &[&str]) -> (Output, u64) {
    let begin = Instant::now();
    let mut command = Command::new(env!("CARGO_BIN_EXE_softras"));
    let command = command.current_dir(folder).args(arguments).stdin(Stdio::null());
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let (mut seconds, mut peak) = (0.0f64, 0);
    while child.try_wait().unwrap().is_none() {
        seconds = seconds.max(processor_seconds(child.id()));
        peak = peak.max(resident_peak(child.id()));
        if begin.elapsed() > ENDLESS || seconds > PATIENCE || peak > MEMORY {
            child.kill().unwrap();
            panic!("{arguments:?}: {:?}, {seconds} s of processors, {} MiB", begin.elapsed(), peak >> 20);
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    (child.wait_with_output().unwrap(), peak)
}

/// The processor time that a process has had so far; 0 where the system does not tell.
fn processor_seconds(id: u32) -> f64 {
    let text = fs::read_to_string(format!("/proc/{id}/stat")).unwrap_or_default();
    // The fields after the name, which is in brackets; the 12th and 13th of them count hundredths of seconds.
    let fields: Vec<f64> = match text.rsplit_once(')') {
        Some((_, rest)) => rest.split_whitespace().skip(11).take(2).map(|n| n.parse().unwrap_or(0.0)).collect(),
        None => Vec::new(),
    };
    fields.iter().sum::<f64>() / 100.0
}

/// The most memory that a process has had so far; 0 where the system does not tell.
fn resident_peak(id: u32) -> u64 {
    let text = fs::read_to_string(format!("/proc/{id}/status")).unwrap_or_default();
    let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| line.trim().strip_suffix(" kB")?.parse::<u64>().ok()).map_or(0, |kilobytes| kilobytes << 10)
}

/// The command is refused in time with a text that has all the parts.
#[track_caller]
pub fn refused(folder: &Path, arguments: &[&str], parts: &[&str]) {
    let (output, _) = bounded(folder, arguments);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{arguments:?}: {errors}");
    assert!(parts.iter().all(|part| errors.contains(part)), "{arguments:?}: {parts:?} not all in {errors}");
    assert!(!errors.contains("panicked"), "{errors}");
}

/// A pipe that nobody writes into, wherever a file is read.
#[cfg(unix)]
#[test]
fn pipes_without_a_writer_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = |name: &str| assert!(Command::new("mkfifo").arg(folder.path().join(name)).status().unwrap().success());
    pipe("pipe");
    pipe("pipe.npz");
    let told = ["pipe", "not a regular file"];
    for line in [
        "render pipe -o o.png",
        "fit --views pipe --cameras pipe -o o.obj",
        "fit --template pipe --from cube --views 2 --size 8 -o o.obj",
        "fit --from cube --views 2 --size 8 --checkpoint pipe.npz --resume -o o.obj",
        "grad cube --target pipe -o o.png",
        "pose --mesh cube --image pipe",
        "iou cube pipe",
        "mesh cube -o pipe",
    ] {
        refused(folder.path(), &words(line), &told);
    }
    fs::create_dir(folder.path().join("views")).unwrap();
    pipe("views/cameras.json");
    refused(folder.path(), &["fit", "--views", "views", "-o", "o.obj"], &["cameras.json", "not a regular file"]);
    fs::remove_file(folder.path().join("views/cameras.json")).unwrap();
    fs::write(folder.path().join("views/cameras.json"), r#"[{"file":"pipe","eye":[0,0,3]}]"#).unwrap();
    pipe("views/pipe");
    refused(folder.path(), &["fit", "--views", "views", "-o", "o.obj"], &told);
}

/// In place of the file of compiled kernels there may lie anything.
#[cfg(target_os = "linux")]
#[test]
fn a_pipe_in_place_of_the_cache_holds_nobody_up() {
    let folder = tempfile::tempdir().unwrap();
    let render = || {
        let mut command = Command::new("timeout");
        let command =
            command.args(["60", env!("CARGO_BIN_EXE_softras"), "render", "cube", "-o", "o.png", "--size", "8"]);
        command.current_dir(folder.path()).env("XDG_CACHE_HOME", folder.path()).output().unwrap()
    };
    assert!(render().status.success());
    let files: Vec<_> =
        fs::read_dir(folder.path().join("softras")).unwrap().map(|entry| entry.unwrap().path()).collect();
    let [cache] = &files[..] else { panic!("one file of kernels: {files:?}") };
    fs::remove_file(cache).unwrap();
    assert!(Command::new("mkfifo").arg(cache).status().unwrap().success());
    let output = render();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

/// Results that were not written are a failure; a reader that has seen enough is none.
#[cfg(target_os = "linux")]
#[test]
fn results_that_cannot_be_written_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str], out: Stdio| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_softras"));
        command.current_dir(folder.path()).args(arguments).stdout(out).stderr(Stdio::piped()).output().unwrap()
    };
    for arguments in [
        &["iou", "cube", "cube"][..],
        &["iou", "cube", "cube", "--json"],
        &["devices"],
        &["devices", "--json"],
        &["mesh", "cube", "-o", "other.obj"],
        &["render", "cube", "-o", "o.png", "--size", "8", "--json"],
        &["--help"],
        &["--version"],
        &["fit", "--help"],
        &["completions", "bash"],
    ] {
        let full = run(arguments, fs::OpenOptions::new().write(true).open("/dev/full").unwrap().into());
        let errors = String::from_utf8_lossy(&full.stderr);
        assert_eq!(full.status.code(), Some(1), "{arguments:?}: {errors}");
        assert!(errors.contains("error: standard output: "), "{arguments:?}: {errors}");
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let closed = run(arguments, writer.into());
        assert_eq!(closed.status.code(), Some(0), "{arguments:?}: {}", String::from_utf8_lossy(&closed.stderr));
    }
}

/// Names of keys and files are shown without what a terminal would obey.
#[test]
fn names_give_the_terminal_no_orders() {
    let folder = tempfile::tempdir().unwrap();
    let orders = "\u{1b}[31mred\u{9b}\u{202e}\r\n";
    Npz::stored().i64(orders, &[], &[1]).i64(&"k".repeat(60_000), &[], &[1]).write(&folder.path().join("a.npz"));
    let mtl = format!("{orders}.mtl").replace('\n', "").replace('\r', "");
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    fs::write(folder.path().join("a.obj"), format!("mtllib {mtl}\n{triangle}f 1 2 3\n")).unwrap();
    fs::write(folder.path().join("b.obj"), format!("{triangle}usemtl {mtl}\nf 1 2 3\n")).unwrap();
    fs::write(folder.path().join("cameras.json"), r#"[{"file":"\u001b[31m.png","eye":[0,0,3]}]"#).unwrap();
    let missing = format!("{orders}.obj");
    let fit = "fit --from cube --views 1 --size 8 --subdivisions 0 -o o.obj --checkpoint a.npz --resume";
    let fit = words(fit);
    for (arguments, part) in [
        (&fit[..], "\\u001b[31mred\\u009b\\u202e"),
        (&["render", "a.obj", "-o", "o.png", "--size", "8"], "\\u001b[31mred"),
        (&["render", "b.obj", "-o", "o.png", "--size", "8"], "\\u001b[31mred"),
        (&["render", &missing, "-o", "o.png"], "\\u001b[31mred"),
        (&["fit", "--views", ".", "-o", "o.obj"], "\\u001b[31m.png"),
        (&["mesh", "cube", "-o", &format!("{orders}/o.obj")], "\\u001b[31mred"),
    ] {
        let output = softras(folder.path(), arguments);
        let told = [&output.stdout[..], &output.stderr].concat();
        let told = String::from_utf8_lossy(&told);
        let is_order = |c: char| (c.is_control() && c != '\n') || c == '\u{202e}';
        assert!(!told.contains(is_order) && told.contains(part), "{arguments:?}: {told:?}");
        assert!(told.len() < 2000, "{arguments:?}: {} bytes", told.len());
    }
}

/// A checkpoint with numbers that no fit writes is refused by its key, at once.
#[test]
fn checkpoints_with_impossible_numbers_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let fit = "fit --from cube --views 2 --size 8 --subdivisions 0 --iterations 2 -o o.obj --checkpoint c.npz";
    let fit = words(fit);
    succeeds(folder.path(), &fit);
    let resume = [&fit[..], &["--resume"]].concat();
    let keys = ["steps", "values", "mean", "square", "colors", "color_mean", "color_square", "positions", "triangles"];
    let path = folder.path().join("c.npz");
    let original: Vec<Vec<f64>> = keys.iter().map(|key| numpy::read(&path, key).1).collect();
    succeeds(folder.path(), &resume);
    for (key, at, value) in [
        ("steps", 0, 1e18),
        ("steps", 0, 1e9),
        ("steps", 0, -5.0),
        ("steps", 0, f64::NAN),
        ("steps", 0, 1.5),
        ("steps", 1, 1e30),
        ("steps", 1, -1.0),
        ("steps", 2, -1.0),
        ("values", 1, f64::NAN),
        ("mean", 2, f64::INFINITY),
        ("square", 0, -1.0),
        ("square", 3, f64::NAN),
        ("positions", 4, 1e300),
        ("triangles", 5, 1e9),
    ] {
        let mut npz = Npz::stored();
        for (name, numbers) in keys.iter().zip(&original) {
            let mut numbers = numbers.clone();
            if *name == key {
                numbers[at] = value;
            }
            npz = npz.f64(name, &[numbers.len()], &numbers);
        }
        npz.write(&path);
        let named = if key == "positions" { "triangles" } else { key };
        refused(folder.path(), &resume, &["c.npz", &format!("`{named}`")]);
    }
}

/// As many triangles on top of each other as a file holds.
#[test]
fn layers_that_take_long_do_not_take_too_long() {
    let folder = tempfile::tempdir().unwrap();
    let mut text = "v -1 -1 0\nv 1 -1 0.5\nv 0 1 1\n".to_string();
    text.push_str(&"f 1 2 3\n".repeat(tier(1 << 13, 1 << 17)));
    fs::write(folder.path().join("layers.obj"), text).unwrap();
    let (output, _) = bounded(folder.path(), &["iou", "layers.obj", "layers.obj"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}
