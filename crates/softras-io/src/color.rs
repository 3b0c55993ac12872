//! Conversion between the renderer's numbers and the bytes of picture files.

use crate::{notes::Notes, texture::linear_from_srgb};
use softras::Mesh;

/// The curve by which numbers are encoded as bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Curve {
    /// Numbers are linear light, bytes sRGB (IEC 61966-2-1).
    Srgb,
    /// A byte is 255 times the number, as the official renderer reads and writes them.
    Raw,
}

impl Curve {
    /// The byte, as a number from 0 to 1, that shows a value.
    pub fn encode(self, value: f64) -> f64 {
        let x = value.clamp(0.0, 1.0);
        match self {
            Self::Raw => x,
            Self::Srgb if x <= 0.003_130_8 => 12.92 * x,
            Self::Srgb => 1.055 * x.powf(1.0 / 2.4) - 0.055,
        }
    }

    /// The value that a byte, as a number from 0 to 1, shows.
    pub fn decode(self, byte: f64) -> f64 {
        let x = byte.clamp(0.0, 1.0);
        match self {
            Self::Raw => x,
            Self::Srgb if x <= 0.040_45 => x / 12.92,
            Self::Srgb => ((x + 0.055) / 1.055).powf(2.4),
        }
    }
}

/// Colours above this are brighter than any light of a scene, or bytes.
pub(crate) const BRIGHT: f32 = 16.0;

/// Whether numbers that should be from 0 to 1 are bytes: all are whole numbers up to 255, and not all are small, as those of bright
/// light may be. The colours of an exporter that rounds, and of light, have fractions.
pub(crate) fn are_bytes(values: impl Iterator<Item = f32> + Clone) -> bool {
    let is_byte = |x: f32| (0.0..=255.0).contains(&x) && x.fract() == 0.0;
    values.clone().any(|x| x >= 2.0 * BRIGHT) && values.into_iter().all(is_byte)
}

/// The number that stands for 1 among whole numbers up to `greatest` in a type up to `most`. A wide type may hold bytes or its full range.
pub(crate) fn top(most: f32, greatest: f32) -> f32 {
    let usual = if greatest <= 255.0 { 255.0 } else { 65535.0 };
    if greatest <= usual { usual.min(most) } else { most }
}

/// The note on colours that [`settle`] makes white.
pub(crate) const BAD: &str = "colours that are no finite numbers are white";

pub(crate) fn is_color(color: &[f32; 3]) -> bool {
    color.iter().all(|x| x.abs() <= Mesh::BRIGHTEST)
}

/// Decodes the colours of a list as a file has them, where `most` is the largest number of their type, if that is whole. Each departure
/// from what the file says is noted.
pub(crate) fn settle(colors: &mut [[f32; 3]], most: Option<f32>, srgb: bool, notes: &mut Notes) {
    let values = || colors.iter().filter(|color| is_color(color)).flatten().copied();
    let greatest = values().fold(0.0, f32::max);
    let top = match most {
        None if are_bytes(values()) => {
            notes.add(None, "colours up to 255 are divided by 255");
            255.0
        }
        None => {
            if greatest > BRIGHT {
                notes.add(None, format!("colours up to {greatest} are brighter than white"));
            }
            1.0
        }
        Some(most) => {
            if most == 65535.0 && greatest > 0.0 && greatest <= 255.0 {
                notes.add(None, "colours of 16 bits, none above 255, are divided by 255");
            }
            top(most, greatest)
        }
    };
    for color in colors {
        // Signed bytes go on below 0 where unsigned ones go on above 127.
        let byte = |x: f32| if most == Some(255.0) && x < 0.0 { x + 256.0 } else { x };
        let one = |x: f32| if srgb { linear_from_srgb(byte(x) / top) } else { byte(x) / top };
        *color = if is_color(color) { color.map(one) } else { [1.0; 3] };
    }
}
