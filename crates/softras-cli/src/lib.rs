//! The library of the `softras` command: what it measures and tests with, for the benchmarks and tests as well.
//!
//! [`articulated`] fits the pose of a jointed figure, an experiment of the paper. [`measure`] times frames and compares them
//! with the least possible time and with the f64 reference. [`stress`] draws random scenes and checks what softras promises
//! of every scene. [`random`] generates all random numbers. [`part`] takes meshes
//! apart. [`npy`] reads and writes numpy arrays.

pub mod articulated;
pub mod measure;
pub mod npy;
pub mod part;
pub mod random;
pub mod stress;
