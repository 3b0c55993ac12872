//! Decoding of a backward pass's buffers into [`Gradients`].

use super::frame_plan::{FramePlan, GradientPlan};
use crate::constants as c;
use crate::error::{Error, Result};
use crate::frame::buffers::BufferId;
use crate::frame::pack::{AppearanceShape, MeshLayout, MeshShape, MeshTables};
use crate::gradients::{CameraGradient, GradientRequest, Gradients, LightGradients, MeshGradients};
use crate::scene::{Background, Camera, Lights, Parity, Projection, Settings, Texture};
use std::ops::Range;

/// The input of a backward pass, which decoding its buffers needs.
#[derive(Clone, Copy, Debug)]
pub struct Decoder<'a> {
    /// The frame's plan.
    pub frame: &'a FramePlan,
    /// The pass's plan.
    pub plan: &'a GradientPlan,
    /// The gradients that the pass was planned for.
    pub wanted: &'a GradientRequest,
    /// The frame's meshes.
    pub tables: &'a MeshTables,
    /// The frame's cameras.
    pub cameras: &'a [Camera],
    /// The frame's settings.
    pub settings: &'a Settings,
    /// The scene's lights.
    pub lights: &'a Lights,
}

/// Gives the first floats of a buffer, from its id and their number.
pub(crate) type ReadFloats<'a> = &'a dyn Fn(BufferId, usize) -> Result<&'a [f32]>;

