//! Remeshing, which evens out the triangles that a fit has stretched: Botsch and Kobbelt, "A Remeshing Approach to
//! Multiresolution Modeling" (2004), section 4, with edge lengths that follow the curvature, as Dunyach et al., "Adaptive
//! Remeshing for Real-Time Mesh Deformation" (2013) take them, and with vertices that stay on the surface that is replaced.
//!
//! A round splits edges longer than 4/3 of the length that is wanted where they are, collapses those shorter than 4/5, flips
//! edges until vertices have about six neighbours, moves vertices tangentially towards the mean of their neighbours, and then
//! to the nearest point of the old surface, whose colours and wanted lengths they take. Vertices on creases move along them
//! alone. The topology is kept: closed surfaces stay closed, components and handles are preserved.

pub(crate) mod nearest;
mod sizing;
mod surface;

use crate::bad;
use nearest::Nearest;
use sizing::lengths;
use softras::{Result, scene::Mesh};
use std::ops::RangeInclusive;
use surface::ChangingMesh;

/// Number of rounds; further ones change little.
const ROUNDS: usize = 5;
/// The largest number of triangles that a remeshed mesh may have, estimated from its area.
const MOST_TRIANGLES: f64 = 4e6;

/// The mesh remeshed to triangles whose edges are about as long, in world units, as the range says: the shortest where the
/// surface is most bent, the longest where it is flat, and between them as long as lets a chord stay within a tenth of the
/// shortest from an arc of the surface's curvature. `0.1..=0.1` makes all edges alike.
///
/// New vertices lie on the old surface; colours are those that it has there. Vertices and triangles come in a new order. The
/// same input gives the same bits.
///
/// # Errors
/// [`softras::Error::Fit`] for a range whose ends are not above 0 and in order or that would make more than 4 million
/// triangles, and for a mesh with surface cells or textures.
///
/// ```
/// let coarse = softras::shapes::icosphere(1)?;
/// let fine = softras_fit::remeshed(&coarse, 0.2..=0.2)?;
/// assert!(fine.triangles().len() > 4 * coarse.triangles().len());
/// # Ok::<(), softras::Error>(())
/// ```
pub fn remeshed(mesh: &Mesh, edges: RangeInclusive<f64>) -> Result<Mesh> {
    remeshed_while(mesh, edges, &|| true)
}

/// [`remeshed`], which calls `goes_on` between its steps and ends with an error when that returns false.
///
/// # Errors
/// As [`remeshed`], and [`softras::Error::Fit`] where it is stopped.
pub fn remeshed_while(mesh: &Mesh, edges: RangeInclusive<f64>, goes_on: &dyn Fn() -> bool) -> Result<Mesh> {
    remade(mesh, &edges, true, goes_on)
}

/// The mesh remeshed to edges of one length, where creases are not kept and vertices need not stay on the old surface: they are
/// smoothed by a fraction of an edge. For a surface made of samples on a grid, whose steps are no detail.
///
/// # Errors
/// As [`remeshed`].
pub fn evened(mesh: &Mesh, edge: f64) -> Result<Mesh> {
    remade(mesh, &(edge..=edge), false, &|| true)
}

/// The tree that finds nearest points of a mesh, which has one colour or vertex colours.
pub(crate) fn nearest(mesh: &Mesh) -> Result<Nearest> {
    Ok(ChangingMesh::of(mesh)?.nearest())
}

fn remade(mesh: &Mesh, edges: &RangeInclusive<f64>, is_kept: bool, goes_on: &dyn Fn() -> bool) -> Result<Mesh> {
    if !(*edges.start() > 0.0 && edges.start() <= edges.end() && edges.end().is_finite()) {
        return bad(format!("triangles with edges of {edges:?}"), "use lengths above 0, the shorter first");
    }
    let mut surface = ChangingMesh::of(mesh)?;
    surface.is_kept = is_kept;
    surface.sizes = lengths(&surface, edges);
    let wanted = surface.triangles_wanted();
    if wanted.is_nan() || wanted >= MOST_TRIANGLES {
        let what = format!("triangles with edges of {edges:?}: some {wanted:.3e} of them");
        return bad(what, "use lengths that make at most 4 million triangles");
    }
    let old = is_kept.then(|| surface.nearest());
    for step in 0..4 * ROUNDS {
        match step % 4 {
            0 => surface.split(),
            1 => surface.collapse(),
            2 => surface.flip(),
            _ => surface.relax(old.as_ref()),
        }
        if !goes_on() {
            return bad("remeshing was stopped", "start it again");
        }
    }
    surface.mesh(mesh.appearance())
}
