//! Sorts transparent triangles into layers, so that no two of a layer overlap in the picture. A frame of each layer then has every
//! fragment, and each pixel blends them by depth, also where panes cross.

use glam::{DVec2, DVec3};
use softras::{Camera, Mesh};

/// The most layers without overlaps. Triangles that find no place are in one more, of which the nearest is drawn.
pub const MOST: usize = 16;
/// Outlines that overlap by less than this, in pixels, are side by side.
const TOUCHING: f64 = 1e-3;
/// The cells along a side of the grid that finds neighbours.
const CELLS: usize = 64;

/// A triangle in the picture.
struct Outline {
    triangle: usize,
    /// Its corners before near, in pixels.
    corners: Vec<DVec2>,
    /// Its least depth.
    nearest: f64,
}

/// The layers of the given triangles of a mesh, cut at near, in a picture of `size`, columns and rows. Nearer triangles
/// come first, so that those without a place are the farthest.
pub fn panes(mesh: &Mesh, triangles: &[usize], camera: &Camera, size: (u32, u32), near: f64) -> Vec<Vec<usize>> {
    let mut outlines: Vec<Outline> = triangles.iter().filter_map(|&t| outline(mesh, t, camera, size, near)).collect();
    outlines.sort_by(|a, b| a.nearest.total_cmp(&b.nearest));
    let mut cells = vec![Vec::new(); CELLS * CELLS];
    let mut layers = vec![Vec::new(); MOST + 1];
    for (number, outline) in outlines.iter().enumerate() {
        let over = covered(&outline.corners, size);
        let layer = free_layer(&outlines, outline, over.iter().flat_map(|&cell| &cells[cell]));
        layers[layer].push(outline.triangle);
        // Triangles of the last layer may overlap. They are the farthest ones, and keep no other out of a layer.
        if layer < MOST {
            over.into_iter().for_each(|cell| cells[cell].push((number, layer)));
        }
    }
    layers.iter_mut().for_each(|layer| layer.sort_unstable());
    layers.retain(|layer| !layer.is_empty());
    layers
}

/// The first layer in which no triangle overlaps an outline, of those nearby by their numbers and layers.
fn free_layer<'a>(outlines: &[Outline], outline: &Outline, nearby: impl Iterator<Item = &'a (usize, usize)>) -> usize {
    let mut is_taken = [false; MOST];
    for &(other, layer) in nearby {
        if !is_taken[layer] && overlap(&outline.corners, &outlines[other].corners) {
            is_taken[layer] = true;
            if is_taken == [true; MOST] {
                break;
            }
        }
    }
    is_taken.iter().position(|taken| !taken).unwrap_or(MOST)
}

/// A triangle cut at near; `None` if it lies before it.
fn outline(mesh: &Mesh, triangle: usize, camera: &Camera, size: (u32, u32), near: f64) -> Option<Outline> {
    let corners = mesh.triangles()[triangle].map(|v| DVec3::from(mesh.positions()[v as usize].map(f64::from)));
    let depths = corners.map(|corner| camera.to_view(corner).z);
    let mut cut = Vec::with_capacity(4);
    for (i, next) in [1, 2, 0].into_iter().enumerate() {
        if depths[i] >= near {
            cut.push(corners[i]);
        }
        if (depths[i] >= near) != (depths[next] >= near) {
            cut.push(corners[i].lerp(corners[next], (near - depths[i]) / (depths[next] - depths[i])));
        }
    }
    let corners: Option<Vec<DVec2>> = cut
        .into_iter()
        .map(|corner| camera.project(corner, size).map(|[column, row, _]| DVec2::new(column, row)))
        .collect();
    let nearest = depths.into_iter().fold(f64::INFINITY, f64::min);
    corners.filter(|corners| !corners.is_empty()).map(|corners| Outline { triangle, corners, nearest })
}

/// The cells of the grid over the picture that an outline's box touches; none beside the picture.
fn covered(corners: &[DVec2], (columns, rows): (u32, u32)) -> Vec<usize> {
    let low = corners.iter().copied().fold(DVec2::INFINITY, DVec2::min);
    let high = corners.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max);
    let range = |low: f64, high: f64, side: u32| {
        let cell = |x: f64| (x / f64::from(side) * CELLS as f64).floor().clamp(-1.0, CELLS as f64) as isize;
        cell(low).max(0) as usize..(cell(high) + 1).clamp(0, CELLS as isize) as usize
    };
    let [across, down] = [range(low.x, high.x, columns), range(low.y, high.y, rows)];
    down.flat_map(|row| across.clone().map(move |column| row * CELLS + column)).collect()
}

/// Whether two convex outlines overlap: no side of either lies between them.
fn overlap(a: &[DVec2], b: &[DVec2]) -> bool {
    let parts = |a: &[DVec2], b: &[DVec2]| {
        let sides = || a.iter().zip(a.iter().cycle().skip(1)).map(|(p, q)| (*p, *q));
        let turn = sides().map(|(p, q)| p.perp_dot(q)).sum::<f64>().signum();
        let is_outside = |(p, q): (DVec2, DVec2)| {
            let most = TOUCHING * (q - p).length();
            b.iter().all(|r| turn * (q - p).perp_dot(*r - p) <= most)
        };
        sides().any(is_outside)
    };
    !parts(a, b) && !parts(b, a)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use softras::{Projection, shapes};

    fn layers(mesh: &Mesh) -> Vec<Vec<usize>> {
        let camera = Camera::from_angles(4.0, 20.0, 30.0, Projection::Perspective { fov_y: 0.7 }).unwrap();
        let all: Vec<usize> = (0..mesh.triangles().len()).collect();
        panes(mesh, &all, &camera, (300, 200), 0.1)
    }

    #[test]
    fn a_layer_has_no_overlaps_and_a_surface_needs_no_more_than_it_has() {
        assert_eq!(layers(&shapes::icosphere(3).unwrap()).iter().map(Vec::len).sum::<usize>(), 1280);
        assert_eq!(layers(&shapes::icosphere(3).unwrap()).len(), 2);
        assert_eq!(layers(&shapes::cube().unwrap()).len(), 2);
        // Panes behind one another, one of them through the camera; then more than there are layers for.
        let quads = |depths: &[f32]| {
            let places = depths.iter().flat_map(|&z| [[-4.0, -4.0, z], [4.0, -4.0, z], [4.0, 4.0, z], [-4.0, 4.0, z]]);
            let corners = (0..depths.len() as u32).flat_map(|i| [[0, 1, 2], [0, 2, 3]].map(|t| t.map(|c| 4 * i + c)));
            Mesh::new(places.collect(), corners.collect()).unwrap()
        };
        assert_eq!(layers(&quads(&[0.0, 0.2, -2.9])).len(), 3);
        let many: Vec<f32> = (0..20).map(|i| 0.05 * i as f32).collect();
        let found = layers(&quads(&many));
        assert_eq!((found.len(), found[MOST].len()), (MOST + 1, 8));
    }
}
