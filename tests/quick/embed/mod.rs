//! The embedding API in the hands of a host: the example engine, a host's own geometry and images, and other devices.
// Tests play the host and pass raw Vulkan handles.
#![allow(unsafe_code, clippy::undocumented_unsafe_blocks, clippy::unwrap_used, clippy::expect_used, clippy::panic)]
// The example contains the engine, and so does the tests' host.
#![allow(clippy::duplicate_mod)]

mod alignment;
mod ash_example;
mod counts;
mod devices;
mod facade;
mod facade_images;
mod facade_status;
mod geometry;
mod images;
mod lifecycle;
mod misuse;
mod scene;

/// Checks that each test exists that the table of docs/robustness.md names.
#[test]
fn the_table_of_mistakes_names_tests() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let docs = std::fs::read_to_string(root.join("docs/robustness.md")).unwrap();
    let (_, section) = docs.split_once("## A host's mistakes").unwrap();
    let (table, _) = section.split_once("\n## ").unwrap();
    let sources = std::fs::read_dir(root.join("tests/quick/embed")).unwrap();
    let sources: String = sources.map(|file| std::fs::read_to_string(file.unwrap().path()).unwrap()).collect();
    let rows = table.lines().filter_map(|line| line.strip_suffix(" |")?.rsplit_once("| `"));
    let names: Vec<&str> =
        rows.flat_map(|(_, names)| names.split(['`', ',', ' '])).filter(|name| !name.is_empty()).collect();
    assert!(names.len() > 10, "{names:?}");
    for name in names {
        assert!(sources.contains(&format!("fn {name}()")), "there is no test {name}");
    }
}
