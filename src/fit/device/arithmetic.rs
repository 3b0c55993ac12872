//! The arithmetic of the fitting kernels in Rust. It repeats `glsl/common/fit.glsl`, `fit_sum.glsl`, `loss.glsl`,
//! `logit.glsl` and `moments.glsl` operation by operation, so that single precision gives the same bits.

use crate::constants as c;

pub type Vec3 = [f32; 3];

/// Invocations of a workgroup, which sums its values pairwise.
pub const GROUP: usize = c::FIT_GROUP as usize;

pub fn add(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub fn sub(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub fn scale(s: f32, a: Vec3) -> Vec3 {
    [s * a[0], s * a[1], s * a[2]]
}

pub fn over(a: Vec3, s: f32) -> Vec3 {
    [a[0] / s, a[1] / s, a[2] / s]
}

pub fn dot(a: Vec3, b: Vec3) -> f32 {
    let sum = a[0] * b[0];
    let sum = sum + a[1] * b[1];
    sum + a[2] * b[2]
}

pub fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub fn length(a: Vec3) -> f32 {
    dot(a, a).sqrt()
}

#[allow(clippy::excessive_precision, clippy::approx_constant)]
pub fn exponential(x: f32) -> f32 {
    let bounded = x.clamp(-80.0, 80.0);
    let exponent = (bounded * 1.442_695_04 + 0.5).floor();
    let fraction = bounded - exponent * 0.693_359_375;
    let fraction = fraction + exponent * 2.121_944_40e-4;
    let mut sum = 1.987_569_150_0e-4;
    for term in [1.398_199_950_7e-3, 8.333_451_907_3e-3, 4.166_579_589_4e-2, 1.666_666_545_9e-1, 5.000_000_120_1e-1_f32]
    {
        sum = sum * fraction + term;
    }
    sum *= fraction * fraction;
    sum += fraction;
    sum += 1.0;
    sum * f32::from_bits(((exponent as i32 + 127) as u32) << 23)
}

pub fn tangent(x: f32) -> f32 {
    let e = exponential(2.0 * x);
    (e - 1.0) / (e + 1.0)
}

pub fn flushed(x: f32) -> f32 {
    if x.abs() < 1.2e-38 { 0.0 } else { x }
}

/// The sum over a workgroup's lanes, pairwise.
pub fn group_sum<const N: usize>(mut lanes: [[f32; N]; GROUP]) -> [f32; N] {
    let mut width = GROUP / 2;
    while width > 0 {
        let (low, high) = lanes.split_at_mut(width);
        for (sum, other) in low.iter_mut().zip(&*high) {
            sum.iter_mut().zip(other).for_each(|(a, b)| *a += b);
        }
        width /= 2;
    }
    lanes[0]
}

/// The sum of rows by one workgroup: each lane sums every 64th row, then the lanes' sums are added pairwise.
pub fn strided_sum<const N: usize>(count: usize, row: impl Fn(usize) -> [f32; N]) -> [f32; N] {
    let mut lanes = [[0.0; N]; GROUP];
    for i in 0..count {
        let (lane, row) = (&mut lanes[i % GROUP], row(i));
        (0..N).for_each(|k| lane[k] += row[k]);
    }
    group_sum(lanes)
}

/// The terms that one value adds to the loss sums of its view.
pub fn terms(kind: u32, p: f32, t: f32, weight: f32, delta: f32) -> [f32; 2] {
    let d = p - t;
    let size = d.abs();
    match kind {
        c::LOSS_IOU => {
            let both = p * t;
            [weight * both, weight * (p + t - both)]
        }
        c::LOSS_L1 => [weight * size, 0.0],
        c::LOSS_L2 => [weight * (d * d), 0.0],
        c::LOSS_HUBER => [weight * (if size <= delta { 0.5 * d * d } else { delta * (size - 0.5 * delta) }), 0.0],
        _ => [0.0, 0.0],
    }
}

/// The derivative of a loss by the predicted value p.
pub fn slope(kind: u32, p: f32, t: f32, sums: [f32; 2], scaled_weight: f32, delta: f32) -> f32 {
    let d = p - t;
    match kind {
        c::LOSS_IOU => {
            let either = sums[1] + c::LOSS_IOU_EPSILON;
            let quotient = sums[0] / either;
            (quotient - t * (1.0 + quotient)) * (scaled_weight / either)
        }
        c::LOSS_L1 if d > 0.0 => scaled_weight,
        c::LOSS_L1 if d < 0.0 => -scaled_weight,
        c::LOSS_L2 => 2.0 * d * scaled_weight,
        c::LOSS_HUBER => d.clamp(-delta, delta) * scaled_weight,
        _ => 0.0,
    }
}

/// A view's part of a loss, from the view's sums.
pub fn value_of(kind: u32, sums: [f32; 2], scale: f32) -> f32 {
    let value = if kind == c::LOSS_IOU { 1.0 - sums[0] / (sums[1] + c::LOSS_IOU_EPSILON) } else { sums[0] };
    value * scale
}

pub struct Logit {
    pub position: f32,
    pub by_displacement: f32,
    pub by_shift: f32,
}

pub fn logit_of(odds: f32, displacement: f32, shift: f32) -> Logit {
    let side = if odds > 0.0 {
        1.0
    } else if odds < 0.0 {
        -1.0
    } else {
        0.0
    };
    let share = 1.0 / (1.0 + odds.abs() * exponential(-displacement));
    let size = if side == 0.0 { 0.0 } else { share };
    let stretch = 1.0 - side * shift;
    Logit {
        position: side * size * stretch + shift,
        by_displacement: side * stretch * size * (1.0 - size),
        by_shift: 1.0 - size,
    }
}

/// The optimiser's push constants of one step.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Rates {
    pub rate: f32,
    pub first_decay: f32,
    pub first_share: f32,
    pub first_bias: f32,
    pub second_decay: f32,
    pub second_share: f32,
    pub second_bias: f32,
    pub epsilon: f32,
}

pub fn next_first(first: Vec3, gradient: Vec3, r: &Rates) -> Vec3 {
    add(scale(r.first_decay, first), scale(r.first_share, gradient)).map(flushed)
}

pub fn next_second(second: Vec3, gradient: Vec3, r: &Rates) -> Vec3 {
    let part = scale(r.second_share, gradient);
    let square = [0, 1, 2].map(|k| part[k] * gradient[k]);
    add(scale(r.second_decay, second).map(flushed), square.map(flushed))
}

pub fn adam_step(first: Vec3, second: Vec3, r: &Rates) -> Vec3 {
    let mean = over(first, r.first_bias);
    let root = over(second, r.second_bias).map(|x| x.sqrt() + r.epsilon);
    let change = scale(r.rate, mean);
    [0, 1, 2].map(|k| change[k] / root[k])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exp_and_tanh_are_what_they_say() {
        for i in -800..=800 {
            let x = i as f32 * 0.1;
            let (e, t) = (f64::from(x).exp(), f64::from(x).tanh());
            assert!((f64::from(exponential(x)) - e).abs() < 3e-7 * e, "exp({x}) = {}", exponential(x));
            assert!((f64::from(tangent(x)) - t).abs() < 3e-7, "tanh({x}) = {}", tangent(x));
        }
        assert_eq!((exponential(0.0), tangent(0.0)), (1.0, 0.0));
    }

    #[test]
    fn sums_miss_nothing() {
        for count in [0, 1, 63, 64, 65, 1000] {
            let [sum, ones] = strided_sum(count, |i| [i as f32, 1.0]);
            assert_eq!((sum, ones), ((0..count).sum::<usize>() as f32, count as f32));
        }
    }
}
