//! Rules of the source itself: the sizes of files and functions, and the list of public items.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod public_items;
mod sizes;
