//! The smallest sphere around points. It turns and moves with them, unlike a sphere around their box.

use glam::{DMat3, DVec3};

/// The most spheres that are tried; each is larger than the one before, and some twenty are enough.
const MAX_ROUNDS: usize = 200;
/// A sphere holds a point that lies at most this share of the radius outside of it.
const SLACK: f64 = 1e-10;

/// The centre and radius of the smallest sphere that holds all points; `None` without points.
///
/// The sphere is determined by two to four of the points. In each round the point that lies farthest outside joins them, and
/// those that still determine the sphere of all of these stay.
pub fn enclosing(points: impl Iterator<Item = DVec3> + Clone) -> Option<(DVec3, f64)> {
    let mut support = vec![points.clone().next()?];
    let (mut center, mut radius) = (support[0], 0.0);
    let farthest =
        |center: DVec3| points.clone().map(|p| (p.distance_squared(center), p)).max_by(|a, b| a.0.total_cmp(&b.0));
    for _ in 0..MAX_ROUNDS {
        let (square, point) = farthest(center)?;
        if square.sqrt() <= radius * (1.0 + SLACK) {
            break;
        }
        support.push(point);
        let Some((sphere, chosen)) = smallest(&support) else { break };
        if sphere.1 <= radius {
            break;
        }
        ((center, radius), support) = (sphere, chosen);
    }
    // The radius also holds points that rounding left outside.
    farthest(center).map(|(square, _)| (center, square.sqrt()))
}

/// The smallest sphere through some of at most five points that holds the others, and the points that it goes through.
fn smallest(points: &[DVec3]) -> Option<((DVec3, f64), Vec<DVec3>)> {
    let mut best: Option<((DVec3, f64), Vec<DVec3>)> = None;
    for subset in 1u32..1 << points.len() {
        let some: Vec<DVec3> = (0..points.len()).filter(|i| subset >> i & 1 == 1).map(|i| points[i]).collect();
        let Some((center, radius)) = through(&some) else { continue };
        let holds = points.iter().all(|p| p.distance(center) <= radius * (1.0 + SLACK));
        if holds && best.as_ref().is_none_or(|best| radius < best.0.1) {
            best = Some(((center, radius), some));
        }
    }
    best
}

/// The smallest sphere through at most four points; `None` where they lie on a line or plane that has none.
fn through(points: &[DVec3]) -> Option<(DVec3, f64)> {
    let [first, rest @ ..] = points else { return None };
    // The centre is the first point plus a sum of the edges from it, equally far from all points.
    let edges: Vec<DVec3> = rest.iter().map(|p| *p - *first).collect();
    let offset = match edges[..] {
        [] => DVec3::ZERO,
        [a] => a / 2.0,
        [a, b] => {
            let normal = a.cross(b);
            let square = normal.length_squared();
            (a.length_squared() * b.cross(normal) + b.length_squared() * normal.cross(a)) / (2.0 * square)
        }
        [a, b, c] => {
            let squares = DVec3::new(a.length_squared(), b.length_squared(), c.length_squared());
            DMat3::from_cols(a, b, c).transpose().inverse() * squares / 2.0
        }
        _ => return None,
    };
    let center = *first + offset;
    let radius = points.iter().map(|p| p.distance(center)).fold(0.0, f64::max);
    (center.is_finite() && radius.is_finite()).then_some((center, radius))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use glam::DQuat;
    use softras_check::random::Random;

    fn of(points: &[DVec3]) -> (DVec3, f64) {
        enclosing(points.iter().copied()).unwrap()
    }

    #[test]
    fn it_is_the_smallest_that_holds_all() {
        assert!(enclosing(std::iter::empty()).is_none());
        assert_eq!(of(&[DVec3::X; 3]), (DVec3::X, 0.0));
        let corners: Vec<DVec3> =
            (0..8).map(|i| [i & 1, i >> 1 & 1, i >> 2 & 1].map(f64::from)).map(DVec3::from).collect();
        let (center, radius) = of(&corners);
        assert!(center.distance(DVec3::splat(0.5)) < 1e-9 && (radius - 0.75f64.sqrt()).abs() < 1e-9);
        // A flat triangle with an obtuse angle: its longest side is a diameter.
        let (center, radius) = of(&[DVec3::ZERO, DVec3::X * 4.0, DVec3::new(2.0, 0.5, 0.0)]);
        assert!(center.distance(DVec3::X * 2.0) < 1e-9 && (radius - 2.0).abs() < 1e-9);
        let mut random = Random::new(7);
        for count in [4, 50, 3000] {
            let points: Vec<DVec3> =
                (0..count).map(|_| random.rotation() * DVec3::X * random.range(0.0, 1.0)).collect();
            let (center, radius) = of(&points);
            assert!(points.iter().all(|p| p.distance(center) <= radius));
            // No centre nearby does better.
            for _ in 0..100 {
                let other = center + 1e-3 * (random.rotation() * DVec3::X);
                let its = points.iter().map(|p| p.distance(other)).fold(0.0, f64::max);
                assert!(its > radius, "{its} {radius}");
            }
        }
    }

    #[test]
    fn it_turns_with_the_points() {
        let mut random = Random::new(3);
        let points: Vec<DVec3> = (0..200)
            .map(|i| DVec3::new(random.range(0.0, 1.0), 3.0 * random.range(0.0, 1.0), f64::from(i) / 50.0))
            .collect();
        let (center, radius) = of(&points);
        for _ in 0..20 {
            let turn: DQuat = random.rotation();
            let turned: Vec<DVec3> = points.iter().map(|p| turn * (*p - center) + center).collect();
            let (its_center, its_radius) = of(&turned);
            assert!(its_center.distance(center) < 1e-9 && (its_radius - radius).abs() < 1e-9);
        }
    }
}
