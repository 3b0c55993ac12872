//! Meshes of long thin triangles, as programs for construction export them.

use softras::{Mesh, Result};
use std::f32::consts::TAU;

/// Each kind by its name: a disc in two ways, a plate with a round hole, a cylinder, and a single needle behind a plate.
///
/// # Errors
/// None.
pub fn kinds() -> Result<[(&'static str, Mesh); 5]> {
    Ok([("fan", fan()?), ("strip", strip()?), ("plate", plate()?), ("cylinder", cylinder()?), ("sliver", sliver()?)])
}

/// Corners of a polygon about the origin.
fn rim(count: u32, radius: f32, z: f32) -> Vec<[f32; 3]> {
    let angle = |i: u32| i as f32 / count as f32 * TAU;
    (0..count).map(|i| [radius * angle(i).cos(), radius * angle(i).sin(), z]).collect()
}

/// A disc whose triangles all share one corner of the rim.
fn fan() -> Result<Mesh> {
    Mesh::new(rim(150, 1.0, 0.0), (2..150).map(|k| [0, k - 1, k]).collect())
}

/// A disc whose triangles go back and forth between two halves of the rim.
fn strip() -> Result<Mesh> {
    let pairs = (0..74).flat_map(|k| [[k, k + 1, 149 - k], [k + 1, 148 - k, 149 - k]]);
    Mesh::new(rim(150, 1.0, 0.0), pairs.collect())
}

/// A plate whose corners take a quarter of the hole's rim each.
fn plate() -> Result<Mesh> {
    let mut points = rim(160, 0.3, 0.0);
    points.extend([[1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [1.0, -1.0, 0.0]]);
    let mut triangles: Vec<[u32; 3]> = (0..160).map(|k| [k, 160 + k / 40, (k + 1) % 160]).collect();
    triangles.extend((0..4).map(|q| [(q + 1) % 4 * 40, 160 + q, 160 + (q + 1) % 4]));
    Mesh::new(points, triangles)
}

/// A cylinder of long sides with fans at its ends.
fn cylinder() -> Result<Mesh> {
    let points = [rim(120, 0.5, -1.0), rim(120, 0.5, 1.0)].concat();
    let sides = (0..120).flat_map(|k| {
        let next = (k + 1) % 120;
        [[k, next, 120 + next], [k, 120 + next, 120 + k]]
    });
    let caps = (2..120).flat_map(|k| [[0, k, k - 1], [120, 119 + k, 120 + k]]);
    Mesh::new(points, sides.chain(caps).collect())
}

/// A plate, and a needle that begins behind it (z > 0) and ends beside it and in front of it.
fn sliver() -> Result<Mesh> {
    let points = vec![
        [-1.0, -1.0, 0.0],
        [1.0, -1.0, 0.0],
        [1.0, 1.0, 0.0],
        [-1.0, 1.0, 0.0],
        [-0.9, 0.1, 0.8],
        [1.6, 0.1, -0.25],
        [1.6, 0.102, -0.25],
    ];
    Mesh::new(points, vec![[0, 1, 2], [0, 2, 3], [4, 5, 6]])
}
