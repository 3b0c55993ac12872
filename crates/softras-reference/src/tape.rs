//! Reverse-mode differentiation: a number that records the operations it results from.
//!
//! Each thread has one tape. To differentiate, clear it, load leaves, compute, and propagate.

use super::real::Real;
use std::cell::RefCell;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Marks a constant, and the absent parent of a unary operation.
const NONE: u32 = u32::MAX;

/// A number on this thread's tape, or a constant.
#[derive(Clone, Copy, Debug)]
pub struct Var {
    value: f64,
    node: u32,
}

/// One operation: its parents and the derivatives with respect to them.
struct Node {
    parents: [u32; 2],
    derivatives: [f64; 2],
}

/// The operations in the order of computation, and which of them are inputs.
#[derive(Default)]
struct Tape {
    nodes: Vec<Node>,
    /// (node, slot of the gradient that it belongs to).
    leaves: Vec<(u32, usize)>,
    adjoints: Vec<f64>,
}

thread_local! {
    static TAPE: RefCell<Tape> = RefCell::default();
}

/// Empties this thread's tape; numbers made before must not be used any more.
pub fn clear() {
    TAPE.with_borrow_mut(|tape| {
        tape.nodes.clear();
        tape.leaves.clear();
    });
}

/// An input, whose derivative [`propagate`] adds to `gradient[slot]`.
pub fn leaf(value: f64, slot: usize) -> Var {
    TAPE.with_borrow_mut(|tape| {
        let var = tape.push(value, [NONE; 2], [0.0; 2]);
        tape.leaves.push((var.node, slot));
        var
    })
}

/// Adds to `gradient` the derivative of Σ seed · var with respect to every leaf.
pub fn propagate(seeds: impl IntoIterator<Item = (Var, f64)>, gradient: &mut [f64]) {
    TAPE.with_borrow_mut(|tape| {
        let Tape { nodes, leaves, adjoints } = tape;
        adjoints.clear();
        adjoints.resize(nodes.len(), 0.0);
        for (var, seed) in seeds {
            if var.node != NONE {
                adjoints[var.node as usize] += seed;
            }
        }
        for (i, node) in nodes.iter().enumerate().rev() {
            let adjoint = adjoints[i];
            // A zero adjoint is skipped: times an infinite derivative it would make a NaN.
            if adjoint != 0.0 {
                for (parent, derivative) in node.parents.iter().zip(node.derivatives) {
                    if *parent != NONE {
                        adjoints[*parent as usize] += adjoint * derivative;
                    }
                }
            }
        }
        for &(node, slot) in leaves.iter() {
            gradient[slot] += adjoints[node as usize];
        }
    });
}

impl Tape {
    fn push(&mut self, value: f64, parents: [u32; 2], derivatives: [f64; 2]) -> Var {
        let node = self.nodes.len() as u32;
        self.nodes.push(Node { parents, derivatives });
        Var { value, node }
    }
}

impl Var {
    fn binary(self, other: Self, value: f64, derivatives: [f64; 2]) -> Self {
        if self.node == NONE && other.node == NONE {
            return Self::constant(value);
        }
        TAPE.with_borrow_mut(|tape| tape.push(value, [self.node, other.node], derivatives))
    }
}

impl Real for Var {
    fn constant(value: f64) -> Self {
        Self { value, node: NONE }
    }
    fn value(self) -> f64 {
        self.value
    }
    fn unary(self, value: f64, derivative: f64) -> Self {
        self.binary(Self::constant(0.0), value, [derivative, 0.0])
    }
}

impl Add for Var {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        self.binary(other, self.value + other.value, [1.0, 1.0])
    }
}

impl Sub for Var {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self.binary(other, self.value - other.value, [1.0, -1.0])
    }
}

impl Mul for Var {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        self.binary(other, self.value * other.value, [other.value, self.value])
    }
}

impl Div for Var {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        self.binary(other, value, [1.0 / other.value, -value / other.value])
    }
}

impl Neg for Var {
    type Output = Self;
    fn neg(self) -> Self {
        self.unary(-self.value, -1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// d f / d x by the tape against central differences of the same generic function.
    fn check(name: &str, f: impl Fn(Var) -> Var, g: impl Fn(f64) -> f64, x: f64) {
        clear();
        let y = f(leaf(x, 0));
        let mut gradient = [0.0];
        propagate([(y, 1.0)], &mut gradient);
        let h = 1e-5;
        let expected = (g(x + h) - g(x - h)) / (2.0 * h);
        assert!((y.value - g(x)).abs() < 1e-15, "{name}({x}): {} against {}", y.value, g(x));
        assert!(
            (gradient[0] - expected).abs() < 1e-8 * (1.0 + expected.abs()),
            "{name}'({x}): {gradient:?} {expected}"
        );
    }

    #[test]
    fn every_operation_matches_finite_differences() {
        macro_rules! check_all {
            ($($name:literal, $x:ident => $body:expr;)*) => {
                for value in [0.3, 0.9, 1.7] {
                    $(check($name, |$x: Var| $body, |$x: f64| $body, value);)*
                }
            };
        }
        check_all! {
            "add", x => x + x; "sub", x => x.exp() - x; "mul", x => x * x.exp(); "div", x => x / x.exp();
            "neg", x => -x; "scale", x => Real::scale(x, 3.0); "shift", x => x.shift(2.0);
            "square", x => x.square(); "recip", x => Real::recip(x); "sqrt", x => Real::sqrt(x);
            "tan", x => Real::tan(Real::scale(x, 0.5)); "exp_m1", x => Real::exp_m1(x);
            "softplus", x => (-x).softplus(); "logistic", x => x.logistic(); "clamp", x => Real::clamp(x, 0.5, 1.0);
        }
    }

    #[test]
    fn a_detached_number_has_no_derivative() {
        clear();
        let x = leaf(2.0, 0);
        let mut gradient = [0.0];
        propagate([(x.detach() * x, 1.0)], &mut gradient);
        assert_eq!(gradient, [2.0]);
    }
}
