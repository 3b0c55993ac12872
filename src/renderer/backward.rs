//! Backward on the simple API: from dL/dimages to dL by what made them.

use super::{Frame, Renderer, StageTime};
use crate::buffers::{self, Role};
use crate::constants as c;
use crate::error::{Error, Result};
use crate::gradients::{CameraGradient, Gradients, ImageGradient, LightGradients, MeshGradients, Wanted};
use crate::image::Image;
use crate::pack::Appearances;
use crate::passes::{BACKWARD_STAGES, BACKWARD_TIMESTAMPS};
use crate::rasterizer::{Differentiate, FramePlan, GradientBindings, GradientPlan};
use crate::scene::{Background, Camera, Lights, Parity, Projection, Settings};
use crate::vulkan::{CommandBuffer, Context, TimestampPool};
use std::ops::Range;
use std::sync::Arc;

/// What a saved frame was made of; its buffers and tables are the renderer's.
pub(super) struct Saved {
    pub id: u64,
    pub plan: Arc<FramePlan>,
    pub cameras: Vec<Camera>,
    pub settings: Settings,
    pub lights: Lights,
}

/// What backward keeps from pass to pass.
pub(super) struct State {
    /// The latest plan, and what it was made for.
    planned: Option<(Arc<FramePlan>, Differentiate, Arc<GradientPlan>)>,
    recorded: Option<(Arc<GradientPlan>, GradientBindings)>,
    commands: CommandBuffer,
    times: Option<TimestampPool>,
}

impl State {
    pub(super) fn new(context: &Context) -> Result<Self> {
        Ok(Self {
            planned: None,
            recorded: None,
            commands: CommandBuffer::new(context, "softras backward")?,
            times: TimestampPool::new(context.device(), context.queue_family(), BACKWARD_TIMESTAMPS)?,
        })
    }

    /// Buffers were renewed: descriptors must be written again.
    pub(super) fn forget(&mut self) {
        self.recorded = None;
    }
}

fn stale<T>(what: &str, mend: &str) -> Result<T> {
    Err(Error::Backward { what: what.into(), mend: mend.into() })
}

impl Renderer {
    /// dL by whatever is wanted, from dL by the frame's images.
    ///
    /// The frame must be this renderer's latest one, rendered with [`Settings::save`]. It can be differentiated any number
    /// of times. Gradients of a mesh are summed over its views. The same input gives the same bits.
    ///
    /// # Errors
    /// [`Error::Backward`] for a frame rendered without [`Settings::save`], one that is not the latest, or an upstream
    /// gradient that does not fit it; [`Error::NotFinite`] where single precision cannot hold the gradient; otherwise as
    /// [`Renderer::render`].
    pub fn backward(&mut self, frame: &Frame, upstream: &ImageGradient, wanted: &Wanted) -> Result<Gradients> {
        let Some(id) = frame.saved else {
            return stale("the frame was rendered for looking at only", "render it with Settings::save = true");
        };
        let Some(saved) = self.saved.take() else {
            return stale("the frame's saved state is gone", "differentiate a frame before rendering the next");
        };
        let result = if saved.id == id {
            self.backward_saved(&saved, upstream, wanted)
        } else {
            stale("the renderer has rendered another frame since", "differentiate a frame before rendering the next")
        };
        self.saved = Some(saved);
        result
    }

    /// Device time of every stage of the latest backward pass, in order; 0 for a stage that was not needed. Empty unless
    /// [`Renderer::time_stages`] asked for it, or where the queue has no timestamps.
    ///
    /// # Errors
    /// [`Error::Vulkan`] without a backward pass before.
    pub fn backward_timings(&self) -> Result<Vec<StageTime>> {
        let Some(times) = self.backward.times.as_ref().filter(|_| self.timed) else {
            return Ok(Vec::new());
        };
        let stamps = times.read(BACKWARD_TIMESTAMPS)?;
        let spans = stamps.windows(2).map(|pair| pair[1] - pair[0]);
        Ok(BACKWARD_STAGES.iter().zip(spans).map(|(&stage, milliseconds)| StageTime { stage, milliseconds }).collect())
    }

