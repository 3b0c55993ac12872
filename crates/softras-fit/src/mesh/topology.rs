//! The connectivity of a mesh: edges, neighbours of vertices, and pairs of triangles that share an edge.

use super::regions::regions;
use crate::bad;
use softras::{Mesh, Result};
use std::collections::BTreeMap;

/// The most vertices: their numbers and twice as many edges' ends fit 32 bits.
const MAX_VERTICES: usize = 1 << 30;

/// Two triangles that share an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Flap {
    /// The edge, lower vertex first.
    pub edge: [u32; 2],
    /// The third vertex of each of the two triangles.
    pub opposite: [u32; 2],
    /// The two triangles.
    pub triangles: [u32; 2],
    /// Whether the official flatten loss includes the flap: it lists only the first two edges of every face, and the first two
    /// triangles of an edge.
    pub official: bool,
}

/// A mesh's edges, neighbours and flaps, in an order that depends on the triangles only.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Topology {
    vertices: usize,
    triangles: Vec<[u32; 3]>,
    edges: Vec<[u32; 2]>,
    flaps: Vec<Flap>,
    first_neighbor: Vec<u32>,
    neighbors: Vec<u32>,
}

impl Topology {
    /// The connectivity of triangles over this number of vertices. If three or more triangles meet at an edge, every two make a flap.
    ///
    /// # Errors
    /// [`softras::Error::Fit`] for an index out of range, and for more vertices than there are indices.
    pub fn new(vertices: usize, triangles: &[[u32; 3]]) -> Result<Self> {
        if vertices > MAX_VERTICES {
            return bad(format!("{vertices} vertices"), "use at most 2³⁰");
        }
        if let Some(t) = triangles.iter().position(|t| t.iter().any(|&i| i as usize >= vertices)) {
            let what = format!("triangle {t} is {:?} but there are {vertices} vertices", triangles[t]);
            return bad(what, "indices count from 0");
        }
        // Per edge: the triangles at it with their third vertices, and whether the official list has it.
        let mut at_edge: BTreeMap<[u32; 2], (Vec<[u32; 2]>, bool)> = BTreeMap::new();
        for (t, &[a, b, c]) in triangles.iter().enumerate() {
            for (i, (from, to, opposite)) in [(a, b, c), (b, c, a), (c, a, b)].into_iter().enumerate() {
                if from != to {
                    let (sides, official) = at_edge.entry([from.min(to), from.max(to)]).or_default();
                    sides.push([t as u32, opposite]);
                    *official |= i < 2;
                }
            }
        }
        let edges: Vec<[u32; 2]> = at_edge.keys().copied().collect();
        let mut flaps = Vec::with_capacity(edges.len());
        for (&edge, (sides, official)) in &at_edge {
            let pairs = (0..sides.len()).flat_map(|i| (i + 1..sides.len()).map(move |j| (i, j)));
            flaps.extend(pairs.map(|(i, j)| {
                let ([t, a], [u, b]) = (sides[i], sides[j]);
                Flap { edge, opposite: [a, b], triangles: [t, u], official: *official && (i, j) == (0, 1) }
            }));
        }
        let (first_neighbor, neighbors) = neighbors(vertices, &edges);
        Ok(Self { vertices, triangles: triangles.to_vec(), edges, flaps, first_neighbor, neighbors })
    }

    /// The connectivity of a mesh.
    ///
    /// # Errors
    /// As [`Topology::new`].
    pub fn of(mesh: &Mesh) -> Result<Self> {
        Self::new(mesh.positions().len(), mesh.triangles())
    }

    /// The number of vertices.
    pub fn vertices(&self) -> usize {
        self.vertices
    }

    /// The triangles.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Every edge once, lower vertex first, sorted.
    pub fn edges(&self) -> &[[u32; 2]] {
        &self.edges
    }

    /// Pairs of triangles that share an edge, in the order of the edges.
    pub fn flaps(&self) -> &[Flap] {
        &self.flaps
    }

    /// The vertices that share an edge with a vertex, in ascending order; empty for an index beyond the mesh.
    pub fn neighbors(&self, vertex: usize) -> &[u32] {
        match (self.first_neighbor.get(vertex), self.first_neighbor.get(vertex + 1)) {
            (Some(&from), Some(&to)) => &self.neighbors[from as usize..to as usize],
            _ => &[],
        }
    }

    /// The vertices of each connected part, in the order of their first ones; none of those that no triangle uses.
    pub(crate) fn parts(&self) -> Vec<Vec<usize>> {
        let beside = |v, around: &mut Vec<usize>| around.extend(self.neighbors(v).iter().map(|n| *n as usize));
        regions(self.vertices, |v| !self.neighbors(v).is_empty(), beside)
    }

    /// The number of parts, and the number of their handles together: the genus of a torus is 1. The genus is `None` unless every
    /// part is a closed surface: 2 - 2 genus = vertices - edges + triangles (Euler's formula).
    pub fn parts_and_genus(&self) -> (usize, Option<usize>) {
        let parts = self.parts();
        let (vertices, parts) = (parts.iter().map(Vec::len).sum::<usize>(), parts.len());
        let paired = self.flaps.iter().map(|flap| flap.edge).eq(self.edges.iter().copied());
        let closed = paired && 2 * self.edges.len() == 3 * self.triangles.len();
        let handles = 2 * parts as i64 - (vertices as i64 - self.edges.len() as i64 + self.triangles.len() as i64);
        (parts, usize::try_from(handles / 2).ok().filter(|_| closed && handles % 2 == 0))
    }

    /// The place in [`Topology::edges`] of the edge between two vertices, if there is one.
    pub fn edge(&self, a: u32, b: u32) -> Option<usize> {
        self.edges.binary_search(&[a.min(b), a.max(b)]).ok()
    }

    /// The mesh with every triangle cut into four: a vertex on each edge, after the old ones in the order of
    /// [`Topology::edges`].
    pub fn subdivided(&self) -> Vec<[u32; 3]> {
        // The midpoint of an edge from a vertex to itself is that vertex.
        let middle = |a: u32, b: u32| self.edge(a, b).map_or(a, |at| (self.vertices + at) as u32);
        let four = |&[a, b, c]: &[u32; 3]| {
            let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
            [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
        };
        self.triangles.iter().flat_map(four).collect()
    }
}

fn neighbors(vertices: usize, edges: &[[u32; 2]]) -> (Vec<u32>, Vec<u32>) {
    let mut both: Vec<[u32; 2]> = edges.iter().flat_map(|&[a, b]| [[a, b], [b, a]]).collect();
    both.sort_unstable();
    let mut first = vec![0; vertices + 1];
    both.iter().for_each(|&[a, _]| first[a as usize + 1] += 1);
    for i in 0..vertices {
        first[i + 1] += first[i];
    }
    (first, both.into_iter().map(|[_, b]| b).collect())
}
