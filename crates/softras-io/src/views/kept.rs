//! The pixels that are kept of a picture: in each row those from the first to the last that shows the object.

use image::Rgba;

/// sRGB and the silhouette of each pixel, not multiplied by each other.
#[derive(Debug, Default)]
pub struct Kept {
    size: (u32, u32),
    /// The column that each row begins with, and where its pixels end in `pixels`; those of the row before end where they
    /// begin.
    rows: Vec<(u32, usize)>,
    pixels: Vec<Rgba<u8>>,
}

const NOTHING: Rgba<u8> = Rgba([0; 4]);

impl Kept {
    /// Keeps what the object has of `size` columns and rows.
    pub fn of(size: (u32, u32), pixel: impl Fn(u32, u32) -> Rgba<u8>) -> Self {
        let span = |row: u32| {
            let shown = |column: &u32| pixel(*column, row).0[3] > 0;
            let first = (0..size.0).find(shown).unwrap_or(size.0);
            first..(first..size.0).rev().find(shown).map_or(first, |last| last + 1)
        };
        let spans: Vec<_> = (0..size.1).map(span).collect();
        // The memory has the exact size, since a fit holds one for each photograph.
        let mut pixels = Vec::with_capacity(spans.iter().map(ExactSizeIterator::len).sum());
        let mut rows = Vec::with_capacity(spans.len());
        for (row, span) in (0..).zip(spans) {
            rows.push((span.start, pixels.len() + span.len()));
            pixels.extend(span.map(|column| pixel(column, row)));
        }
        Self { size, rows, pixels }
    }

    /// Columns and rows.
    pub fn size(&self) -> (u32, u32) {
        self.size
    }

    /// A pixel; 0 where nothing is shown, and beyond the border.
    pub fn pixel(&self, column: u32, row: u32) -> Rgba<u8> {
        let row = row as usize;
        let Some(&(first, end)) = self.rows.get(row) else { return NOTHING };
        let begin = row.checked_sub(1).map_or(0, |before| self.rows[before].1);
        let at = column.checked_sub(first).map(|along| begin + along as usize);
        at.filter(|at| *at < end).map_or(NOTHING, |at| self.pixels[at])
    }
}
