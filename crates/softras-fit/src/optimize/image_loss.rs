//! Image losses, each with its value and its gradient by every value of the predicted image.
//!
//! Sums are taken in f64 in the order of the values, so a loss has the same bits on every machine.

use crate::bad;
use crate::shown;
use softras::{Image, Result};

/// Keeps the IoU of two empty silhouettes finite; the official code's number.
const IOU_EPSILON: f64 = 1e-6;

/// A loss and its gradient.
#[derive(Clone, Debug, PartialEq)]
pub struct LossGradient {
    /// The loss.
    pub value: f64,
    /// dL/dprediction, in the prediction's shape.
    pub gradient: Image,
}

/// The loss of a predicted image P against a target T, with a weight w for every value (1 unless given).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ImageLoss {
    /// The mean over views of 1 - Σ w P T / (Σ w (P + T - P T) + 1e-6), as the official code has it. For silhouettes.
    NegativeIou,
    /// Σ w |P - T| / Σ w; the gradient by a value that equals its target is 0.
    L1,
    /// Σ w (P - T)² / Σ w.
    L2,
}

impl ImageLoss {
    /// The loss and its gradient. `weights` has the prediction's shape with one channel; 0 masks a pixel out.
    ///
    /// # Errors
    /// [`softras::Error::Fit`] when shapes differ, a weight is negative or not finite, or all are 0.
    pub fn evaluate(self, prediction: &Image, target: &Image, weights: Option<&Image>) -> Result<LossGradient> {
        validate(prediction, target, weights)?;
        let weight = Weight { data: weights.map(|w| &w.data[..]), channels: prediction.channels };
        let penalty: fn(f64) -> (f64, f64) = match self {
            Self::NegativeIou => return Ok(negative_iou(prediction, target, &weight)),
            Self::L1 => |d| (d.abs(), if d == 0.0 { 0.0 } else { d.signum() }),
            Self::L2 => |d| (d * d, 2.0 * d),
        };
        let total: f64 = (0..prediction.data.len()).map(|i| weight.at(i)).sum();
        if total <= 0.0 {
            return bad("no pixel has a weight above 0", "leave some pixels in the mask");
        }
        let mut value = 0.0;
        let pairs = prediction.data.iter().zip(&target.data).enumerate();
        let data = pairs.map(|(i, (&p, &t))| {
            let (penalty, slope) = penalty(f64::from(p) - f64::from(t));
            let share = weight.at(i) / total;
            value += share * penalty;
            (share * slope) as f32
        });
        let data = data.collect();
        Ok(LossGradient { value, gradient: Image { data, ..shape_of(prediction) } })
    }
}

/// The intersection over union of each view's masks, the pixels above ½; 1 where both masks are empty.
///
/// # Errors
/// [`softras::Error::Fit`] when the shapes differ.
pub fn mask_iou(prediction: &Image, target: &Image) -> Result<Vec<f64>> {
    validate(prediction, target, None)?;
    let one = |view: usize| {
        let (mut both, mut either) = (0u32, 0u32);
        for (&p, &t) in prediction.view(view).iter().zip(target.view(view)) {
            both += u32::from(p > 0.5 && t > 0.5);
            either += u32::from(p > 0.5 || t > 0.5);
        }
        if either == 0 { 1.0 } else { f64::from(both) / f64::from(either) }
    };
    Ok((0..prediction.batch).map(one).collect())
}

fn validate(prediction: &Image, target: &Image, weights: Option<&Image>) -> Result<()> {
    let shape = |i: &Image| [i.batch, i.height, i.width, i.channels];
    let expected = shape(prediction);
    if shape(target) != expected || !target.is_whole() || !prediction.is_whole() {
        let what = format!("a prediction of shape {expected:?} and a target of shape {:?}", shape(target));
        return bad(what, "both must be [views, height, width, channels] of the same size, at least one value");
    }
    let Some(weights) = weights else { return Ok(()) };
    if shape(weights) != [expected[0], expected[1], expected[2], 1] || !weights.is_whole() {
        let what = format!("weights of shape {:?} for images of shape {expected:?}", shape(weights));
        return bad(what, "give one weight a pixel");
    }
    match weights.data.iter().position(|w| !(w.is_finite() && *w >= 0.0)) {
        Some(i) => bad(format!("weight {} at value {i}", weights.data[i]), "weights must be finite and not negative"),
        None => Ok(()),
    }
}

