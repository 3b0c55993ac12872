//! Isotropic remeshing, which evens out the triangles that a fit has stretched: Botsch and Kobbelt, "A Remeshing
//! Approach to Multiresolution Modeling" (2004), section 4.
//!
//! A round splits edges longer than 4/3 of the wanted length, collapses those shorter than 4/5, flips edges until
//! vertices have about six neighbours, and moves vertices tangentially towards the mean of their neighbours. The
//! topology is kept: closed surfaces stay closed, components and handles are preserved. The surface itself moves by a
//! fraction of an edge, which a continuing fit corrects.

use super::bad;
use crate::error::Result;
use crate::scene::{Appearance, Mesh};
use glam::DVec3;

/// Number of rounds; further ones change little.
const ROUNDS: usize = 5;
/// The largest number of triangles that a remeshed mesh may have, estimated from its area.
const MOST_TRIANGLES: f64 = 4e6;
/// Passes of splitting: each halves the edges that are too long, so edges of up to 1e9 times the wanted length are
/// split.
const HALVINGS: usize = 30;

/// The mesh remeshed to triangles whose edges are about `edge_length` world units long.
///
/// Vertex colours are interpolated; vertices and triangles come in a new order. The same input gives the same bits.
///
/// # Errors
/// [`crate::Error::Fit`] for a length that is not above 0 or would make more than 4 million triangles, and for a mesh
/// with surface cells or textures.
///
/// ```
/// let coarse = softras::shapes::icosphere(1)?;
/// let fine = softras::fit::remeshed(&coarse, 0.2)?;
/// assert!(fine.triangles().len() > 4 * coarse.triangles().len());
/// # Ok::<(), softras::Error>(())
/// ```
pub fn remeshed(mesh: &Mesh, edge_length: f64) -> Result<Mesh> {
    let mut surface = Surface::of(mesh)?;
    // The second term counts triangles without area, whose edges are split as well.
    let around: f64 = surface.edges().iter().map(|(length, _)| length).sum();
    let wanted = surface.area() / (0.25 * 3f64.sqrt() * edge_length * edge_length) + around / edge_length;
    if !(edge_length > 0.0 && wanted < MOST_TRIANGLES) {
        let what = format!("triangles with edges of {edge_length}: some {wanted:.3e} of them");
        return bad(what, "use a length above 0 that makes at most 4 million triangles");
    }
    let (shortest, longest) = (0.8 * edge_length, 4.0 / 3.0 * edge_length);
    for _ in 0..ROUNDS {
        surface.split(longest);
        surface.collapse(shortest, longest);
        surface.flip();
        surface.relax();
    }
    surface.mesh(mesh.appearance())
}

/// A mesh under change, with the triangles at each vertex.
struct Surface {
    positions: Vec<DVec3>,
    /// One for each vertex, or empty for a mesh without vertex colours.
    colors: Vec<DVec3>,
    /// `None` for a triangle that was removed.
    triangles: Vec<Option<[u32; 3]>>,
    /// The triangles at each vertex, in the order in which they were added.
    at: Vec<Vec<u32>>,
}

impl Surface {
    fn of(mesh: &Mesh) -> Result<Self> {
        let double = |values: &[[f32; 3]]| values.iter().map(|v| DVec3::from(v.map(f64::from))).collect::<Vec<_>>();
        let colors = match mesh.appearance() {
            Appearance::Uniform(_) => Vec::new(),
            Appearance::VertexColors(colors) => double(colors),
            _ => return bad("a textured mesh to remesh", "use one colour or vertex colours"),
        };
        let mut at = vec![Vec::new(); mesh.positions().len()];
        // A triangle that uses a vertex twice has no area and would break the search for neighbours.
        let whole = |t: &&[u32; 3]| t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
        let triangles: Vec<_> = mesh.triangles().iter().filter(whole).map(|t| Some(*t)).collect();
        for (t, corners) in triangles.iter().enumerate() {
            corners.iter().flatten().for_each(|&v| at[v as usize].push(t as u32));
        }
        Ok(Self { positions: double(mesh.positions()), colors, triangles, at })
    }

    fn position(&self, vertex: u32) -> DVec3 {
        self.positions[vertex as usize]
    }

    /// The normal of a triangle, its length twice the area.
    fn normal(&self, corners: [u32; 3]) -> DVec3 {
        let [a, b, c] = corners.map(|v| self.position(v));
        (b - a).cross(c - a)
    }

    fn area(&self) -> f64 {
        self.triangles.iter().flatten().map(|t| 0.5 * self.normal(*t).length()).sum()
    }

    fn corners_at(&self, vertex: u32) -> impl Iterator<Item = [u32; 3]> {
        self.at[vertex as usize].iter().filter_map(|&t| self.triangles[t as usize])
    }

