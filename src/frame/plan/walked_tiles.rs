//! How tiles are processed whose lists are nowhere in memory: whether there can be any, and in how many turns.

use super::{FramePush, ViewRange};
use crate::constants as c;
use crate::frame::buffers::Totals;

/// The dispatches of forward_soft_long and forward_long.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Walks {
    /// Whether entries without room in a list are found again where they are needed. If not, a frame may be incomplete.
    pub wanted: bool,
    /// Whether walks are wanted, and lists can lack room or be longer than the device's loops can walk.
    pub needed: bool,
    /// Turns that a tile gets if its walk may take more loop passes than the device executes correctly; 0 if there are
    /// no such tiles.
    pub turns: u32,
}

impl Walks {
    /// The walks of a frame with these capacities, if they are wanted.
    pub fn new(wanted: bool, push: &FramePush, views: &[ViewRange], totals: &Totals, loop_passes: u32) -> Self {
        let bits = u64::from(c::WORD_BITS);
        let bins = u64::from(push.bins_x) * u64::from(push.bins_y);
        let tiles = u64::from(push.tiles_x) * u64::from(push.tiles_y);
        let most = views.iter().map(|view| u64::from(view.records)).max().unwrap_or(0);
        let coarse: u64 = views.iter().map(|view| bins * u64::from(view.records).next_multiple_of(bits)).sum();
        let has_room = coarse <= push.coarse_capacity.into() && tiles * totals.records <= push.list_capacity.into();
        // As bin_fine computes it, for a tile that lists all records of its view: three walks over its bin's words.
        let blocks = most.div_ceil(bits);
        let passes = 3 * (u64::from(c::WALK_GROUP_PASSES) * (blocks / bits + 1) + blocks)
            + u64::from(c::WALK_LIST_PASSES) * (most / bits + 2);
        let at_once = passes <= loop_passes.into();
        // A turn ends before a group that it might not complete.
        let of_turn = u64::from(loop_passes.saturating_sub(2 * c::WALK_MOST_PASSES)).max(1);
        let turns = if at_once { 0 } else { passes.div_ceil(of_turn) as u32 };
        Self { wanted, needed: wanted && !(has_room && at_once), turns }
    }

    /// Rows of RESUMED_ROW tiles.
    pub fn rows(self, totals: &Totals) -> u32 {
        if self.turns > 0 { totals.tiles.div_ceil(c::RESUMED_ROW.into()) as u32 } else { 0 }
    }

    /// The tiles of the largest row, for each of which a walk's state is kept.
    pub fn resumed_tiles(self, totals: &Totals) -> u64 {
        if self.wanted && self.turns > 0 { totals.tiles.min(c::RESUMED_ROW.into()) } else { 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn walks(records: u32, room: u32, loop_passes: u32) -> Walks {
        let push = FramePush {
            tiles_x: 8,
            tiles_y: 8,
            bins_x: 1,
            bins_y: 1,
            coarse_capacity: records.next_multiple_of(32),
            list_capacity: room,
            ..FramePush::default()
        };
        let view =
            ViewRange { screen_base: 0, record_base: 0, bin_base: 0, word_base: 0, records, words: records / 32 };
        let totals = Totals { records: records.into(), tiles: 64, ..Totals::default() };
        Walks::new(true, &push, &[view], &totals, loop_passes)
    }

    #[test]
    fn walks_are_recorded_only_where_lists_can_lack_room() {
        assert_eq!(walks(100, 6400, 60_000), Walks { wanted: true, needed: false, turns: 0 });
        assert_eq!(walks(100, 6399, 60_000), Walks { wanted: true, needed: true, turns: 0 });
        assert_eq!(walks(100, 1, u32::MAX), Walks { wanted: true, needed: true, turns: 0 });
    }

    /// A hundred thousand records on one list take 118,750 passes to gather, and some ten thousand to be found.
    #[test]
    fn long_walks_take_turns() {
        assert_eq!(walks(40_000, u32::MAX, 60_000), Walks { wanted: true, needed: false, turns: 0 });
        assert_eq!(walks(100_000, u32::MAX, 60_000), Walks { wanted: true, needed: true, turns: 3 });
        assert_eq!(walks(100_000, u32::MAX, u32::MAX), Walks { wanted: true, needed: false, turns: 0 });
        let totals = Totals { tiles: 10_000, ..Totals::default() };
        let walks = Walks { wanted: true, needed: true, turns: 3 };
        assert_eq!((walks.rows(&totals), walks.resumed_tiles(&totals)), (3, 4096));
    }
}
