//! The bits of frames and gradients: equal between two runs, and never those of NaN or infinity.

use crate::agreement::numbers;
use softras::{Frame, Gradients};
use std::hash::{DefaultHasher, Hasher};

/// The bits of all values of a frame's images.
pub(super) fn bits(frame: &Frame) -> impl Iterator<Item = u32> {
    frame.images().flat_map(|(_, image)| image.data.iter().map(|x| x.to_bits()))
}

/// The bits of all gradients.
pub(super) fn gradient_bits(gradients: &Gradients) -> impl Iterator<Item = u64> {
    numbers(gradients).into_iter().flat_map(|(_, values)| values).map(f64::to_bits)
}

/// A fingerprint of the bits of all images and gradients.
pub fn fingerprint(frame: &Frame, gradients: &Gradients) -> u64 {
    let mut hasher = DefaultHasher::new();
    bits(frame).for_each(|word| hasher.write_u32(word));
    gradient_bits(gradients).for_each(|word| hasher.write_u64(word));
    hasher.finish()
}
