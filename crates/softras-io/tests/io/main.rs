//! Files: what is read, noted and refused, in how much memory, and that what is written is read back.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod arrays;
mod cameras;
#[path = "../../../../tests/common/pool.rs"]
mod common;
mod corpus;
mod formats;
mod generated;
#[path = "../../../../tests/common/mutate.rs"]
mod mutate;
mod mutation;
mod named;
#[allow(dead_code, reason = "shared with the tests of the command")]
mod numpy;
mod obj;
mod save;
mod views;

/// The outcome of work, and the most bytes of the heap that it had at a time.
fn peak_of<T>(work: impl FnOnce() -> T) -> (T, usize) {
    let mut outcome = None;
    let info = allocation_counter::measure(|| outcome = Some(work()));
    (outcome.unwrap(), info.bytes_max as usize)
}

use softras::{Mesh, Result};
use softras_io::{LoadOptions, SaveOptions, load_with as load};
use std::path::{Path, PathBuf};

/// A texel is its value / 255.
const RAW: LoadOptions = LoadOptions { srgb: false, allow_outside: false, strict: false, memory: None };

/// Writes a mesh whose texels are numbers as they are.
fn save(mesh: &Mesh, path: &Path) -> Result<Vec<PathBuf>> {
    softras_io::save_with(mesh, path, &SaveOptions { srgb: false, ..SaveOptions::default() })
}
