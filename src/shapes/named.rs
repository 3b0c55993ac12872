//! The built-in meshes by name, for the command and the tests.

use super::fish::fine_fish;
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

/// A mesh by its name with `detail` times as many triangles in each direction.
///
/// # Errors
/// [`crate::Error::Mesh`] for a name that is unknown or of a mesh that has no finer form, and for a detail beyond 1 to 16.
pub fn finer(name: &str, detail: u32) -> Result<Mesh> {
    if !(1..=16).contains(&detail) {
        return shape_error(format!("a detail of {detail}"), "use 1 to 16".into());
    }
    match name {
        "torus" => torus(0.7, 0.3, 64 * detail, 32 * detail),
        "fish" => fine_fish(detail),
        _ if detail == 1 || !NAMES.contains(&name) => by_name(name),
        _ => shape_error(format!("a {name} has no detail"), "give --detail for fish or torus".into()),
    }
}
