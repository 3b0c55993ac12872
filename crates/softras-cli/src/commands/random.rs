//! Random numbers that are the same everywhere, from a seed that the user gives.

use glam::DQuat;

/// SplitMix64 (Steele et al. 2014).
pub struct Random(u64);

impl Random {
    /// The sequence of a seed.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// In [0, 1).
    pub fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// In [low, high).
    pub fn range(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }

    /// Evenly among all rotations (Shoemake 1992).
    pub fn rotation(&mut self) -> DQuat {
        let [u, a, b] = [self.next(), std::f64::consts::TAU * self.next(), std::f64::consts::TAU * self.next()];
        let (r, q) = ((1.0 - u).sqrt(), u.sqrt());
        DQuat::from_xyzw(r * a.sin(), r * a.cos(), q * b.sin(), q * b.cos())
    }
}