    fn backward_saved(&mut self, saved: &Saved, upstream: &ImageGradient, wanted: &Wanted) -> Result<Gradients> {
        let s = &saved.settings;
        let batch = saved.cameras.len();
        upstream.judge(s.outputs, batch, s.height as usize, s.width as usize)?;
        let plan = self.plan_backward(&saved.plan, upstream, wanted)?;
        for slot in buffers::BACKWARD {
            if let Some(requirement) = plan.buffer(slot.name) {
                let reserved = self.buffers.reserve(&self.context, slot, requirement.size);
                if !matches!(reserved, Ok(false)) {
                    self.backward.forget();
                }
                reserved?;
            }
        }
        self.write_upstream(upstream)?;
        self.prepare_backward(&plan, wanted)?;
        self.backward.commands.submit_and_wait()?;
        self.gather(saved, &plan, wanted)
    }

    /// The last plan where nothing that it depends on has changed.
    fn plan_backward(
        &mut self,
        frame: &Arc<FramePlan>,
        upstream: &ImageGradient,
        wanted: &Wanted,
    ) -> Result<Arc<GradientPlan>> {
        let largest = |image: &Image| f64::from(image.data.iter().fold(0.0f32, |m, &x| m.max(x.abs())));
        let differentiate = Differentiate {
            upstream: upstream.outputs(),
            wanted: *wanted,
            largest_upstream: upstream.color.as_ref().filter(|_| wanted.texels).map_or(0.0, largest),
        };
        if let Some((planned_for, d, plan)) = &self.backward.planned
            && *d == differentiate
            && (Arc::ptr_eq(planned_for, frame) || planned_for == frame)
        {
            return Ok(plan.clone());
        }
        let plan = Arc::new(self.rasterizer.plan_backward(frame, &differentiate)?);
        self.backward.planned = Some((frame.clone(), differentiate, plan.clone()));
        Ok(plan)
    }

    fn write_upstream(&mut self, upstream: &ImageGradient) -> Result<()> {
        let alpha = upstream.silhouette.as_ref();
        if let Some(color) = &upstream.color {
            let pixels = color.data.as_chunks::<3>().0;
            let texels = self.buffers.floats_mut("upstream_color", 4 * pixels.len())?.as_chunks_mut::<4>().0;
            match alpha {
                Some(alpha) => {
                    for ((to, &[r, g, b]), &a) in texels.iter_mut().zip(pixels).zip(&alpha.data) {
                        *to = [r, g, b, a];
                    }
                }
                None => write_texels(texels, pixels),
            }
        } else if let Some(alpha) = alpha {
            self.buffers.write("upstream_silhouette", bytemuck::cast_slice(&alpha.data))?;
        }
        if let Some(depth) = &upstream.depth {
            self.buffers.write("upstream_depths", bytemuck::cast_slice(&depth.data))?;
        }
        if let Some(normal) = &upstream.normal {
            let pixels = normal.data.as_chunks::<3>().0;
            let texels = self.buffers.floats_mut("upstream_normals", 4 * pixels.len())?;
            write_texels(texels.as_chunks_mut::<4>().0, pixels);
        }
        Ok(())
    }

    /// Records the pass's commands, unless they are recorded already.
    fn prepare_backward(&mut self, plan: &Arc<GradientPlan>, wanted: &Wanted) -> Result<()> {
        let same =
            |(recorded, _): &(Arc<GradientPlan>, GradientBindings)| Arc::ptr_eq(recorded, plan) || recorded == plan;
        if self.backward.recorded.as_ref().is_some_and(same) {
            return Ok(());
        }
        let Some((_, frame)) = &self.recorded else {
            return stale("the frame's commands are gone", "render it again");
        };
        let parts = self.buffers.parts(plan.buffers())?;
        let bindings = self.rasterizer.bind_backward_parts(plan, &parts, frame)?;
        let (rasterizer, buffers) = (&self.rasterizer, &self.buffers);
        let times = self.backward.times.as_ref().filter(|_| self.timed);
        self.backward.recorded = None;
        self.backward.commands.record(|recorder| {
            if let Some(times) = times {
                recorder.reset_timestamps(times);
            }
            for (slot, buffer) in buffers.shared() {
                if slot.role == Role::Input && plan.buffer(slot.name).is_some() {
                    buffer.record_upload(recorder)?;
                }
            }
            rasterizer.backward(recorder, plan, &bindings, times)?;
            for (slot, buffer) in buffers.shared() {
                let read = match slot.name {
                    "corner_gradients" => wanted.uvs,
                    "texel_sums" => wanted.texels,
                    "vertex_gradients" => wanted.positions || wanted.colors,
                    "totals" => true,
                    _ => false,
                };
                if read {
                    buffer.record_download(recorder)?;
                }
            }
            recorder.barrier_to_host();
            Ok(())
        })?;
        self.backward.recorded = Some((plan.clone(), bindings));
        Ok(())
    }

