//! Meshes by their names: built-in ones, and names of nothing.

use softras::{scene::Appearance, shapes};
use softras_io::{LoadOptions, SaveOptions, built_in, load_named, save_with};
use std::{fs, path::Path};

#[test]
fn a_built_in_mesh_is_what_its_file_holds() {
    let folder = tempfile::tempdir().unwrap();
    for name in shapes::NAMES {
        let (mesh, file) = (shapes::by_name(name).unwrap(), folder.path().join(name).with_extension("obj"));
        // As `softras mesh` writes it.
        let srgb = matches!(mesh.appearance(), Appearance::VertexColors(_));
        save_with(&mesh, &file, &SaveOptions { srgb, ..SaveOptions::default() }).unwrap();
        for srgb in [false, true] {
            let options = LoadOptions { srgb, ..LoadOptions::default() };
            let [made, read] = [Path::new(name), &file].map(|path| load_named(path, &options).unwrap());
            assert_eq!(made.mesh, read.mesh, "{name}, srgb {srgb}");
            assert!(made.notes.is_empty() && made.files.is_empty());
        }
    }
}

#[test]
fn a_name_of_nothing_is_told_with_the_names_near_it() {
    let folder = tempfile::tempdir().unwrap();
    let told = |name: &str| built_in(folder.path().join(name)).unwrap_err().to_string();
    for file in ["spot.ply", "Spot2.OBJ", "spot.png", "bunny.obj", "abcd\u{1b}.glb"] {
        fs::write(folder.path().join(file), "").unwrap();
    }
    fs::create_dir(folder.path().join("spots.obj")).unwrap();
    let spot = told("spot.obj");
    assert!(spot.contains("neither a file nor a built-in mesh: did you mean "), "{spot}");
    assert!(spot.contains("spot.ply or ") && spot.contains("Spot2.OBJ? give the path"), "{spot}");
    assert!(spot.ends_with("or one of cube, icosphere, torus, fish, double-torus, mug, chair"), "{spot}");
    assert!(told("bnuny").contains("bunny.obj?") && told("abcde").contains("abcd\\u001b.glb"));
    for (name, near) in [("fsh", "fish"), ("Fish", "fish"), ("chair.obj", "chair"), ("sphere", "icosphere")] {
        assert!(told(name).contains(&format!("the built-in {near}? ")), "{name}: {}", told(name));
    }
    assert!(!told("teapot").contains("did you mean") && told("no/fish").contains("there is no folder "));
    // In a folder of its own a name is that of a file.
    assert!(told("fish").contains("the built-in fish? "));
}
