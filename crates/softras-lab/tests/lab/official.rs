//! Scenes as the official renderer's options describe them, with the answers of its equations (`tests/official`).

use super::numpy::Npz;
use super::official_equations::{
    equations::{self, Triangles},
    scenes::{Mode, every_mode, random_triangles},
};
use softras::scene::{ColorAggregation, Distance, Faces, Settings, SilhouetteAggregation};

pub const SIZE: usize = 16;

/// A scene's file and what comes of it.
pub struct Official {
    pub mode: Mode,
    pub scene: Npz,
    pub image: equations::Image,
    pub gradient: equations::Gradient,
}

/// `[4, H, W]` of colour and silhouette.
pub fn planes(color: &[f64], silhouette: &[f64]) -> Vec<f64> {
    let channel = |k: usize| color.iter().skip(k).step_by(3).copied();
    (0..3).flat_map(channel).chain(silhouette.iter().copied()).collect()
}

fn options(mode: &Mode, s: &Settings) -> Npz {
    let distance = match mode.distance {
        Distance::Euclidean => "euclidean",
        Distance::Barycentric => "barycentric",
        Distance::Hard => "hard",
    };
    let silhouette = match mode.silhouette {
        SilhouetteAggregation::Product => "prod",
        SilhouetteAggregation::Sum => "sum",
        SilhouetteAggregation::Hard => "hard",
    };
    Npz::stored()
        .i64("opt_image_size", &[], &[SIZE as i64])
        .f64("opt_background_color", &[3], &s.background_color)
        .f64("opt_near", &[], &[s.near])
        .f64("opt_far", &[], &[s.far])
        .bool("opt_fill_back", mode.faces == Faces::Both)
        .f64("opt_eps", &[], &[s.epsilon])
        .f64("opt_sigma_val", &[], &[s.sigma])
        .f64("opt_gamma_val", &[], &[s.gamma])
        .f64("opt_dist_eps", &[], &[s.tau])
        .text("opt_dist_func", distance)
        .text("opt_aggr_func_rgb", if mode.color == ColorAggregation::Hard { "hard" } else { "softmax" })
        .text("opt_aggr_func_alpha", silhouette)
        .text("opt_texture_type", if mode.resolution.is_some() { "surface" } else { "vertex" })
}

/// Weights of the images' values that are exact in f32.
fn weights(count: usize, from: usize) -> Vec<f64> {
    (0..count).map(|i| ((i * 37 + from) % 64) as f64 / 32.0 - 1.0).collect()
}

/// The official kernels take these as float32, and the cut-off ln(1 / τ - 1) rather than τ.
fn rounded(mut s: Settings) -> Settings {
    for value in [&mut s.near, &mut s.far, &mut s.epsilon, &mut s.sigma, &mut s.gamma] {
        *value = f64::from(*value as f32);
    }
    s.tau = 1.0 / (1.0 + f64::from((1.0 / s.tau - 1.0).ln() as f32).exp());
    s
}

fn official(seed: u64, mode: Mode) -> Official {
    let settings = rounded(mode.settings(SIZE as u32, SIZE as u32));
    let triangles: Triangles = random_triangles(seed, 8, mode.resolution);
    let image = equations::image(&triangles, &settings);
    let (color, silhouette) = (weights(3 * SIZE * SIZE, 11), weights(SIZE * SIZE, 5));
    let gradient = equations::gradient(&triangles, &settings, &color, &silhouette);
    let single = |values: &[f64]| values.iter().map(|&x| x as f32).collect::<Vec<_>>();
    let scene = options(&mode, &settings)
        .f32("face_vertices", &[1, 8, 3, 3], &single(triangles.corners.as_flattened().as_flattened()))
        .f32("textures", &[1, 8, triangles.colors.len() / 8, 3], &single(triangles.colors.as_flattened()))
        .f32("grad_soft_colors", &[1, 4, SIZE, SIZE], &single(&planes(&color, &silhouette)));
    Official { mode, scene, image, gradient }
}

/// A scene for each distance, silhouette, colour and winding, among them near and far within the scene and surface
/// textures of one cell (of more, rounding chooses cells).
pub fn scenes() -> Vec<Official> {
    let coarse = every_mode().into_iter().filter(|mode| mode.resolution != Some(4));
    coarse.enumerate().filter(|(i, _)| i % 13 == 0).map(|(i, mode)| official(i as u64, mode)).collect()
}
