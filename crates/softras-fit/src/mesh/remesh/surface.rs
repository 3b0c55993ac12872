//! A mesh under change: edges that are split, collapsed and flipped, and vertices that move on the surface.

use super::nearest::{Nearest, SurfacePoint};
use crate::{bad, doubles, points, singles};
use glam::DVec3;
use softras::{
    Result,
    scene::{Appearance, Mesh},
};
use std::cmp::Ordering;

/// Passes of splitting: each halves the edges that are too long, so edges of up to 1e9 times the wanted length are
/// split.
const HALVINGS: usize = 30;
/// Edges are split above this share of the wanted length, and collapsed below that one.
const LONGEST: f64 = 4.0 / 3.0;
const SHORTEST: f64 = 0.8;
/// A vertex is looked for on the old surface within this many times the wanted length.
const REACH: f64 = 2.0;
/// The least sine of the angle between a vertex's normal and one of its triangles at a crease.
const CREASE: f64 = 0.5;
/// How far a vertex may leave its crease or corner where it is merged with another, as a share of the wanted length.
const OFF: f64 = 0.1;

/// A mesh under change, with the triangles at each vertex.
pub struct ChangingMesh {
    pub positions: Vec<DVec3>,
    /// One for each vertex, or empty for a mesh without vertex colours.
    pub colors: Vec<DVec3>,
    /// The length that edges at each vertex are to have.
    pub sizes: Vec<f64>,
    /// Whether vertices stay on creases, and on the old surface.
    pub is_kept: bool,
    /// `None` for a triangle that was removed.
    pub triangles: Vec<Option<[u32; 3]>>,
    /// The triangles at each vertex, in the order in which they were added.
    at: Vec<Vec<u32>>,
}

impl ChangingMesh {
    /// The surface of a mesh, with edges that may be of any length.
    pub fn of(mesh: &Mesh) -> Result<Self> {
        let colors = match mesh.appearance() {
            Appearance::Uniform(_) => Vec::new(),
            Appearance::VertexColors(colors) => doubles(colors),
            _ => return bad("a textured mesh to remesh", "use one colour or vertex colours"),
        };
        let mut at = vec![Vec::new(); mesh.positions().len()];
        // A triangle that uses a vertex twice has no area and would break the search for neighbours.
        let whole = |t: &&[u32; 3]| t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
        let triangles: Vec<_> = mesh.triangles().iter().filter(whole).map(|t| Some(*t)).collect();
        for (t, corners) in triangles.iter().enumerate() {
            corners.iter().flatten().for_each(|&v| at[v as usize].push(t as u32));
        }
        let sizes = vec![f64::INFINITY; at.len()];
        Ok(Self { positions: points(mesh), colors, sizes, is_kept: true, triangles, at })
    }

    /// The tree that finds nearest points of the surface.
    pub fn nearest(&self) -> Nearest {
        let triangles = self.triangles.iter().flatten().copied();
        Nearest::new(&self.positions, triangles, self.colors.clone(), self.sizes.clone())
    }

    fn position(&self, vertex: u32) -> DVec3 {
        self.positions[vertex as usize]
    }

    /// The normal of a triangle, its length twice the area.
    fn normal(&self, corners: [u32; 3]) -> DVec3 {
        let [a, b, c] = corners.map(|v| self.position(v));
        (b - a).cross(c - a)
    }

    /// The sum of the normals of the triangles at a vertex.
    pub fn normal_at(&self, vertex: u32) -> DVec3 {
        self.corners_at(vertex).map(|t| self.normal(t)).sum()
    }

    /// Orthogonal directions in which a vertex leaves the planes of its triangles: one where the surface is smooth, two on a
    /// crease, three at a corner. Where creases are not kept it is always one.
    fn fixed(&self, vertex: u32) -> Vec<DVec3> {
        let mut fixed = vec![self.normal_at(vertex).normalize_or_zero()];
        for corners in self.corners_at(vertex).filter(|_| self.is_kept) {
            let rest = without(self.normal(corners).normalize_or_zero(), &fixed);
            if rest.length() > CREASE {
                fixed.push(rest.normalize());
            }
        }
        fixed
    }

