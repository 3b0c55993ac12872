//! What softras is measured and tested with, by the command, the benchmarks and the tests.
//!
//! [`articulated`] fits the pose of a jointed figure, an experiment of the paper. [`measure`] times frames and compares them
//! with the least possible time and with the f64 reference. [`stress`] draws random scenes and checks what softras promises
//! of every scene. [`random`] generates all random numbers.

pub mod articulated;
pub mod measure;
pub mod random;
pub mod stress;
