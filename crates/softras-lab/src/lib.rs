//! What softras is measured and tested with, by the command, the benchmarks and the tests.
//!
//! [`check`] compares a device with the f64 reference on small scenes. [`stress`] draws random scenes and checks what softras
//! promises of every scene. [`measure`] times frames and compares them with the least possible time and with the f64 reference.
//! [`agreement`] says how far gradients are from the reference's, [`gradients`] brings upstream gradients into its form, and
//! [`random`] generates all random numbers.
//!
//! The program of this package renders archives of arrays: `cargo run --release -p softras-lab -- eval --help`.
//!
//! ```
//! use softras_lab::check::{cases, compare};
//!
//! # fn main() -> softras::Result<()> {
//! let mut renderer = softras::Renderer::new()?;
//! let case = &cases()?[0];
//! let found = compare(&mut renderer, case)?;
//! assert!(found.pass(case.gradient_tolerance), "{}: {:?}", case.name, found.images);
//! # Ok(())
//! # }
//! ```

pub mod agreement;
pub mod check;
pub mod gradients;
pub mod measure;
pub mod random;
pub mod stress;
