//! Converts the renderer's float images to 8-bit pictures and to arrays of floats.

use crate::{
    framing::Viewpoint,
    layers::{Layer, blended, image_of},
    options::Output,
    solid::solid,
};
use softras::{
    Frame, Image, Result, Settings,
    scene::{Background, ColorAggregation},
};
use softras_io::Curve;
use std::borrow::Cow;
use std::ops::Range;

/// A rendered image, or a band of its rows, and how it was made.
#[derive(Debug)]
pub struct Shot {
    /// The band with its margins, without transparent triangles.
    pub frame: Frame,
    /// The transparent triangles.
    pub layers: Vec<Layer>,
    /// The band's rows in the whole image.
    pub rows: Range<usize>,
    /// Rows of the frame above the band's own.
    pub above: usize,
    /// The camera of the whole image.
    pub view: Viewpoint,
    /// The settings of the whole image.
    pub settings: Settings,
    /// The curve by which numbers are encoded as bytes.
    pub curve: Curve,
    /// The picture has one pixel for each `samples × samples` pixels of the frame.
    pub samples: usize,
    /// Whether no background was given, so that colour has an alpha channel.
    pub transparent: bool,
    /// Whether alpha is 1 inside of surfaces in pictures.
    pub is_solid: bool,
}

impl Shot {
    /// An image of the frame, or of all layers with alpha as `is_solid` says.
    fn image(&self, output: Output, is_solid: bool) -> Result<Cow<'_, Image>> {
        if self.layers.is_empty() {
            return image_of(&self.frame, output).map(Cow::Borrowed);
        }
        blended(&self.frame, &self.layers, &self.settings, output, is_solid, self.transparent).map(Cow::Owned)
    }

    /// Whether an output's values are multiplied by alpha already, as the composite background's model has them.
    fn premultiplied(&self, output: Output) -> bool {
        let composite = self.settings.background == Background::Composite;
        composite && (output == Output::Color || self.settings.color == ColorAggregation::Softmax)
    }

    /// The values of the band's own rows.
    fn own<'a>(&self, image: &'a Image) -> &'a [f32] {
        let row = image.width * image.channels;
        &image.view(0)[self.above * row..(self.above + self.rows.len()) * row]
    }

    /// Whether the alpha of any pixel, in any layer, is above 0 as a byte.
    pub fn is_seen(&self) -> bool {
        let layers = self.layers.iter().flat_map(|layer| layer.frames());
        let mut alphas = std::iter::once(&self.frame).chain(layers).filter_map(|frame| frame.silhouette().ok());
        alphas.any(|alpha| self.own(alpha).iter().any(|a| *a >= 0.5 / 255.0))
    }

    /// The least and greatest depth where the mesh covers at least half a pixel: infinity and 0 where it covers nothing.
    pub fn depth_range(&self) -> Result<(f64, f64)> {
        let image = |output| self.image(output, self.is_solid);
        let (depth, alpha) = (image(Output::Depth)?, image(Output::Silhouette)?);
        let (depth, alpha) = (self.own(&depth), self.own(&alpha));
        let premultiplied = self.premultiplied(Output::Depth);
        let straight = |(z, a): (&f32, &f32)| f64::from(if premultiplied { z / a } else { *z });
        let covered = depth.iter().zip(alpha).filter(|(z, a)| **a >= 0.5 && **z > 0.0).map(straight);
        Ok(covered.fold((f64::INFINITY, 0.0f64), |(low, high), z| (low.min(z), high.max(z))))
    }

    /// Visits the band's pixels in order.
    pub fn for_each_pixel(&self, output: Output, mut visit: impl FnMut(Mean)) -> Result<()> {
        let (image, alpha) = (self.image(output, self.is_solid)?, self.image(Output::Silhouette, self.is_solid)?);
        let (image, alpha) = (image.as_ref(), alpha.as_ref());
        let (width, first) = (image.width / self.samples, self.above / self.samples);
        // An image that is blended of several layers is solid already.
        let solid = (self.is_solid && self.layers.is_empty()).then(|| solid(alpha));
        let samples = Samples { image, model: alpha.view(0), alpha: solid.as_deref().unwrap_or(alpha.view(0)) };
        for row in first..first + self.rows.len() / self.samples {
            (0..width).for_each(|column| visit(self.mean(output, &samples, (row, column))));
        }
        Ok(())
    }

    /// Appends the band's pixels to a picture of one output other than depth.
    pub fn append_pixels(&self, output: Output, pixels: &mut Vec<[u8; 4]>) -> Result<()> {
        let axes = self.view.camera()?.axes().map(|axis| axis.to_array());
        self.for_each_pixel(output, |mean| {
            pixels.push(match output {
                Output::Color => self.color_pixel(&mean),
                Output::Normal => normal_pixel(mean.straight, mean.alpha, axes),
                Output::Silhouette | Output::Depth => [byte(mean.alpha), byte(mean.alpha), byte(mean.alpha), 255],
            });
        })
    }

    /// Averages the samples of one pixel of the picture. Values that the model has multiplied by its alpha, or blended with
    /// the background by it, are converted to the alpha of the picture.
    fn mean(&self, output: Output, samples: &Samples<'_>, (row, column): (usize, usize)) -> Mean {
        let n = self.samples;
        let premultiplied = self.premultiplied(output);
        let (mut plain, mut weighted, mut coverage) = ([0.0; 3], [0.0; 3], 0.0);
        for sample in 0..n * n {
            let (r, c) = (row * n + sample / n, column * n + sample % n);
            let at = r * samples.image.width + c;
            let (model, a) = (f64::from(samples.model[at]), f64::from(samples.alpha[at]));
            for (k, &value) in samples.image.pixel(0, r, c).iter().take(3).enumerate() {
                let (value, ground) = (f64::from(value), self.settings.background_color[k]);
                let is_other = premultiplied && a != model;
                plain[k] +=
                    if is_other { ground + (value - ground * (1.0 - model)) / model * a - ground * a } else { value };
                weighted[k] += if is_other {
                    value / model * a
                } else if premultiplied {
                    value
                } else {
                    value * a
                };
            }
            coverage += a;
        }
        let count = (n * n) as f64;
        let straight = weighted.map(|v| v / coverage.max(1e-9));
        Mean { plain: plain.map(|v| v / count), straight, alpha: coverage / count }
    }

    /// Straight alpha when transparent; with a background, which the model has blended in already, the plain mean.
    fn color_pixel(&self, mean: &Mean) -> [u8; 4] {
        let (color, alpha) = if self.transparent { (mean.straight, byte(mean.alpha)) } else { (mean.plain, 255) };
        let [r, g, b] = color.map(|c| byte(self.curve.encode(c)));
        [r, g, b, alpha]
    }

    /// Appends the band's values of one output. Colour without a background is RGBA, premultiplied with the composite
    /// background. Returns the number of channels.
    pub fn append_floats(&self, output: Output, data: &mut Vec<f32>) -> Result<usize> {
        let image = self.image(output, false)?;
        if output == Output::Color && self.transparent {
            let alpha = self.image(Output::Silhouette, false)?;
            data.extend(
                self.own(&image).chunks_exact(3).zip(self.own(&alpha)).flat_map(|(c, &a)| [c[0], c[1], c[2], a]),
            );
            return Ok(4);
        }
        data.extend(self.own(&image));
        Ok(image.channels)
    }
}

