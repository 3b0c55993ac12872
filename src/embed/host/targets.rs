//! Where gradients go in a host's buffers, and what else lies there.

use super::geometry::Layout;
use crate::vulkan::{BufferRef, vk};

/// The floats of a host's array: what a step writes, or reads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Floats {
    buffer: vk::Buffer,
    /// Bytes from the VkBuffer's start to the first element's floats, and behind the last one's.
    start: u64,
    end: u64,
    stride: u64,
    /// Bytes of an element that are used.
    bytes: u64,
}

/// The overlap of two arrays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Overlap {
    /// Nothing.
    None,
    /// Elements coincide: they are the same array, or parts of one.
    Elements,
    /// They overlap in some other way.
    Torn,
}

impl Floats {
    /// `floats` numbers of each of `count` elements from `first` on.
    pub fn new(&(at, layout): &(BufferRef, Layout), first: u32, count: u32, floats: u64) -> Self {
        let (stride, bytes) = (u64::from(layout.stride), 4 * floats);
        let start = at.offset() + u64::from(layout.offset) + u64::from(first) * stride;
        let end = if count == 0 { start } else { start + u64::from(count - 1) * stride + bytes };
        Self { buffer: at.raw(), start, end, stride, bytes }
    }

    /// All bytes of a part.
    pub fn whole(at: &BufferRef) -> Self {
        let (start, range) = (at.offset(), at.range());
        Self { buffer: at.raw(), start, end: start + range, stride: range, bytes: range }
    }

    pub fn overlap(&self, other: &Self) -> Overlap {
        if self.buffer != other.buffer || self.end.min(other.end) <= self.start.max(other.start) {
            return Overlap::None;
        }
        if self.stride != other.stride {
            return Overlap::Torn;
        }
        // The distance from the other array's elements to this one's.
        let behind = (self.start % self.stride + self.stride - other.start % self.stride) % self.stride;
        match behind {
            0 if self.bytes == other.bytes => Overlap::Elements,
            _ if behind >= other.bytes && self.stride - behind >= self.bytes => Overlap::None,
            _ => Overlap::Torn,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ash::vk::Handle;

    #[test]
    fn arrays_overlap_where_a_float_is_in_both() {
        let floats = |buffer, stride: u64, offset, first: u64, count: u64| {
            let start = offset + first * stride;
            let end = start + count.saturating_sub(1) * stride + if count > 0 { 12 } else { 0 };
            Floats { buffer: vk::Buffer::from_raw(buffer), start, end, stride, bytes: 12 }
        };
        let (one, other) = (1, 2);
        let all = floats(one, 32, 0, 0, 10);
        for (array, expected) in [
            (floats(other, 32, 0, 0, 10), Overlap::None),
            (all, Overlap::Elements),
            (floats(one, 32, 0, 9, 5), Overlap::Elements),
            (floats(one, 32, 0, 10, 5), Overlap::None),
            (floats(one, 32, 96, 0, 2), Overlap::Elements),
            (floats(one, 32, 12, 0, 10), Overlap::None),
            (floats(one, 32, 20, 0, 10), Overlap::None),
            (floats(one, 32, 24, 0, 10), Overlap::Torn),
            (floats(one, 32, 8, 0, 10), Overlap::Torn),
            (floats(one, 12, 0, 0, 10), Overlap::Torn),
            (floats(one, 12, 0, 0, 0), Overlap::None),
            (
                Floats { buffer: vk::Buffer::from_raw(one), start: 0, end: 4096, stride: 4096, bytes: 4096 },
                Overlap::Torn,
            ),
        ] {
            assert_eq!(all.overlap(&array), expected, "{array:?}");
            assert_eq!(array.overlap(&all), expected, "{array:?}");
        }
    }
}
