//! The status of a frame, as its kernels report it.

use super::plan::FramePlan;
use crate::constants as c;
use crate::error::{Error, Result};
use crate::frame::plan::Capacity;

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

    /// Whether all lists had room.
    #[cfg(feature = "renderer")]
    pub(crate) fn had_room(&self, plan: &FramePlan) -> bool {
        self.walked_tiles == 0 && self.needed.cells <= plan.forward.push.cell_capacity
    }

    /// Whether the kernels that it was planned with suffice for the frame.
    #[cfg(feature = "renderer")]
    pub(crate) fn is_complete(&self, plan: &FramePlan) -> bool {
        let rare = plan.forward.rare;
        (rare.walked || self.had_room(plan)) && (rare.thin || self.thin_tiles == 0) && (rare.large || !self.large_boxes)
    }

    /// Checks that the frame of this plan is valid. Returns the capacity to plan further frames with, so that they are
    /// faster, or `None` if all its lists had room or cannot have more on this device.
    ///
    /// # Errors
    /// [`Error::NotFinite`] when the device's arithmetic overflowed: the frame's images mean nothing.
    pub fn validate(&self, plan: &FramePlan) -> Result<Option<Capacity>> {
        if self.not_finite {
            let fix = "bring positions and camera to a scale within 1e15, and near above 1e-6".into();
            return Err(Error::NotFinite { stage: "triangle", fix });
        }
        Ok(plan.capacity.grown(self.needed).map(|larger| plan.within_limits(larger)).filter(|c| *c != plan.capacity))
    }
}
