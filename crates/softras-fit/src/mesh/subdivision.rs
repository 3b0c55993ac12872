//! Subdivision: every triangle becomes four, with a vertex on each edge.
//!
//! [`Subdivision::Loop`] is the scheme of Loop, "Smooth Subdivision Surfaces Based on Triangles" (1987), with Warren's weights
//! for vertices, which are fractions and need no cosine, so that every machine computes the same bits. Each new position is
//! written as an old one plus weighted differences. The weights of the old positions therefore sum to exactly 1, and an affine
//! map before subdividing does the same as one after it.

use super::topology::Topology;
use crate::{bad, doubles, singles};
use glam::DVec3;
use softras::{
    Result,
    scene::{Appearance, Mesh},
};

/// How a mesh is subdivided.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Subdivision {
    /// New vertices in the middle of the edges: the surface stays what it is.
    #[default]
    Midpoint,
    /// Loop's scheme, whose surfaces become smooth: all vertices move to weighted means of their neighbours, those of a boundary
    /// along the boundary alone. A rounded mesh lies a little within one that is convex.
    Loop,
}

impl Subdivision {
    /// The mesh with every triangle divided into four. The old vertices come first, then those of the edges. Vertex colours take
    /// the weights of the positions; UV coordinates stay where they are, with new ones in the middle of their edges, so that
    /// textures keep their seams. The mesh has no normals of its own.
    ///
    /// An edge of one triangle, or of more than two, is a boundary. A vertex where other than two boundary edges meet stays.
    ///
    /// # Errors
    /// [`softras::Error::Fit`] for a mesh with surface cells, or with too many vertices.
    ///
    /// ```
    /// use softras_fit::Subdivision;
    ///
    /// let rounded = Subdivision::Loop.of(&softras::shapes::icosphere(0)?)?;
    /// assert_eq!(rounded.triangles().len(), 4 * 20);
    /// # Ok::<(), softras::Error>(())
    /// ```
    pub fn of(self, mesh: &Mesh) -> Result<Mesh> {
        self.with(mesh, &Topology::of(mesh)?)
    }

    /// Subdivides a mesh whose topology is known, as [`Subdivision::of`].
    pub(crate) fn with(self, mesh: &Mesh, topology: &Topology) -> Result<Mesh> {
        let finer = |values: &[[f32; 3]]| match self {
            Self::Midpoint => with_middles(values, topology),
            Self::Loop => rounded(values, topology),
        };
        let appearance = match mesh.appearance() {
            Appearance::Uniform(color) => Appearance::Uniform(*color),
            Appearance::VertexColors(colors) => Appearance::VertexColors(finer(colors)),
            Appearance::Textured { uvs, uv_triangles, textures, texture_of_triangle } => {
                let topology = Topology::new(uvs.len(), uv_triangles)?;
                Appearance::Textured {
                    uvs: with_middles(uvs, &topology),
                    uv_triangles: topology.subdivided(),
                    textures: textures.clone(),
                    texture_of_triangle: texture_of_triangle.iter().flat_map(|&texture| [texture; 4]).collect(),
                }
            }
            Appearance::Surface { .. } => {
                return bad("a mesh with surface cells to subdivide", "use one colour, vertex colours or a texture");
            }
        };
        Mesh::new(finer(mesh.positions()), topology.subdivided())?.with_appearance(appearance)
    }
}

/// The values of the vertices, then those in the middle of the edges.
fn with_middles<const N: usize>(values: &[[f32; N]], topology: &Topology) -> Vec<[f32; N]> {
    let middle = |&[a, b]: &[u32; 2]| {
        let (a, b) = (values[a as usize], values[b as usize]);
        std::array::from_fn(|k| 0.5 * (a[k] + b[k]))
    };
    values.iter().copied().chain(topology.edges().iter().map(middle)).collect()
}

/// The values of the vertices, then those of the edges, by Loop's scheme.
fn rounded(values: &[[f32; 3]], topology: &Topology) -> Vec<[f32; 3]> {
    let values = doubles(values);
    let around = opposite(topology);
    let on_edge = |(&[a, b], opposite): (&[u32; 2], &Vec<u32>)| {
        let middle = 0.5 * (values[a as usize] + values[b as usize]);
        match opposite[..] {
            // 3/8 of each end and 1/8 of each opposite vertex.
            [c, d] => middle + (values[c as usize] - middle + values[d as usize] - middle) / 8.0,
            _ => middle,
        }
    };
    let mut boundary = vec![Vec::new(); values.len()];
    for (&[a, b], _) in topology.edges().iter().zip(&around).filter(|(_, opposite)| opposite.len() != 2) {
        boundary[a as usize].push(b);
        boundary[b as usize].push(a);
    }
    let moved = |(v, &value): (usize, &DVec3)| {
        let toward = |others: &[u32], weight: f64| {
            value + weight * others.iter().map(|&other| values[other as usize] - value).sum::<DVec3>()
        };
        match boundary[v].len() {
            0 => toward(topology.neighbors(v), weight(topology.neighbors(v).len())),
            2 => toward(&boundary[v], 1.0 / 8.0),
            _ => value,
        }
    };
    let vertices = values.iter().enumerate().map(moved);
    let finer = vertices.chain(topology.edges().iter().zip(&around).map(on_edge));
    singles(&finer.collect::<Vec<DVec3>>())
}

/// The weight of each neighbour of a vertex that has `neighbors` of them (Warren).
fn weight(neighbors: usize) -> f64 {
    match neighbors {
        0 => 0.0,
        3 => 3.0 / 16.0,
        n => 3.0 / (8.0 * n as f64),
    }
}

/// For each edge the third vertices of its triangles.
fn opposite(topology: &Topology) -> Vec<Vec<u32>> {
    let mut opposite = vec![Vec::new(); topology.edges().len()];
    for &[a, b, c] in topology.triangles() {
        for (from, to, third) in [(a, b, c), (b, c, a), (c, a, b)] {
            if let Some(edge) = topology.edge(from, to) {
                opposite[edge].push(third);
            }
        }
    }
    opposite
}
