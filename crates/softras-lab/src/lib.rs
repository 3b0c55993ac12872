//! What softras is measured and tested with, by the command, the benchmarks and the tests.
//!
//! [`check`] compares a device with the f64 reference on small scenes. [`stress`] draws random scenes and checks what softras
//! promises of every scene. [`measure`] times frames and compares them with the least possible time and with the f64 reference.
//! [`gradients`] brings a device's gradients into the reference's layout. [`random`] generates all random numbers.
//!
//! The program of this package renders archives of arrays: `cargo run --release -p softras-lab -- eval --help`.

pub mod check;
pub mod gradients;
pub mod measure;
pub mod random;
pub mod stress;