    fn gather(&self, saved: &Saved, plan: &GradientPlan, wanted: &Wanted) -> Result<Gradients> {
        let mut gradients = Gradients { meshes: self.gather_meshes(saved, plan, wanted)?, ..Gradients::default() };
        let views = saved.cameras.len();
        let totals = self.buffers.floats("totals", 12 * (views + saved.lights.directional.len() + 2))?;
        let row = |i: usize| &totals[12 * i..12 * (i + 1)];
        if wanted.camera {
            gradients.cameras =
                saved.cameras.iter().enumerate().map(|(i, camera)| camera_gradient(camera, row(i), saved)).collect();
        }
        if wanted.lights && plan.plan.groups.reduce_lights[0] > 0 {
            let rows: Vec<&[f32]> = (0..=saved.lights.directional.len()).map(|i| row(views + i)).collect();
            gradients.lights = Some(light_gradients(&saved.lights, &rows));
        } else if wanted.lights {
            let directional = vec![([0.0; 3], [0.0; 3], 0.0); saved.lights.directional.len()];
            gradients.lights = Some(LightGradients { directional, ..LightGradients::default() });
        }
        let pixels = row(views + saved.lights.directional.len() + 1).iter().map(|&x| f64::from(x)).collect::<Vec<_>>();
        let s = &saved.settings;
        if wanted.background {
            gradients.background_color = [pixels[0], pixels[1], pixels[2]];
            // The official code's background score is twice epsilon.
            let factor = if s.parity == Parity::Official { 2.0 } else { 1.0 };
            let weighted = s.background == Background::Weighted;
            gradients.epsilon = if weighted { pixels[3] / s.gamma * factor } else { 0.0 };
        }
        if wanted.scalars {
            let sum = |k: usize| (0..views).map(|view| f64::from(row(view)[k])).sum::<f64>();
            // x = ±d²/σ, and log weights are depth scores over γ.
            gradients.sigma = -sum(10) / s.sigma;
            gradients.gamma = -(sum(11) + pixels[4]) * std::f64::consts::LN_2 / s.gamma;
        }
        match gradients.not_finite() {
            None => Ok(gradients),
            Some(field) => Err(Error::NotFinite {
                stage: "backward",
                mend: format!(
                    "the gradient by {field} overflowed: bring the scene to a scale within 1e6 of the camera's"
                ),
            }),
        }
    }