/// The images of a frame.
struct Samples<'a> {
    image: &'a Image,
    /// The model's silhouette.
    model: &'a [f32],
    /// The alpha that the picture has.
    alpha: &'a [f32],
}

/// The samples of one pixel of a picture.
pub struct Mean {
    /// Their mean.
    plain: [f64; 3],
    /// Their mean, each weighted by its alpha.
    pub straight: [f64; 3],
    /// Their mean alpha.
    pub alpha: f64,
}

/// (n + 1) / 2 in camera axes: right, up, towards the viewer; `axes` are the camera's right, up and forward.
fn normal_pixel(world: [f64; 3], alpha: f64, axes: [[f64; 3]; 3]) -> [u8; 4] {
    let [x, y, z] = axes.map(|axis| (0..3).map(|k| axis[k] * world[k]).sum::<f64>());
    let length = (x * x + y * y + z * z).sqrt().max(1e-12);
    let [r, g, b] = [x, y, -z].map(|n| byte(n / length / 2.0 + 0.5));
    [r, g, b, byte(alpha)]
}

/// Near is white, far is black.
pub fn depth_pixel(z: f64, alpha: f64, depths: Option<(f64, f64)>) -> [u8; 4] {
    let (low, high) = depths.unwrap_or((0.0, 0.0));
    let grey = if high > low { byte((high - z) / (high - low)) } else { 255 };
    [grey, grey, grey, byte(alpha)]
}

fn byte(x: f64) -> u8 {
    (x.clamp(0.0, 1.0) * 255.0).round() as u8
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn depth_is_white_near_and_black_far() {
        assert_eq!(depth_pixel(2.0, 1.0, Some((2.0, 4.0))), [255; 4]);
        assert_eq!(depth_pixel(4.0, 0.5, Some((2.0, 4.0))), [0, 0, 0, 128]);
        assert_eq!(depth_pixel(2.0, 1.0, None), [255; 4]);
    }

    #[test]
    fn a_normal_towards_the_viewer_is_blue() {
        let axes = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]];
        assert_eq!(normal_pixel([0.2, 0.0, 0.0], 1.0, axes), [128, 128, 255, 255]);
        assert_eq!(normal_pixel([0.0, 0.0, 2.0], 0.0, axes), [255, 128, 128, 0]);
    }
}
