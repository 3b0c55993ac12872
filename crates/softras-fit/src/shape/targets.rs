//! The target images of a shape fit.

use crate::bad;
use softras::{Image, Result, scene::Camera};
use std::borrow::Cow;

/// The target images of a shape fit, at least one of them.
#[derive(Clone, Debug, Default)]
pub struct Targets {
    /// One for each view.
    pub cameras: Vec<Camera>,
    /// `[views, height, width, 1]`.
    pub silhouette: Option<Image>,
    /// `[views, height, width, 3]`, linear, on the settings' background colour.
    pub color: Option<Image>,
    /// `[views, height, width, 1]`: the view depth, in world units, of the surface that a pixel shows; 0, or what is not finite,
    /// where it is not known. Only pixels that the silhouette covers wholly are compared.
    pub depth: Option<Image>,
    /// `[views, height, width, 3]`: the surface's unit normal in world space; 0, or what is not finite, where it is not known. Only
    /// pixels that the silhouette covers wholly are compared.
    pub normal: Option<Image>,
}

impl Targets {
    /// The targets of some of the views.
    pub(super) fn views(&self, views: &[usize]) -> Cow<'_, Self> {
        if views.len() == self.cameras.len() {
            return Cow::Borrowed(self);
        }
        let some = |image: &Option<Image>| image.as_ref().map(|image| image.views(views.iter().copied()));
        Cow::Owned(Self {
            cameras: views.iter().map(|&view| self.cameras[view]).collect(),
            silhouette: some(&self.silhouette),
            color: some(&self.color),
            depth: some(&self.depth),
            normal: some(&self.normal),
        })
    }

    /// Height and width of the targets.
    ///
    /// # Errors
    /// [`softras::Error::Fit`] without any image, or when the images do not go with the cameras and each other.
    pub fn size(&self) -> Result<(usize, usize)> {
        let images = [&self.silhouette, &self.color, &self.depth, &self.normal];
        let named = ["silhouettes", "colors", "depths", "normals"].into_iter().zip(images).zip([1, 3, 1, 3]);
        let given = named.filter_map(|((name, image), channels)| image.as_ref().map(|image| (name, image, channels)));
        let Some((_, first, _)) = given.clone().next() else {
            return bad("targets without an image", "give silhouettes, colours, depths or normals");
        };
        for (name, image, channels) in given {
            let shape = [image.batch, image.height, image.width, image.channels];
            let right = [self.cameras.len(), first.height, first.width, channels];
            if shape != right || !image.is_whole() {
                let what =
                    format!("{name} of shape {shape:?} with {} values for {} cameras", image.data.len(), right[0]);
                return bad(what, &format!("give {name} of shape {right:?}, as large as the other images"));
            }
        }
        Ok((first.height, first.width))
    }
}
