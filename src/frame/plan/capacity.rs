//! The capacities of lists whose lengths are only known on the device.

use super::ViewSize;
use crate::constants as c;
use crate::scene::{Distance, Settings};

/// How many entries the lists of the bins and the tiles have room for. It affects speed alone: entries without room are
/// found again wherever they are needed, to the same bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Capacity {
    /// Entries of all bins' lists together.
    pub coarse: u32,
    /// Entries of all tiles' lists together.
    pub list: u32,
    /// Cells that the boxes of large triangles have beyond their first, for backward.
    pub cells: u32,
}

/// If the tiles' lists cannot have more entries than this, there is room for all of them.
const FEW: u64 = 1 << 16;
/// The most entries that lists grow to: their memory is at most some gigabytes.
const LARGEST: u32 = 1 << 28;
/// Bytes of the largest item of backward: an entry of `partials`.
const LARGEST_ITEM: u64 =
    16 * (c::PARTIAL_TEXELS + c::PARTIAL_COLOR_TEXELS + c::PARTIAL_COORDINATE_TEXELS + c::PARTIAL_NORMAL_TEXELS) as u64;

fn tiles_of(settings: &Settings) -> u64 {
    u64::from(settings.width.div_ceil(c::TILE_WIDTH)) * u64::from(settings.height.div_ceil(c::TILE_HEIGHT))
}

fn bins_of(settings: &Settings) -> u64 {
    u64::from(settings.width.div_ceil(c::BIN_WIDTH)) * u64::from(settings.height.div_ceil(c::BIN_HEIGHT))
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

    /// The capacity reduced to buffers of `range` bytes, where backward also needs an item for each of the `records`.
    pub fn within(self, range: u64, records: u64) -> Self {
        let most = |entries: u64, capacity: u32| capacity.min(u32::try_from(entries).unwrap_or(u32::MAX));
        let block = 4 * u64::from(c::BLOCK_WORDS);
        Self {
            coarse: most(range / block * u64::from(c::WORD_BITS), self.coarse),
            list: most(range / 4, self.list),
            cells: most((range / LARGEST_ITEM).saturating_sub(records), self.cells),
        }
    }

    /// The capacity with a quarter more room than was needed in the lists that had too little, so that a mesh in motion does not
    /// grow its lists every frame; `None` if there was room for all.
    pub fn grown(self, needed: Self) -> Option<Self> {
        let room = |needed: u32, had: u32| {
            if needed > had { needed.saturating_add(needed / 4).min(LARGEST) } else { had }
        };
        let grown = Self {
            coarse: room(needed.coarse, self.coarse),
            list: room(needed.list, self.list),
            cells: room(needed.cells, self.cells),
        };
        let more = grown.coarse > self.coarse || grown.list > self.list || grown.cells > self.cells;
        more.then(|| self.max(grown))
    }

    /// An estimate for usual meshes: each view's triangles have equal areas and cover its image once. For few triangles
    /// it is all that they can need. `cutoff` is the squared support radius from [`Settings::cutoff_of`].
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
        // A triangle that the near plane may cut has two records.
        let records = || views.iter().map(|view| 2 * u64::from(view.triangles));
        let estimate = Self {
            // Every bin's list is rounded up to whole words of 32 entries.
            coarse: entries(lists((c::BIN_WIDTH, c::BIN_HEIGHT), bins) + bins * views.len() as f64 * 32.0),
            list: entries(lists((c::TILE_WIDTH, c::TILE_HEIGHT), tiles)),
            cells: 1024,
        };
        let padded = |n: u64| n.next_multiple_of(c::WORD_BITS.into());
        let coarse: u64 = records().map(|n| bins_of(settings) * padded(n)).sum();
        let list: u64 = records().map(|n| tiles_of(settings) * n).sum();
        let few = list <= FEW;
        estimate.max(if few { Self { coarse: coarse as u32, list: list as u32, cells: 0 } } else { Self::default() })
    }
}
