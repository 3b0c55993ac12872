//! SVG files.

use plotters::coord::Shift;
use plotters::prelude::*;
use softras::{Error, Result};
use softras_io::output;
use std::path::Path;

/// The area that a picture is drawn on.
pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Draws a picture of the given size in pixels and writes it, whole or not at all.
pub fn write(
    path: &Path,
    size: (u32, u32),
    draw: impl FnOnce(&Area<'_>) -> std::result::Result<(), Box<dyn std::error::Error>>,
) -> Result<()> {
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, size).into_drawing_area();
        let drawn = draw(&area).and_then(|()| Ok(area.present()?));
        drawn.map_err(|e| Error::Io { path: path.into(), source: std::io::Error::other(e.to_string()) })?;
    }
    output::write_file(path, text.as_bytes())
}
