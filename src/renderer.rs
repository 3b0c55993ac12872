//! The simple API: a renderer that owns its device.

use crate::{
    error::Result,
    image::Image,
    scene::{Camera, Scene, Settings},
};

/// What a frame took on the device.
#[derive(Clone, Debug)]
pub struct StageTime {
    /// The stage's name, as its GLSL file's.
    pub stage: &'static str,
    /// Milliseconds on the device.
    pub milliseconds: f64,
}

/// One rendered batch.
#[derive(Debug)]
pub struct Frame {
    pub(crate) color: Option<Image>,
    pub(crate) silhouette: Option<Image>,
    pub(crate) depth: Option<Image>,
    pub(crate) normal: Option<Image>,
    pub(crate) timings: Vec<StageTime>,
}

impl Frame {
    /// RGB, linear, 3 channels; `None` unless asked for in [`crate::scene::Outputs`].
    pub fn color(&self) -> Option<&Image> {
        self.color.as_ref()
    }
    /// Silhouette in [0, 1], 1 channel.
    pub fn silhouette(&self) -> Option<&Image> {
        self.silhouette.as_ref()
    }
    /// Σ w z in world units, 1 channel; 0 where nothing is near.
    pub fn depth(&self) -> Option<&Image> {
        self.depth.as_ref()
    }
    /// Σ w n, world space, 3 channels.
    pub fn normal(&self) -> Option<&Image> {
        self.normal.as_ref()
    }
    /// Device time per stage, in the order in which they ran; empty when the queue has no timestamps.
    pub fn timings(&self) -> &[StageTime] {
        &self.timings
    }
}

/// A device and everything a frame needs on it.
#[derive(Debug)]
pub struct Renderer {}

impl Renderer {
    /// Opens the device named by `SOFTRAS_DEVICE` (index or part of its name), else the best one.
    pub fn new() -> Result<Self> {
        Ok(Self {})
    }
    /// Opens a device by index or part of its name.
    pub fn with_device(_selector: &str) -> Result<Self> {
        Ok(Self {})
    }
    /// The device's name.
    pub fn device_name(&self) -> &str {
        "stub"
    }
    /// Renders every camera's view.
    pub fn render(&mut self, scene: &Scene, cameras: &[Camera], settings: &Settings) -> Result<Frame> {
        scene.judge(cameras)?;
        settings.judge()?;
        Ok(Frame { color: None, silhouette: None, depth: None, normal: None, timings: Vec::new() })
    }
}
