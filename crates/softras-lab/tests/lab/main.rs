//! The laboratory: some hundred scenes drawn to hurt and the least scenes of what they have found; `eval`.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../../../../tests/common/mod.rs"]
mod common;
mod drawn;
mod eval;
mod found;
#[allow(dead_code, reason = "shared with the tests of files")]
#[path = "../../../softras-io/tests/io/numpy.rs"]
mod numpy;
mod official;
#[path = "../../../../tests/official/mod.rs"]
mod official_equations;
mod program;
