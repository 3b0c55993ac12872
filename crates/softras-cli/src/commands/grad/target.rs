//! The target image, and the loss against it.

use super::engine::Images;
use crate::commands::note;
use softras::{Image, ImageGradient, Result};
use softras_io::Budget;
use softras_io::Curve;
use softras_io::PictureFile;
use std::path::Path;

/// Bytes of a pixel of the target, of the images that are compared with it and of the sheet that shows them all.
const BYTES_PER_PIXEL: u64 = 400;

/// A target image.
pub struct Target {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Linear colour `[H, W, 3]` over the background.
    pub color: Vec<f64>,
    /// `[H, W]`.
    pub silhouette: Vec<f64>,
}

/// The loss and its parts.
#[derive(Clone, Debug, Default)]
pub struct Loss {
    /// The mean over the pixels of the squared differences of R, G and B.
    pub color: f64,
    /// The mean over the pixels of the squared difference of the silhouette.
    pub silhouette: f64,
    /// The loss of each pixel.
    pub pixels: Vec<f64>,
}

impl Loss {
    /// The total, which is differentiated.
    pub fn total(&self) -> f64 {
        self.color + self.silhouette
    }
}

impl Target {
    /// Reads a picture file.
    pub fn read(path: &Path, curve: Curve, background: [f64; 3], budget: &Budget) -> Result<Self> {
        let picture = PictureFile::open(path)?;
        let (width, height) = (picture.width, picture.height);
        budget.count_file(picture.file_bytes);
        let what = format!("a picture of {width}×{height} pixels");
        budget.claim(path, &what, picture.pixels().saturating_mul(BYTES_PER_PIXEL))?;
        let (picture, notes) = picture.decode_object(path)?;
        notes.iter().for_each(|text| note(text));
        let silhouette = picture.pixels().map(|pixel| f64::from(pixel.0[3]) / 255.0).collect();
        let mut color = Vec::new();
        for pixel in picture.pixels() {
            let [r, g, b, a] = pixel.0.map(|byte| f64::from(byte) / 255.0);
            let straight = [r, g, b].map(|byte| curve.decode(byte));
            color.extend((0..3).map(|k| a * straight[k] + (1.0 - a) * background[k]));
        }
        Ok(Self { width: width as usize, height: height as usize, color, silhouette })
    }

    /// The loss of an image and its derivatives by the image's values.
    pub fn loss(&self, images: &Images) -> (Loss, ImageGradient) {
        let count = (self.width * self.height) as f64;
        let differences =
            |ours: &[f64], theirs: &[f64]| ours.iter().zip(theirs).map(|(a, b)| a - b).collect::<Vec<f64>>();
        let color = differences(&images.color, &self.color);
        let silhouette = differences(&images.silhouette, &self.silhouette);
        let squares = |values: &[f64]| values.iter().map(|d| d * d).sum::<f64>();
        let pixels = color.chunks_exact(3).zip(&silhouette).map(|(c, s)| squares(c) + s * s);
        let loss =
            Loss { color: squares(&color) / count, silhouette: squares(&silhouette) / count, pixels: pixels.collect() };
        let image = |channels: usize, differences: Vec<f64>| {
            let data = differences.into_iter().map(|d| (2.0 * d / count) as f32).collect();
            Some(Image { batch: 1, height: self.height, width: self.width, channels, data })
        };
        let gradient =
            ImageGradient { color: image(3, color), silhouette: image(1, silhouette), ..ImageGradient::default() };
        (loss, gradient)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gradient_is_the_derivative_of_the_loss() {
        let target =
            Target { width: 2, height: 1, color: vec![0.1, 0.2, 0.3, 0.4, 0.5, 0.6], silhouette: vec![1.0, 0.0] };
        let images = |shift: f64| Images {
            color: vec![0.5, 0.1 + shift, 0.9, 0.0, 0.2, 0.6],
            silhouette: vec![0.25, 0.5],
            depth: Vec::new(),
        };
        let (loss, gradient) = target.loss(&images(0.0));
        let slope = (target.loss(&images(1e-4)).0.total() - target.loss(&images(-1e-4)).0.total()) / 2e-4;
        assert!(gradient.color.is_some_and(|g| (f64::from(g.data[1]) - slope).abs() < 1e-6));
        assert!((loss.pixels.iter().sum::<f64>() / 2.0 - loss.total()).abs() < 1e-12);
    }
}
