//! Rigid motions of the camera by six numbers: ξ = (v, ω) stands for exp(ξ), and a point p moves by ω × p + v to first order.

use softras::glam::{DMat3, DMat4, DVec3};

/// Terms of a series: for rotations up to 2π the first that is left out is below 1e-12 of the sum.
const TERMS: u32 = 40;

/// The matrix M with M p = ω × p.
fn cross(w: DVec3) -> DMat3 {
    DMat3::from_cols(DVec3::new(0.0, w.z, -w.y), DVec3::new(-w.z, 0.0, w.x), DVec3::new(w.y, -w.x, 0.0))
}

/// exp(ξ) as a matrix on homogeneous points: Σ ξ̂ⁿ / n!.
pub fn exponential(twist: [f64; 6]) -> DMat4 {
    let [v, w] = halves(twist);
    let mut generator = DMat4::from_mat3(cross(w));
    generator.w_axis = v.extend(0.0);
    let (mut sum, mut term) = (DMat4::IDENTITY, DMat4::IDENTITY);
    for n in 1..TERMS {
        term = generator * term * (1.0 / f64::from(n));
        sum += term;
    }
    sum
}

/// The derivative of a loss by ξ, from the one by a further motion δ in exp(δ) exp(ξ): Jᵀ δ with the left Jacobian
/// J = Σ ad(ξ)ⁿ / (n + 1)!, where ad(ξ) (a, b) = (ω × a + v × b, ω × b).
pub fn pull_back(twist: [f64; 6], by_motion: [f64; 6]) -> [f64; 6] {
    let [v, w] = halves(twist);
    let [mut a, mut b] = halves(by_motion);
    let [mut sum_a, mut sum_b] = [a, b];
    for n in 1..TERMS {
        // The transpose of ad(ξ): a cross product's matrix is antisymmetric.
        let next = [-w.cross(a), -v.cross(a) - w.cross(b)];
        [a, b] = next.map(|x| x / f64::from(n + 1));
        sum_a += a;
        sum_b += b;
    }
    [sum_a.x, sum_a.y, sum_a.z, sum_b.x, sum_b.y, sum_b.z]
}

fn halves([a, b, c, d, e, f]: [f64; 6]) -> [DVec3; 2] {
    [DVec3::new(a, b, c), DVec3::new(d, e, f)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rotation_is_one_of_its_angle() {
        let turned = exponential([0.0, 0.0, 0.0, 0.0, 0.0, 2.0]).transform_point3(DVec3::X);
        assert!((turned - DVec3::new(2f64.cos(), 2f64.sin(), 0.0)).length() < 1e-14, "{turned}");
        let moved = exponential([1.0, 2.0, 3.0, 0.0, 0.0, 0.0]).transform_point3(DVec3::X);
        assert_eq!(moved, DVec3::new(2.0, 2.0, 3.0));
    }

    #[test]
    fn the_pulled_back_gradient_is_that_of_differences() {
        let (twist, point, weight) =
            ([0.4, -0.3, 0.8, 1.1, -0.7, 0.5], DVec3::new(0.3, -0.8, 0.6), DVec3::new(1.0, 2.0, -1.5));
        let loss = |twist: [f64; 6]| exponential(twist).transform_point3(point).dot(weight);
        let moved = exponential(twist).transform_point3(point);
        let by_rotation = moved.cross(weight);
        let by_motion = [weight.x, weight.y, weight.z, by_rotation.x, by_rotation.y, by_rotation.z];
        let gradient = pull_back(twist, by_motion);
        for i in 0..6 {
            let at = |step: f64| {
                let mut twist = twist;
                twist[i] += step;
                loss(twist)
            };
            let difference = (at(1e-5) - at(-1e-5)) / 2e-5;
            assert!((difference - gradient[i]).abs() < 1e-8, "{i}: {difference} and {}", gradient[i]);
        }
    }
}
