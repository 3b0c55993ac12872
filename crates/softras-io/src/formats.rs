//! The lists of docs/formats.md are those of the readers, and what they call not drawn is noted.

use crate::{
    LoadOptions,
    fate::{self, Approximated, Drawn, Fate, Fates, NotDrawn, Silent},
    gltf, load_with, obj, ply,
    source::Source,
};
use serde_json::{Value, json};
use std::{fs, path::Path};

/// A section of docs/formats.md: what is drawn, what is no part of the picture, and a table of what is approximated or not drawn.
fn section(rows: &'static Fates) -> String {
    let rows: Vec<(&str, Fate)> = fate::names(rows).collect();
    let list = |wanted: fn(Fate) -> bool| {
        let names = rows.iter().filter(|(_, fate)| wanted(*fate)).map(|(name, _)| format!("`{name}`"));
        names.collect::<Vec<_>>().join(", ")
    };
    let mut notes: Vec<(&str, &str, String)> = Vec::new();
    for (name, fate) in &rows {
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
    let lists = [
        ("OBJ", obj::STATEMENTS),
        ("MTL", obj::MATERIAL_STATEMENTS),
        ("PLY", ply::PROPERTIES),
        ("glTF 2.0", gltf::PROPERTIES),
    ];
    for (title, rows) in lists {
        // Words on a format may stand before its lists.
        let start =
            text.find(&format!("## {title}\n\n")).unwrap_or_else(|| panic!("docs/formats.md has no part {title:?}"));
        let old = text[start..].split("\n## ").next().unwrap_or_default();
        let kept = old.split("Drawn: ").next().unwrap_or_default();
        whole = whole.replacen(old, &format!("{kept}{}", section(rows)), 1);
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
        gltf::note_all(&mut source, &document);
        source.notes.finish(false).unwrap_or_default().join(" ")
    };
    for (path, fate) in fate::names(gltf::PROPERTIES) {
        let told = notes(document(path));
        match fate {
            NotDrawn(note) => assert!(told.contains(note), "{path}: {told:?}"),
            _ => assert_eq!(told, "", "{path}"),
        }
    }
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: String| {
        let path = folder.path().join(name);
        fs::write(&path, text).expect("a file");
        path
    };
    let check = |name: &str, fate: Fate, place: &str, path: &Path| {
        let told = load_with(path, &options).map(|loaded| loaded.notes.join(" "));
        let told = told.unwrap_or_else(|error| panic!("{name}: {error}"));
        match fate {
            NotDrawn(note) => assert!(told.contains(note) && told.contains(place), "{name}: {told:?}"),
            Silent => assert_eq!(told, "", "{name}"),
            _ => {}
        }
    };
    let triangle = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n";
    let path = write("a.obj", triangle.into());
    for (name, fate) in fate::names(obj::MATERIAL_STATEMENTS) {
        write("a.mtl", format!("newmtl a\nKd 1 1 1\n{name} 0\n"));
        check(name, fate, "a.mtl:3", &path);
    }
    for (name, fate) in fate::names(obj::STATEMENTS).filter(|(_, fate)| *fate != Drawn) {
        check(name, fate, "b.obj:7", &write("b.obj", format!("{triangle}{name} 1\n")));
    }
    for (name, fate) in fate::names(ply::PROPERTIES).filter(|(_, fate)| *fate != Drawn) {
        let (element, property) = name.split_once('.').unwrap_or((name, "x"));
        let extra = |wanted: &str| if element == wanted { property } else { "nothing" };
        let other = if matches!(element, "vertex" | "face") { "camera" } else { element };
        let text = format!(
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty float {}\n\
             element face 1\nproperty list uchar int vertex_indices\nproperty float {}\nelement {other} 1\nproperty float x\n\
             end_header\n0 0 0 0\n1 0 0 0\n0 1 0 0\n3 0 1 2 0\n0\n",
            extra("vertex"),
            extra("face")
        );
        check(name, fate, "c.ply", &write("c.ply", text.clone()));
        if property == "alpha" {
            check(name, Silent, "opaque", &write("d.ply", text.replace(" 0\n", " 1\n")));
        }
    }
}
