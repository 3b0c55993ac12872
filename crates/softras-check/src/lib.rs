//! Checks a device against the f64 reference of the soft rasterizer softras, and measures its speed. The commands `softras check`,
//! `softras bench` and `softras stress` print what this crate finds.
//!
//! [`check`] compares a device with the f64 reference on small scenes. [`stress`] draws random scenes and checks what softras
//! promises of every scene. [`measure`] times frames and compares them with the least possible time and with the f64 reference.
//! [`agreement`] says how far gradients are from the reference's, [`gradients`] brings upstream gradients into its form, and
//! [`random`] generates all random numbers.
//!
//! ```
//! use softras_check::check::{cases, compare};
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
