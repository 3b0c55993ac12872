//! The fates of the properties of file formats. Each format lists its own; docs/formats.md shows them all.

pub use Fate::{Approximated, Drawn, NotDrawn, Silent};

/// The way in which a property of a file is handled.
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

/// The fates of properties. Each row has names separated by spaces.
pub type Fates = [(&'static str, Fate)];

/// All names of a table.
pub fn names(table: &'static Fates) -> impl Iterator<Item = (&'static str, Fate)> {
    table.iter().flat_map(|(names, fate)| names.split_whitespace().map(|name| (name, *fate)))
}

/// The fate of a name.
pub fn of(table: &'static Fates, name: &str) -> Option<Fate> {
    names(table).find(|(known, _)| *known == name).map(|(_, fate)| fate)
}
