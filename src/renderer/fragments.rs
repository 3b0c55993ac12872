//! Which triangle each pixel shows: an image in the hard mode whose colours are the triangles' numbers, read on the host.

use super::Renderer;
use crate::error::Result;
use crate::scene::{
    Appearance, Background, Camera, ColorAggregation, Distance, Mesh, Outputs, Projection, Scene, Settings,
};
use glam::DVec3;

/// The point of a triangle that a pixel's centre shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fragment {
    /// The triangle's number in its mesh.
    pub triangle: u32,
    /// The weights of its corners at the point that is seen: Σ b_k p_k is that point, also under a perspective projection.
    pub barycentrics: [f32; 3],
    /// View depth of the point, world units.
    pub depth: f32,
}

/// The fragments of a batch of images: `data[(view · height + row) · width + column]`, row 0 at the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Fragments {
    /// Number of views.
    pub batch: usize,
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// The nearest triangle of each pixel; `None` where there is none.
    pub data: Vec<Option<Fragment>>,
}

/// Steps of each of the two colour channels that hold a number. Single precision holds them with room to spare.
const STEPS: u32 = 1 << 12;

/// The mesh in the colours of its triangles' numbers, counted from 1.
fn numbered(mesh: &Mesh) -> Result<Mesh> {
    let color = |i: u32| [(i % STEPS) as f32 / STEPS as f32, (i / STEPS) as f32 / STEPS as f32, 0.0];
    let texels = (1..=mesh.triangles().len() as u32).map(color).collect();
    mesh.clone().with_appearance(Appearance::Surface { resolution: 1, texels })
}

/// The triangle that a colour stands for.
fn number_of(color: &[f32]) -> Option<u32> {
    let step = |x: f32| (x * STEPS as f32).round() as u32;
    (step(color[0]) + STEPS * step(color[1])).checked_sub(1)
}

/// The point of a triangle that a pixel's centre shows. Corners behind the camera count too: with (column·w, row·w, w)
/// of each corner relative to the pixel, and w = z, or 1 without perspective, the weight of a corner is proportional to
/// the 2D cross product of the other two.
fn seen(camera: &Camera, corners: [[f32; 3]; 3], [column, row]: [usize; 2], size: (u32, u32)) -> ([f32; 3], f32) {
    let points = corners.map(|p| camera.to_view(DVec3::from_array(p.map(f64::from))));
    let flat = matches!(camera.projection(), Projection::Orthographic { .. });
    let places = points.map(|p| {
        let w = if flat { 1.0 } else { p.z };
        let [x, y] = camera.place(p, size);
        DVec3::new(x - (column as f64 + 0.5), y - (row as f64 + 0.5), 1.0) * w
    });
    let by_corner = [0, 1, 2].map(|k: usize| places[(k + 1) % 3].truncate().perp_dot(places[(k + 2) % 3].truncate()));
    let total: f64 = by_corner.iter().sum();
    // Rounding may put the pixel's centre beyond an edge.
    let shares = by_corner.map(|share| (share / total).max(0.0));
    let sum: f64 = shares.iter().sum();
    let weights = if sum > 0.0 && sum.is_finite() { shares.map(|share| share / sum) } else { [1.0, 0.0, 0.0] };
    let depth: f64 = weights.iter().zip(&points).map(|(weight, point)| weight * point.z).sum();
    (weights.map(|weight| weight as f32), depth as f32)
}

impl Renderer {
    /// The nearest triangle of each pixel, with the point of it that the pixel's centre shows. Nothing is blurred: of
    /// the settings only the size, near, far, faces, front_face and parity count. Textures count as opaque.
    ///
    /// # Errors
    /// As [`Renderer::render`].
    pub fn fragments(&mut self, scene: &Scene, cameras: &[Camera], settings: &Settings) -> Result<Fragments> {
        let settings = Settings {
            sigma: 1e-12,
            distance: Distance::Euclidean,
            color: ColorAggregation::Hard,
            background: Background::Weighted,
            background_color: [0.0; 3],
            outputs: Outputs { color: true, ..Outputs::NOTHING },
            save: false,
            ..settings.clone()
        };
        let marked = Scene::batch(scene.meshes.iter().map(numbered).collect::<Result<_>>()?);
        let frame = self.render(&marked, cameras, &settings)?;
        let image = frame.color()?;
        let (height, width) = (image.height, image.width);
        let of_pixel = |(at, color): (usize, &[f32])| {
            let view = at / (height * width);
            let mesh = &scene.meshes[if scene.meshes.len() == 1 { 0 } else { view }];
            let triangle = number_of(color)?;
            let corners = mesh.triangles().get(triangle as usize)?.map(|v| mesh.positions()[v as usize]);
            let pixel = [at % width, at / width % height];
            let (barycentrics, depth) = seen(&cameras[view], corners, pixel, (settings.width, settings.height));
            Some(Fragment { triangle, barycentrics, depth })
        };
        let data = image.data.chunks_exact(3).enumerate().map(of_pixel).collect();
        Ok(Fragments { batch: image.batch, height, width, data })
    }
}