/// The weight of each value of the prediction, by its index.
struct Weight<'a> {
    /// One of each pixel; `None` for 1.
    data: Option<&'a [f32]>,
    channels: usize,
}

impl Weight<'_> {
    fn at(&self, i: usize) -> f64 {
        self.data.map_or(1.0, |w| f64::from(w[i / self.channels]))
    }
}

fn shape_of(image: &Image) -> Image {
    Image { data: Vec::new(), ..*image }
}

fn negative_iou(prediction: &Image, target: &Image, weight: &Weight<'_>) -> LossGradient {
    let views = prediction.batch as f64;
    let mut value = 0.0;
    let mut data = Vec::with_capacity(prediction.data.len());
    for view in 0..prediction.batch {
        let (p, t) = (prediction.view(view), target.view(view));
        let first = view * p.len();
        let (mut both, mut either) = (0.0, IOU_EPSILON);
        for (i, (&p, &t)) in p.iter().zip(t).enumerate() {
            let (w, p, t) = (weight.at(first + i), f64::from(p), f64::from(t));
            both += w * p * t;
            either += w * (p + t - p * t);
        }
        value += (1.0 - both / either) / views;
        // d(both / either) = (T either - both (1 - T)) / either².
        let slope_of = |w: f64, t: f64| -w * (t * either - both * (1.0 - t)) / (either * either * views);
        data.extend(t.iter().enumerate().map(|(i, &t)| slope_of(weight.at(first + i), f64::from(t)) as f32));
    }
    LossGradient { value, gradient: Image { data, ..shape_of(prediction) } }
}

/// An image `factor` times smaller, sides rounded up: a pixel is the mean of the up to factor² fine ones under it.
///
/// # Errors
/// [`softras::Error::Fit`] for a factor of 0, and for an image without values or not as its shape says.
pub fn pooled(image: &Image, factor: usize) -> Result<Image> {
    let mut coarse = pooled_shape(image, factor)?;
    let mut data = vec![0.0; coarse.batch * coarse.height * coarse.width * coarse.channels];
    each_pair(image, &coarse, factor, |fine, at, share| data[at] += image.data[fine] * share);
    coarse.data = data;
    Ok(coarse)
}

/// The shape of a pooled image, without its values.
fn pooled_shape(fine: &Image, factor: usize) -> Result<Image> {
    if factor == 0 {
        return bad("pixels pooled by a factor of 0", "use 1 or more");
    }
    if !fine.is_whole() {
        return bad(told(fine), "give as many values as the shape says, at least one");
    }
    Ok(Image { height: fine.height.div_ceil(factor), width: fine.width.div_ceil(factor), ..shape_of(fine) })
}

fn told(image: &Image) -> String {
    let Image { batch, height, width, channels, ref data } = *image;
    format!("an image of shape {:?} with {} values", [batch, height, width, channels], data.len())
}

/// The transpose of [`pooled`]: `scale` times the gradient by an image whose pooled image has the gradient `coarse`.
///
/// # Errors
/// As [`pooled`] for the image; [`softras::Error::Fit`] for a gradient that is not as its pooled image.
pub fn pooled_gradient(image: &Image, coarse: &Image, factor: usize, scale: f64) -> Result<Image> {
    if !coarse.is_whole() || shape_of(coarse) != pooled_shape(image, factor)? {
        return bad(told(coarse), "give one value for each of the pooled image");
    }
    let mut data = vec![0.0; image.data.len()];
    each_pair(image, coarse, factor, |at, from, share| {
        data[at] += (scale * f64::from(coarse.data[from])) as f32 * share
    });
    Ok(Image { data, ..*image })
}

