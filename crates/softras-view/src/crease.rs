//! Smooth shading that keeps the edges of a mesh.
//!
//! Smooth shading has one normal for each vertex: the one that the file gives, or the mean of its triangles'. So the mesh is
//! rendered with a vertex of its own for each normal of the file at a position, and for each group of triangles that are smooth
//! with one another; vertices at one position, as at the seams of a texture, count as one.

use glam::DVec3;
use softras::scene::Appearance;
use softras::{Mesh, Result};
use std::collections::HashMap;

/// The most triangles at an edge whose angles are all compared; of more, only neighbours in the list.
const MOST_AT_AN_EDGE: usize = 8;

/// The angle where none is given, in degrees.
pub const DEFAULT: f64 = 40.0;

/// The mesh with vertices split where its surface bends by more than an angle in degrees, and joined where they lie at one
/// position. Corners with `given` normals, three for each triangle or none at all, keep these instead, and those with the same
/// normal share a vertex. Positions, triangles and colours stay what they are.
pub fn creased(mesh: &Mesh, given: &[[[f32; 3]; 3]], degrees: f64) -> Result<Mesh> {
    let welded = welded(mesh);
    let normals: Vec<Option<DVec3>> = mesh.triangles().iter().map(|triangle| normal(mesh, *triangle)).collect();
    let mut groups = Groups((0..3 * welded.len() as u32).collect());
    let least = degrees.to_radians().cos() - 1e-9;
    let is_smooth = |a: usize, b: usize| match (normals[a], normals[b]) {
        (Some(a), Some(b)) => a.dot(b) >= least,
        _ => false,
    };
    let edges = edges(&welded);
    for edge in edges.chunk_by(|a, b| a.0 == b.0) {
        for (i, (ends, first)) in edge.iter().enumerate() {
            for (_, second) in edge.iter().skip(i + 1).take(MOST_AT_AN_EDGE) {
                if is_smooth(*first as usize, *second as usize) {
                    for end in [ends.0, ends.1] {
                        groups.join(corner(&welded, *first, end), corner(&welded, *second, end));
                    }
                }
            }
        }
    }
    split(mesh, &welded, given, &mut groups)
}

/// The triangles with one index for each position.
fn welded(mesh: &Mesh) -> Vec<[u32; 3]> {
    let mut index_of = HashMap::new();
    let key = |position: &[f32; 3]| position.map(|x| (x + 0.0).to_bits());
    let first: Vec<u32> =
        mesh.positions().iter().zip(0..).map(|(position, i)| *index_of.entry(key(position)).or_insert(i)).collect();
    mesh.triangles().iter().map(|triangle| triangle.map(|i| first[i as usize])).collect()
}

/// The unit normal; `None` without area.
fn normal(mesh: &Mesh, triangle: [u32; 3]) -> Option<DVec3> {
    let [a, b, c] = triangle.map(|i| DVec3::from(mesh.positions()[i as usize].map(f64::from)));
    (b - a).cross(c - a).try_normalize()
}

/// The ends of each edge, the lower first, with a triangle that has it; sorted.
fn edges(triangles: &[[u32; 3]]) -> Vec<((u32, u32), u32)> {
    let of_one = |(triangle, t): (&[u32; 3], u32)| {
        let [a, b, c] = *triangle;
        [(a, b), (b, c), (c, a)].map(|(a, b)| ((a.min(b), a.max(b)), t))
    };
    let mut edges: Vec<_> = triangles.iter().zip(0..).flat_map(of_one).filter(|((a, b), _)| a != b).collect();
    edges.sort_unstable();
    edges
}

/// The corner of a triangle at a vertex that it has.
fn corner(triangles: &[[u32; 3]], triangle: u32, vertex: u32) -> u32 {
    let at = triangles[triangle as usize].iter().position(|&v| v == vertex).unwrap_or(0);
    3 * triangle + at as u32
}

/// Sets of corners that share a normal: each corner's parent, a root's parent being itself.
struct Groups(Vec<u32>);