impl Decoder<'_> {
    pub(crate) fn decode_floats(&self, floats: ReadFloats<'_>) -> Result<Gradients> {
        let Self { plan, wanted, cameras, settings: s, lights, .. } = self;
        let mut gradients = Gradients { meshes: self.meshes(floats)?, ..Gradients::default() };
        let views = cameras.len();
        let sums = wanted.camera || wanted.lights || wanted.background || wanted.scalars;
        let totals = match 12 * (views + lights.directional.len() + 2) {
            count if sums => floats(BufferId::Totals, count)?,
            _ => &[],
        };
        let row = |i: usize| totals.get(12 * i..12 * (i + 1)).unwrap_or(&[0.0; 12]);
        if wanted.camera {
            let height = f64::from(s.height);
            let gradient = |(i, camera)| camera_gradient(camera, row(i), height);
            gradients.cameras = cameras.iter().enumerate().map(gradient).collect();
        }
        if wanted.lights && plan.backward.groups.reduce_lights[0] > 0 {
            let rows: Vec<&[f32]> = (0..=lights.directional.len()).map(|i| row(views + i)).collect();
            gradients.lights = Some(light_gradients(lights, &rows));
        } else if wanted.lights {
            let directional = vec![([0.0; 3], [0.0; 3], 0.0); lights.directional.len()];
            gradients.lights = Some(LightGradients { directional, ..LightGradients::default() });
        }
        let pixels = row(views + lights.directional.len() + 1).iter().map(|&x| f64::from(x)).collect::<Vec<_>>();
        if wanted.background {
            gradients.background_color = [pixels[0], pixels[1], pixels[2]];
            // The official code's background score is twice epsilon.
            let factor = if s.parity == Parity::Official { 2.0 } else { 1.0 };
            let weighted = s.background == Background::Weighted;
            gradients.epsilon = if weighted { pixels[3] / s.gamma * factor } else { 0.0 };
        }
        if wanted.scalars {
            let sum = |k: usize| (0..views).map(|view| f64::from(row(view)[k])).sum::<f64>();
            // σ enters through x = ±d²/σ only, and γ through log weights, which are depth scores divided by γ.
            gradients.sigma = -sum(10) / s.sigma;
            gradients.gamma = -(sum(11) + pixels[4]) * std::f64::consts::LN_2 / s.gamma;
        }
        match gradients.not_finite() {
            None => Ok(gradients),
            Some(field) => Err(Error::NotFinite {
                stage: "backward",
                fix: format!(
                    "the gradient by {field} overflowed: bring the scene to a scale within 1e6 of the camera's"
                ),
            }),
        }
    }

    fn meshes(&self, floats: ReadFloats<'_>) -> Result<Vec<MeshGradients>> {
        let Self { plan, wanted, tables, .. } = self;
        let vertices: &[[f32; 8]] = if wanted.positions || wanted.colors {
            floats(BufferId::VertexGradients, 8 * tables.vertices())?.as_chunks().0
        } else {
            &[]
        };
        let corners = if wanted.uvs && plan.backward.has(c::GRADIENT_COORDINATE) {
            floats(BufferId::CornerGradients, plan.backward.sizes[BufferId::CornerGradients] as usize / 4)?
        } else {
            &[]
        };
        let mut images = tables.images.iter();
        let has_features = wanted.features && plan.backward.has(c::GRADIENT_FEATURES);
        let mut meshes = Vec::with_capacity(tables.layouts.len());
        for (m, layout) in tables.layouts.iter().enumerate() {
            let range = layout.vertex_range();
            let rows = vertices.get(range).unwrap_or_default();
            let mut mesh = MeshGradients::default();
            if wanted.positions {
                mesh.positions = rows.iter().map(|r| [r[0], r[1], r[2]]).collect();
            }
            let shape = &tables.shapes[m];
            if wanted.colors {
                mesh.colors = match shape.appearance {
                    AppearanceShape::VertexColors => rows.iter().map(|r| [r[4], r[5], r[6]]).collect(),
                    AppearanceShape::Uniform => vec![sum_colors(rows)],
                    _ => Vec::new(),
                };
            }
            if has_features {
                let (channels, stride) = (shape.features as usize, 4 * plan.backward.modes.feature_texels as usize);
                let rows = floats(BufferId::FeatureGradients, stride * tables.vertices())?.chunks_exact(stride);
                let own = rows.skip(layout.vertex as usize).take(layout.vertices as usize);
                mesh.features = own.flat_map(|row| &row[..channels]).copied().collect();
            } else if wanted.features {
                mesh.features = vec![0.0; shape.features as usize * layout.vertices as usize];
            }
            if wanted.texels {
                self.add_texels(layout, shape, &mut images, floats, &mut mesh)?;
            }
            if let AppearanceShape::Textured { uvs, .. } = &shape.appearance
                && wanted.uvs
            {
                let first = layout.uv_index as usize;
                let indices = &tables.uv_indices[first..first + 3 * layout.triangles as usize];
                // A single mesh is seen by every view.
                let one = tables.layouts.len() == 1;
                let views = if one { 0..self.cameras.len() } else { m..m + 1 };
                mesh.uvs = self.uvs(views, *uvs as usize, indices.as_chunks().0, corners);
            }
            meshes.push(mesh);
        }
        Ok(meshes)
    }

    /// Adds the gradients by a mesh's texels, and by the alpha of those of its textures that have one. `images` are those of this
    /// mesh and of the meshes after it; a host's own meshes have none.
    fn add_texels(
        &self,
        layout: &MeshLayout,
        shape: &MeshShape,
        images: &mut std::slice::Iter<'_, Texture>,
        floats: ReadFloats<'_>,
        mesh: &mut MeshGradients,
    ) -> Result<()> {
        let sums: Result<Vec<_>> =
            layout.texel_ranges(shape).into_iter().map(|range| self.texels(range, floats)).collect();
        let rgb = |texels: &Vec<[f32; 4]>| texels.iter().map(|t| [t[0], t[1], t[2]]).collect::<Vec<_>>();
        if let AppearanceShape::Surface { .. } = shape.appearance {
            mesh.surface_texels = sums?.iter().flat_map(rgb).collect();
            return Ok(());
        }
        for texels in sums? {
            mesh.texture_texels.push(rgb(&texels));
            let has_alpha = images.next().is_some_and(|image| image.alpha().is_some());
            let alpha = texels.iter().filter(|_| has_alpha).map(|t| t[3]);
            mesh.texture_alphas.push(alpha.collect());
        }
        Ok(())
    }

    /// The gradients of a range of texels by r, g, b and alpha, from their fixed-point sums.
    fn texels(&self, range: Range<usize>, floats: ReadFloats<'_>) -> Result<Vec<[f32; 4]>> {
        let plan = self.plan;
        if plan.backward.sizes[BufferId::TexelSums] == 0 {
            return Ok(vec![[0.0; 4]; range.len()]);
        }
        // Each texel has three or four sums of two words.
        let stride = if plan.backward.modes.opacity != 0 { 8 } else { 6 };
        let words: &[u32] = bytemuck::cast_slice(floats(BufferId::TexelSums, stride * range.end)?);
        let scale = 1.0 / f64::from(plan.texel_scale());
        let value = |&[low, high]: &[u32; 2]| ((i64::from(high as i32) << 32 | i64::from(low)) as f64 * scale) as f32;
        let row = |words: &[u32]| {
            let mut sums = words.as_chunks::<2>().0.iter().map(value);
            [(); 4].map(|()| sums.next().unwrap_or(0.0))
        };
        Ok(words[stride * range.start..].chunks_exact(stride).map(row).collect())
    }

    /// Each UV pair's gradient: the sum over the corners that use it, in all of the views.
    fn uvs(&self, views: Range<usize>, uvs: usize, uv_triangles: &[[u32; 3]], corners: &[f32]) -> Vec<[f32; 2]> {
        let plan = self.plan;
        let mut sums = vec![[0.0f64; 2]; uvs];
        let stride = plan.backward.corner_stride() as usize;
        if plan.backward.has(c::GRADIENT_COORDINATE) {
            for view in views {
                let first = self.frame.forward.views[view].record_base as usize;
                let rows = corners[4 * first * stride..].chunks_exact(4 * stride);
                for (triangle, row) in uv_triangles.iter().zip(rows) {
                    for (&uv, by_corner) in triangle.iter().zip(row[4 * (stride - 2)..].chunks_exact(2)) {
                        sums[uv as usize][0] += f64::from(by_corner[0]);
                        sums[uv as usize][1] += f64::from(by_corner[1]);
                    }
                }
            }
        }
        sums.into_iter().map(|[u, v]| [u as f32, v as f32]).collect()
    }
}

