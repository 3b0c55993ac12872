//! The kernels `regularize_vertices` and `regularize_flaps` on the host, and the part of `shape_gradient` that gathers
//! their results.

use crate::constants as c;
use crate::fit::device::arithmetic::{Vec3, add, cross, dot, length, over, scale, strided_sum, sub};
use crate::fit::device::plan::FitPlan;
use crate::fit::device::tables::Tables;

/// The constants of the kernels: the ε of the official code, and the least length of a normal.
const EPSILON: f32 = 1e-6;
const LEAST: f32 = 1e-18;

#[derive(Clone, Copy, Default)]
struct VertexPenalty {
    /// (p - mean of the neighbours) / their number.
    share: Vec3,
    square: f32,
    edge_gradient: Vec3,
    edge_value: f32,
}

#[derive(Clone, Copy, Default)]
struct FlapGradient {
    by: [Vec3; 4],
    flatten: f32,
    normals: f32,
}

/// The regularizers' values and gradients.
pub struct Penalties {
    vertices: Vec<VertexPenalty>,
    flaps: Vec<FlapGradient>,
}

fn row(table: &[u32], i: usize) -> &[u32] {
    &table[table[i] as usize..table[i + 1] as usize]
}

impl Penalties {
    pub fn of(plan: &FitPlan, tables: &Tables, positions: &[Vec3]) -> Self {
        let count = if plan.vertex_penalties() { positions.len() } else { 0 };
        let flaps = if plan.flap_penalties() { &tables.flaps[..] } else { &[] };
        Self {
            vertices: (0..count).map(|i| vertex(plan, tables, positions, i)).collect(),
            flaps: flaps.iter().map(|flap| self::flap(plan, positions, *flap)).collect(),
        }
    }

    /// The penalties Laplacian, flatten, edge length and normals, in the summation order of `loss_record`.
    pub fn values(&self, plan: &FitPlan) -> [f32; 4] {
        let vertices = &self.vertices;
        let [laplacian, edges] = strided_sum(vertices.len(), |i| [vertices[i].square, vertices[i].edge_value]);
        let [flatten, normals] = strided_sum(self.flaps.len(), |i| [self.flaps[i].flatten, self.flaps[i].normals]);
        [laplacian, flatten, edges * edge_share(plan), normals]
    }

    /// The gradient of the image losses by positions, plus those of the regularizers.
    pub fn gathered(&self, plan: &FitPlan, tables: &Tables, images: &[Vec3]) -> Vec<Vec3> {
        let one = |(i, by_images): (usize, &Vec3)| {
            let mut sum = *by_images;
            if plan.has_penalty(0) {
                let neighbors = row(&tables.neighbors, i);
                let mut offset = scale(neighbors.len() as f32, self.vertices[i].share);
                neighbors.iter().for_each(|&j| offset = sub(offset, self.vertices[j as usize].share));
                sum = add(sum, scale(2.0 * plan.laplacian_weight, offset));
            }
            if plan.has_penalty(2) {
                sum = add(sum, self.vertices[i].edge_gradient);
            }
            if plan.flap_penalties() {
                for &at in row(&tables.flap_corners, i) {
                    sum = add(sum, self.flaps[at as usize / 4].by[at as usize % 4]);
                }
            }
            sum
        };
        images.iter().enumerate().map(one).collect()
    }
}

/// 1 / edges.
pub fn edge_share(plan: &FitPlan) -> f32 {
    1.0 / plan.edges.max(1) as f32
}

/// 2 × weight / edges.
pub fn edge_scale(plan: &FitPlan) -> f32 {
    2.0 * plan.edge_weight * edge_share(plan)
}

fn vertex(plan: &FitPlan, tables: &Tables, positions: &[Vec3], i: usize) -> VertexPenalty {
    let p = positions[i];
    let neighbors = row(&tables.neighbors, i);
    let (mut sum, mut edges, mut edge_value) = ([0.0; 3], [0.0; 3], 0.0);
    for &j in neighbors {
        let q = positions[j as usize];
        sum = add(sum, q);
        if plan.has_penalty(2) {
            let edge = sub(p, q);
            let size = length(edge);
            let factor = if size > 0.0 { 1.0 - plan.edge_target / size } else { 0.0 };
            let off = size - plan.edge_target;
            edges = add(edges, scale(factor, edge));
            edge_value += if j as usize > i { off * off } else { 0.0 };
        }
    }
    let one = (neighbors.len() as f32).max(1.0);
    let offset = if neighbors.is_empty() { [0.0; 3] } else { sub(p, over(sum, one)) };
    VertexPenalty {
        share: over(offset, one),
        square: dot(offset, offset),
        edge_gradient: scale(edge_scale(plan), edges),
        edge_value,
    }
}

