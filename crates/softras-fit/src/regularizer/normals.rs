//! The normal consistency loss Σ (1 - n·m) over edges, n and m the unit normals of the two triangles there. Edges of a
//! triangle without area are left out.

use crate::topology::Topology;
use glam::DVec3;

/// A triangle counts as one without area if the length of its normal, twice the area, is at most this.
const LEAST: f64 = 1e-30;

pub fn add(topology: &Topology, positions: &[DVec3], weight: f64, gradient: &mut [DVec3]) -> f64 {
    let corners = |t: &[u32; 3]| t.map(|i| positions[i as usize]);
    let normal_of = |t: &[u32; 3]| {
        let [a, b, c] = corners(t);
        let normal = (b - a).cross(c - a);
        let length = normal.length();
        if length > LEAST { (normal / length, length) } else { (DVec3::ZERO, 0.0) }
    };
    let normals: Vec<(DVec3, f64)> = topology.triangles().iter().map(normal_of).collect();
    let mut by_unit = vec![DVec3::ZERO; normals.len()];
    let mut sum = 0.0;
    for flap in topology.flaps() {
        let [t, u] = flap.triangles.map(|t| t as usize);
        let ((n, n_length), (m, m_length)) = (normals[t], normals[u]);
        if n_length > 0.0 && m_length > 0.0 {
            sum += 1.0 - n.dot(m);
            by_unit[t] -= weight * m;
            by_unit[u] -= weight * n;
        }
    }
    for ((triangle, (normal, length)), by_unit) in topology.triangles().iter().zip(&normals).zip(by_unit) {
        if *length == 0.0 {
            continue;
        }
        let [a, b, c] = corners(triangle);
        let by_normal = (by_unit - normal * normal.dot(by_unit)) / *length;
        let (by_b, by_c) = ((c - a).cross(by_normal), by_normal.cross(b - a));
        let [a, b, c] = triangle.map(|i| i as usize);
        gradient[b] += by_b;
        gradient[c] += by_c;
        gradient[a] -= by_b + by_c;
    }
    sum
}
