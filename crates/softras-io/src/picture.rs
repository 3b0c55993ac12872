//! Pictures of 8 bits a channel, arrays of floats, and the files of both.

use crate::{failed, npy, output};
use exr::prelude::{AnyChannel, AnyChannels, FlatSamples, Image, WritableImage};
use image::{ExtendedColorType, ImageEncoder, ImageResult, codecs::png::PngEncoder};
use softras::{Error, Result};
use std::{borrow::Cow, io::Cursor, path::Path};

/// The format of a picture file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureFormat {
    /// 8-bit sRGB with straight alpha.
    Png,
    /// Linear 32-bit float.
    Exr,
    /// numpy float32 `[H, W, C]`.
    Npy,
    /// 256 colours, animated.
    Gif,
}

impl PictureFormat {
    /// The format of a path, by its ending in upper or lower case.
    pub fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "png" => Some(Self::Png),
            "exr" => Some(Self::Exr),
            "npy" => Some(Self::Npy),
            "gif" => Some(Self::Gif),
            _ => None,
        }
    }
}

/// 8-bit RGBA, straight alpha, row 0 at the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `height × width` pixels.
    pub pixels: Vec<[u8; 4]>,
}

/// An array of floats: `data[(row · width + column) · channels + channel]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Floats {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// 1, 3 or 4.
    pub channels: usize,
    /// The values.
    pub data: Vec<f32>,
}

/// The content of a PNG file.
///
/// # Errors
/// An error of the encoder: no pixels, or too many.
pub(crate) fn png(bytes: &[u8], width: u32, height: u32, color: ExtendedColorType) -> ImageResult<Vec<u8>> {
    let mut file = Vec::new();
    PngEncoder::new(&mut file).write_image(bytes, width, height, color)?;
    Ok(file)
}

impl Picture {
    /// A picture of one colour.
    pub fn filled(width: usize, height: usize, pixel: [u8; 4]) -> Self {
        Self { width, height, pixels: vec![pixel; width * height] }
    }

    /// Lays the picture on an opaque background.
    pub fn flattened(mut self, ground: [u8; 3]) -> Self {
        for pixel in &mut self.pixels {
            let a = u32::from(pixel[3]);
            for (value, under) in pixel.iter_mut().zip(ground) {
                *value = ((u32::from(*value) * a + u32::from(under) * (255 - a) + 127) / 255) as u8;
            }
            pixel[3] = 255;
        }
        self
    }

    /// Whether every pixel is opaque.
    pub fn is_opaque(&self) -> bool {
        self.pixels.iter().all(|p| p[3] == 255)
    }

    /// Copies a picture into this one, its upper left corner at the given column and row; parts outside are cut off.
    pub fn paste(&mut self, other: &Self, column: usize, row: usize) {
        for r in 0..other.height.min(self.height.saturating_sub(row)) {
            let columns = other.width.min(self.width.saturating_sub(column));
            let from = &other.pixels[r * other.width..][..columns];
            self.pixels[(row + r) * self.width + column..][..columns].copy_from_slice(from);
        }
    }

    /// The content of a PNG file: RGBA, or RGB where all is opaque.
    ///
    /// # Errors
    /// [`Error::Mesh`] for a picture without pixels or larger than PNG files may be.
    pub fn png(&self) -> Result<Vec<u8>> {
        let (bytes, color): (Cow<[u8]>, _) = if self.is_opaque() {
            (self.pixels.iter().flat_map(|p| [p[0], p[1], p[2]]).collect(), ExtendedColorType::Rgb8)
        } else {
            (self.pixels.as_flattened().into(), ExtendedColorType::Rgba8)
        };
        let (width, height) = (self.width as u32, self.height as u32);
        png(&bytes, width, height, color).map_err(|error| Error::Mesh {
            what: format!("a picture of {width}×{height} pixels cannot be encoded ({error})"),
            place: "picture".into(),
            fix: "give at least one pixel and a smaller picture".into(),
        })
    }

    /// Writes a PNG file.
    ///
    /// # Errors
    /// [`Error::Io`] when the file cannot be written; those of [`Picture::png`].
    pub fn save(&self, path: impl AsRef<Path>) -> Result<()> {
        output::write_file(path.as_ref(), &self.png()?)
    }
}

impl Floats {
    /// Writes a numpy file, float32 `[H, W, C]`.
    ///
    /// # Errors
    /// [`Error::Io`] when the file cannot be written.
    pub fn save_npy(&self, path: &Path) -> Result<()> {
        let shape = [self.height, self.width, self.channels];
        output::write_file(path, &npy::write(&shape, npy::Data::F32(&self.data)))
    }

    /// Writes an OpenEXR file: the channels R, G, B and A of four, R, G, B of three, and one that is called `name`: Z for depths, Y
    /// for grey.
    ///
    /// # Errors
    /// [`Error::Io`] when the file cannot be written.
    pub fn save_exr(&self, path: &Path, name: &str) -> Result<()> {
        let names = match self.channels {
            channels @ (3 | 4) => &["R", "G", "B", "A"][..channels],
            _ => &[name],
        };
        let channel = |(k, name): (usize, &&str)| {
            let samples = self.data.iter().skip(k).step_by(self.channels).copied().collect();
            AnyChannel::new(*name, FlatSamples::F32(samples))
        };
        let channels = AnyChannels::sort(names.iter().enumerate().map(channel).collect());
        let mut file = Cursor::new(Vec::new());
        let written =
            Image::from_channels((self.width, self.height), channels).write().non_parallel().to_buffered(&mut file);
        written.map_err(|e| failed(path, e))?;
        output::write_file(path, file.get_ref())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flattening_mixes_by_alpha() {
        let picture = Picture { width: 3, height: 1, pixels: vec![[10, 20, 30, 255], [0, 0, 0, 0], [255, 0, 0, 128]] };
        let flat = picture.flattened([255; 3]);
        assert_eq!(flat.pixels, vec![[10, 20, 30, 255], [255, 255, 255, 255], [255, 127, 127, 255]]);
    }

    #[test]
    fn pasting_cuts_what_sticks_out() {
        let mut ground = Picture::filled(3, 2, [0; 4]);
        ground.paste(&Picture::filled(2, 2, [9; 4]), 2, 1);
        assert_eq!(ground.pixels.iter().filter(|p| p[0] == 9).count(), 1);
        assert_eq!(ground.pixels[5], [9; 4]);
        ground.paste(&Picture::filled(2, 2, [9; 4]), 7, 7);
    }
}