    /// The length that an edge is to have.
    fn size(&self, [a, b]: [u32; 2]) -> f64 {
        self.sizes[a as usize].min(self.sizes[b as usize])
    }

    /// About how many triangles the surface will have when its edges have the wanted lengths. Triangles without area are counted by
    /// their edges, which are split as well.
    pub fn triangles_wanted(&self) -> f64 {
        let even = |t: &[u32; 3]| {
            let size = self.size([t[0], t[1]]).min(self.size([t[1], t[2]]));
            0.5 * self.normal(*t).length() / (0.25 * 3f64.sqrt() * size * size)
        };
        let around: f64 = self.edges().iter().map(|(length, edge)| length / self.size(*edge)).sum();
        self.triangles.iter().flatten().map(even).sum::<f64>() + around
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

    /// The neighbours of a vertex, each once.
    pub fn neighbors(&self, vertex: u32) -> Vec<u32> {
        let mut ring = self.ring(vertex);
        ring.dedup();
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

    /// Splits edges at their midpoints, the longest first, until none is too long.
    pub fn split(&mut self) {
        for _ in 0..HALVINGS {
            let mut edges = self.edges();
            edges.retain(|(length, edge)| *length > LONGEST * self.size(*edge));
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
                self.sizes.push(0.5 * (self.sizes[a as usize] + self.sizes[b as usize]));
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

    /// Collapses edges that are too short, the shortest first, where the result is still a surface.
    pub fn collapse(&mut self) {
        let mut edges = self.edges();
        edges.retain(|(length, edge)| *length < SHORTEST * self.size(*edge));
        edges.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (_, [a, b]) in edges {
            let sides = self.sides([a, b]);
            // Earlier collapses may have removed the edge or lengthened it.
            if sides.len() != 2 || self.position(a).distance(self.position(b)) >= SHORTEST * self.size([a, b]) {
                continue;
            }
            if let Some(merge) = self.merge([a, b]).filter(|merge| self.may_merge(merge, &sides)) {
                self.apply(&merge, &sides);
            }
        }
    }

    /// How the ends of an edge are merged: at the end that is on the rim, or on a crease or corner that the other end is not on,
    /// else halfway; `None` where both are on the rim, or would leave their creases.
    fn merge(&self, [a, b]: [u32; 2]) -> Option<Merge> {
        let (kept, gone, part) = match (self.on_rim(a), self.on_rim(b)) {
            (true, true) => return None,
            (false, true) => (b, a, 0.0),
            (true, false) => (a, b, 0.0),
            (false, false) => {
                let [of_a, of_b] = [a, b].map(|v| self.fixed(v));
                match of_a.len().cmp(&of_b.len()) {
                    Ordering::Less => (b, a, 0.0),
                    Ordering::Greater => (a, b, 0.0),
                    Ordering::Equal => {
                        let half = 0.5 * (self.position(b) - self.position(a));
                        let leaves = |fixed: &[DVec3]| half.distance(without(half, fixed)) > OFF * self.size([a, b]);
                        if of_a.len() > 1 && (leaves(&of_a) || leaves(&of_b)) {
                            return None;
                        }
                        (a, b, 0.5)
                    }
                }
            }
        };
        let (from, to) = (kept as usize, gone as usize);
        let size = self.sizes[from] + part * (self.sizes[to] - self.sizes[from]);
        Some(Merge { kept, gone, part, to: self.positions[from].lerp(self.positions[to], part), size })
    }

    fn apply(&mut self, &Merge { kept, gone, part, to, size }: &Merge, sides: &[u32]) {
        self.positions[kept as usize] = to;
        self.sizes[kept as usize] = size;
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

    /// Whether two vertices may be merged: no two triangles coincide, none turns over, no edge becomes too long.
    fn may_merge(&self, &Merge { kept, gone, to, size, .. }: &Merge, sides: &[u32]) -> bool {
        let ends = [kept, gone];
        let [one, other] = ends.map(|end| self.neighbors(end));
        let mut common = one.iter().filter(|v| other.contains(v));
        // The link condition: the common neighbours are the two vertices opposite the edge, and both keep three
        // neighbours.
        if common.clone().count() != 2 || common.any(|&v| self.at[v as usize].len() <= 3) {
            return false;
        }
        let short =
            |v: &u32| ends.contains(v) || self.position(*v).distance(to) < LONGEST * size.min(self.sizes[*v as usize]);
        let moved = |v: u32| if ends.contains(&v) { to } else { self.position(v) };
        let stays = |t: &&u32| !sides.contains(t);
        let turned = |corners: [u32; 3]| {
            let [a, b, c] = corners.map(moved);
            !alike(self.normal(corners), (b - a).cross(c - a))
        };
        let around = || ends.iter().flat_map(|&end| self.at[end as usize].iter().filter(stays));
        one.iter().chain(&other).all(short) && !around().filter_map(|&t| self.triangles[t as usize]).any(turned)
    }

    /// Flips edges to the other diagonal of their two triangles where that brings the vertices' degrees nearer to 6, or
    /// to 4 on a boundary.
    pub fn flip(&mut self) {
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
            // An edge of a crease stays.
            let smooth = !self.is_kept || old.contains(&DVec3::ZERO) || alike(old[0], old[1]);
            let flat = smooth && turned.iter().all(|&corners| old.iter().all(|&n| alike(n, self.normal(corners))));
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

    /// Moves every vertex off the boundary towards the mean of its neighbours, in the tangent plane or along its crease, and
    /// from there to the nearest point of the old surface that faces its way. Where there is none, it stays; without an old
    /// surface it stays in the tangent plane, and keeps its colour.
    pub fn relax(&mut self, old: Option<&Nearest>) {
        let moved = |v: u32| {
            let (position, ring) = (self.position(v), self.ring(v));
            if ring.is_empty() || self.on_rim(v) {
                return None;
            }
            let middle = ring.iter().map(|&n| self.position(n)).sum::<DVec3>() / ring.len() as f64;
            let slid = position + without(middle - position, &self.fixed(v));
            match old {
                Some(old) => old.find(slid, self.normal_at(v), REACH * self.sizes[v as usize]),
                None => Some(SurfacePoint { point: slid, color: None, size: self.sizes[v as usize] }),
            }
        };
        let moves: Vec<Option<SurfacePoint>> = (0..self.positions.len() as u32).map(moved).collect();
        for (v, found) in moves.into_iter().enumerate() {
            let Some(SurfacePoint { point, color, size }) = found else { continue };
            (self.positions[v], self.sizes[v]) = (point, size);
            if let Some(color) = color {
                self.colors[v] = color;
            }
        }
    }

    /// The mesh of the remaining triangles and the vertices that they use.
    pub fn mesh(self, appearance: &Appearance) -> Result<Mesh> {
        let used: Vec<usize> = (0..self.at.len()).filter(|&v| !self.at[v].is_empty()).collect();
        let mut new = vec![0; self.at.len()];
        used.iter().enumerate().for_each(|(at, &v)| new[v] = at as u32);
        let single = |values: &[DVec3]| singles(&used.iter().map(|&v| values[v]).collect::<Vec<_>>());
        let triangles = self.triangles.iter().flatten().map(|t| t.map(|v| new[v as usize])).collect();
        let appearance = match appearance {
            Appearance::VertexColors(_) => Appearance::VertexColors(single(&self.colors)),
            other => other.clone(),
        };
        Mesh::new(single(&self.positions), triangles)?.with_appearance(appearance)
    }
}

/// A collapse of an edge: the end that remains, the one that goes, and what the remaining one becomes.
struct Merge {
    kept: u32,
    gone: u32,
    /// How far on the way to `gone` the kept vertex moves.
    part: f64,
    to: DVec3,
    size: f64,
}

/// A vector less its parts along orthogonal directions of length 1 or 0.
fn without(vector: DVec3, directions: &[DVec3]) -> DVec3 {
    directions.iter().fold(vector, |rest, direction| rest - rest.dot(*direction) * *direction)
}

/// Whether two normals are less than 60 degrees apart; true if `before` has no direction.
fn alike(before: DVec3, after: DVec3) -> bool {
    before == DVec3::ZERO || before.dot(after) > 0.5 * before.length() * after.length()
}
