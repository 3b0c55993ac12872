//! The losses of a shape fit's images, each with its weighted gradient by the rendered images.

use super::{ShapeOptions, Targets};
use crate::error::Result;
use crate::fit::image_loss::{ImageLoss, Valued, add_pooled_gradient, pooled};
use crate::gradients::ImageGradient;
use crate::image::Image;
use crate::renderer::Frame;

/// The least silhouette of a pixel of the targets at which all of it shows the surface.
pub const COVERED: f32 = 0.99;

/// The losses of some views, unweighted; 0 for images without a target.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ImageLosses {
    pub silhouette: f64,
    pub color: f64,
    pub depth: f64,
    pub normal: f64,
}

impl ImageLosses {
    /// Adds a share of those of some views.
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
pub fn compare(frame: &Frame, targets: &Targets, options: &ShapeOptions) -> Result<(ImageLosses, ImageGradient)> {
    let (mut losses, mut by) = (ImageLosses::default(), ImageGradient::default());
    if let (Some(rendered), Some(target)) = (frame.silhouette(), &targets.silhouette) {
        let pooled = Pooled::of(rendered, options)?;
        let (loss, gradient) = pooled.against(rendered, target, options.silhouette, options)?;
        (losses.silhouette, by.silhouette) = (loss, Some(gradient));
    }
    if let (Some(rendered), Some(target)) = (frame.color(), &targets.color) {
        let (loss, gradient) = Pooled::of(rendered, options)?.against(rendered, target, options.color, options)?;
        (losses.color, by.color) = (loss, Some(gradient));
    }
    if let (Some(rendered), Some(target)) = (frame.normal(), &targets.normal) {
        let mut pooled = Pooled::of(rendered, options)?;
        let known = known(target, targets.silhouette.as_ref());
        pooled.keep(&known);
        let (loss, mut gradient) = pooled.against(rendered, &masked(target, &known), options.normal, options)?;
        mask_fine(&mut gradient, &known, options.samples);
        (losses.normal, by.normal) = (loss, Some(gradient));
    }
    if let (Some(depth), Some(silhouette), Some(target)) = (frame.depth(), frame.silhouette(), &targets.depth) {
        let (loss, [by_depth, by_silhouette]) = compare_depths(depth, silhouette, target, targets, options)?;
        (losses.depth, by.depth) = (loss, Some(by_depth));
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
    targets: &Targets,
    options: &ShapeOptions,
) -> Result<(f64, [Image; 2])> {
    let known = known(target, targets.silhouette.as_ref());
    let means = means(target, &known);
    let (mut rendered, coverage) = (Pooled::of(depth, options)?, Pooled::of(silhouette, options)?);
    let pixels = target.height * target.width;
    let mut goal = masked(target, &known);
    for (i, (value, covered)) in rendered.image.data.iter_mut().zip(&coverage.image.data).enumerate() {
        *value -= means[i / pixels] * covered;
        goal.data[i] -= if known[i] { means[i / pixels] } else { 0.0 };
    }
    rendered.keep(&known);
    let (loss, mut by_depth) = rendered.against(depth, &goal, options.depth, options)?;
    mask_fine(&mut by_depth, &known, options.samples);
    let mut by_silhouette = by_depth.clone();
    let fine = by_depth.height * by_depth.width;
    by_silhouette.data.iter_mut().enumerate().for_each(|(i, g)| *g *= -means[i / fine]);
    Ok((loss, [by_depth, by_silhouette]))
}

/// A rendered image with the targets' pixels.
struct Pooled {
    image: Image,
}

impl Pooled {
    fn of(rendered: &Image, options: &ShapeOptions) -> Result<Self> {
        Ok(Self { image: if options.samples == 1 { rendered.clone() } else { pooled(rendered, options.samples)? } })
    }

    /// Makes the pixels black that are not to be compared.
    fn keep(&mut self, known: &[bool]) {
        self.image = masked(&self.image, known);
    }

    /// The unweighted loss and its weighted gradient by the rendered image.
    fn against(
        &self,
        rendered: &Image,
        target: &Image,
        (loss, weight): (ImageLoss, f64),
        options: &ShapeOptions,
    ) -> Result<(f64, Image)> {
        let Valued { value, mut gradient } = loss.multi_scale(&self.image, target, None, options.levels)?;
        if options.samples > 1 {
            let mut fine = Image { data: vec![0.0; rendered.data.len()], ..*rendered };
            add_pooled_gradient(&mut fine, &gradient, options.samples, 1.0)?;
            gradient = fine;
        }
        if weight != 1.0 {
            gradient.data.iter_mut().for_each(|g| *g *= weight as f32);
        }
        Ok((value, gradient))
    }
}

/// Whether each pixel of a target shows the surface and nothing beside it. An unknown value is 0 in all channels.
fn known(target: &Image, silhouette: Option<&Image>) -> Vec<bool> {
    let given = target.data.chunks_exact(target.channels).map(|pixel| pixel.iter().any(|x| *x != 0.0));
    match silhouette {
        Some(silhouette) => given.zip(&silhouette.data).map(|(given, a)| given && *a >= COVERED).collect(),
        None => given.collect(),
    }
}

fn masked(image: &Image, known: &[bool]) -> Image {
    let pixels = image.data.chunks_exact(image.channels).zip(known);
    let data = pixels.flat_map(|(pixel, known)| pixel.iter().map(move |x| if *known { *x } else { 0.0 })).collect();
    Image { data, ..*image }
}

/// Makes the gradient 0 by the samples of pixels that are not compared.
fn mask_fine(gradient: &mut Image, known: &[bool], samples: usize) {
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
