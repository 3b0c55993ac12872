//! The target images of a pose fit, and the loss against them.

use crate::bad;
use crate::optimize::image_loss::{blurred, blurred_gradient, pooled, pooled_gradient};
use crate::photographs::cameras::outer;
use glam::{DMat3, DVec3};
use softras::{Frame, Image, ImageGradient, Result};
use std::{borrow::Cow, ops::Range};

/// Added to the variance of colours, so that colour differences below about a tenth carry no information.
const LEAST_VARIANCE: f64 = 0.01;

/// The target images of a [`PoseFit`](crate::PoseFit), one for each pose, and the loss against them.
///
/// The loss of a view is the mean over pixels of w₀ eᵀ M e + w₁ f². f is the blurred difference of the silhouettes A,
/// and e that of ΔC - μ ΔA for colours C on black, where μ is the mean colour of the target's object and M the inverse
/// of the regularised covariance of its colours. Subtracting μ ΔA removes the outline from the colour term, since many
/// wrong poses share an outline; M makes all directions of colour count equally. An object of one colour has the
/// silhouette term only.
#[derive(Clone, Debug)]
pub struct PoseTarget {
    color: Image,
    silhouette: Image,
    metrics: Vec<Metric>,
}

/// The metric of colour differences: μ and M of [`PoseTarget`].
#[derive(Clone, Copy, Debug)]
struct Metric {
    mean: DVec3,
    inverse: DMat3,
}

impl PoseTarget {
    /// A target of colours on black, `[poses, height, width, 3]`, and silhouettes, `[poses, height, width, 1]`.
    ///
    /// # Errors
    /// [`softras::Error::Fit`] for images of other shapes.
    pub fn new(color: Image, silhouette: Image) -> Result<Self> {
        let shape = |i: &Image| [i.batch, i.height, i.width];
        let whole = |i: &Image, channels: usize| i.channels == channels && i.is_whole();
        if shape(&color) != shape(&silhouette) || !whole(&color, 3) || !whole(&silhouette, 1) {
            let what = format!("a target of shapes {:?} and {:?}", shape(&color), shape(&silhouette));
            return bad(what, "give colours and silhouettes of one size for each pose");
        }
        let metrics = (0..color.batch).map(|view| Metric::of(color.view(view), silhouette.view(view))).collect();
        Ok(Self { color, silhouette, metrics })
    }

    /// These images with unweighted colour differences: μ = 0, M = 1.
    pub fn plain(self) -> Self {
        let metrics = vec![Metric { mean: DVec3::ZERO, inverse: DMat3::IDENTITY }; self.metrics.len()];
        Self { metrics, ..self }
    }

    /// The images' height in pixels.
    pub(super) fn height(&self) -> usize {
        self.color.height
    }

    /// Refuses a target that does not have one image for each of `poses` poses.
    pub(super) fn validate(&self, poses: usize) -> Result<()> {
        match self.metrics.len() {
            count if count == poses => Ok(()),
            count => bad(format!("{count} targets for {poses} poses"), "give one target for each pose"),
        }
    }

