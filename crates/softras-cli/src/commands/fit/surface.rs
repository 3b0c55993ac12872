//! The distance between two surfaces by points drawn evenly from both.

use glam::DVec3;
use softras::Mesh;
use softras_lab::random::Random;

/// Points drawn from each surface.
const POINTS: usize = 30_000;

/// The Chamfer distance: the mean of the distances from points of each surface to the nearest of the other's, the mean of
/// both ways, as a share of the diagonal of the second mesh's bounding box. The same meshes always give the same number. Since
/// the points are finitely many it is not 0 for a surface and itself.
pub fn chamfer(a: &Mesh, b: &Mesh) -> f64 {
    let [of_a, of_b] = [points(a, 1), points(b, 2)];
    let (low, high) = b.bounds().unwrap_or_default();
    let diagonal = DVec3::from(high.map(f64::from)).distance(DVec3::from(low.map(f64::from)));
    0.5 * (mean_distance(&of_a, &of_b) + mean_distance(&of_b, &of_a)) / diagonal
}

/// Points of a surface, one in each of as many shares of equal area, sorted by x.
fn points(mesh: &Mesh, seed: u64) -> Vec<DVec3> {
    let corners = |t: &[u32; 3]| t.map(|v| DVec3::from(mesh.positions()[v as usize].map(f64::from)));
    let area = |t: &[u32; 3]| {
        let [a, b, c] = corners(t);
        0.5 * (b - a).cross(c - a).length()
    };
    let whole: f64 = mesh.triangles().iter().map(area).sum();
    let mut random = Random::new(seed);
    let (mut points, mut passed) = (Vec::with_capacity(POINTS), 0.0);
    for triangle in mesh.triangles() {
        passed += area(triangle);
        let [a, b, c] = corners(triangle);
        while (points.len() as f64) < (POINTS as f64 * passed / whole).round() {
            let (across, along) = (random.range(0.0, 1.0).sqrt(), random.range(0.0, 1.0));
            points.push(a.lerp(b.lerp(c, along), across));
        }
    }
    points.sort_by(|a, b| a.x.total_cmp(&b.x));
    points
}

/// The mean distance from points to the nearest of others, which are sorted by x.
fn mean_distance(from: &[DVec3], to: &[DVec3]) -> f64 {
    let nearest = |p: &DVec3| {
        let at = to.partition_point(|q| q.x < p.x);
        let mut best = f64::INFINITY;
        let mut better = |q: &DVec3| {
            let near = (q.x - p.x).abs() < best;
            best = best.min(q.distance(*p));
            near
        };
        let _ = to[at..].iter().all(&mut better);
        let _ = to[..at].iter().rev().all(&mut better);
        best
    };
    from.iter().map(nearest).sum::<f64>() / from.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use softras::shapes;

    fn scaled(mesh: &Mesh, by: f32) -> softras::Result<Mesh> {
        let positions = mesh.positions().iter().map(|p| p.map(|x| by * x)).collect();
        Mesh::new(positions, mesh.triangles().to_vec())
    }

    #[test]
    fn the_distance_of_two_spheres_is_that_of_their_radii() -> softras::Result<()> {
        let ball = shapes::icosphere(4)?;
        let diagonal = 12f64.sqrt();
        let between = chamfer(&scaled(&ball, 0.8)?, &ball);
        assert!((between - 0.2 / diagonal).abs() < 2e-3, "{between}");
        let itself = chamfer(&ball, &ball);
        assert!((1e-4..4e-3).contains(&itself), "{itself}");
        // The size of both does not matter.
        let large = chamfer(&scaled(&ball, 8.0)?, &scaled(&ball, 10.0)?);
        assert!((large - between).abs() < 1e-5, "{large} and {between}");
        Ok(())
    }

    #[test]
    fn the_nearest_point_is_found() {
        let mut random = Random::new(3);
        let mut some = |count: usize| {
            let mut points: Vec<DVec3> = (0..count).map(|_| random.direction()).collect();
            points.sort_by(|a, b| a.x.total_cmp(&b.x));
            points
        };
        let (from, to) = (some(50), some(70));
        let least = |p: &DVec3| to.iter().map(|q| q.distance(*p)).fold(f64::INFINITY, f64::min);
        let expected = from.iter().map(least).sum::<f64>() / 50.0;
        assert!((mean_distance(&from, &to) - expected).abs() < 1e-12);
    }
}
