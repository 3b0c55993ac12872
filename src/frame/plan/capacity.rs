//! Room for lists whose length only the device finds out.

use super::ViewSize;
use crate::constants as c;
use crate::scene::{Distance, Settings};

/// Entries of the bins' and of the tiles' lists that memory is set aside for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Capacity {
    /// Entries of all bins' lists together.
    pub coarse: u32,
    /// Entries of all tiles' lists together.
    pub list: u32,
    /// Cells that large boxes have beyond their first, for backward.
    pub cells: u32,
}

impl Capacity {
    /// The larger of both, list by list.
    pub fn max(self, other: Self) -> Self {
        Self {
            coarse: self.coarse.max(other.coarse),
            list: self.list.max(other.list),
            cells: self.cells.max(other.cells),
        }
    }

    /// Room that usual meshes need, from the mean triangle that would cover each image once; the status word tells when
    /// it was not enough. `cutoff` is the radius of support as in [`Settings::cutoff_of`].
    pub fn estimate(settings: &Settings, cutoff: f64, views: &[ViewSize]) -> Self {
        let (w, h) = (f64::from(settings.width), f64::from(settings.height));
        let hard = settings.distance == Distance::Hard;
        let radius = if hard { 0.0 } else { (settings.sigma * cutoff).sqrt() * h / 2.0 };
        let blur = 2.0 * radius.min(w + h);
        let lists = |tile: (u32, u32), most: f64| -> f64 {
            let each = views.iter().filter(|v| v.triangles > 0).map(|v| {
                let side = (2.0 * w * h / f64::from(v.triangles)).sqrt() + blur;
                let touched = (side / f64::from(tile.0) + 1.0) * (side / f64::from(tile.1) + 1.0);
                f64::from(v.triangles) * touched.min(most)
            });
            each.sum()
        };
        let (tiles, bins) = (w * h / 32.0 + 2.0, w * h / 2048.0 + 2.0);
        let entries = |x: f64| x.min(f64::from(1 << 24)) as u32 + 1024;
        Self {
            // Every bin's list is rounded up to whole words.
            coarse: entries(lists((c::BIN_WIDTH, c::BIN_HEIGHT), bins) + bins * views.len() as f64 * 32.0),
            list: entries(lists((c::TILE_WIDTH, c::TILE_HEIGHT), tiles)),
            cells: 1024,
        }
    }
}
