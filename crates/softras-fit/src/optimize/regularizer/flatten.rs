//! The official flatten loss: the angle at an edge a from v0 to v1 is that between the components perpendicular to a of
//! the vectors b from v0 to the third vertex of each of the two triangles. Its ε = 1e-6 stand where the official code
//! has them.

use crate::mesh::topology::Topology;
use glam::DVec3;

const EPSILON: f64 = 1e-6;

pub fn add(topology: &Topology, positions: &[DVec3], weight: f64, gradient: &mut [DVec3]) -> f64 {
    let mut sum = 0.0;
    for flap in topology.flaps().iter().filter(|flap| flap.official) {
        let [i0, i1, i2, i3] = [flap.edge[0], flap.edge[1], flap.opposite[0], flap.opposite[1]].map(|i| i as usize);
        let edge = positions[i1] - positions[i0];
        let sides = [i2, i3].map(|i| Side::new(edge, positions[i] - positions[i0]));
        let [one, two] = &sides;
        let (dot, lengths) = (one.across.dot(two.across), one.length * two.length + EPSILON);
        let cosine = dot / lengths;
        sum += (cosine + 1.0).powi(2);
        let by_dot = 2.0 * weight * (cosine + 1.0) / lengths;
        let by_lengths = -by_dot * cosine;
        for (side, other, third) in [(one, two, i2), (two, one, i3)] {
            let (by_edge, by_wing) = side.pull(by_dot * other.across, by_lengths * other.length);
            gradient[i1] += by_edge;
            gradient[third] += by_wing;
            gradient[i0] -= by_edge + by_wing;
        }
    }
    sum
}

/// One of the two triangles at an edge; its wing is the vector from v0 to the third vertex.
struct Side {
    edge: DVec3,
    wing: DVec3,
    /// Square of the edge's length, plus ε.
    edge_square: f64,
    edge_length: f64,
    wing_length: f64,
    cosine: f64,
    sine: f64,
    /// Where the wing's projection onto the edge ends, in edge lengths.
    foot: f64,
    /// The component of the wing perpendicular to the edge.
    across: DVec3,
    /// The length of `across`, computed from the sine as in the official code.
    length: f64,
}

impl Side {
    fn new(edge: DVec3, wing: DVec3) -> Self {
        let edge_square = edge.length_squared() + EPSILON;
        let (edge_length, wing_length) = (edge_square.sqrt(), (wing.length_squared() + EPSILON).sqrt());
        let along = edge.dot(wing);
        let cosine = along / (edge_length * wing_length + EPSILON);
        let sine = (1.0 - cosine * cosine + EPSILON).sqrt();
        let foot = along / edge_square;
        let across = wing - foot * edge;
        let length = wing_length * sine;
        Self { edge, wing, edge_square, edge_length, wing_length, cosine, sine, foot, across, length }
    }

    /// From dL by `across` and `length` to dL by edge and wing.
    fn pull(&self, by_across: DVec3, by_length: f64) -> (DVec3, DVec3) {
        let by_foot = -by_across.dot(self.edge);
        let by_cosine = -by_length * self.wing_length * self.cosine / self.sine;
        let product = self.edge_length * self.wing_length + EPSILON;
        let by_product = -by_cosine * self.cosine / product;
        let by_along = by_cosine / product + by_foot / self.edge_square;
        let by_edge_square =
            -by_foot * self.foot / self.edge_square + by_product * self.wing_length / (2.0 * self.edge_length);
        let by_wing_length = by_length * self.sine + by_product * self.edge_length;
        let by_edge = 2.0 * by_edge_square * self.edge + by_along * self.wing - self.foot * by_across;
        let by_wing = by_wing_length / self.wing_length * self.wing + by_along * self.edge + by_across;
        (by_edge, by_wing)
    }
}
