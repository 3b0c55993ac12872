//! Tests of the `softras` command: arguments, exit codes, files.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod arguments;
mod command;
mod eval;
mod killed;
mod numpy;
mod render;

use command::{fails, softras, succeeds};
