//! Spheres around meshes.

use crate::enclosing::enclosing;
use glam::DVec3;
use softras::Mesh;

/// A sphere around a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// The centre.
    pub center: DVec3,
    /// The distance from the centre to the farthest vertex in use; 1 for a mesh without extent.
    pub radius: f64,
}

/// The vertices that triangles use, each as often as triangles use it.
fn used(mesh: &Mesh) -> impl Iterator<Item = DVec3> + Clone {
    mesh.triangles().iter().flatten().map(|&i| DVec3::from_array(mesh.positions()[i as usize].map(f64::from)))
}

impl Bounds {
    /// The smallest sphere around the vertices that triangles use. The camera looks at its centre by default, so that it
    /// looks at a mesh that was turned from the same place.
    pub fn of(mesh: &Mesh) -> Self {
        let (center, radius) = enclosing(used(mesh)).unwrap_or((DVec3::ZERO, 0.0));
        Self { center, radius: if radius > 0.0 { radius } else { 1.0 } }
    }
}