fn sum_colors(rows: &[[f32; 8]]) -> [f32; 3] {
    let mut sum = [0.0f64; 3];
    for row in rows {
        for (channel, total) in sum.iter_mut().enumerate() {
            *total += f64::from(row[4 + channel]);
        }
    }
    sum.map(|x| x as f32)
}

/// The gradient by a camera from a view's sums: the twist, then dL by the two scales and two offsets that map projected
/// units to pixels.
fn camera_gradient(camera: &Camera, row: &[f32], height: f64) -> CameraGradient {
    let row: Vec<f64> = row.iter().map(|&x| f64::from(x)).collect();
    let [sx, sy, ox, oy] = [row[6], row[7], row[8], row[9]];
    let half_height = height / 2.0;
    let projection = match *camera.projection() {
        Projection::Perspective { fov_y } => {
            // The scales are ±f with f = (height / 2) / tan(fov / 2).
            let slope = -half_height / 2.0 / (fov_y / 2.0).sin().powi(2);
            [(sx - sy) * slope, 0.0, 0.0, 0.0]
        }
        Projection::Orthographic { half_height: size } => [-(sx - sy) * half_height / (size * size), 0.0, 0.0, 0.0],
        Projection::Pinhole { .. } => [sx, -sy, ox, oy],
        Projection::Official { .. } | Projection::Screen => [0.0; 4],
    };
    CameraGradient { twist: [row[0], row[1], row[2], row[3], row[4], row[5]], projection }
}

/// The gradients by the lights from their sums, which are by unit direction and by colour times intensity, the ambient light
/// first.
fn light_gradients(lights: &Lights, rows: &[&[f32]]) -> LightGradients {
    let three = |row: &[f32], at: usize| [row[at], row[at + 1], row[at + 2]].map(f64::from);
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let by_ambient = three(rows[0], 4);
    let directional = lights.directional.iter().zip(&rows[1..]).map(|(light, row)| {
        let (by_unit, by_rgb) = (three(row, 0), three(row, 4));
        let length = dot(light.direction, light.direction).sqrt();
        let unit = light.direction.map(|x| x / length);
        let along = dot(unit, by_unit);
        let direction = [0, 1, 2].map(|k| (by_unit[k] - along * unit[k]) / length);
        (direction, by_rgb.map(|x| x * light.intensity), dot(by_rgb, light.color))
    });
    LightGradients {
        ambient_color: by_ambient.map(|x| x * lights.ambient_intensity),
        ambient_intensity: dot(by_ambient, lights.ambient_color),
        directional: directional.collect(),
    }
}
