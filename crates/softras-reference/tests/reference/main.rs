//! The f64 reference against numbers computed by hand, symmetries, differences of its own images, and the official equations.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod by_hand;
#[path = "../../../../tests/common/mod.rs"]
mod common;
mod culling;
mod details;
mod differences;
mod equations;
#[path = "../../../../tests/official/mod.rs"]
mod official;
mod opacity;
mod projection;

use glam::{DMat4, DVec3};
use softras::scene::{
    Appearance, Background, Camera, ColorAggregation, DirectionalLight, Distance, Faces, FrontFace, Interpolation,
    Lights, Mesh, Outputs, Parity, Projection, Scene, Settings, Shading, SilhouetteAggregation, Texture, Wrap,
};
use softras_reference::{ReferenceFrame, Truncation, render, render_culled, strongest};
use softras_reference::{pairs, render_untruncated};

/// One pixel, at the screen's origin.
fn one_pixel() -> Settings {
    Settings { width: 1, height: 1, sigma: 0.01, gamma: 0.1, outputs: Outputs::ALL, ..Settings::default() }
}

fn screen_mesh(positions: &[[f32; 3]]) -> Mesh {
    let triangles = (0..positions.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    Mesh::new(positions.to_vec(), triangles).unwrap()
}

fn colored(positions: &[[f32; 3]], colors: &[[f32; 3]]) -> Scene {
    Scene::new(screen_mesh(positions).with_appearance(Appearance::VertexColors(colors.to_vec())).unwrap())
}

fn on_screen(scene: &Scene, settings: &Settings) -> ReferenceFrame {
    render(scene, &[Camera::screen()], settings, Truncation::Tau).unwrap()
}

/// Whether two numbers agree to 1e-12, absolutely or relatively.
fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-12 * b.abs().max(1.0)
}

fn assert_close(what: &str, got: &[f64], expected: &[f64]) {
    let good = got.len() == expected.len() && got.iter().zip(expected).all(|(&a, &b)| close(a, b));
    assert!(good, "{what}: {got:?}, expected {expected:?}");
}

/// The largest difference between any images of two frames, margins included; infinite where shapes differ or a value is
/// not a number.
fn difference(a: &ReferenceFrame, b: &ReferenceFrame) -> f64 {
    let images = |f: &ReferenceFrame| [&f.color, &f.silhouette, &f.depth, &f.normal, &f.margin].map(Vec::clone);
    let pairs = images(a).into_iter().zip(images(b));
    pairs.fold(0.0, |worst: f64, (a, b)| {
        let differences = a.iter().zip(&b).map(|(a, b)| (a - b).abs());
        let all = differences.fold(0.0, |w: f64, d| if d.is_nan() { f64::INFINITY } else { w.max(d) });
        if a.len() == b.len() { worst.max(all) } else { f64::INFINITY }
    })
}

fn sigmoid(x: f64) -> f64 {
    1.0 / (1.0 + (-x).exp())
}

/// A triangle around the origin, its lower edge `below` under it, at depth z.
fn triangle_above(below: f32, z: f32) -> [[f32; 3]; 3] {
    [[-4.0, -below, z], [4.0, -below, z], [0.0, 4.0, z]]
}
