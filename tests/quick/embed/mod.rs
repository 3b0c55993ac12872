//! The embedding API in the hands of a host: the example engine, a host's own geometry and images, and other devices.
// Tests play the host's half of a contract of raw handles.
#![allow(unsafe_code, clippy::undocumented_unsafe_blocks, clippy::unwrap_used, clippy::expect_used, clippy::panic)]
// The example brings the engine along, and so does the tests' host.
#![allow(clippy::duplicate_mod)]

mod alignment;
mod ash_example;
mod counts;
mod devices;
mod facade;
mod facade_images;
mod facade_status;
mod geometry;
mod images;
mod lifecycle;
mod misuse;
