//! The losses of a shape fit's images, each with its weighted gradient by the rendered images.

use super::options::ShapeOptions;
use crate::optimize::image_loss::{ImageLoss, LossGradient, pooled, pooled_gradient};
use softras::{Frame, Image, ImageGradient, Result};
use softras_io::Views;
use std::borrow::Cow;

/// The least silhouette value of a target's pixel that shows nothing but the surface.
const COVERED: f32 = 0.99;

/// The losses of some views, unweighted; 0 for images without a target.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ImageLosses {
    pub silhouette: f64,
    pub color: f64,
    pub depth: f64,
    pub normal: f64,
}

impl ImageLosses {
    /// Adds the losses of some views times their share of all views.
    pub fn add(&mut self, part: &Self, share: f64) {
        self.silhouette += share * part.silhouette;
        self.color += share * part.color;
        self.depth += share * part.depth;
        self.normal += share * part.normal;
    }

    /// The sum with the options' weights.
    pub fn weighted(&self, options: &ShapeOptions) -> f64 {
        let ShapeOptions { silhouette, color, depth, normal, .. } = options;
        silhouette.1 * self.silhouette + color.1 * self.color + depth.1 * self.depth + normal.1 * self.normal
    }
}

/// The losses of a frame against the targets, and the gradient of their weighted sum by its images.
pub fn compare(frame: &Frame, targets: &Views, options: &ShapeOptions) -> Result<(ImageLosses, ImageGradient)> {
    let (mut losses, mut by) = (ImageLosses::default(), ImageGradient::default());
    if let (Ok(rendered), Some(target)) = (frame.silhouette(), &targets.silhouette) {
        let (value, gradient) = loss(&*shrunk(rendered, options)?, rendered, target, options.silhouette, options)?;
        (losses.silhouette, by.silhouette) = (value, Some(gradient));
    }
    if let (Ok(rendered), Some(target)) = (frame.color(), &targets.color) {
        let shown = shrunk(rendered, options)?;
        let (value, gradient) = loss(&shown, rendered, &reached(target, &shown), options.color, options)?;
        (losses.color, by.color) = (value, Some(gradient));
    }
    if let (Ok(rendered), Some(target)) = (frame.normal(), &targets.normal) {
        let known = known(target, targets.silhouette.as_ref());
        let shown = masked(&*shrunk(rendered, options)?, &known);
        let (value, mut gradient) = loss(&shown, rendered, &masked(target, &known), options.normal, options)?;
        mask_samples(&mut gradient, &known, options.samples);
        (losses.normal, by.normal) = (value, Some(gradient));
    }
    if let (Ok(depth), Ok(silhouette), Some(target)) = (frame.depth(), frame.silhouette(), &targets.depth) {
        let (value, [by_depth, by_silhouette]) = compare_depths(depth, silhouette, target, targets, options)?;
        (losses.depth, by.depth) = (value, Some(by_depth));
        match &mut by.silhouette {
            Some(sum) => sum.data.iter_mut().zip(&by_silhouette.data).for_each(|(sum, g)| *sum += g),
            None => by.silhouette = Some(by_silhouette),
        }
    }
    Ok((losses, by))
}

/// Compares A z - A z̄ with z' - z̄ where the depth z' of the target is known: z̄ is the mean of z' in each view, A the rendered
/// silhouette and A z the rendered depth, which fades with it. So a pixel that the mesh does not reach is off by no more than
/// the depth of the object.
fn compare_depths(
    depth: &Image,
    silhouette: &Image,
    target: &Image,
    targets: &Views,
    options: &ShapeOptions,
) -> Result<(f64, [Image; 2])> {
    let known = known(target, targets.silhouette.as_ref());
    let means = means(target, &known);
    let pixels = target.height * target.width;
    let mut shown = shrunk(depth, options)?.into_owned();
    let coverage = shrunk(silhouette, options)?;
    let mut goal = target.clone();
    for (i, (value, covered)) in shown.data.iter_mut().zip(&coverage.data).enumerate() {
        *value -= means[i / pixels] * covered;
        goal.data[i] -= means[i / pixels];
    }
    let (shown, goal) = (masked(&shown, &known), masked(&goal, &known));
    let (value, mut by_depth) = loss(&shown, depth, &goal, options.depth, options)?;
    mask_samples(&mut by_depth, &known, options.samples);
    let mut by_silhouette = by_depth.clone();
    let samples = by_depth.height * by_depth.width;
    by_silhouette.data.iter_mut().enumerate().for_each(|(i, g)| *g *= -means[i / samples]);
    Ok((value, [by_depth, by_silhouette]))
}

