//! What the `softras` command measures and tests with, for its own benchmarks and tests as well.
//!
//! [`articulated`] fits the pose of a jointed figure, an experiment of the paper; [`measure`] times frames and holds them against their floor and their error; [`stress`] draws random scenes and checks
//! what softras promises of any scene.

pub mod articulated;
pub mod measure;
pub mod random;
pub mod stress;
