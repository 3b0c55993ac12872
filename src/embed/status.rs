//! What a frame tells of itself.

use super::plan::FramePlan;
use crate::constants as c;
use crate::error::{Error, Result};
use crate::frame::plan::Capacity;

/// The words of a frame's `status` buffer, to be read whenever the frame is done; nothing waits for them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Status {
    /// Room that the frame's lists would have needed.
    pub needed: Capacity,
    /// A vertex or a triangle was not finite on the screen.
    pub not_finite: bool,
    /// Triangles near the tile with the most of them, where that is more than 16384; else 0.
    pub longest_list: u32,
}

impl Status {
    /// Bytes of the buffer that are read.
    pub const BYTES: usize = 4 * c::STATUS_WORDS as usize;

    /// Where in the `status` buffer the word lies that tells the device itself, a 32-bit unsigned integer: 1 once
    /// [`record_backward`](super::Rasterizer::record_backward) has found the frame to be whole, 0 before that and for good
    /// where it is not. Every gradient of a frame that is not whole is zero; an optimiser on the device that has momentum or
    /// other terms should not step unless the word is 1.
    pub const WHOLE_OFFSET: u64 = 4 * c::STATUS_WHOLE as u64;

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
            longest_list: word(c::STATUS_LONGEST_LIST),
        }
    }

    /// `None` when the frame of this plan is whole; else the capacity to plan the next one with, its images being worth
    /// nothing.
    ///
    /// # Errors
    /// [`Error::NotFinite`] when the device's arithmetic overflowed, [`Error::Limit`] where a software device cannot walk
    /// so long a list.
    pub fn validate(&self, plan: &FramePlan) -> Result<Option<Capacity>> {
        if self.not_finite {
            let fix = "bring positions and camera to a scale within 1e15, and near above 1e-6".into();
            return Err(Error::NotFinite { stage: "triangle", fix });
        }
        if self.longest_list > plan.longest_list {
            return Err(Error::Limit {
                what: "one tile of 8×4 pixels, or bin of 64×32,".into(),
                needed: self.longest_list.into(),
                unit: "triangles near it",
                limit_name: "passes of a loop on a software driver",
                limit: plan.longest_list.into(),
                fix: "render larger, nearer or with a smaller sigma, or simplify the mesh".into(),
            });
        }
        let (needed, had) = (self.needed, plan.capacity);
        if needed.coarse <= had.coarse && needed.list <= had.list && needed.cells <= had.cells {
            return Ok(None);
        }
        // A quarter more than was needed, so that a mesh in motion does not grow its lists every frame.
        let room = |needed: u32, had: u32| if needed > had { needed.saturating_add(needed / 4) } else { had };
        Ok(Some(Capacity {
            coarse: room(needed.coarse, had.coarse),
            list: room(needed.list, had.list),
            cells: room(needed.cells, had.cells),
        }))
    }
}
