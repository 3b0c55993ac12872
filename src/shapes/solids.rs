//! Solids that are the inside of a function: a torus of two holes, a mug and a chair, each one closed surface.
//!
//! Each function is a signed distance, or a bound of one, below 0 inside, put together of a few solids by unions with rounded
//! seams. The mesh is its zero level.

use super::{level_set::Samples, rainbow, shape_error};
use crate::{
    error::Result,
    scene::{Appearance, Mesh},
};
use glam::{DVec2, DVec3};

/// Samples along a side of the cube that holds a solid: a triangle's edges are about a twenty-fifth of its half side.
const RESOLUTION: usize = 52;
/// Half the side of the cube.
const REACH: f64 = 1.1;
/// The width of the rounded seam between two solids.
const SEAM: f64 = 0.06;

/// Two rings beside each other in the plane z = 0, joined into a figure of eight, in the colours of the rainbow around the z
/// axis: a surface of genus 2.
pub fn double_torus() -> Result<Mesh> {
    let ring = |p: DVec3, x: f64| torus_distance(p - DVec3::new(x, 0.0, 0.0), 0.4, 0.17);
    let mesh = solid("double-torus", |p| seamless(ring(p, -0.47), ring(p, 0.47), SEAM))?;
    let colors = mesh.positions().iter().map(|p| rainbow(f64::from(p[1]).atan2(f64::from(p[0])))).collect();
    mesh.with_appearance(Appearance::VertexColors(colors))
}

/// A wide mug that is open above (+y), with thick walls and a handle at +x, of one colour: a surface of genus 1.
pub fn mug() -> Result<Mesh> {
    let cup = |p: DVec3, radius: f64, low: f64, high: f64| {
        let middle = DVec3::new(-0.17, 0.5 * (low + high), 0.0);
        cylinder_distance(p - middle, radius, 0.5 * (high - low), 0.08)
    };
    let distance = |p: DVec3| {
        let handle = torus_distance(p - DVec3::new(0.51, 0.0, 0.0), 0.25, 0.09);
        let outside = seamless(cup(p, 0.68, -0.4, 0.4), handle, SEAM);
        // The hollow is cut out with a rounded rim.
        -seamless(-outside, cup(p, 0.52, -0.24, 0.9), SEAM)
    };
    solid("mug", distance)?.with_appearance(Appearance::Uniform([0.75, 0.6, 0.45]))
}

/// A chair with a seat, four legs and a back at -z, of one colour and one surface of genus 0.
pub fn chair() -> Result<Mesh> {
    let distance = |p: DVec3| {
        let seat = box_distance(p - DVec3::new(0.0, -0.05, 0.0), DVec3::new(0.5, 0.07, 0.5), 0.03);
        let back = box_distance(p - DVec3::new(0.0, 0.45, -0.43), DVec3::new(0.5, 0.55, 0.07), 0.03);
        // The four legs are one, mirrored.
        let folded = DVec3::new(p.x.abs() - 0.41, p.y + 0.5, p.z.abs() - 0.41);
        let leg = box_distance(folded, DVec3::new(0.09, 0.5, 0.09), 0.03);
        seamless(seamless(seat, back, SEAM), leg, SEAM)
    };
    solid("chair", distance)?.with_appearance(Appearance::Uniform([0.55, 0.65, 0.8]))
}

/// The surface where a signed distance is 0.
fn solid(name: &str, distance: impl Fn(DVec3) -> f64) -> Result<Mesh> {
    let mut samples = Samples::new(DVec3::splat(-REACH), 2.0 * REACH, RESOLUTION);
    for i in 0..samples.values.len() {
        samples.values[i] = -distance(samples.position(i)) as f32;
    }
    match samples.mesh()? {
        Some(mesh) => Ok(mesh),
        None => shape_error(format!("a {name} without an inside"), "report this".into()),
    }
}

/// The lesser of two distances, smoothed where they are close: a union with a rounded seam, `width` / 4 thick at most.
fn seamless(a: f64, b: f64, width: f64) -> f64 {
    let near = (1.0 - (a - b).abs() / width).max(0.0);
    a.min(b) - 0.25 * width * near * near
}

/// The distance from a ring about the z axis: `tube` is the radius of its tube, `ring` that of the centre line.
fn torus_distance(p: DVec3, ring: f64, tube: f64) -> f64 {
    (p.x.hypot(p.y) - ring).hypot(p.z) - tube
}

/// The distance from a cylinder about the y axis whose edges are rounded by `round`.
fn cylinder_distance(p: DVec3, radius: f64, half_height: f64, round: f64) -> f64 {
    let beyond = DVec2::new(p.x.hypot(p.z) - radius + round, p.y.abs() - half_height + round);
    beyond.max(DVec2::ZERO).length() + beyond.max_element().min(0.0) - round
}

/// The distance from a box of these half sides whose edges are rounded by `round`.
fn box_distance(p: DVec3, half: DVec3, round: f64) -> f64 {
    let beyond = p.abs() - half + round;
    beyond.max(DVec3::ZERO).length() + beyond.max_element().min(0.0) - round
}
