//! Rules that the sources of all packages keep.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The folders of sources of the packages, with the files in each.
fn packages() -> Vec<Vec<(PathBuf, String)>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let crates = std::fs::read_dir(root.join("crates")).unwrap().map(|entry| entry.unwrap().path().join("src"));
    let packages: Vec<_> = crates.chain([root.join("src")]).map(files).collect();
    let count: usize = packages.iter().map(Vec::len).sum();
    assert!(count > 100, "{count} files");
    packages
}

fn files(folder: PathBuf) -> Vec<(PathBuf, String)> {
    let (mut folders, mut files) = (vec![folder], Vec::new());
    while let Some(folder) = folders.pop() {
        for path in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                let text = std::fs::read_to_string(&path).unwrap();
                files.push((path, text));
            }
        }
    }
    files
}

/// The documentation has every item that another crate can reach: no package of this repository hides one (`doc(hidden)`).
#[test]
fn nothing_public_is_hidden() {
    let hidden = packages().concat().into_iter().filter(|(_, text)| text.contains("doc(hidden)")).map(|(path, _)| path);
    assert_eq!(hidden.collect::<Vec<_>>(), [PathBuf::new(); 0]);
}

/// The type that a line defines outside of functions and of implementations of traits.
fn type_of(line: &str) -> Option<&str> {
    let mut words = line.split([' ', '<', '(', ';', ':']).filter(|word| !word.is_empty());
    let defined = words.find(|word| !word.starts_with("pub") && !["crate)", "super)", "in"].contains(word))?;
    let is_type = ["struct", "enum", "trait", "union", "type"].contains(&defined) && !line.starts_with(' ');
    words.next().filter(|_| is_type)
}

/// A name stands for one type in a package, so that a reader who finds it knows what it is.
#[test]
fn types_have_names_of_their_own() {
    assert_eq!(type_of("pub(crate) struct Layouts {"), Some("Layouts"));
    assert_eq!(type_of("type Floats<'a> = &'a [f32];"), Some("Floats"));
    assert_eq!(type_of("    type Output = u64;"), None);
    for package in packages() {
        let mut defined: BTreeMap<&str, Vec<&Path>> = BTreeMap::new();
        for (path, text) in &package {
            text.lines().filter_map(type_of).for_each(|name| defined.entry(name).or_default().push(path));
        }
        defined.retain(|_, paths| paths.len() > 1);
        assert!(defined.is_empty(), "types of one name: {defined:#?}");
    }
}