    /// The targets of some of the poses.
    pub(super) fn part(&self, poses: Range<usize>) -> Cow<'_, Self> {
        if poses.len() == self.metrics.len() {
            return Cow::Borrowed(self);
        }
        let (color, silhouette) = (self.color.views(poses.clone()), self.silhouette.views(poses.clone()));
        Cow::Owned(Self { color, silhouette, metrics: self.metrics[poses].to_vec() })
    }

    /// Each view's loss, and the gradient of their sum by the frame's images. `blur` is the standard deviation in
    /// pixels of the target, `weights` are w₀ and w₁. If the frame is n times as wide and high as the target, the mean of each n×n
    /// pixels is compared.
    ///
    /// # Errors
    /// [`softras::Error::Settings`] for a frame without colour or silhouette, [`softras::Error::Fit`] for one whose size is no
    /// multiple of the target's.
    pub fn compare(&self, frame: &Frame, blur: f64, weights: [f64; 2]) -> Result<(Vec<f64>, ImageGradient)> {
        let (color, silhouette) = (frame.color()?, frame.silhouette()?);
        let samples = color.width / self.color.width.max(1);
        if samples <= 1 {
            let (losses, by_color, by_silhouette) = self.compare_pixels(color, silhouette, blur, weights)?;
            return Ok((losses, gradient_by(by_color, by_silhouette)));
        }
        let (means, coverage) = (pooled(color, samples)?, pooled(silhouette, samples)?);
        let (losses, by_color, by_silhouette) = self.compare_pixels(&means, &coverage, blur, weights)?;
        let by_color = pooled_gradient(color, &by_color, samples, 1.0)?;
        Ok((losses, gradient_by(by_color, pooled_gradient(silhouette, &by_silhouette, samples, 1.0)?)))
    }

    /// Each view's loss and the gradients by colour and by silhouette, for images of the target's size.
    fn compare_pixels(
        &self,
        color: &Image,
        silhouette: &Image,
        blur: f64,
        weights: [f64; 2],
    ) -> Result<(Vec<f64>, Image, Image)> {
        let shape = |i: &Image| [i.batch, i.height, i.width, i.channels];
        if shape(color) != shape(&self.color) {
            let what = format!("a target of shape {:?} for images of shape {:?}", shape(&self.color), shape(color));
            return bad(what, "give one target for each pose");
        }
        let difference =
            |a: &Image, b: &Image| Image { data: a.data.iter().zip(&b.data).map(|(a, b)| a - b).collect(), ..*a };
        let (mut by_color, mut by_silhouette) =
            (difference(color, &self.color), difference(silhouette, &self.silhouette));
        let pixels = color.height * color.width;
        for (i, (e, f)) in by_color.data.chunks_exact_mut(3).zip(&by_silhouette.data).enumerate() {
            let mean = self.metrics[i / pixels].mean;
            (0..3).for_each(|k| e[k] -= (mean[k] * f64::from(*f)) as f32);
        }
        (by_color, by_silhouette) = (blurred(&by_color, blur)?, blurred(&by_silhouette, blur)?);
        let mut losses = vec![0.0; color.batch];
        let coarse = by_color.height * by_color.width;
        let [by_e, by_f] = weights.map(|weight| weight / coarse as f64);
        for (i, (e, f)) in by_color.data.chunks_exact_mut(3).zip(&mut by_silhouette.data).enumerate() {
            let wide = DVec3::new(f64::from(e[0]), f64::from(e[1]), f64::from(e[2]));
            let slope = by_e * (self.metrics[i / coarse].inverse * wide);
            losses[i / coarse] += slope.dot(wide) + by_f * f64::from(*f) * f64::from(*f);
            (0..3).for_each(|k| e[k] = (2.0 * slope[k]) as f32);
            *f *= (2.0 * by_f) as f32;
        }
        let by_color = blurred_gradient(color, &by_color, blur)?;
        let mut by_silhouette = blurred_gradient(silhouette, &by_silhouette, blur)?;
        for (i, (e, f)) in by_color.data.chunks_exact(3).zip(&mut by_silhouette.data).enumerate() {
            let mean = self.metrics[i / pixels].mean;
            *f -= (0..3).map(|k| mean[k] * f64::from(e[k])).sum::<f64>() as f32;
        }
        Ok((losses, by_color, by_silhouette))
    }
}

fn gradient_by(color: Image, silhouette: Image) -> ImageGradient {
    ImageGradient { color: Some(color), silhouette: Some(silhouette), ..ImageGradient::default() }
}

impl Metric {
    /// The metric of an object's colours, given on black, where its coverage is above ½.
    fn of(color: &[f32], silhouette: &[f32]) -> Self {
        let pixels = || {
            color.chunks_exact(3).zip(silhouette).filter(|(_, a)| **a > 0.5).map(|(c, a)| {
                let a = f64::from(*a);
                DVec3::new(f64::from(c[0]), f64::from(c[1]), f64::from(c[2])) / a
            })
        };
        let count = (pixels().count() as f64).max(1.0);
        let mean = pixels().sum::<DVec3>() / count;
        let sum = pixels().fold(DMat3::ZERO, |sum, c| sum + outer(c - mean));
        let covariance = sum * count.recip() + DMat3::from_diagonal(DVec3::splat(LEAST_VARIANCE));
        // The inverse exists: every eigenvalue is at least `LEAST_VARIANCE`.
        Self { mean, inverse: covariance.inverse() }
    }
}
