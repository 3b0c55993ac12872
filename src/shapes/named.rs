//! The built-in meshes by name, for the command and the tests.

use super::solids::{chair, double_torus, mug};
use super::{cube, fish, icosphere, shape_error, torus};
use crate::error::Result;
use crate::scene::Mesh;

/// The names that [`by_name`] knows.
pub const NAMES: [&str; 7] = ["cube", "icosphere", "torus", "fish", "double-torus", "mug", "chair"];

/// A mesh by its name: those of [`NAMES`], the icosphere with 3 subdivisions, the torus with 64×32 quads.
///
/// # Errors
/// [`crate::Error::Mesh`] for any other name; it lists the valid ones.
pub fn by_name(name: &str) -> Result<Mesh> {
    match name {
        "cube" => cube(),
        "icosphere" => icosphere(3),
        "torus" => torus(0.7, 0.3, 64, 32),
        "fish" => fish(),
        "double-torus" => double_torus(),
        "mug" => mug(),
        "chair" => chair(),
        _ => shape_error(format!("no mesh is called {name:?}"), format!("use one of {}", NAMES.join(", "))),
    }
}
