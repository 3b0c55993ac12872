//! Tests of the `softras` command: arguments, exit codes, files.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod arguments;
mod bench;
mod command;
mod fit;
mod full;
mod gradient;
mod hostile;
mod killed;
mod memory;
mod mistakes;
#[allow(dead_code, reason = "shared with the tests of files")]
#[path = "../../../softras-io/tests/io/numpy.rs"]
mod numpy;
mod parts;
mod pose;
mod render;
mod transparency;
mod views;

use command::{fails, softras, succeeds, words};