impl Groups {
    fn root(&mut self, mut corner: u32) -> u32 {
        while self.0[corner as usize] != corner {
            let parent = self.0[corner as usize];
            self.0[corner as usize] = self.0[parent as usize];
            corner = parent;
        }
        corner
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}

/// What the corners of a vertex have in common.
#[derive(PartialEq, Eq, Hash)]
enum Shared {
    /// The position and the bits of a given normal.
    Normal(u32, [u32; 3]),
    /// The group, by its root.
    Group(u32),
}

/// The mesh with one vertex for each given normal at a position, and for each group of the other corners; where vertices have
/// colours, for each colour too.
fn split(mesh: &Mesh, welded: &[[u32; 3]], given: &[[[f32; 3]; 3]], groups: &mut Groups) -> Result<Mesh> {
    let colors = if let Appearance::VertexColors(colors) = mesh.appearance() { Some(colors) } else { None };
    let (mut positions, mut new_colors, mut normals) = (Vec::new(), Vec::new(), Vec::new());
    let mut index_of = HashMap::new();
    let mut triangles = Vec::with_capacity(mesh.triangles().len());
    for (t, triangle) in mesh.triangles().iter().enumerate() {
        triangles.push([0, 1, 2].map(|c| {
            let vertex = triangle[c] as usize;
            let normal = given.get(t).map_or([0.0; 3], |corners| corners[c]);
            let shared = if normal == [0.0; 3] {
                Shared::Group(groups.root((3 * t + c) as u32))
            } else {
                Shared::Normal(welded[t][c], normal.map(f32::to_bits))
            };
            let color = colors.map(|colors| colors[vertex]);
            *index_of.entry((shared, color.map(|color| color.map(f32::to_bits)))).or_insert_with(|| {
                positions.push(mesh.positions()[vertex]);
                new_colors.extend(color);
                normals.push(normal);
                positions.len() as u32 - 1
            })
        }));
    }
    let appearance = match mesh.appearance() {
        Appearance::VertexColors(_) => Appearance::VertexColors(new_colors),
        other => other.clone(),
    };
    let is_given = normals.iter().any(|normal| *normal != [0.0; 3]);
    let normals = if is_given { normals } else { Vec::new() };
    Mesh::new(positions, triangles)?.with_appearance(appearance)?.with_normals(normals)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use softras::shapes;

    fn cube() -> Mesh {
        let positions = (0..8u8).map(|i| [i & 1, i >> 1 & 1, i >> 2 & 1].map(f32::from)).collect();
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = quads.iter().flat_map(|q: &[u32; 4]| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
        Mesh::new(positions, triangles).unwrap()
    }

    fn corners(mesh: &Mesh) -> Vec<[[f32; 3]; 3]> {
        mesh.triangles().iter().map(|t| t.map(|i| mesh.positions()[i as usize])).collect()
    }

    #[test]
    fn edges_are_kept_and_seams_are_not() {
        let cube = cube();
        for (degrees, vertices) in [(40.0, 24), (89.0, 24), (91.0, 8), (180.0, 8)] {
            let creased = creased(&cube, &[], degrees).unwrap();
            assert_eq!(creased.positions().len(), vertices, "{degrees}");
            assert_eq!(corners(&creased), corners(&cube));
        }
        // A sphere whose triangles have vertices of their own is as smooth as one of shared vertices.
        let sphere = shapes::icosphere(2).unwrap();
        let apart = corners(&sphere).concat();
        let triangles = (0..apart.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        let apart = Mesh::new(apart, triangles).unwrap();
        assert_eq!(creased(&apart, &[], 40.0).unwrap().positions().len(), sphere.positions().len());
    }

    #[test]
    fn colours_stay_with_their_corners() {
        let sphere = shapes::icosphere(1).unwrap();
        let colors: Vec<[f32; 3]> = sphere.positions().iter().map(|p| p.map(f32::abs)).collect();
        let colored = sphere.with_appearance(Appearance::VertexColors(colors)).unwrap();
        let creased = creased(&colored, &[], 10.0).unwrap();
        let Appearance::VertexColors(found) = creased.appearance() else { unreachable!() };
        assert!(found.len() > colored.positions().len());
        assert!(found.iter().zip(creased.positions()).all(|(color, p)| *color == p.map(f32::abs)));
    }

    #[test]
    fn normals_of_a_file_are_kept_where_it_has_any() {
        let cube = cube();
        let from_center = |i: u32| DVec3::from(cube.positions()[i as usize].map(|x| f64::from(x) - 0.5));
        let round: Vec<_> = cube.triangles().iter().map(|t| t.map(|i| from_center(i).as_vec3().to_array())).collect();
        let flat: Vec<_> =
            cube.triangles().iter().map(|t| [normal(&cube, *t).unwrap().as_vec3().to_array(); 3]).collect();
        let made = |given: &[[[f32; 3]; 3]], degrees| creased(&cube, given, degrees).unwrap();
        let (as_sphere, as_cube) = (made(&round, 40.0), made(&flat, 180.0));
        assert_eq!((as_sphere.positions().len(), as_cube.positions().len()), (8, 24));
        for (mesh, given) in [(&as_sphere, &round), (&as_cube, &flat)] {
            for (triangle, given) in mesh.triangles().iter().zip(given) {
                for (&vertex, given) in triangle.iter().zip(given) {
                    let unit = DVec3::from(given.map(f64::from)).normalize();
                    let off = DVec3::from(mesh.normals()[vertex as usize].map(f64::from)) - unit;
                    assert!(off.length() < 1e-6, "{off}");
                }
            }
        }
        // Without normals at the corners the angle decides, and the renderer computes them.
        let none = made(&[[[0.0; 3]; 3]; 12], 40.0);
        assert_eq!((none.positions().len(), none.normals().len()), (24, 0));
        // A file may give normals to some corners alone.
        let mut some = vec![[[0.0; 3]; 3]; 12];
        some[..2].copy_from_slice(&round[..2]);
        let some = made(&some, 40.0);
        assert_eq!(some.normals().iter().filter(|normal| **normal != [0.0; 3]).count(), 4);
        assert_eq!(some.positions().len(), 24);
    }
}
