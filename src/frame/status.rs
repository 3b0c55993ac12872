//! The status of a frame, as its kernels report it.

use super::frame_plan::FramePlan;
use crate::constants as c;
use crate::error::{Error, Result};
use crate::frame::plan::{Capacity, Rare};

/// The words of a frame's `status` buffer, to be read whenever the frame is done; nothing waits for them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Status {
    /// Room that the frame's lists would have needed; that of tiles' lists is unknown if bins' lists had no room.
    pub needed: Capacity,
    /// A vertex or a triangle was not finite on the screen.
    pub not_finite: bool,
    /// Tiles whose lists had no room, or were longer than the device's loops walk.
    pub(crate) walked_tiles: u32,
    /// Tiles with a list that have a triangle too thin for forward_soft.
    pub(crate) thin_tiles: u32,
    /// A triangle's box has more pixels than LARGE_BOX or several cells, in a saved frame.
    pub(crate) large_boxes: bool,
}

impl Status {
    /// Bytes of the buffer that are read.
    pub const BYTES: usize = 4 * c::STATUS_WORDS as usize;

    /// From the buffer's first [`BYTES`](Self::BYTES).
    pub fn from_bytes(bytes: &[u8; Self::BYTES]) -> Self {
        let word = |at: u32| {
            let at = 4 * at as usize;
            u32::from_ne_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
        };
        Self {
            needed: Capacity {
                coarse: word(c::STATUS_COARSE_NEEDED),
                list: word(c::STATUS_LIST_NEEDED),
                cells: word(c::STATUS_CELLS_NEEDED),
            },
            not_finite: word(c::STATUS_NOT_FINITE) != 0,
            walked_tiles: word(c::STATUS_WALKED_TILES),
            thin_tiles: word(c::STATUS_THIN_TILES),
            large_boxes: word(c::STATUS_LARGE_BOXES) != 0,
        }
    }

    /// The capacity and the kernels for the frame after one of this plan.
    ///
    /// A frame that is not complete is rendered again with them, which ends: each time a list has grown, up to what the device can
    /// bind, or one of three kernels was added; a list that cannot grow is walked, and every frame with all kernels is complete.
    ///
    /// # Errors
    /// [`Error::NotFinite`] when the device's arithmetic overflowed: the frame's images mean nothing.
    pub fn next(&self, plan: &FramePlan) -> Result<Next> {
        if self.not_finite {
            let fix = "bring positions and camera to a scale within 1e15, and near above 1e-6".into();
            return Err(Error::NotFinite { stage: "triangle", fix });
        }
        let grown = plan.capacity.grown(self.needed).map_or(plan.capacity, |larger| plan.within_limits(larger));
        let had = plan.forward.rare;
        let had_room = self.walked_tiles == 0 && self.needed.cells <= plan.forward.push.cell_capacity;
        let rare = Rare {
            walked: had.walked || (!had_room && grown == plan.capacity),
            thin: had.thin || self.thin_tiles > 0,
            large: had.large || self.large_boxes,
        };
        Ok(Next { capacity: grown, rare, is_complete: rare == had && (had_room || had.walked) })
    }
}

/// The needs of the next frame, as a frame reports them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Next {
    /// Room for all that its lists needed, as far as the device can have it.
    pub capacity: Capacity,
    /// The kernels that it had and those that it lacked.
    pub rare: Rare,
    /// Whether its images and gradients are valid.
    pub is_complete: bool,
}
