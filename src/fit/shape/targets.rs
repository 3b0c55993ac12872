//! The target images of a shape fit.

use crate::error::Result;
use crate::fit::bad;
use crate::image::Image;
use crate::scene::Camera;
use std::{borrow::Cow, ops::Range};

/// The target images of a shape fit, at least one of them.
#[derive(Clone, Debug, Default)]
pub struct Targets {
    /// One for each view.
    pub cameras: Vec<Camera>,
    /// `[views, height, width, 1]`.
    pub silhouette: Option<Image>,
    /// `[views, height, width, 3]`, linear, on the settings' background colour.
    pub color: Option<Image>,
    /// `[views, height, width, 1]`: the view depth, in world units, of the surface that a pixel shows; 0 where it is not known.
    /// Only pixels that the silhouette covers wholly are compared.
    pub depth: Option<Image>,
    /// `[views, height, width, 3]`: the surface's unit normal in world space; 0 where it is not known. Only pixels that the
    /// silhouette covers wholly are compared.
    pub normal: Option<Image>,
}

impl Targets {
    /// The targets of some of the views.
    pub(super) fn views(&self, range: Range<usize>) -> Cow<'_, Self> {
        if range.len() == self.cameras.len() {
            return Cow::Borrowed(self);
        }
        let some = |image: &Option<Image>| image.as_ref().map(|image| image.views(range.clone()));
        Cow::Owned(Self {
            cameras: self.cameras[range.clone()].to_vec(),
            silhouette: some(&self.silhouette),
            color: some(&self.color),
            depth: some(&self.depth),
            normal: some(&self.normal),
        })
    }

    /// Height and width of the targets.
    ///
    /// # Errors
    /// [`crate::Error::Fit`] without any image, or when the images do not go with the cameras and each other.
    pub fn size(&self) -> Result<(usize, usize)> {
        let shape = |image: &Image| [image.batch, image.height, image.width];
        let images = [(&self.silhouette, 1), (&self.color, 3), (&self.depth, 1), (&self.normal, 3)];
        let mut shapes = images.iter().filter_map(|(image, channels)| image.as_ref().map(|i| (i, *channels)));
        let Some((first, _)) = shapes.clone().next() else {
            return bad("targets without an image", "give silhouettes, colours, depths or normals");
        };
        let right = |(image, channels): (&Image, usize)| {
            shape(image) == shape(first)
                && image.channels == channels
                && image.batch == self.cameras.len()
                && image.is_whole()
        };
        if !shapes.all(right) {
            let what = format!("images of shape {:?} for {} cameras", shape(first), self.cameras.len());
            let fix = "give one image of the same size for each camera, 1 channel of silhouette and depth, 3 of colour and normal";
            return bad(what, fix);
        }
        Ok((first.height, first.width))
    }
}
