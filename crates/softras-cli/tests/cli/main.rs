//! Tests of the `softras` command: arguments, exit codes, files.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod arguments;
mod bench;
mod benchmark;
mod command;
mod each;
mod eval;
mod fit;
mod full;
mod gradient;
mod hollow;
mod hostile;
mod killed;
mod memory;
mod mistakes;
mod numpy;
mod official;
#[path = "../../../../tests/official/mod.rs"]
mod official_equations;
mod parts;
mod pose;
mod readme;
mod render;
mod stress;
mod topology;
mod transparency;
mod views;

use command::{fails, softras, succeeds};
