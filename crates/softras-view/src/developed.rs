//! The content of a picture's files, collected band by band.

use crate::{
    options::Output,
    shot::{Shot, depth_pixel},
};
use softras::Result;
use softras_io::{Floats, Picture, PictureFormat};
use std::path::Path;

/// An output of a picture that is being rendered.
#[derive(Debug)]
pub struct Developed {
    output: Output,
    width: usize,
    values: Values,
}

#[derive(Debug)]
enum Values {
    /// 8-bit pixels.
    Pixels(Vec<[u8; 4]>),
    /// The depth and the alpha of each pixel, whose greys depend on the range of all depths.
    Depths(Vec<[f32; 2]>, (f64, f64)),
    /// The model's values, and the number of their channels.
    Floats(Vec<f32>, usize),
}

/// A picture that is complete.
#[derive(Debug)]
pub enum Image {
    /// 8-bit pixels; of depth, which depths are white and black.
    Picture(Picture, Option<(f64, f64)>),
    /// The model's values.
    Floats(Floats),
}

impl Image {
    /// The picture; one without pixels where the model's values were asked for.
    pub fn into_picture(self) -> Picture {
        match self {
            Self::Picture(picture, _) => picture,
            Self::Floats(_) => Picture::filled(0, 0, [0; 4]),
        }
    }

    /// Writes a PNG file of a picture, and of the model's values an OpenEXR or a numpy file, by the path's ending.
    ///
    /// # Errors
    /// [`Error::Io`](softras::Error::Io) when the file cannot be written.
    pub fn save(&self, path: &Path, output: Output) -> Result<()> {
        match self {
            Self::Picture(picture, _) => picture.save(path),
            Self::Floats(floats) if PictureFormat::of(path) == Some(PictureFormat::Exr) => {
                floats.save_exr(path, if output == Output::Depth { "Z" } else { "Y" })
            }
            Self::Floats(floats) => floats.save_npy(path),
        }
    }
}

impl Developed {
    /// An output before its first band. `floats`: the model's values, in place of a picture of 8 bits.
    pub fn new(output: Output, floats: bool) -> Self {
        let values = match (floats, output) {
            (true, _) => Values::Floats(Vec::new(), 0),
            (false, Output::Depth) => Values::Depths(Vec::new(), (f64::INFINITY, 0.0)),
            (false, _) => Values::Pixels(Vec::new()),
        };
        Self { output, width: 0, values }
    }

    /// Appends a band.
    pub fn add(&mut self, shot: &Shot) -> Result<()> {
        self.width = shot.settings.width as usize / shot.samples;
        match &mut self.values {
            Values::Pixels(pixels) => shot.append_pixels(self.output, pixels),
            Values::Depths(depths, range) => {
                let (low, high) = shot.depth_range()?;
                *range = (range.0.min(low), range.1.max(high));
                shot.for_each_pixel(self.output, |mean| depths.push([mean.straight[0] as f32, mean.alpha as f32]))
            }
            Values::Floats(data, channels) => {
                *channels = shot.append_floats(self.output, data)?;
                Ok(())
            }
        }
    }

    /// The whole image. `range` are the depths shown white and black, in place of the least and the greatest.
    pub fn finished(self, range: Option<(f64, f64)>) -> Image {
        let Self { width, values, .. } = self;
        let picture = |pixels: Vec<[u8; 4]>| Picture { width, height: pixels.len() / width.max(1), pixels };
        match values {
            Values::Pixels(pixels) => Image::Picture(picture(pixels), None),
            Values::Depths(depths, found) => {
                let range = range.or((found.0 <= found.1).then_some(found));
                let pixel = |[z, alpha]: [f32; 2]| depth_pixel(z.into(), alpha.into(), range);
                Image::Picture(picture(depths.into_iter().map(pixel).collect()), range)
            }
            Values::Floats(data, channels) => {
                let height = data.len() / (width * channels).max(1);
                Image::Floats(Floats { width, height, channels, data })
            }
        }
    }
}
