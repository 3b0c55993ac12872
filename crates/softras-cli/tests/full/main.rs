//! The full tier of the command: fits to their end, the commands of README and docs.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[allow(dead_code, reason = "shared with the tests of the quick tier")]
#[path = "../cli/command.rs"]
mod command;
mod hollow;
mod pages;
mod topology;
