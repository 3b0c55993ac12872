//! The commands of the README run as they stand there, one after the other in an empty folder, twice with the same pictures.
//!
//! They are made small by default; with the environment variable `SOFTRAS_README=full` they run as written.

use crate::command::{commands, readme, succeeds};
use std::collections::BTreeMap;
use std::path::Path;

/// What makes a command small: the first text in it, what stands there instead, and arguments to add.
const SMALLER: [(&str, &str, &str, &str); 7] = [
    ("softras render ", "--turntable 100", "--turntable 3", ""),
    ("softras render ", "--sweep sigma=1e-5..1e-2:8", "--sweep sigma=1e-5..1e-2:2", ""),
    ("softras render ", "", "", "--size 64"),
    ("softras fit ", "", "", "--size 32 --views 4 --iterations 4"),
    ("softras pose ", "", "", "--starts 3 --iterations 4"),
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
fn the_commands_of_the_readme_run_twice() {
    let full = std::env::var("SOFTRAS_README").is_ok_and(|size| size == "full");
    let commands = commands(&readme());
    let folder = tempfile::tempdir().unwrap();
    let mut seen = BTreeMap::new();
    for round in 0..2 {
        for command in &commands {
            let command = if full { command.clone() } else { smaller(command) };
            // The second round is about files that are there already, which what only prints does not meet.
            if round == 0 || command.contains(" -o ") {
                succeeds(folder.path(), &command.split(' ').filter(|a| !a.is_empty()).skip(1).collect::<Vec<_>>());
            }
        }
        let pictures = pictures(folder.path());
        assert!(pictures.len() > 6, "{:?}", pictures.keys());
        if round == 1 {
            let differing: Vec<_> = pictures.keys().filter(|name| seen.get(*name) != pictures.get(*name)).collect();
            assert!(differing.is_empty(), "the second time other pictures: {differing:?}");
        }
        seen = pictures;
    }
}