struct Side {
    edge_square: f32,
    edge_length: f32,
    wing_length: f32,
    cosine: f32,
    sine: f32,
    foot: f32,
    across: Vec3,
    size: f32,
}

impl Side {
    fn of(edge: Vec3, wing: Vec3) -> Self {
        let edge_square = dot(edge, edge) + EPSILON;
        let edge_length = edge_square.sqrt();
        let wing_length = (dot(wing, wing) + EPSILON).sqrt();
        let along = dot(edge, wing);
        let cosine = along / (edge_length * wing_length + EPSILON);
        let sine = (1.0 - cosine * cosine + EPSILON).sqrt();
        let foot = along / edge_square;
        let across = sub(wing, scale(foot, edge));
        Self { edge_square, edge_length, wing_length, cosine, sine, foot, across, size: wing_length * sine }
    }

    fn pull(&self, edge: Vec3, wing: Vec3, by_across: Vec3, by_size: f32) -> (Vec3, Vec3) {
        let by_foot = -dot(by_across, edge);
        let by_cosine = -(by_size * self.wing_length * self.cosine / self.sine);
        let product = self.edge_length * self.wing_length + EPSILON;
        let by_product = -(by_cosine * self.cosine / product);
        let by_along = by_cosine / product + by_foot / self.edge_square;
        let by_edge_square =
            by_product * self.wing_length / (2.0 * self.edge_length) - by_foot * self.foot / self.edge_square;
        let by_wing_length = by_size * self.sine + by_product * self.edge_length;
        let by_edge = add(scale(2.0 * by_edge_square, edge), scale(by_along, wing));
        let by_edge = sub(by_edge, scale(self.foot, by_across));
        let by_wing = add(scale(by_wing_length / self.wing_length, wing), scale(by_along, edge));
        (by_edge, add(by_wing, by_across))
    }
}

fn flap(plan: &FitPlan, positions: &[Vec3], words: [u32; 4]) -> FlapGradient {
    let [origin, end, wing0, wing1] =
        [words[0] & c::FLAP_VERTEX, words[1], words[2], words[3]].map(|i| positions[i as usize]);
    let (edge, wings) = (sub(end, origin), [sub(wing0, origin), sub(wing1, origin)]);
    let mut found = FlapGradient::default();
    let (mut by_edge, mut by_wings) = ([0.0; 3], [[0.0; 3]; 2]);
    if plan.has_penalty(1) {
        let [one, two] = wings.map(|wing| Side::of(edge, wing));
        let lengths = one.size * two.size + EPSILON;
        let cosine = dot(one.across, two.across) / lengths;
        let rise = cosine + 1.0;
        let counts = words[0] & c::FLAP_OFFICIAL != 0;
        found.flatten = if counts { rise * rise } else { 0.0 };
        let by_dot = if counts { 2.0 * plan.flatten_weight * rise / lengths } else { 0.0 };
        let by_lengths = -(by_dot * cosine);
        for (k, (side, other)) in [(&one, &two), (&two, &one)].into_iter().enumerate() {
            let (part, by_wing) = side.pull(edge, wings[k], scale(by_dot, other.across), by_lengths * other.size);
            by_edge = add(by_edge, part);
            by_wings[k] = by_wing;
        }
    }
    if plan.has_penalty(3) {
        let signs = [c::FLAP_FIRST_ALONG, c::FLAP_SECOND_ALONG].map(|b| if words[0] & b != 0 { 1.0 } else { -1.0 });
        let areas = [0, 1].map(|k| scale(signs[k], cross(edge, wings[k])));
        let sizes = areas.map(length);
        let counts = sizes[0] > LEAST && sizes[1] > LEAST;
        let sizes = sizes.map(|size| if counts { size } else { 1.0 });
        let [n, m] = [0, 1].map(|k| over(areas[k], sizes[k]));
        let cosine = dot(n, m);
        found.normals = if counts { 1.0 - cosine } else { 0.0 };
        let weight = if counts { plan.normal_weight } else { 0.0 };
        let by_areas = [(n, m), (m, n)].map(|(own, other)| sub(scale(cosine, own), other));
        let by_areas = [0, 1].map(|k| scale(weight * signs[k], over(by_areas[k], sizes[k])));
        for k in 0..2 {
            by_edge = add(by_edge, cross(wings[k], by_areas[k]));
            by_wings[k] = add(by_wings[k], cross(by_areas[k], edge));
        }
    }
    let by_origin = add(add(by_edge, by_wings[0]), by_wings[1]).map(|x| -x);
    found.by = [by_origin, by_edge, by_wings[0], by_wings[1]];
    found
}
