//! The lists of docs/formats.md are those of the readers, and what they call not drawn is noted.

use crate::{
    LoadOptions,
    fate::{Approximated, Drawn, Fate, NotDrawn, Silent},
    gltf::{PROPERTIES, note_all},
    load_with,
    obj::STATEMENTS,
    source::Source,
};
use serde_json::{Value, json};
use std::{fs, path::Path};

/// A section of docs/formats.md: what is drawn, a table of what is not quite, and what is no part of the picture.
fn section(rows: &[(&str, Fate)]) -> String {
    let list = |wanted: fn(Fate) -> bool| {
        let names = rows.iter().filter(|(_, fate)| wanted(*fate)).map(|(name, _)| format!("`{name}`"));
        names.collect::<Vec<_>>().join(", ")
    };
    let mut notes: Vec<(&str, &str, String)> = Vec::new();
    for (name, fate) in rows {
        let (word, note) = match fate {
            Approximated(note) => ("approximated", note),
            NotDrawn(note) => ("not drawn", note),
            Drawn | Silent => continue,
        };
        match notes.iter_mut().find(|row| (row.0, row.1) == (word, *note)) {
            Some(row) => row.2 += &format!(", `{name}`"),
            None => notes.push((word, note, format!("`{name}`"))),
        }
    }
    let table: String = notes.iter().map(|(word, note, names)| format!("| {names} | {word} | {note} |\n")).collect();
    let drawn = list(|fate| matches!(fate, Drawn));
    let silent = list(|fate| matches!(fate, Silent));
    format!(
        "Drawn: {drawn}.\n\nNo part of the picture: {silent}.\n\n| property | | note |\n| --- | --- | --- |\n{table}"
    )
}

#[test]
fn the_lists_of_formats_are_those_of_the_readers() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/formats.md");
    let text = fs::read_to_string(&path).unwrap_or_default();
    let mut whole = text.clone();
    for (title, rows) in [("glTF 2.0", PROPERTIES), ("MTL", STATEMENTS)] {
        let head = format!("## {title}\n\n");
        let start = text.find(&head).unwrap_or_else(|| panic!("docs/formats.md has no part {title:?}")) + head.len();
        let old = text[start..].split("\n## ").next().unwrap_or_default();
        whole = whole.replacen(&(head.clone() + old), &(head + &section(rows)), 1);
    }
    if std::env::var_os("RENEW_FORMATS").is_some() {
        fs::write(&path, &whole).unwrap();
    } else {
        assert!(whole == text, "renew docs/formats.md: RENEW_FORMATS=1 cargo test -p softras-io formats::");
    }
}

/// A document with a property at a path: lists where glTF has lists, objects elsewhere.
fn document(path: &str) -> Value {
    let nested = |path: &str, inner: Value| {
        path.rsplit('.').fold(inner, |value, name| {
            let is_list = matches!(name, "materials" | "meshes" | "primitives" | "nodes" | "samplers");
            json!({ name: if is_list { json!([value]) } else { value } })
        })
    };
    match path.strip_prefix("extensions.") {
        Some(_) => nested(&format!("materials.{path}"), json!({})),
        None => nested(&path.replace("COLOR_n", "COLOR_1"), json!(1)),
    }
}

#[test]
fn what_is_not_drawn_is_noted() {
    let options = LoadOptions::default();
    let notes = |document: Value| {
        let mut source = Source::new(Path::new("a.gltf"), &options);
        note_all(&mut source, &document);
        source.notes.finish(false).unwrap_or_default().join(" ")
    };
    for (path, fate) in PROPERTIES {
        let told = notes(document(path));
        match fate {
            NotDrawn(note) => assert!(told.contains(note), "{path}: {told:?}"),
            _ => assert_eq!(told, "", "{path}"),
        }
    }
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.obj");
    fs::write(&path, "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n").expect("a file");
    for (name, fate) in STATEMENTS {
        fs::write(path.with_extension("mtl"), format!("newmtl a\nKd 1 1 1\n{name} 0\n")).expect("a file");
        let told = load_with(&path, &options).expect("a mesh").notes.join(" ");
        match fate {
            NotDrawn(note) => assert!(told.contains(note) && told.contains("a.mtl:3"), "{name}: {told:?}"),
            Silent => assert_eq!(told, "", "{name}"),
            _ => {}
        }
    }
}
