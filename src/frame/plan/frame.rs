//! The push constants, which are the same block in every kernel of a frame.

use crate::constants as c;
use crate::scene::{Distance, Parity, Settings};

/// The push constant block (`glsl/common/frame.glsl`).
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[allow(missing_docs)] // The fields are the block's members, which frame.glsl documents.
pub struct FramePush {
    pub width: u32,
    pub height: u32,
    pub tiles_x: u32,
    pub tiles_y: u32,
    pub bins_x: u32,
    pub bins_y: u32,
    pub coarse_capacity: u32,
    pub list_capacity: u32,
    pub scale: f32,
    pub radius_squared: f32,
    pub radius_pixels: f32,
    pub barycentric_scale: f32,
    pub barycentric_radius: f32,
    pub near_high: f32,
    pub near_low: f32,
    pub far_high: f32,
    pub far_low: f32,
    pub score_high: f32,
    pub score_low: f32,
    pub background_exponent: f32,
    pub background_fraction: f32,
    pub background_red: f32,
    pub background_green: f32,
    pub background_blue: f32,
    pub light_count: u32,
    pub record_count: u32,
    pub cell_capacity: u32,
    pub view_count: u32,
    pub mesh_count: u32,
    pub number: u32,
    pub first: u32,
    pub texel_scale: f32,
}

const _: () = assert!(size_of::<FramePush>() == 128, "one field per member of the push constant block");

/// A number as the sum of two floats, which hold about 48 of its bits.
pub fn split(x: f64) -> (f32, f32) {
    let high = x as f32;
    (high, (x - f64::from(high)) as f32)
}

/// The members that follow from the settings; [`ForwardPlan::new`](super::ForwardPlan::new) adds capacities and counts.
pub(super) fn push_of(settings: &Settings, cutoff: f64) -> FramePush {
    let log2e = std::f64::consts::LOG2_E;
    let half_height = f64::from(settings.height) / 2.0;
    let score = log2e / ((settings.far - settings.near) * settings.gamma);
    let epsilon = settings.epsilon * if settings.parity == Parity::Official { 2.0 } else { 1.0 };
    let background = (epsilon * log2e / settings.gamma).clamp(-1e30, 1e30);
    let background_exponent = background.round() as f32;
    let ((near_high, near_low), (far_high, far_low)) = (split(settings.near), split(settings.far));
    let (score_high, score_low) = split(score);
    let hard = settings.distance == Distance::Hard;
    // Both soft distances are measured in units of the log2 weight, so they share one cutoff.
    let radius_squared = if hard { 0.0 } else { (cutoff * log2e) as f32 };
    let [red, green, blue] = settings.background_color.map(|x| x as f32);
    FramePush {
        width: settings.width,
        height: settings.height,
        tiles_x: settings.width.div_ceil(c::TILE_WIDTH),
        tiles_y: settings.height.div_ceil(c::TILE_HEIGHT),
        bins_x: settings.width.div_ceil(c::BIN_WIDTH),
        bins_y: settings.height.div_ceil(c::BIN_HEIGHT),
        scale: ((log2e / settings.sigma).sqrt() / half_height) as f32,
        radius_squared,
        radius_pixels: if hard { 0.0 } else { ((settings.sigma * cutoff).sqrt() * half_height) as f32 },
        barycentric_scale: (log2e / settings.sigma) as f32,
        barycentric_radius: (settings.sigma * cutoff).sqrt() as f32,
        near_high,
        near_low,
        far_high,
        far_low,
        score_high,
        score_low,
        background_exponent,
        background_fraction: (background - f64::from(background_exponent)) as f32,
        background_red: red,
        background_green: green,
        background_blue: blue,
        ..FramePush::default()
    }
}
