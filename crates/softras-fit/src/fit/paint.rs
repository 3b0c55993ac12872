//! The texture that `--texture` makes of a mesh without one: an atlas on the mesh that was found, whose texels are fitted while
//! the shape stays.

use super::{setup::Setup, texels::Texels};
use crate::{
    Schedule,
    mesh::atlas::{atlas, between, corner_colors},
    photographs::{
        color::color_error,
        seen::{Seen, normals},
        subject::Subject,
    },
    points, with_atlas,
    work::{Stage, Work},
};
use glam::DVec3;
use softras::{Mesh, Result, scene::Appearance};
use softras_io::Views;
use std::cell::{Cell, RefCell};

/// Steps of the texels.
const STEPS: usize = 100;
/// Their length, for colours from 0 to 1.
const RATE: Schedule = Schedule::Exponential { from: 0.1, to: 0.005 };
/// The length of a texel in pixels of the images, where the texture has room.
const TEXEL: f64 = 1.0;
/// Photographs that a triangle's texels are taken of, those that see it most squarely.
const BLENDED: usize = 4;
/// Triangles after which it is told how many are done.
const TOLD: usize = 256;

/// A mesh with a fitted texture.
#[derive(Clone, Debug)]
pub struct Painted {
    /// The mesh.
    pub mesh: Mesh,
    /// Whether all steps of the texels were taken.
    pub is_complete: bool,
    /// Texels along each side of the texture.
    pub side: u32,
    /// The length of a texel in pixels of the views.
    pub texel: f64,
    /// The loss before each step.
    pub losses: Vec<f64>,
    /// The error of the colours with vertex colours, and with the texture.
    pub errors: [Option<f64>; 2],
}

/// Gives a mesh that was fitted a texture of at most `most` texels a side in its colours, and fits the texels to the views under the
/// lights of the fit, until the work is to end.
pub fn painted(
    mesh: &Mesh,
    most: u32,
    setup: &Setup,
    subject: &Subject,
    views: &Views,
    work: &mut Work,
) -> Result<Painted> {
    let settings = setup.settings(setup.iterations);
    let fitted = setup.given.fitted(subject);
    let by_vertices = color_error(mesh, &settings, subject, &fitted, work.renderer)?;
    let mut losses = Vec::new();
    let (mesh, texel) = if !subject.views.photographs.is_empty() {
        // Without steps, so that a break is seen in `Work` alone.
        let _ = work.begin(Stage::Texture, mesh.triangles().len().div_ceil(TOLD));
        let seen = Seen::of_photographs(mesh, &subject.views, &settings, work.renderer)?;
        let pixel = seen.pixel(subject.bounds.center);
        let (mesh, texel) = photographed(mesh, TEXEL * pixel, most, &seen, &fitted, work)?;
        (mesh, texel / pixel)
    } else {
        let (start, texel) = with_atlas(mesh, TEXEL * subject.pixel, most)?;
        let mut texels = Texels::new(start, setup, &subject.lights, views, work.renderer)?;
        let _ = work.begin(Stage::Texture, STEPS);
        while texels.can_step() && losses.len() < STEPS && !work.is_stopped() {
            let loss = texels.step(RATE.at_step(losses.len(), STEPS), work.renderer)?;
            losses.push(loss);
            let _ = work.step(Some(loss));
        }
        (texels.mesh().clone(), texel / subject.pixel)
    };
    let is_complete = !work.is_stopped() || losses.len() == STEPS;
    let errors = [by_vertices, color_error(&mesh, &settings, subject, &fitted, work.renderer)?];
    Ok(Painted { side: side(&mesh), texel, mesh, is_complete, losses, errors })
}

/// The mesh with texels as photographs show them, and as the vertices have them where no photograph does, or where the work is to end.
fn photographed(
    mesh: &Mesh,
    texel: f64,
    most: u32,
    seen: &Seen,
    views: &[usize],
    work: &mut Work,
) -> Result<(Mesh, f64)> {
    let (color, points, normals) = (corner_colors(mesh)?, points(mesh), normals(mesh));
    let (work, done) = (RefCell::new(work), Cell::new(0usize));
    atlas(mesh, texel, most, |triangle, corners| {
        done.set(done.get() + 1);
        let mut work = work.borrow_mut();
        if done.get().is_multiple_of(TOLD) {
            let _ = work.step(None);
        }
        let vertices = corners.map(|corner| mesh.triangles()[triangle][corner]);
        let mix = |[a, b, c]: [DVec3; 3], along: f64, up: f64| a + along * (b - a) + up * (c - a);
        let [places, directions] = [&points, &normals].map(|all| vertices.map(|vertex| all[vertex as usize]));
        let colors = vertices.map(&color);
        let third = 1.0 / 3.0;
        let some = if work.is_stopped() { &[][..] } else { views };
        let mut near = seen.views(some, mix(places, third, third), mix(directions, third, third).normalize_or_zero());
        near.truncate(BLENDED);
        move |along, up| {
            let (place, normal) = (mix(places, along, up), mix(directions, along, up).normalize_or_zero());
            let shown = seen.color(&near, place, normal).or_else(|| seen.color(some, place, normal));
            shown.map_or_else(|| between(colors, along, up), |shown| shown.as_vec3().to_array())
        }
    })
}

impl Painted {
    /// A sentence about the texture that was made.
    pub fn sentence(&self) -> String {
        let Self { side, texel, errors, .. } = self;
        let longer = if *texel > TEXEL { ", limited by the texture's size" } else { "" };
        let error = |error: Option<f64>| error.map_or("unknown".into(), |error| format!("{error:.4}"));
        let [before, after] = errors.map(error);
        format!(
            "a texture of {side}×{side} texels, {texel:.2} pixels long{longer}, brings the error of the colours from {before} to \
             {after}"
        )
    }
}

/// Width and height of a mesh's first texture.
fn side(mesh: &Mesh) -> u32 {
    match mesh.appearance() {
        Appearance::Textured { textures, .. } => textures.first().map_or(0, |texture| texture.width()),
        _ => 0,
    }
}
