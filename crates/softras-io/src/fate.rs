//! What becomes of the properties of file formats. Each format lists its own; docs/formats.md shows them all.

pub use Fate::{Approximated, Drawn, NotDrawn, Silent};

/// What becomes of a property.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fate {
    /// It is in the picture.
    Drawn,
    /// It is drawn nearly, with this note.
    Approximated(&'static str),
    /// It changes the picture and is not drawn, with this note.
    NotDrawn(&'static str),
    /// It changes nothing in a still picture under diffuse light.
    Silent,
}
