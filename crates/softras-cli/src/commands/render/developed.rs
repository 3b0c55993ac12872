//! What the files of a picture are made of, collected band by band.

use super::args::Output;
use super::formats::Format;
use super::picture::{Floats, Picture, Shot, depth_pixel};
use softras::Result;

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
    /// The model's values, of so many channels.
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

impl Developed {
    /// Nothing yet of an output, for a file of this format.
    pub fn new(output: Output, format: Format) -> Self {
        let values = match (format, output) {
            (Format::Exr | Format::Npy, _) => Values::Floats(Vec::new(), 0),
            (_, Output::Depth) => Values::Depths(Vec::new(), (f64::INFINITY, 0.0)),
            _ => Values::Pixels(Vec::new()),
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
