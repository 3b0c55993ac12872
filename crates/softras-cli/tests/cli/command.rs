//! Runs the `softras` command in a folder, for all tests of the command line.

use std::path::Path;
use std::process::{Command, Output};

/// Runs the command in a folder.
pub fn softras(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_softras")).current_dir(folder).args(arguments).output().unwrap()
}

/// The arguments of a line.
pub fn words(line: &str) -> Vec<&str> {
    line.split_whitespace().collect()
}

/// Runs the command, which must succeed, and returns what it printed.
#[track_caller]
pub fn succeeds(folder: &Path, arguments: &[&str]) -> String {
    let output = softras(folder, arguments);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {errors}");
    String::from_utf8(output.stdout).unwrap()
}

/// Runs the command, which must fail with the exit code and a text that has all the parts, without a panic.
#[track_caller]
pub fn fails(folder: &Path, arguments: &[&str], code: i32, parts: &[&str]) {
    let output = softras(folder, arguments);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {errors}");
    assert!(errors.contains("error: ") && !errors.contains("panicked"), "{arguments:?}: {errors}");
    for part in parts {
        assert!(errors.contains(part), "{arguments:?}: no {part:?} in {errors}");
    }
}

/// The value for the quick tier, or for the full one: `SOFTRAS_TIER=full`.
pub fn tier<T>(quick: T, full: T) -> T {
    if std::env::var("SOFTRAS_TIER").is_ok_and(|tier| tier == "full") { full } else { quick }
}

/// The pages whose commands are tests.
pub const PAGES: [&str; 4] = ["README.md", "docs/index.md", "docs/fit.md", "docs/photos.md"];

/// The text of a page.
pub fn page(name: &str) -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(name)).unwrap()
}

/// The lines of a page's blocks of shell commands that run `softras`, by its name or by `cargo run`, without their comments.
pub fn commands(page: &str) -> Vec<String> {
    let mut inside = false;
    let mut found = Vec::new();
    for line in page.lines() {
        let line = line.replace("cargo run -- ", "softras ");
        // The first line of the README installs packages before.
        let line = line.rsplit(" && ").next().unwrap_or_default();
        if line.starts_with("```") {
            inside = line == "```sh";
        } else if inside && line.starts_with("softras ") {
            found.push(line.split(" #").next().unwrap_or(line).trim().to_owned());
        }
    }
    found
}
