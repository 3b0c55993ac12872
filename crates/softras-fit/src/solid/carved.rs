//! A mesh's solid cut to silhouettes, so that a fit gets holes and parts that it did not begin with.
//!
//! The signed distance to the mesh's surface, above 0 within it, is sampled on the grid of the visual hull. The lesser of it and
//! the hull's samples is above 0 where both have an inside, and its zero level is a closed mesh whatever the old mesh was:
//! a film of triangles over a hole disappears, and parts that overlap become one. Where the old mesh leaves out a part, only the
//! hull's samples count.

use super::hull::{far, mend, pixel_of, samples};
use super::voxel::Voxels;
use crate::bad;
use crate::cores::on_all_cores;
use crate::mesh::regions::pixels_around;
use crate::mesh::remesh::nearest;
use crate::mesh::remesh::nearest::Nearest;
use glam::DVec3;
use rayon::prelude::*;
use softras::{
    Image, Result,
    scene::{Appearance, Mesh},
    shapes::Samples,
};
use softras_io::Views;

/// The solid of a mesh less all that a silhouette shows to be empty, as a mesh of new triangles in the colours of the nearest
/// points. `missing` marks, above ½, the parts of a view's silhouette that the mesh leaves out; they are added from the
/// [hull](crate::visual_hull). Parts of less than a thousandth of the solid are left out, and enclosed air is filled.
///
/// The cube and the resolution are those of [`visual_hull`](crate::visual_hull).
///
/// # Errors
/// Those of [`visual_hull`](crate::visual_hull); [`softras::Error::Fit`] for a mesh with surface cells or textures, for marks of another size
/// than the silhouettes, and where nothing is left of the mesh.
pub fn carved(
    of: &Views,
    mesh: &Mesh,
    missing: Option<&Image>,
    center: [f64; 3],
    side: f64,
    resolution: usize,
) -> Result<Mesh> {
    cut_to(samples(of, center, side, resolution, &mut || Ok(()))?, of, mesh, missing)
}

/// As [`carved`], from the samples of the views' hull.
pub(crate) fn cut_to(mut grid: Samples, of: &Views, mesh: &Mesh, missing: Option<&Image>) -> Result<Mesh> {
    let old = nearest(mesh)?;
    let added = missing.map(|missing| added(of, missing, &grid)).transpose()?;
    cut(&mut grid, mesh, &old)?;
    let both = grid.values.iter_mut().zip(added.into_iter().flatten());
    both.for_each(|(value, added)| *value = value.max(added));
    mend(&mut grid);
    match grid.mesh()? {
        Some(new) => colored(new, mesh, &old),
        None => bad("no part of the mesh is in all silhouettes", "begin with a mesh that lies within them"),
    }
}

/// The hull's samples that a marked pixel or one beside it shows; all others are outside. The marks may be one pixel wider than
/// a part, since at least one pixel of background, where the hull has nothing, lies between a silhouette's parts.
fn added(of: &Views, missing: &Image, hull: &Samples) -> Result<Vec<f32>> {
    let size = |image: &Image| (image.batch, image.height, image.width, image.channels);
    if of.silhouette.as_ref().map(size) != Some(size(missing)) {
        return bad(format!("marks of size {:?}", size(missing)), "give one for each pixel of the silhouettes");
    }
    let size = (missing.height, missing.width);
    let is_marked = |view: usize, (column, row): (usize, usize)| {
        pixels_around(row * size.1 + column, size, true).any(|pixel| missing.view(view)[pixel] > 0.5)
    };
    let marked: Vec<usize> = (0..missing.batch).filter(|&v| missing.view(v).iter().any(|x| *x > 0.5)).collect();
    let one = |(i, &value): (usize, &f32)| {
        let point = hull.position(i);
        let shown = |&view: &usize| {
            let pixel = pixel_of(&of.cameras[view], point, (missing.width as u32, missing.height as u32));
            pixel.is_some_and(|pixel| is_marked(view, pixel))
        };
        if value > -far(hull) && marked.iter().any(shown) { value } else { -far(hull) }
    };
    Ok(on_all_cores(|| hull.values.par_iter().enumerate().map(one).collect()))
}

/// Lowers each sample to its signed distance from a mesh's surface.
fn cut(grid: &mut Samples, mesh: &Mesh, surface: &Nearest) -> Result<()> {
    // Samples lie in the middle of voxels.
    let low = grid.low - 0.5 * grid.step;
    let solid = Voxels::new(mesh, low.to_array(), grid.resolution as f64 * grid.step, grid.resolution)?;
    let far = far(grid);
    let mut values = std::mem::take(&mut grid.values);
    let cut_one = |(i, (value, inside)): (usize, (&mut f32, &bool))| {
        // Samples far outside of the hull, which are many, stay as they are.
        if *value > -far {
            let point = grid.position(i);
            let found = surface.find(point, DVec3::ZERO, f64::from(far));
            let distance = found.map_or(far, |found| found.point.distance(point) as f32);
            *value = value.min(if *inside { distance } else { -distance });
        }
    };
    on_all_cores(|| values.par_iter_mut().zip(solid.inside()).enumerate().for_each(cut_one));
    grid.values = values;
    Ok(())
}

/// The new mesh in the colours of the old one's nearest points.
fn colored(new: Mesh, old: &Mesh, surface: &Nearest) -> Result<Mesh> {
    let color = |p: &[f32; 3]| {
        let found = surface.find(DVec3::from(p.map(f64::from)), DVec3::ZERO, f64::INFINITY);
        found.and_then(|found| found.color).unwrap_or_default().as_vec3().to_array()
    };
    let appearance = match old.appearance() {
        Appearance::VertexColors(_) => {
            Appearance::VertexColors(on_all_cores(|| new.positions().par_iter().map(color).collect()))
        }
        other => other.clone(),
    };
    new.with_appearance(appearance)
}
