//! Triangles that lie on each other, as those of a sheet whose front and back have materials of their own.

use crate::input;
use softras::{Mesh, Result, scene::Appearance};
use std::path::Path;

/// A triangle of several on the same points: these in order, whether it turns in that order, what its corners show there, its number.
type Twin = ([[u32; 3]; 3], bool, [[u32; 3]; 3], u32);

/// Makes triangles single-sided that lie on the same points, look different and face opposite ways. Returns the number of those that
/// look different and face the same way, so that nothing tells which is seen.
///
/// # Errors
/// [`softras::Error::OutOfMemory`].
pub fn face_away(path: &Path, mesh: &Mesh, single_sided: &mut Vec<bool>) -> Result<usize> {
    let mut same_way = 0;
    if matches!(mesh.appearance(), Appearance::Uniform(_)) {
        return Ok(same_way);
    }
    let mut order: Vec<(u64, u32)> = input::vector(path, mesh.triangles().len())?;
    order.extend(mesh.triangles().iter().map(|triangle| hash(mesh, triangle)).zip(0..));
    order.sort_unstable();
    for group in order.chunk_by(|a, b| a.0 == b.0).filter(|group| group.len() > 1) {
        let mut twins: Vec<Twin> = group.iter().filter_map(|(_, t)| twin(mesh, *t)).collect();
        twins.sort_unstable();
        for twins in twins.chunk_by(|a, b| a.0 == b.0) {
            let ways = || twins.chunk_by(|a, b| a.1 == b.1);
            same_way += ways().flat_map(|way| way.iter().filter(|twin| twin.2 != way[0].2)).count();
            if ways().count() == 2 && twins.iter().any(|twin| twin.2 != twins[0].2) {
                single_sided.resize(mesh.triangles().len(), false);
                twins.iter().for_each(|twin| single_sided[twin.3 as usize] = true);
            }
        }
    }
    Ok(same_way)
}

/// The bits of a vertex's place; -0 and 0 are one.
fn place(mesh: &Mesh, vertex: u32) -> [u32; 3] {
    mesh.positions()[vertex as usize].map(|x| (x + 0.0).to_bits())
}

/// A number that triangles on the same points share.
fn hash(mesh: &Mesh, triangle: &[u32; 3]) -> u64 {
    let mixed = |hash: u64, x: &u32| (hash ^ u64::from(*x)).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29);
    triangle.iter().map(|&vertex| place(mesh, vertex).iter().fold(0, mixed)).fold(0, u64::wrapping_add)
}

/// `None` for a triangle without an area.
fn twin(mesh: &Mesh, number: u32) -> Option<Twin> {
    let t = number as usize;
    let show = |k: usize| match mesh.appearance() {
        Appearance::VertexColors(colors) => colors[mesh.triangles()[t][k] as usize].map(f32::to_bits),
        Appearance::Surface { resolution, texels } => texels[t * resolution.pow(2) as usize].map(f32::to_bits),
        Appearance::Textured { uvs, uv_triangles, texture_of_triangle, .. } => {
            let [u, v] = uvs[uv_triangles[t][k] as usize].map(f32::to_bits);
            [u, v, texture_of_triangle.get(t).copied().unwrap_or_default()]
        }
        Appearance::Uniform(_) => [0; 3],
    };
    let mut corners = [0, 1, 2].map(|k| (place(mesh, mesh.triangles()[t][k]), show(k)));
    let first = (0..3).min_by_key(|&k| corners[k].0).unwrap_or_default();
    corners.rotate_left(first);
    let turns = corners[1].0 < corners[2].0;
    corners.sort_unstable();
    let places = corners.map(|corner| corner.0);
    (places[0] != places[1] && places[1] != places[2]).then(|| (places, turns, corners.map(|corner| corner.1), number))
}
