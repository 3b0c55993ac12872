//! The capacities of lists whose lengths are only known on the device.

use super::ViewSize;
use crate::constants as c;
use crate::scene::{Distance, Settings};

/// How many entries memory is reserved for, in the lists of the bins and the tiles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Capacity {
    /// Entries of all bins' lists together.
    pub coarse: u32,
    /// Entries of all tiles' lists together.
    pub list: u32,
    /// Cells that the boxes of large triangles have beyond their first, for backward.
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

    /// An estimate for usual meshes, which assumes that each view's triangles have equal areas and cover its image once.
    /// The status tells if it was too small. `cutoff` is the squared radius of support from [`Settings::cutoff_of`].
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
            // Every bin's list is rounded up to whole words of 32 entries.
            coarse: entries(lists((c::BIN_WIDTH, c::BIN_HEIGHT), bins) + bins * views.len() as f64 * 32.0),
            list: entries(lists((c::TILE_WIDTH, c::TILE_HEIGHT), tiles)),
            cells: 1024,
        }
    }
}
