//! A command for each mesh of a folder.

use crate::command::{fails, softras, succeeds};
use serde_json::Value;
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// A folder with two meshes, a broken one, and what is no mesh.
fn meshes() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("in")).unwrap();
    for name in ["a", "b"] {
        succeeds(folder.path(), &["mesh", "cube", "-o", &format!("in/{name}.obj")]);
    }
    fs::write(folder.path().join("in/broken.obj"), "v 1 2\n").unwrap();
    fs::write(folder.path().join("in/notes.txt"), "no mesh").unwrap();
    folder
}

const RENDER: [&str; 7] = ["--", "render", "{path}", "-o", "out/{name}.png", "--size", "16"];

/// Runs `each` on the folder, and returns its exit code and its lines.
fn each(folder: &Path, options: &[&str], command: &[&str]) -> (Option<i32>, Vec<Value>) {
    let output = softras(folder, &[&["each", "in"], options, command].concat());
    let text = String::from_utf8(output.stdout).unwrap();
    (output.status.code(), text.lines().map(|line| serde_json::from_str(line).unwrap()).collect())
}

fn names(lines: &[Value]) -> BTreeSet<&str> {
    lines.iter().map(|line| line["job"].as_str().unwrap()).collect()
}

#[test]
fn every_mesh_is_a_job_and_a_broken_one_leaves_the_others_alone() {
    let folder = meshes();
    let (code, lines) = each(folder.path(), &["--jobs", "2"], &RENDER);
    assert_eq!((code, names(&lines)), (Some(1), BTreeSet::from(["a.obj", "b.obj", "broken.obj"])));
    for line in &lines {
        let is_broken = line["job"] == "broken.obj";
        assert_eq!(line["status"], i32::from(is_broken), "{line}");
        assert_eq!(line["messages"].as_str().unwrap().contains("in/broken.obj"), is_broken, "{line}");
    }
    let made: BTreeSet<_> = fs::read_dir(folder.path().join("out")).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(made, BTreeSet::from(["a.png".into(), "b.png".into()]));
    // What a command prints as JSON is JSON.
    let (_, lines) = each(folder.path(), &[], &["--", "iou", "{path}", "in/{file}", "--json", "--resolution", "8"]);
    assert_eq!(lines[0]["output"]["iou"], 1.0, "{lines:?}");
}

#[test]
fn a_log_is_gone_on_from() {
    let folder = meshes();
    let log = folder.path().join("log.jsonl");
    assert_eq!(each(folder.path(), &["--log", "log.jsonl"], &RENDER).1.len(), 3);
    // Only what failed is tried again, also behind a line that was cut off.
    let whole = fs::read_to_string(&log).unwrap();
    let cut = |lines: usize| whole.split_inclusive('\n').take(lines).collect::<String>() + "{\"command\":[\"ren";
    for (text, expected) in
        [(&whole, &["broken.obj"][..]), (&cut(2), &["broken.obj"]), (&cut(1), &["b.obj", "broken.obj"])]
    {
        for _ in 0..2 {
            fs::write(&log, text).unwrap();
            let (code, lines) = each(folder.path(), &["--log", "log.jsonl"], &RENDER);
            assert_eq!((code, names(&lines)), (Some(1), expected.iter().copied().collect()));
        }
    }
    fs::remove_file(folder.path().join("in/broken.obj")).unwrap();
    assert_eq!(each(folder.path(), &["--log", "log.jsonl"], &RENDER), (Some(0), Vec::new()));
    // Another command is another job.
    let other = ["--", "render", "{path}", "-o", "out/{name}_2.png", "--size", "16"];
    assert_eq!(each(folder.path(), &["--log", "log.jsonl"], &other).1.len(), 2);
    // A file that is none of ours stays as it is.
    let notes = fs::read(folder.path().join("in/notes.txt")).unwrap();
    fails(folder.path(), &[&["each", "in", "--log", "in/notes.txt"], &RENDER[..]].concat(), 1, &["line 1", "--log"]);
    assert_eq!(fs::read(folder.path().join("in/notes.txt")).unwrap(), notes);
}

#[test]
fn shards_are_all_jobs_once() {
    let folder = meshes();
    let of =
        |shard: &str| each(folder.path(), &["--of", "file", "--shard", shard], &["--", "iou", "{path}", "in/a.obj"]).1;
    let (first, second) = (of("0/2"), of("1/2"));
    let all: Vec<&str> = names(&first).into_iter().chain(names(&second)).collect();
    let files = fs::read_dir(folder.path().join("in")).unwrap().map(|entry| entry.unwrap().file_name());
    let files: BTreeSet<String> = files.map(|name| name.into_string().unwrap()).collect();
    assert!(first.len().abs_diff(second.len()) <= 1 && all.len() == files.len(), "{all:?}");
    assert_eq!(all.iter().map(|name| name.to_string()).collect::<BTreeSet<_>>(), files);
}

#[test]
fn commands_that_cannot_be_meant_are_refused() {
    let folder = meshes();
    let refused = |line: &[&str], parts: &[&str]| fails(folder.path(), &[&["each"], line].concat(), 2, parts);
    refused(&["in", "--", "render", "in/a.obj", "-o", "a.png"], &["same for every job", "{path}"]);
    refused(&["in", "--", "render", "{path}", "-o", "a.png"], &["every job would write", "{name}"]);
    refused(&["in", "--of", "folder", "--", "fit", "--views", "{path}", "-o", "{name}.obj"], &["no folders", "--of"]);
    refused(&["in", "--shard", "2/2", "--", "iou", "{path}", "in/a.obj"], &["I from 0 to N - 1"]);
    refused(&["in"], &["COMMAND"]);
    refused(&["in", "--", "render", "{path}", "-o", "{name}.png", "--sizes", "8"], &["--sizes"]);
    fails(folder.path(), &[&["each", "nowhere"], &RENDER[..]].concat(), 1, &["nowhere"]);
}