/// An image blurred by a Gaussian with a standard deviation in pixels; beyond its edges the image counts as black. For
/// a wide blur the image is first pooled by [`blur_factor`], so the result is smaller.
///
/// # Errors
/// [`softras::Error::Fit`] for a standard deviation outside 0 to a million, and as [`pooled`].
pub fn blurred(image: &Image, deviation: f64) -> Result<Image> {
    let factor = blur_factor(deviation)?;
    pooled_shape(image, factor)?;
    let mut coarse = if factor > 1 { pooled(image, factor)? } else { image.clone() };
    gaussian(&mut coarse, deviation / factor as f64);
    Ok(coarse)
}

/// The transpose of [`blurred`]: the gradient by an image whose blurred image has the gradient `coarse`.
///
/// # Errors
/// As [`blurred`].
pub fn blurred_gradient(image: &Image, coarse: &Image, deviation: f64) -> Result<Image> {
    let factor = blur_factor(deviation)?;
    if !coarse.is_whole() {
        return bad(told(coarse), "give one value for each of the blurred image");
    }
    let mut coarse = coarse.clone();
    // With black beyond the edges the Gaussian is a symmetric matrix, so it is its own transpose.
    gaussian(&mut coarse, deviation / factor as f64);
    pooled_gradient(image, &coarse, factor, 1.0)
}

/// The factor by which an image is pooled before a blur: a third of the standard deviation in pixels, at least 1.
///
/// # Errors
/// [`softras::Error::Fit`] for a standard deviation outside 0 to a million.
pub fn blur_factor(deviation: f64) -> Result<usize> {
    if !((0.0..=MAX_BLUR).contains(&deviation)) {
        return bad(format!("a blur of {} pixels", shown(deviation)), "use 0 to 1e6");
    }
    Ok((deviation / 3.0).max(1.0) as usize)
}

/// The largest standard deviation in pixels: far beyond any image.
const MAX_BLUR: f64 = 1e6;

/// Standard deviation in pixels below which a Gaussian's neighbouring pixels have no weight.
const LEAST_BLUR: f64 = 0.2;

fn gaussian(image: &mut Image, deviation: f64) {
    if deviation < LEAST_BLUR {
        return;
    }
    let reach = (3.0 * deviation).ceil() as usize;
    let weight = |i: usize| (-0.5 * (i as f64 / deviation).powi(2)).exp();
    let total = weight(0) + 2.0 * (1..=reach).map(weight).sum::<f64>();
    let kernel: Vec<f32> = (0..=reach).map(|i| (weight(i) / total) as f32).collect();
    let row = image.width * image.channels;
    for line in image.data.chunks_exact_mut(row) {
        let source = line.to_vec();
        convolve(&source, line, image.channels, &kernel);
    }
    for view in image.data.chunks_exact_mut(row * image.height) {
        let source = view.to_vec();
        convolve(&source, view, row, &kernel);
    }
}

/// to[i] = Σ kernel[|j|] from[i + j stride], over indices inside the line.
fn convolve(from: &[f32], to: &mut [f32], stride: usize, kernel: &[f32]) {
    to.iter_mut().zip(from).for_each(|(to, from)| *to = kernel[0] * from);
    for (j, weight) in kernel.iter().enumerate().skip(1).take_while(|(j, _)| j * stride < from.len()) {
        let shift = j * stride;
        to.iter_mut().zip(&from[shift..]).for_each(|(to, from)| *to += weight * from);
        to[shift..].iter_mut().zip(from).for_each(|(to, from)| *to += weight * from);
    }
}

/// Calls `visit` for every value of a fine image with its index, the index of the coarse value that it is pooled into,
/// and its share there.
fn each_pair(fine: &Image, coarse: &Image, factor: usize, mut visit: impl FnMut(usize, usize, f32)) {
    let channels = fine.channels;
    for row in 0..fine.batch * fine.height {
        let (view, r) = (row / fine.height, row % fine.height);
        let rows = factor.min(fine.height - r / factor * factor);
        for column in 0..fine.width {
            let columns = factor.min(fine.width - column / factor * factor);
            let from = (row * fine.width + column) * channels;
            let to = ((view * coarse.height + r / factor) * coarse.width + column / factor) * channels;
            (0..channels).for_each(|k| visit(from + k, to + k, 1.0 / (rows * columns) as f32));
        }
    }
}