/// A rendered image with the targets' pixels.
fn shrunk<'a>(rendered: &'a Image, options: &ShapeOptions) -> Result<Cow<'a, Image>> {
    Ok(if options.samples == 1 { Cow::Borrowed(rendered) } else { Cow::Owned(pooled(rendered, options.samples)?) })
}

/// The unweighted loss of an image with the targets' pixels, and its weighted gradient by the rendered image.
fn loss(
    shown: &Image,
    rendered: &Image,
    target: &Image,
    (loss, weight): (ImageLoss, f64),
    options: &ShapeOptions,
) -> Result<(f64, Image)> {
    let LossGradient { value, mut gradient } = loss.evaluate(shown, target, None)?;
    if options.samples > 1 {
        gradient = pooled_gradient(rendered, &gradient, options.samples, 1.0)?;
    }
    if weight != 1.0 {
        gradient.data.iter_mut().for_each(|g| *g *= weight as f32);
    }
    Ok((value, gradient))
}

/// A target of colours in which those that are only known to be bright are as bright as an image, where that is bright enough.
pub fn reached(target: &Image, shown: &Image) -> Image {
    let one = |(target, shown): (&f32, &f32)| if *target < 0.0 { shown.max(-target) } else { *target };
    Image { data: target.data.iter().zip(&shown.data).map(one).collect(), ..*target }
}

/// Whether each pixel of a target shows the surface and nothing beside it. A value that is 0 in all channels or not finite is not
/// known, nor is a depth below 0.
pub fn known(target: &Image, silhouette: Option<&Image>) -> Vec<bool> {
    let is_given = |pixel: &[f32]| match pixel {
        [depth] => depth.is_finite() && *depth > 0.0,
        normal => normal.iter().all(|x| x.is_finite()) && normal.iter().any(|x| *x != 0.0),
    };
    let given = target.data.chunks_exact(target.channels).map(is_given);
    match silhouette {
        Some(silhouette) => given.zip(&silhouette.data).map(|(given, a)| given && *a >= COVERED).collect(),
        None => given.collect(),
    }
}

/// The image with 0 in the pixels that are not known.
pub fn masked(image: &Image, known: &[bool]) -> Image {
    let pixels = image.data.chunks_exact(image.channels).zip(known);
    let data = pixels.flat_map(|(pixel, known)| pixel.iter().map(move |x| if *known { *x } else { 0.0 })).collect();
    Image { data, ..*image }
}

/// Makes the gradient 0 by the samples of pixels that are not compared.
fn mask_samples(gradient: &mut Image, known: &[bool], samples: usize) {
    let (height, width, channels) = (gradient.height, gradient.width, gradient.channels);
    let coarse = width / samples;
    for (i, pixel) in gradient.data.chunks_exact_mut(channels).enumerate() {
        let (view, row, column) = (i / (height * width), i / width % height, i % width);
        if !known[(view * (height / samples) + row / samples) * coarse + column / samples] {
            pixel.fill(0.0);
        }
    }
}

/// The mean of each view's known depths.
fn means(target: &Image, known: &[bool]) -> Vec<f32> {
    let pixels = target.height * target.width;
    let mean = |(depths, known): (&[f32], &[bool])| {
        let all: Vec<f64> = depths.iter().zip(known).filter(|(_, known)| **known).map(|(z, _)| f64::from(*z)).collect();
        (all.iter().sum::<f64>() / all.len().max(1) as f64) as f32
    };
    target.data.chunks_exact(pixels).zip(known.chunks_exact(pixels)).map(mean).collect()
}
