//! The `softras` command.
fn main() {}
