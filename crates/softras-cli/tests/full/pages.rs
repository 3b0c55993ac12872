//! The commands of the README and of docs/ run as they stand there, one after the other in an empty folder, twice with the same
//! pictures.
//!
//! They are made small by default; with the environment variable `SOFTRAS_README=full` they run as written.

use crate::command::{PAGES, commands, page, succeeds};
use std::collections::BTreeMap;
use std::path::Path;

/// Changes that make commands small: how a command begins, a text in it, the text in place of that, and arguments to add.
const SMALLER: [(&str, &str, &str, &str); 10] = [
    ("softras render ", "--turntable 100", "--turntable 3", ""),
    ("softras render ", "--sweep sigma=1e-5..1e-2:4", "--sweep sigma=1e-5..1e-2:2", ""),
    ("softras render ", "", "", "--size 64"),
    ("softras fit --from ", "", "", "--size 32 --views 4"),
    ("softras fit ", "", "", "--iterations 4"),
    ("softras iou ", "", "", "--resolution 16"),
    ("softras pose --mesh fish ", "", "", "--starts 3"),
    ("softras pose ", "", "", "--iterations 4"),
    ("softras stress ", "--cases 1000", "--cases 4", ""),
    ("softras bench ", "", "", "--quick"),
];

fn smaller(command: &str) -> String {
    let mut command = command.to_owned();
    for (start, old, new, more) in SMALLER {
        let option = more.split(' ').next().unwrap_or("");
        if command.starts_with(start) && command.contains(old) {
            command = if old.is_empty() { command } else { command.replace(old, new) };
            if !more.is_empty() && !command.contains(option) {
                command = format!("{command} {more}");
            }
        }
    }
    command
}

/// Every picture of a folder with its bytes.
fn pictures(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let picture = |path: &Path| path.extension().is_some_and(|e| e == "png" || e == "gif" || e == "exr");
    let named = |path: std::path::PathBuf| {
        (path.file_name().unwrap().to_string_lossy().into_owned(), std::fs::read(&path).unwrap())
    };
    files.filter(|path| picture(path)).map(named).collect()
}

#[test]
fn the_commands_of_the_pages_run_twice() {
    for name in PAGES {
        let folder = tempfile::tempdir().unwrap();
        let first = run(name, folder.path(), true);
        assert!(!first.is_empty(), "{name} makes no picture");
        let second = run(name, folder.path(), false);
        let differing: Vec<_> = second.keys().filter(|file| first.get(*file) != second.get(*file)).collect();
        assert!(differing.is_empty(), "{name}: the second time other pictures: {differing:?}");
    }
}

/// Runs the commands of a page and returns the pictures. The second run is about files that are there already, which what only
/// prints does not meet.
fn run(name: &str, folder: &Path, prints: bool) -> BTreeMap<String, Vec<u8>> {
    let full = std::env::var("SOFTRAS_README").is_ok_and(|size| size == "full");
    for command in commands(&page(name)) {
        let command = if full { command } else { smaller(&command) };
        if prints || command.contains(" -o ") {
            succeeds(folder, &command.split_whitespace().skip(1).collect::<Vec<_>>());
        }
    }
    pictures(folder)
}

#[test]
fn the_example_of_camera_files_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let run = |command: &str| succeeds(folder.path(), &command.split(' ').collect::<Vec<_>>());
    run("fit --from fish --views 1 --iterations 1 --write-views photos -o a.obj");
    let text = page("docs/cameras.md");
    let example = text.split("```json\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
    std::fs::write(folder.path().join("photos/cameras.json"), example).unwrap();
    run("fit --views photos --iterations 1 -o b.obj");
}

#[test]
fn commands_are_found_and_made_small() {
    let page = "softras outside\n```sh\ncargo run -- render a.obj -o a.png --turntable 100   # turns\nls\n```\n```rust\nsoftras no\n```";
    assert_eq!(commands(page), ["softras render a.obj -o a.png --turntable 100"]);
    assert_eq!(smaller(&commands(page)[0]), "softras render a.obj -o a.png --turntable 3 --size 64");
    assert_eq!(smaller("softras check"), "softras check");
}
