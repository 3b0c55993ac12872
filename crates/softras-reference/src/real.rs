//! The number type that the reference is generic over: `f64` for images, a number recorded on a tape for gradients.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// A number that may carry derivatives; comparisons and branches look at [`Real::value`] alone.
pub trait Real:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// A number without derivatives.
    fn constant(value: f64) -> Self;

    /// Its value.
    fn value(self) -> f64;

    /// f(self), given the value of f and of f' there.
    fn unary(self, value: f64, derivative: f64) -> Self;

    fn zero() -> Self {
        Self::constant(0.0)
    }

    fn one() -> Self {
        Self::constant(1.0)
    }

    /// This value, treated as a constant.
    fn detach(self) -> Self {
        Self::constant(self.value())
    }

    /// self · factor.
    fn scale(self, factor: f64) -> Self {
        self.unary(self.value() * factor, factor)
    }

    /// self + term.
    fn shift(self, term: f64) -> Self {
        self.unary(self.value() + term, 1.0)
    }

    /// self².
    fn square(self) -> Self {
        self.unary(self.value() * self.value(), 2.0 * self.value())
    }

    /// 1 / self.
    fn recip(self) -> Self {
        let value = 1.0 / self.value();
        self.unary(value, -value * value)
    }

    /// Square root; the caller keeps away from 0, where there is no derivative.
    fn sqrt(self) -> Self {
        let value = self.value().sqrt();
        self.unary(value, 0.5 / value)
    }

    fn tan(self) -> Self {
        let value = self.value().tan();
        self.unary(value, 1.0 + value * value)
    }

    /// e^self.
    fn exp(self) -> Self {
        let value = self.value().exp();
        self.unary(value, value)
    }

    /// e^self - 1 without cancellation.
    fn exp_m1(self) -> Self {
        self.unary(self.value().exp_m1(), self.value().exp())
    }

    /// ln(1 + e^self) without overflow: -log(1 - D) for the logit of D.
    fn softplus(self) -> Self {
        let x = self.value();
        self.unary(x.max(0.0) + (-x.abs()).exp().ln_1p(), logistic(x))
    }

    /// D = 1 / (1 + e^-self).
    fn logistic(self) -> Self {
        let x = self.value();
        self.unary(logistic(x), logistic(x) * logistic(-x))
    }

    /// self limited to [low, high]; constant beyond.
    fn clamp(self, low: f64, high: f64) -> Self {
        if self.value() < low {
            Self::constant(low)
        } else if self.value() > high {
            Self::constant(high)
        } else {
            self
        }
    }
}

fn logistic(x: f64) -> f64 {
    if x >= 0.0 { 1.0 / (1.0 + (-x).exp()) } else { x.exp() / (1.0 + x.exp()) }
}

impl Real for f64 {
    fn constant(value: f64) -> Self {
        value
    }
    fn value(self) -> f64 {
        self
    }
    fn unary(self, value: f64, _derivative: f64) -> Self {
        value
    }
}

/// Σ aₖ bₖ.
pub fn dot<R: Real, const N: usize>(a: [R; N], b: [R; N]) -> R {
    (0..N).fold(R::zero(), |sum, k| sum + a[k] * b[k])
}

/// a + b.
pub fn add<R: Real, const N: usize>(a: [R; N], b: [R; N]) -> [R; N] {
    std::array::from_fn(|k| a[k] + b[k])
}

/// a - b.
pub fn sub<R: Real, const N: usize>(a: [R; N], b: [R; N]) -> [R; N] {
    std::array::from_fn(|k| a[k] - b[k])
}

/// a · s.
pub fn scale<R: Real, const N: usize>(a: [R; N], s: R) -> [R; N] {
    a.map(|x| x * s)
}

/// The product, element by element.
pub fn multiply<R: Real, const N: usize>(a: [R; N], b: [R; N]) -> [R; N] {
    std::array::from_fn(|k| a[k] * b[k])
}

/// a + t (b - a).
pub fn lerp<R: Real, const N: usize>(a: [R; N], b: [R; N], t: R) -> [R; N] {
    std::array::from_fn(|k| a[k] + t * (b[k] - a[k]))
}

/// Σ weightₖ pointₖ over a triangle's three corners.
pub fn blend<R: Real, const N: usize>(weights: [R; 3], points: [[R; N]; 3]) -> [R; N] {
    std::array::from_fn(|c| weights[0] * points[0][c] + weights[1] * points[1][c] + weights[2] * points[2][c])
}

/// a × b in space.
pub fn cross<R: Real>(a: [R; 3], b: [R; 3]) -> [R; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// a × b in the plane: twice the signed area between them.
pub fn cross2<R: Real>(a: [R; 2], b: [R; 2]) -> R {
    a[0] * b[1] - a[1] * b[0]
}

/// a / |a|; zero, without derivative, where a is zero.
pub fn normalize<R: Real>(a: [R; 3]) -> [R; 3] {
    let squared = dot(a, a);
    if squared.value() > 0.0 { scale(a, squared.sqrt().recip()) } else { [R::zero(); 3] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stable_forms_hold_at_both_ends() {
        assert_eq!((-800.0f64).softplus(), 0.0);
        assert_eq!(800.0f64.softplus(), 800.0);
        assert_eq!(Real::softplus(f64::INFINITY), f64::INFINITY);
        assert!((0.0f64.softplus() - 2f64.ln()).abs() < 1e-16);
        assert!((Real::logistic(-40.0f64) - (-40f64).exp()).abs() < 1e-30);
        assert_eq!(Real::logistic(-800.0f64), 0.0);
    }

    #[test]
    fn the_zero_vector_has_no_direction() {
        assert_eq!(normalize([0.0; 3]), [0.0; 3]);
        assert_eq!(normalize([0.0, 3.0, 4.0]).map(|x| (x * 1e12).round()), [0.0, 6e11, 8e11]);
    }
}
