//! Smooth shading that keeps the edges of a mesh.
//!
//! Smooth shading has one normal for each vertex: the one that the file gives, or the mean of its triangles'. So the mesh is
//! rendered with a vertex of its own for each normal of the file at a position, and for each group of triangles that are smooth
//! with one another; vertices at one position, as at the seams of a texture, count as one. Flat shading keeps all edges.

use glam::DVec3;
use softras::scene::Appearance;
use softras::{Mesh, Result};
use std::collections::HashMap;

/// The most triangles at an edge whose angles are all compared; of more, only neighbours in the list.
const MOST_AT_AN_EDGE: usize = 8;

/// The angle where none is given, in degrees.
pub const DEFAULT: f64 = 40.0;

/// The mesh with a normal for each vertex: vertices are split where its surface bends by more than an angle in degrees, and joined
/// where they lie at one position. Corners with `given` normals, three for each triangle or none at all, keep these instead, and
/// those with the same normal share a vertex. Positions, triangles and colours stay what they are. Where triangles side by side are
/// wound in opposite directions, one of them counts as if it were turned over.
pub fn creased(mesh: &Mesh, given: &[[[f32; 3]; 3]], degrees: f64) -> Result<Mesh> {
    let welded = welded(mesh);
    let areas: Vec<DVec3> = mesh.triangles().iter().map(|triangle| area(mesh, *triangle)).collect();
    let mut groups = Groups((0..3 * welded.len() as u32).map(|corner| 2 * corner).collect());
    let least = degrees.to_radians().cos() - 1e-9;
    let cosine = |a: u32, b: u32| {
        let [a, b] = [a, b].map(|t| areas[t as usize].try_normalize());
        a.zip(b).map_or(f64::NAN, |(a, b)| a.dot(b))
    };
    let edges = edges(&welded);
    for edge in edges.chunk_by(|a, b| a.ends == b.ends) {
        for (i, first) in edge.iter().enumerate() {
            for second in edge.iter().skip(i + 1).take(MOST_AT_AN_EDGE) {
                let is_turned = first.is_rising == second.is_rising;
                let cosine = cosine(first.triangle, second.triangle);
                if (if is_turned { -cosine } else { cosine }) >= least {
                    for end in first.ends {
                        let [first, second] = [first, second].map(|edge| corner(&welded, edge.triangle, end));
                        groups.join(first, second, is_turned);
                    }
                }
            }
        }
    }
    split(mesh, &welded, given, &areas, &mut groups)
}

/// The triangles with one index for each position.
pub fn welded(mesh: &Mesh) -> Vec<[u32; 3]> {
    let mut index_of = HashMap::new();
    let key = |position: &[f32; 3]| position.map(|x| (x + 0.0).to_bits());
    let first: Vec<u32> =
        mesh.positions().iter().zip(0..).map(|(position, i)| *index_of.entry(key(position)).or_insert(i)).collect();
    mesh.triangles().iter().map(|triangle| triangle.map(|i| first[i as usize])).collect()
}

/// The normal, as long as twice the area.
pub fn area(mesh: &Mesh, triangle: [u32; 3]) -> DVec3 {
    let [a, b, c] = triangle.map(|i| DVec3::from(mesh.positions()[i as usize].map(f64::from)));
    (b - a).cross(c - a)
}

/// A triangle's edge.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
pub struct Edge {
    /// Its vertices, the lower first.
    pub ends: [u32; 2],
    triangle: u32,
    /// Whether the triangle runs from the lower to the higher one.
    pub is_rising: bool,
}

/// All edges of triangles, sorted.
pub fn edges(triangles: &[[u32; 3]]) -> Vec<Edge> {
    let of_one = |(&[a, b, c], triangle): (&[u32; 3], u32)| {
        [(a, b), (b, c), (c, a)].map(|(a, b)| Edge { ends: [a.min(b), a.max(b)], triangle, is_rising: a < b })
    };
    let mut edges: Vec<_> =
        triangles.iter().zip(0..).flat_map(of_one).filter(|edge| edge.ends[0] != edge.ends[1]).collect();
    edges.sort_unstable();
    edges
}

/// The corner of a triangle at a vertex that it has.
fn corner(triangles: &[[u32; 3]], triangle: u32, vertex: u32) -> u32 {
    let at = triangles[triangle as usize].iter().position(|&v| v == vertex).unwrap_or(0);
    3 * triangle + at as u32
}

/// Sets of corners that share a normal. Each corner links to another one of its set, a root to itself. A link is twice the corner's
/// number, plus 1 if the two corners have opposite normals.
struct Groups(Vec<u32>);

