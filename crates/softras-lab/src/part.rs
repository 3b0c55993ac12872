//! Parts of meshes.

use softras::scene::Appearance;
use softras::{Mesh, Result};

/// The mesh with the given triangles only, and only the vertices that they use.
///
/// # Errors
/// As [`Mesh::with_appearance`].
pub fn part_of(mesh: &Mesh, kept: &[usize]) -> Result<Mesh> {
    let mut vertices: Vec<u32> = kept.iter().flat_map(|&t| mesh.triangles()[t]).collect();
    vertices.sort_unstable();
    vertices.dedup();
    let place = |v: u32| vertices.partition_point(|&other| other < v) as u32;
    let triangles = kept.iter().map(|&t| mesh.triangles()[t].map(place)).collect();
    let positions = vertices.iter().map(|&v| mesh.positions()[v as usize]).collect();
    let appearance = match mesh.appearance() {
        Appearance::Uniform(color) => Appearance::Uniform(*color),
        Appearance::VertexColors(colors) => {
            Appearance::VertexColors(vertices.iter().map(|&v| colors[v as usize]).collect())
        }
        Appearance::Surface { resolution, texels } => {
            let cells = (*resolution as usize).pow(2);
            let of = |t: &usize| texels[t * cells..(t + 1) * cells].to_vec();
            Appearance::Surface { resolution: *resolution, texels: kept.iter().flat_map(of).collect() }
        }
        Appearance::Textured { uvs, uv_triangles, textures, texture_of_triangle } => Appearance::Textured {
            uvs: uvs.clone(),
            uv_triangles: kept.iter().map(|&t| uv_triangles[t]).collect(),
            textures: textures.clone(),
            texture_of_triangle: kept.iter().filter_map(|&t| texture_of_triangle.get(t).copied()).collect(),
        },
    };
    let normals = if mesh.normals().is_empty() { &[] } else { &vertices[..] };
    let normals = normals.iter().map(|&v| mesh.normals()[v as usize]).collect();
    Mesh::new(positions, triangles)?.with_appearance(appearance)?.with_normals(normals)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_keeps_what_its_triangles_are_made_of() -> Result<()> {
        let positions = (0..6).map(|i| [i as f32, 0.0, 1.0]).collect();
        let mesh = Mesh::new(positions, vec![[0, 1, 2], [5, 3, 1]])?;
        let colors = (0..6).map(|i| [i as f32; 3]).collect();
        let normals = (0..6).map(|i| [0.0, i as f32, 0.0]).collect();
        let mesh = mesh.with_appearance(Appearance::VertexColors(colors))?.with_normals(normals)?;
        let part = part_of(&mesh, &[1])?;
        assert_eq!(part.normals(), [[0.0, 1.0, 0.0]; 3]);
        assert_eq!(part.triangles(), [[2, 1, 0]]);
        assert_eq!(part.positions(), [[1.0, 0.0, 1.0], [3.0, 0.0, 1.0], [5.0, 0.0, 1.0]]);
        assert_eq!(*part.appearance(), Appearance::VertexColors(vec![[1.0; 3], [3.0; 3], [5.0; 3]]));
        Ok(())
    }
}
