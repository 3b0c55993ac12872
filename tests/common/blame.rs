//! Which pixel a wrong gradient comes from.

use super::gradient::{Group, backward, groups, norm, reference_gradient};
use super::scenes::Case;
use softras::{GradientMode, GradientRequest, Image, ImageGradient, Renderer};

/// The upstream gradient of one pixel, counted over the batch; zero elsewhere.
pub fn only_pixel(upstream: &ImageGradient, pixel: usize) -> ImageGradient {
    let only = |image: &Option<Image>| {
        image.as_ref().map(|image| {
            let mut data = vec![0.0; image.data.len()];
            let range = pixel * image.channels..(pixel + 1) * image.channels;
            data[range.clone()].copy_from_slice(&image.data[range]);
            Image { data, ..*image }
        })
    };
    ImageGradient {
        color: only(&upstream.color),
        silhouette: only(&upstream.silhouette),
        depth: only(&upstream.depth),
        normal: only(&upstream.normal),
    }
}

/// The pixels that make most of the error of the `index`th gradient, each differentiated by itself.
pub fn blame(
    renderer: &mut Renderer,
    case: &Case,
    upstream: &ImageGradient,
    mode: GradientMode,
    index: usize,
) -> String {
    let (width, height) = (case.settings.width as usize, case.settings.height as usize);
    let off = |g: &Group| norm(&g.ours.iter().zip(&g.reference).map(|(a, b)| a - b).collect::<Vec<_>>());
    let mut found = Vec::new();
    for pixel in 0..case.cameras.len() * width * height {
        let alone = only_pixel(upstream, pixel);
        let Ok(ours) = backward(renderer, case, &alone, &GradientRequest { mode, ..GradientRequest::ALL }) else {
            continue;
        };
        let Ok(groups) = groups(case, &ours, &reference_gradient(case, &alone, mode)) else { continue };
        let group = &groups[index];
        found.push((off(group), norm(&group.reference), pixel));
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let line = |&(error, size, pixel): &(f64, f64, usize)| {
        let (view, row, column) = (pixel / (width * height), pixel / width % height, pixel % width);
        format!("view {view}, row {row}, column {column}: off by {error:.2e} of {size:.2e}")
    };
    found.iter().take(3).map(line).collect::<Vec<_>>().join("; ")
}