impl Groups {
    /// The link from a corner to the root of its set.
    fn root(&mut self, corner: u32) -> u32 {
        let mut link = 2 * corner;
        loop {
            let next = self.0[(link >> 1) as usize];
            if next >> 1 == link >> 1 {
                return link;
            }
            let further = self.0[(next >> 1) as usize] ^ (next & 1);
            self.0[(link >> 1) as usize] = further;
            link = further ^ (link & 1);
        }
    }

    fn join(&mut self, a: u32, b: u32, is_turned: bool) {
        let (a, b) = (self.root(a), self.root(b));
        if a >> 1 != b >> 1 {
            let turn = (a ^ b ^ u32::from(is_turned)) & 1;
            self.0[(a.max(b) >> 1) as usize] = (a.min(b) & !1) | turn;
        }
    }
}

/// The key that the corners of one vertex share.
#[derive(PartialEq, Eq, Hash)]
enum Shared {
    /// The position and the bits of a given normal.
    Normal(u32, [u32; 3]),
    /// The link to the root of a group.
    Group(u32),
}

/// The mesh with one vertex for each given normal at a position, and for each group of the other corners and each side of it; where
/// vertices have colours, for each colour too.
fn split(
    mesh: &Mesh,
    welded: &[[u32; 3]],
    given: &[[[f32; 3]; 3]],
    areas: &[DVec3],
    groups: &mut Groups,
) -> Result<Mesh> {
    let side = |link: u32| if link & 1 == 1 { -1.0 } else { 1.0 };
    let mut sums = vec![DVec3::ZERO; 3 * areas.len()];
    for corner in 0..sums.len() as u32 {
        let link = groups.root(corner);
        sums[(link >> 1) as usize] += side(link) * areas[corner as usize / 3];
    }
    let colors = if let Appearance::VertexColors(colors) = mesh.appearance() { Some(colors) } else { None };
    let (mut positions, mut new_colors, mut normals) = (Vec::new(), Vec::new(), Vec::new());
    let mut index_of = HashMap::new();
    let mut triangles = Vec::with_capacity(mesh.triangles().len());
    for (t, triangle) in mesh.triangles().iter().enumerate() {
        triangles.push([0, 1, 2].map(|c| {
            let vertex = triangle[c] as usize;
            let of_file = given.get(t).map_or([0.0; 3], |corners| corners[c]);
            let (shared, normal) = if of_file == [0.0; 3] {
                let link = groups.root((3 * t + c) as u32);
                let sum = side(link) * sums[(link >> 1) as usize];
                (Shared::Group(link), sum.normalize_or_zero().as_vec3().to_array())
            } else {
                (Shared::Normal(welded[t][c], of_file.map(f32::to_bits)), of_file)
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
        let flat: Vec<_> = cube.triangles().iter().map(|t| [area(&cube, *t).as_vec3().to_array(); 3]).collect();
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
        // Without normals at the corners the angle decides.
        let none = made(&[[[0.0; 3]; 3]; 12], 40.0);
        assert_eq!((none.positions().len(), none.normals()), (24, made(&[], 40.0).normals()));
        // A file may give normals to some corners alone.
        let mut some = vec![[[0.0; 3]; 3]; 12];
        some[..2].copy_from_slice(&round[..2]);
        let some = made(&some, 40.0);
        let slanted = |normal: &&[f32; 3]| normal.iter().all(|x| x.abs() > 0.5);
        assert_eq!(some.normals().iter().filter(slanted).count(), 4);
        assert_eq!(some.positions().len(), 24);
    }

    /// A ball of which every other triangle is turned over has the same normals, but for their signs.
    #[test]
    fn winding_does_not_break_a_surface() {
        let sphere = shapes::icosphere(3).unwrap();
        let turned =
            sphere.triangles().iter().enumerate().map(|(t, &[a, b, c])| if t % 2 == 0 { [a, b, c] } else { [a, c, b] });
        let mixed = Mesh::new(sphere.positions().to_vec(), turned.collect()).unwrap();
        let found = creased(&mixed, &[], 40.0).unwrap();
        for (t, triangle) in found.triangles().iter().enumerate() {
            let side = if t % 2 == 0 { 1.0 } else { -1.0 };
            for &v in triangle {
                let [normal, place] =
                    [found.normals(), found.positions()].map(|all| DVec3::from(all[v as usize].map(f64::from)));
                assert!(normal.distance(side * place.normalize()) < 0.03, "{t}: {normal} at {place}");
            }
        }
    }
}