    /// Every edge once with its length, in an order that depends on the triangles only.
    fn edges(&self) -> Vec<(f64, [u32; 2])> {
        let ends = |t: &[u32; 3]| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]].map(|[a, b]| [a.min(b), a.max(b)]);
        let mut edges: Vec<[u32; 2]> = self.triangles.iter().flatten().flat_map(ends).collect();
        edges.sort_unstable();
        edges.dedup();
        edges.into_iter().map(|[a, b]| (self.position(a).distance(self.position(b)), [a, b])).collect()
    }

    /// The triangles at an edge.
    fn sides(&self, [a, b]: [u32; 2]) -> Vec<u32> {
        let has_b = |t: &&u32| self.triangles[**t as usize].is_some_and(|corners| corners.contains(&b));
        self.at[a as usize].iter().filter(has_b).copied().collect()
    }

    /// The neighbours of a vertex, each listed once for every triangle at the edge to it.
    fn ring(&self, vertex: u32) -> Vec<u32> {
        let mut ring: Vec<u32> = self.corners_at(vertex).flatten().filter(|&v| v != vertex).collect();
        ring.sort_unstable();
        ring
    }

    /// Whether a vertex lies on the surface's boundary or on a non-manifold edge.
    fn on_rim(&self, vertex: u32) -> bool {
        self.ring(vertex).chunk_by(|a, b| a == b).any(|edge| edge.len() != 2)
    }

    fn put(&mut self, triangle: u32, corners: [u32; 3]) {
        self.remove(triangle);
        self.triangles[triangle as usize] = Some(corners);
        corners.iter().for_each(|&v| self.at[v as usize].push(triangle));
    }

    fn remove(&mut self, triangle: u32) {
        for v in self.triangles[triangle as usize].take().into_iter().flatten() {
            self.at[v as usize].retain(|&t| t != triangle);
        }
    }

    /// Splits edges at their midpoints, the longest first, until none is longer than `longest`.
    fn split(&mut self, longest: f64) {
        for _ in 0..HALVINGS {
            let mut edges = self.edges();
            edges.retain(|(length, _)| *length > longest);
            if edges.is_empty() {
                return;
            }
            edges.sort_by(|a, b| b.0.total_cmp(&a.0));
            for (_, [a, b]) in edges {
                let middle = self.positions.len() as u32;
                self.positions.push(0.5 * (self.position(a) + self.position(b)));
                if !self.colors.is_empty() {
                    self.colors.push(0.5 * (self.colors[a as usize] + self.colors[b as usize]));
                }
                self.at.push(Vec::new());
                for side in self.sides([a, b]) {
                    let Some(corners) = self.triangles[side as usize] else { continue };
                    let with = |old: u32| corners.map(|v| if v == old { middle } else { v });
                    self.put(side, with(b));
                    self.triangles.push(None);
                    self.put(self.triangles.len() as u32 - 1, with(a));
                }
            }
        }
    }

    /// Collapses edges shorter than `shortest`, the shortest first, where the result is still a surface.
    fn collapse(&mut self, shortest: f64, longest: f64) {
        let mut edges = self.edges();
        edges.retain(|(length, _)| *length < shortest);
        edges.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (_, [a, b]) in edges {
            let sides = self.sides([a, b]);
            // Earlier collapses may have removed the edge or lengthened it.
            if sides.len() != 2 || self.position(a).distance(self.position(b)) >= shortest {
                continue;
            }
            let (kept, gone, part) = match (self.on_rim(a), self.on_rim(b)) {
                (true, true) => continue,
                (false, true) => (b, a, 0.0),
                (true, false) => (a, b, 0.0),
                (false, false) => (a, b, 0.5),
            };
            let to = self.position(kept).lerp(self.position(gone), part);
            if self.may_meet([kept, gone], &sides, to, longest) {
                self.positions[kept as usize] = to;
                if !self.colors.is_empty() {
                    self.colors[kept as usize] = self.colors[kept as usize].lerp(self.colors[gone as usize], part);
                }
                sides.iter().for_each(|&side| self.remove(side));
                for t in self.at[gone as usize].clone() {
                    if let Some(corners) = self.triangles[t as usize] {
                        self.put(t, corners.map(|v| if v == gone { kept } else { v }));
                    }
                }
            }
        }
    }

    /// Whether the ends of an edge may be merged at `to`: no two triangles coincide, none turns over, no edge becomes
    /// longer than `longest`.
    fn may_meet(&self, ends: [u32; 2], sides: &[u32], to: DVec3, longest: f64) -> bool {
        let [mut one, mut other] = ends.map(|end| self.ring(end));
        one.dedup();
        other.dedup();
        let mut common = one.iter().filter(|v| other.contains(v));
        // The link condition: the common neighbours are the two vertices opposite the edge, and both keep three
        // neighbours.
        if common.clone().count() != 2 || common.any(|&v| self.at[v as usize].len() <= 3) {
            return false;
        }
        let moved = |v: u32| if ends.contains(&v) { to } else { self.position(v) };
        ends.iter().all(|&end| {
            let stays = |t: &&u32| !sides.contains(t);
            self.at[end as usize].iter().filter(stays).filter_map(|&t| self.triangles[t as usize]).all(|corners| {
                let [a, b, c] = corners.map(moved);
                let short =
                    [(a, b), (b, c), (c, a)].iter().all(|(p, q)| (*p != to && *q != to) || p.distance(*q) < longest);
                short && alike(self.normal(corners), (b - a).cross(c - a))
            })
        })
    }

    /// Flips edges to the other diagonal of their two triangles where that brings the vertices' degrees nearer to 6, or
    /// to 4 on a boundary.
    fn flip(&mut self) {
        for (_, [a, b]) in self.edges() {
            let &[t, u] = &self.sides([a, b])[..] else { continue };
            let (Some(first), Some(second)) = (self.triangles[t as usize], self.triangles[u as usize]) else {
                continue;
            };
            let from = |corners: [u32; 3]| corners.iter().position(|&v| v == a);
            let (Some(i), Some(j)) = (from(first), from(second)) else { continue };
            // The triangle that has the edge in the direction from a to b comes first.
            let ((t, first, i), (u, second, j)) =
                if first[(i + 1) % 3] == b { ((t, first, i), (u, second, j)) } else { ((u, second, j), (t, first, i)) };
            let (c, d) = (first[(i + 2) % 3], second[(j + 1) % 3]);
            if first[(i + 1) % 3] != b || second[(j + 2) % 3] != b || c == d || !self.sides([c, d]).is_empty() {
                continue;
            }
            let turned = [[a, d, c], [d, b, c]];
            let old = [first, second].map(|corners| self.normal(corners));
            let flat = turned.iter().all(|&corners| old.iter().all(|&n| alike(n, self.normal(corners))));
            let excess = |v: u32| {
                let rim = self.on_rim(v);
                self.at[v as usize].len() as i64 + i64::from(rim) - if rim { 4 } else { 6 }
            };
            let badness = |change: i64| {
                let [a, b, c, d] = [excess(a) - change, excess(b) - change, excess(c) + change, excess(d) + change];
                a * a + b * b + c * c + d * d
            };
            if flat && badness(1) < badness(0) {
                self.put(t, turned[0]);
                self.put(u, turned[1]);
            }
        }
    }

    /// Moves every vertex off the boundary to the mean of its neighbours, projected to the tangent plane, and its
    /// colour by the same fraction of the way to the mean of their colours.
    fn relax(&mut self) {
        let moved = |v: u32| {
            let (position, ring) = (self.position(v), self.ring(v));
            if ring.is_empty() || self.on_rim(v) {
                return (position, 0.0);
            }
            let middle = ring.iter().map(|&n| self.position(n)).sum::<DVec3>() / ring.len() as f64;
            let normal = self.corners_at(v).map(|t| self.normal(t)).sum::<DVec3>().normalize_or_zero();
            let slid = (middle - position).reject_from_normalized(normal);
            (position + slid, slid.length() / (middle - position).length().max(f64::MIN_POSITIVE))
        };
        let recolored = |(v, &(_, part)): (usize, &(DVec3, f64))| {
            let ring = self.ring(v as u32);
            let mean = ring.iter().map(|&n| self.colors[n as usize]).sum::<DVec3>() / ring.len().max(1) as f64;
            self.colors[v].lerp(mean, part)
        };
        let moves: Vec<(DVec3, f64)> = (0..self.positions.len() as u32).map(moved).collect();
        if !self.colors.is_empty() {
            self.colors = moves.iter().enumerate().map(recolored).collect();
        }
        self.positions = moves.into_iter().map(|(position, _)| position).collect();
    }

    /// The mesh of the remaining triangles and the vertices that they use.
    fn mesh(self, appearance: &Appearance) -> Result<Mesh> {
        let used: Vec<usize> = (0..self.at.len()).filter(|&v| !self.at[v].is_empty()).collect();
        let mut new = vec![0; self.at.len()];
        used.iter().enumerate().for_each(|(at, &v)| new[v] = at as u32);
        let single = |values: &[DVec3]| used.iter().map(|&v| values[v].as_vec3().to_array()).collect::<Vec<_>>();
        let triangles = self.triangles.iter().flatten().map(|t| t.map(|v| new[v as usize])).collect();
        let appearance = match appearance {
            Appearance::VertexColors(_) => Appearance::VertexColors(single(&self.colors)),
            other => other.clone(),
        };
        Mesh::new(single(&self.positions), triangles)?.with_appearance(appearance)
    }
}

/// Whether two normals are less than 60 degrees apart; true if `before` has no direction.
fn alike(before: DVec3, after: DVec3) -> bool {
    before == DVec3::ZERO || before.dot(after) > 0.5 * before.length() * after.length()
}
