//! How long edges are to be at each vertex of a surface, by its curvature.

use super::surface::ChangingMesh;
use glam::DVec3;
use std::ops::RangeInclusive;

/// How far a chord may be from the arc that it replaces, as a share of the shortest edge.
const TOLERANCE: f64 = 0.1;
/// How often normals, and then lengths, are averaged with those of the neighbours, so that the noise of a fit is not taken
/// for curvature and lengths change slowly over the surface.
const PASSES: usize = 2;

/// The length for each vertex: that of a chord that stays within a tolerance of a circle of the vertex's curvature, within
/// the range.
pub fn lengths(surface: &ChangingMesh, edges: &RangeInclusive<f64>) -> Vec<f64> {
    let (shortest, longest) = (*edges.start(), *edges.end());
    let rings: Vec<Vec<u32>> = (0..surface.positions.len() as u32).map(|v| surface.neighbors(v)).collect();
    if shortest == longest {
        return vec![longest; rings.len()];
    }
    let normals: Vec<DVec3> = (0..rings.len() as u32).map(|v| surface.normal_at(v).normalize_or_zero()).collect();
    let normals: Vec<DVec3> = averaged(normals, &rings).into_iter().map(DVec3::normalize_or_zero).collect();
    let tolerance = TOLERANCE * shortest;
    let length = |v: usize| {
        let curvature = rings[v].iter().map(|&n| curvature(surface, &normals, v, n as usize)).fold(0.0, f64::max);
        // The chord of a circle of radius 1 / curvature at the distance `tolerance` from its arc.
        let squared = 8.0 * tolerance / curvature - 4.0 * tolerance * tolerance;
        if curvature > 0.0 { squared.max(0.0).sqrt().clamp(shortest, longest) } else { longest }
    };
    // Rounding may put a mean beyond the values that it is of.
    averaged((0..rings.len()).map(length).collect(), &rings).into_iter().map(|l| l.clamp(shortest, longest)).collect()
}

/// The curvature along an edge: how much the normal turns per length.
fn curvature(surface: &ChangingMesh, normals: &[DVec3], from: usize, to: usize) -> f64 {
    let length = surface.positions[from].distance(surface.positions[to]);
    normals[from].distance(normals[to]) / length.max(f64::MIN_POSITIVE)
}

/// The mean of each value with those of the neighbours, several times.
fn averaged<T>(mut values: Vec<T>, rings: &[Vec<u32>]) -> Vec<T>
where
    T: Copy + std::ops::Add<Output = T> + std::ops::Div<f64, Output = T>,
{
    for _ in 0..PASSES {
        let mean = |(v, ring): (usize, &Vec<u32>)| {
            ring.iter().fold(values[v], |sum, &n| sum + values[n as usize]) / (1 + ring.len()) as f64
        };
        values = rings.iter().enumerate().map(mean).collect();
    }
    values
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use softras::shapes;

    #[test]
    fn lengths_follow_the_curvature() {
        // A torus whose tube is bent by 1 / 0.3 around, and a ball.
        for (mesh, radius) in [(shapes::torus(0.7, 0.3, 96, 48).unwrap(), 0.3), (shapes::icosphere(4).unwrap(), 1.0)] {
            let surface = ChangingMesh::of(&mesh).unwrap();
            let all = lengths(&surface, &(0.02..=9.0));
            let expected = (8.0f64 * 0.002 * radius).sqrt();
            let off = all.iter().map(|length| (length / expected - 1.0).abs()).fold(0.0, f64::max);
            assert!(off < 0.12, "{off} of {expected}");
            let (low, high) = (1.1 * expected, 1.3 * expected);
            assert!(lengths(&surface, &(low..=high)).iter().all(|length| (low..=high).contains(length)));
            assert!(lengths(&surface, &(high..=high)).iter().all(|length| *length == high));
        }
    }
}
