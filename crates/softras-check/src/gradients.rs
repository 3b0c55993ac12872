//! Converts upstream gradients to the form that the reference takes.

use softras::{Image, ImageGradient};
use softras_reference::Upstream;

/// dL/dimage in the form that the reference takes.
pub fn upstream(images: &ImageGradient) -> Upstream {
    let exact = |image: &Option<Image>| image.as_ref().map(|i| i.data.iter().copied().map(f64::from).collect());
    Upstream {
        d_color: exact(&images.color),
        d_silhouette: exact(&images.silhouette),
        d_depth: exact(&images.depth),
        d_normal: exact(&images.normal),
    }
}
