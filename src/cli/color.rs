//! Between the renderer's numbers and the bytes of a picture file.

/// How a number becomes a byte.
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