    fn gather_meshes(&self, saved: &Saved, plan: &GradientPlan, wanted: &Wanted) -> Result<Vec<MeshGradients>> {
        let tables = &self.inputs.tables;
        let vertices: &[[f32; 8]] = if wanted.positions || wanted.colors {
            self.buffers.floats("vertex_gradients", 8 * tables.positions.len() / 3)?.as_chunks().0
        } else {
            &[]
        };
        let corners = if wanted.uvs && plan.plan.has(c::GRADIENT_COORDINATE) {
            self.buffers.floats("corner_gradients", plan.plan.sizes.corner_gradients as usize / 4)?
        } else {
            &[]
        };
        let texels = |range: &Range<usize>| self.texel_gradients(range.clone(), plan);
        let mut meshes = Vec::with_capacity(tables.layouts.len());
        for (m, layout) in tables.layouts.iter().enumerate() {
            let range = layout.vertex_range();
            let rows = vertices.get(range).unwrap_or_default();
            let mut mesh = MeshGradients::default();
            if wanted.positions {
                mesh.positions = rows.iter().map(|r| [r[0], r[1], r[2]]).collect();
            }
            if wanted.colors {
                mesh.colors = match &tables.appearances[m] {
                    Appearances::Vertices => rows.iter().map(|r| [r[4], r[5], r[6]]).collect(),
                    Appearances::Uniform => vec![sum_colors(rows)],
                    _ => Vec::new(),
                };
            }
            match &tables.appearances[m] {
                Appearances::Surface { texels: range } if wanted.texels => {
                    mesh.surface_texels = texels(range)?;
                }
                Appearances::Textured { textures, uvs, uv_triangles, .. } => {
                    if wanted.texels {
                        mesh.texture_texels = textures.iter().map(texels).collect::<Result<_>>()?;
                    }
                    if wanted.uvs {
                        let triangles = tables.uv_indices[uv_triangles.clone()].as_chunks().0;
                        // One mesh is seen by every view.
                        let one = tables.layouts.len() == 1;
                        let views = if one { 0..saved.cameras.len() } else { m..m + 1 };
                        mesh.uvs = uv_gradients(saved, plan, views, *uvs, triangles, corners);
                    }
                }
                _ => {}
            }
            meshes.push(mesh);
        }
        Ok(meshes)
    }

    /// Some texels' fixed-point sums as floats.
    fn texel_gradients(&self, range: Range<usize>, plan: &GradientPlan) -> Result<Vec<[f32; 3]>> {
        if plan.plan.sizes.texel_sums == 0 {
            return Ok(vec![[0.0; 3]; range.len()]);
        }
        // Two words a number, three numbers a texel.
        let words: &[u32] = bytemuck::cast_slice(self.buffers.floats("texel_sums", 6 * range.end)?);
        let scale = 1.0 / f64::from(plan.texel_scale());
        let value = |low: u32, high: u32| ((i64::from(high as i32) << 32 | i64::from(low)) as f64 * scale) as f32;
        let sums = words[6 * range.start..].as_chunks::<6>().0;
        Ok(sums.iter().map(|&[r, r1, g, g1, b, b1]| [value(r, r1), value(g, g1), value(b, b1)]).collect())
    }
}

/// Three floats of every four; the fourth is not read.
fn write_texels(texels: &mut [[f32; 4]], pixels: &[[f32; 3]]) {
    for (to, &[x, y, z]) in texels.iter_mut().zip(pixels) {
        *to = [x, y, z, 0.0];
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

/// Each UV pair's share of the corners that name it, over views.
fn uv_gradients(
    saved: &Saved,
    plan: &GradientPlan,
    views: Range<usize>,
    uvs: usize,
    uv_triangles: &[[u32; 3]],
    corners: &[f32],
) -> Vec<[f32; 2]> {
    let mut sums = vec![[0.0f64; 2]; uvs];
    let stride = plan.plan.corner_stride() as usize;
    if plan.plan.has(c::GRADIENT_COORDINATE) {
        for view in views {
            let first = saved.plan.plan.views[view].slot_base as usize;
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

/// From a view's sums: twist, then dL by the two scales and two offsets that map projected units to pixels.
fn camera_gradient(camera: &Camera, row: &[f32], saved: &Saved) -> CameraGradient {
    let row: Vec<f64> = row.iter().map(|&x| f64::from(x)).collect();
    let [sx, sy, ox, oy] = [row[6], row[7], row[8], row[9]];
    let half_height = f64::from(saved.settings.height) / 2.0;
    let projection = match *camera.projection() {
        Projection::Perspective { fov_y } => {
            // Scales ±f with f = (height / 2) / tan(fov / 2).
            let slope = -half_height / 2.0 / (fov_y / 2.0).sin().powi(2);
            [(sx - sy) * slope, 0.0, 0.0, 0.0]
        }
        Projection::Orthographic { half_height: size } => [-(sx - sy) * half_height / (size * size), 0.0, 0.0, 0.0],
        Projection::Pinhole { .. } => [sx, -sy, ox, oy],
        Projection::Official { .. } | Projection::Screen => [0.0; 4],
    };
    CameraGradient { twist: [row[0], row[1], row[2], row[3], row[4], row[5]], projection }
}

/// From the lights' sums: by each unit direction and by each colour times intensity, the ambient light first.
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
