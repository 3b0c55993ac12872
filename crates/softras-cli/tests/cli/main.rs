//! Tests of the `softras` command: arguments, exit codes, files.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod arguments;
mod bench;
mod command;
mod eval;
mod fit;
mod full;
mod gradient;
mod hostile;
mod hostile_files;
mod killed;
mod memory;
mod mistakes;
#[path = "../../../../tests/common/mutate.rs"]
mod mutate;
mod numpy;
mod official;
#[path = "../../../../tests/official/mod.rs"]
mod official_equations;
mod parts;
mod pose;
mod render;
mod transparency;
mod views;

use command::{fails, softras, succeeds};

/// What comes of work, and the most bytes of the heap that it had at a time.
fn peak_of<T>(work: impl FnOnce() -> T) -> (T, usize) {
    let mut outcome = None;
    let info = allocation_counter::measure(|| outcome = Some(work()));
    (outcome.unwrap(), info.bytes_max as usize)
}
