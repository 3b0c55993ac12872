//! A rendered batch with its images, timings and counts.

use super::memory::Contents;
use super::pixels::{self, Spare};
use crate::error::{Error, Result};
use crate::frame::buffers::BufferId;
use crate::image::Image;
#[cfg(doc)]
use crate::scene::Outputs;
use crate::scene::Settings;
use std::sync::Arc;

/// The time of one stage on the device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StageTime {
    /// The stage's name, mostly that of its GLSL file.
    pub stage: &'static str,
    /// Milliseconds on the device.
    pub milliseconds: f64,
}

impl StageTime {
    /// The times of stages in milliseconds, from a timestamp before the first of them and one after each.
    pub(super) fn between<const N: usize>(stamps: &[f64], stages: [&'static str; N]) -> Vec<Self> {
        let spans = stamps.windows(2).map(|pair| pair[1] - pair[0]);
        stages.into_iter().zip(spans).map(|(stage, milliseconds)| Self { stage, milliseconds }).collect()
    }
}

/// Counts of a frame on the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameCounts {
    /// Entries of all tiles' lists.
    pub list_entries: u64,
    /// (pixel, triangle) pairs that the forward stage evaluated: every pixel of a tile against every entry of its list.
    pub forward_pairs: u64,
    /// Bytes of inputs uploaded for it; inputs that were on the device already do not count.
    pub uploaded_bytes: u64,
    /// Dispatches of its commands, as recorded.
    pub dispatches: u32,
    /// Dispatches of the latest backward pass's commands, as recorded; 0 before the first pass.
    pub backward_dispatches: u32,
}

/// One rendered batch. A saved one keeps its buffers on the device until it and its clones are dropped.
#[derive(Clone, Debug)]
pub struct Frame {
    color: Option<Image>,
    silhouette: Option<Image>,
    depth: Option<Image>,
    normal: Option<Image>,
    features: Option<Image>,
    timings: Vec<StageTime>,
    /// Takes the memory of the images back.
    spare: Spare,
    /// The owner of the renderer's slot that keeps what backward needs; `None` for a frame that was not saved.
    pub(super) owner: Option<Arc<()>>,
}

impl Frame {
    /// RGB, linear, `[batch, height, width, 3]`.
    ///
    /// # Errors
    /// [`Error::Settings`] unless [`Outputs`] asked for it.
    pub fn color(&self) -> Result<&Image> {
        asked("outputs.color", &self.color)
    }

    /// The silhouette in [0, 1], `[batch, height, width, 1]`.
    ///
    /// # Errors
    /// As [`Frame::color`].
    pub fn silhouette(&self) -> Result<&Image> {
        asked("outputs.silhouette", &self.silhouette)
    }

    /// Σ w z in world units, `[batch, height, width, 1]`, 0 where no triangle contributes.
    ///
    /// # Errors
    /// As [`Frame::color`].
    pub fn depth(&self) -> Result<&Image> {
        asked("outputs.depth", &self.depth)
    }

    /// Σ w n in world space, `[batch, height, width, 3]`.
    ///
    /// # Errors
    /// As [`Frame::color`].
    pub fn normal(&self) -> Result<&Image> {
        asked("outputs.normal", &self.normal)
    }

    /// Σ w f of the meshes' features, `[batch, height, width, channels]`.
    ///
    /// # Errors
    /// As [`Frame::color`].
    pub fn features(&self) -> Result<&Image> {
        asked("outputs.features", &self.features)
    }

    /// The images that [`Outputs`] asked for, by its fields' names and in their order.
    pub fn images(&self) -> impl Iterator<Item = (&'static str, &Image)> {
        let all = [
            ("color", &self.color),
            ("silhouette", &self.silhouette),
            ("depth", &self.depth),
            ("normal", &self.normal),
            ("features", &self.features),
        ];
        all.into_iter().filter_map(|(name, image)| Some((name, image.as_ref()?)))
    }

    /// As [`Frame::images`], moved out without a copy. The frame, which then has no images, can be differentiated as before.
    pub fn take_images(&mut self) -> impl Iterator<Item = (&'static str, Image)> + use<> {
        let all = [
            ("color", self.color.take()),
            ("silhouette", self.silhouette.take()),
            ("depth", self.depth.take()),
            ("normal", self.normal.take()),
            ("features", self.features.take()),
        ];
        all.into_iter().filter_map(|(name, image)| Some((name, image?)))
    }

    /// Device time of every stage, in the order in which they ran; empty unless
    /// [`Renderer::time_stages`](crate::Renderer::time_stages) asked for it, or if the queue has no timestamps.
    pub fn timings(&self) -> &[StageTime] {
        &self.timings
    }
}

impl Frame {
    /// Copies the images that the settings ask for out of their buffers. `channels` are the features of each vertex.
    pub(super) fn download(
        buffers: &Contents<'_>,
        batch: usize,
        settings: &Settings,
        channels: usize,
        timings: Vec<StageTime>,
        spare: &Spare,
    ) -> Result<Self> {
        let outputs = settings.outputs;
        let (height, width) = (settings.height as usize, settings.width as usize);
        let count = batch * height * width;
        let image = |channels: usize, data: Vec<f32>| Some(Image { batch, height, width, channels, data });
        let texels = |id: BufferId| buffers.floats(id, 4 * count).map(|floats| floats.as_chunks::<4>().0);
        let (color, silhouette, depth, normal, features) = (None, None, None, None, None);
        let mut frame = Self { color, silhouette, depth, normal, features, timings, spare: spare.clone(), owner: None };
        if outputs.color {
            let texels = texels(BufferId::Color)?;
            let (rgb, alpha) = pixels::split(texels, outputs.silhouette, spare);
            frame.color = image(3, rgb);
            frame.silhouette = alpha.and_then(|alpha| image(1, alpha));
        } else if outputs.silhouette {
            frame.silhouette = image(1, pixels::copied(buffers.floats(BufferId::Silhouette, count)?, spare));
        }
        if outputs.depth {
            frame.depth = image(1, pixels::copied(buffers.floats(BufferId::Depths, count)?, spare));
        }
        if outputs.normal {
            frame.normal = image(3, pixels::split(texels(BufferId::Normals)?, false, spare).0);
        }
        if outputs.features {
            let stride = channels.next_multiple_of(4);
            let rows = buffers.floats(BufferId::FeatureImage, stride * count)?;
            frame.features = image(channels, pixels::first(rows, stride, channels, spare));
        }
        Ok(frame)
    }
}

impl Drop for Frame {
    fn drop(&mut self) {
        let spare = self.spare.clone();
        self.take_images().for_each(|(_, image)| spare.give(image.data));
    }
}

fn asked<'a>(field: &'static str, image: &'a Option<Image>) -> Result<&'a Image> {
    image.as_ref().ok_or_else(|| Error::Settings { field, value: "false".into(), fix: "ask for it".into() })
}
