//! The normal consistency loss Σ (1 - n·m) over edges and pairs of triangles there, n and m their unit normals. Pairs with a triangle
//! without area are left out.

use crate::mesh::topology::Topology;
use glam::DVec3;

pub fn add(topology: &Topology, positions: &[DVec3], weight: f64, gradient: &mut [DVec3]) -> f64 {
    let corners = |t: &[u32; 3]| t.map(|i| positions[i as usize]);
    let normal_of = |t: &[u32; 3]| {
        let [a, b, c] = corners(t);
        let normal = (b - a).cross(c - a);
        let length = normal.length();
        if length.is_normal() { (normal / length, length) } else { (DVec3::ZERO, 0.0) }
    };
    let normals: Vec<(DVec3, f64)> = topology.triangles().iter().map(normal_of).collect();
    // Whether a triangle runs along an edge from its lower vertex to its upper one.
    let along = |t: usize, edge: [u32; 2]| {
        let [a, b, c] = topology.triangles()[t];
        [[a, b], [b, c], [c, a]].contains(&edge)
    };
    let mut by_unit = vec![DVec3::ZERO; normals.len()];
    let mut sum = 0.0;
    for flap in topology.flaps() {
        let [t, u] = flap.triangles.map(|t| t as usize);
        let ((n, n_length), (m, m_length)) = (normals[t], normals[u]);
        if n_length > 0.0 && m_length > 0.0 {
            // Triangles that run along their edge the same way have their normals on different sides.
            let sign = if along(t, flap.edge) == along(u, flap.edge) { -1.0 } else { 1.0 };
            sum += 1.0 - sign * n.dot(m);
            by_unit[t] -= sign * weight * m;
            by_unit[u] -= sign * weight * n;
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
