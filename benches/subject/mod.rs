//! The mesh that the benches render.

use softras::{Mesh, shapes};
use std::path::Path;

/// A mesh of `../shared/meshes`, or the crate's own fish if that is not there or the argument `fish` asks for it.
pub fn mesh(name: &str) -> (String, Mesh) {
    if asked("fish") {
        return ("fish".to_string(), shapes::fish().expect("the crate's own mesh"));
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../shared/meshes/{name}.obj"));
    match softras_io::load_with(&path, &softras_io::LoadOptions::default()) {
        Ok(loaded) => (name.to_string(), loaded.mesh),
        Err(_) => {
            println!("{name} is not there: the fish instead");
            ("fish".to_string(), shapes::fish().expect("the crate's own mesh"))
        }
    }
}

/// Whether the arguments ask for it: `cargo bench --bench growth -- full`.
pub fn asked(word: &str) -> bool {
    std::env::args().any(|argument| argument == word)
}
