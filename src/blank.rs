//! Buffers filled with one pattern: what a frame's images and lists are before any triangle is drawn.
//!
//! A first block goes into the command buffer itself and is copied behind itself in steps, between the barriers that lie
//! between the stages anyway. vkCmdFillBuffer knows patterns of four bytes only, and lavapipe takes some nanoseconds for
//! each four.

use crate::Result;
use crate::constants as c;
use crate::plan::Plan;
use crate::vulkan::{BufferPart, Recorder};

/// Sixteen bytes, over and over.
pub type Pattern = [u32; 4];

/// Patterns of the first block: 16 KiB.
const BLOCK: usize = 1024;

/// How often what is there is copied behind itself in one step.
const COPIES: u64 = 15;

/// A buffer on its way to being filled.
pub struct Blank<'a> {
    buffer: &'a BufferPart,
    size: u64,
    done: u64,
}

impl<'a> Blank<'a> {
    /// Records the first block of `size` bytes, a multiple of 16.
    pub fn begin(recorder: &mut Recorder<'_>, buffer: &'a BufferPart, size: u64, pattern: Pattern) -> Result<Self> {
        let block = [pattern; BLOCK];
        let bytes: &[u8] = bytemuck::cast_slice(&block);
        let done = size.min(bytes.len() as u64);
        recorder.update(buffer, 0, &bytes[..done as usize])?;
        Ok(Self { buffer, size, done })
    }

    /// Records a step: sixteen times as much is filled then. Belongs behind a barrier after the last.
    pub fn grow(&mut self, recorder: &mut Recorder<'_>) -> Result<()> {
        self.copy(recorder, self.size.min((1 + COPIES) * self.done))
    }

    /// The same as far as it goes.
    pub fn finish(&mut self, recorder: &mut Recorder<'_>) -> Result<()> {
        self.copy(recorder, self.size)
    }

    /// All of it is filled, or recorded to be.
    pub fn is_whole(&self) -> bool {
        self.done == self.size
    }

    fn copy(&mut self, recorder: &mut Recorder<'_>, end: u64) -> Result<()> {
        let block = self.done;
        while self.done < end {
            let size = block.min(end - self.done);
            recorder.copy(self.buffer, 0, self.buffer, self.done, size)?;
            self.done += size;
        }
        Ok(())
    }
}

/// What forward would write where no triangle is, by the names of its buffers (`write_pixel` of `glsl/common/forward.glsl`).
pub fn of_forward(plan: &Plan) -> [(&'static str, u64, Pattern); 6] {
    let f = &plan.frame;
    let alpha = if plan.mode("OUTPUTS") & c::OUTPUT_SILHOUETTE != 0 { 0.0 } else { 1.0 };
    let color = [f.background_red, f.background_green, f.background_blue, alpha];
    let softmax = plan.mode("COLOR_MODE") == c::COLOR_SOFTMAX;
    let entry = softmax && plan.mode("COMPOSITE") == 0;
    // What the softmax is relative to; of the hard mode the slot.
    let [whole, rest, inverse] = match (softmax, entry) {
        (_, true) => [f.background_whole, f.background_rest, 1.0],
        (true, false) => [NOTHING, 0.0, 0.0],
        (false, false) => [0.0; 3],
    };
    let product = plan.mode("SILHOUETTE_MODE") == c::SILHOUETTE_PRODUCT;
    let saved = [whole, rest, inverse, f32::from(u8::from(product))];
    let shaded = plan.mode("OUTPUTS") & !c::OUTPUT_SILHOUETTE != 0;
    let log_sum = if shaded && entry { whole + rest } else { NOTHING };
    let sizes = &plan.sizes;
    let pattern = |floats: [f32; 4]| floats.map(f32::to_bits);
    [
        ("color", sizes.color, pattern(color)),
        ("silhouette", sizes.silhouette, pattern([0.0; 4])),
        ("depths", sizes.depths, pattern([0.0; 4])),
        ("normals", sizes.normals, pattern([0.0; 4])),
        ("saved", sizes.saved, pattern(saved)),
        ("tile_bounds", sizes.tile_bounds, pattern([log_sum, 1.0, log_sum, 1.0])),
    ]
}

/// The logarithm of nothing, as the kernels have it.
const NOTHING: f32 = -3e38;
