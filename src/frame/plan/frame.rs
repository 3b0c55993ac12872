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

#[cfg(test)]
mod tests {
    use super::FramePush;
    use crate::frame::buffers::kernels_of_a_frame;
    use crate::vulkan::{Kernel, kernels};
    use std::mem::offset_of;

    /// Name and offset of every field of the Rust mirror.
    fn rust_members() -> Vec<(&'static str, usize)> {
        macro_rules! fields {
            ($($name:ident),* $(,)?) => { vec![$((stringify!($name), offset_of!(FramePush, $name))),*] };
        }
        fields![
            width,
            height,
            tiles_x,
            tiles_y,
            bins_x,
            bins_y,
            coarse_capacity,
            list_capacity,
            scale,
            radius_squared,
            radius_pixels,
            barycentric_scale,
            barycentric_radius,
            near_high,
            near_low,
            far_high,
            far_low,
            score_high,
            score_low,
            background_exponent,
            background_fraction,
            background_red,
            background_green,
            background_blue,
            light_count,
            record_count,
            cell_capacity,
            view_count,
            mesh_count,
            number,
            first,
            texel_scale,
        ]
    }

    /// The difference between a kernel's push constants and the mirror.
    fn difference(kernel: &Kernel, mirror: &[(&str, usize)]) -> Option<String> {
        let found: Vec<_> = kernel.push_members.iter().map(|m| (m.name, m.offset as usize)).collect();
        (found != mirror).then(|| format!("{}: {found:?}", kernel.name))
    }

    #[test]
    fn push_constants_lie_as_the_kernels_have_them() {
        let mirror = rust_members();
        for kernel in kernels_of_a_frame() {
            assert_eq!(difference(kernel, &mirror), None);
            assert_eq!(kernel.push_constant_bytes as usize, size_of::<FramePush>(), "{}", kernel.name);
        }
    }

    #[test]
    fn a_wrong_mirror_is_noticed() {
        let mut moved = rust_members();
        moved[3].1 += 4;
        assert!(difference(&kernels::FORWARD, &moved).is_some());
        let mut renamed = rust_members();
        renamed[0].0 = "breadth";
        assert!(difference(&kernels::FORWARD, &renamed).is_some());
    }
}
