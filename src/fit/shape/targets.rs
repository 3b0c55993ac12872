//! The target images of a shape fit.

use crate::error::Result;
use crate::fit::bad;
use crate::image::Image;
use crate::scene::Camera;
use std::{borrow::Cow, ops::Range};

/// The target images of a shape fit; at least one of silhouette and colour.
#[derive(Clone, Debug, Default)]
pub struct Targets {
    /// One for each view.
    pub cameras: Vec<Camera>,
    /// `[views, height, width, 1]`.
    pub silhouette: Option<Image>,
    /// `[views, height, width, 3]`, linear, on the settings' background colour.
    pub color: Option<Image>,
}

impl Targets {
    /// The targets of some of the views.
    pub(super) fn views(&self, range: Range<usize>) -> Cow<'_, Self> {
        if range.len() == self.cameras.len() {
            return Cow::Borrowed(self);
        }
        let some = |image: &Option<Image>| image.as_ref().map(|image| image.views(range.clone()));
        let (silhouette, color) = (some(&self.silhouette), some(&self.color));
        Cow::Owned(Self { cameras: self.cameras[range].to_vec(), silhouette, color })
    }

    /// Height and width of the targets.
    ///
    /// # Errors
    /// [`crate::Error::Fit`] without any image, or when the images do not go with the cameras and each other.
    pub fn size(&self) -> Result<(usize, usize)> {
        let shape = |image: &Image| [image.batch, image.height, image.width];
        let images = [(&self.silhouette, 1), (&self.color, 3)];
        let mut shapes = images.iter().filter_map(|(image, channels)| image.as_ref().map(|i| (i, *channels)));
        let Some((first, _)) = shapes.clone().next() else {
            return bad("targets without an image", "give silhouettes, colours or both");
        };
        let right = |(image, channels): (&Image, usize)| {
            shape(image) == shape(first)
                && image.channels == channels
                && image.batch == self.cameras.len()
                && image.is_whole()
        };
        if !shapes.all(right) {
            let what = format!("images of shape {:?} for {} cameras", shape(first), self.cameras.len());
            return bad(what, "give one image of the same size for each camera, 1 channel of silhouette, 3 of colour");
        }
        Ok((first.height, first.width))
    }
}
