//! Files: the one door by which they are read and the one writer, for the library and the command alike.

pub(crate) mod input;
pub(crate) mod output;
#[cfg(feature = "obj")]
pub(crate) mod picture;
