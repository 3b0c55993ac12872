//! The buffers of a fit: what the frame and its gradients need, and the fit's own.

use super::arithmetic::{GROUP, Vec3};
use super::host::FitState;
use super::plan::FitPlan;
use super::tables::Tables;
use crate::constants as c;
use crate::embed::{FramePlan, GradientPlan, Inputs, Parts};
use crate::error::Result;
use crate::frame::buffers::{BACKWARD, BufferSet, FORWARD, Role, Slot, UNUSED, UNUSED_SIZE};
use crate::vulkan::{Context, Recorder, TexelFormat};

/// Steps whose records are kept until the host has read them.
pub const ROWS: usize = 64;

/// What the host reads back besides records: all that a fit resumes from, and its best.
const STATE: [&str; 7] =
    ["positions", "colors", "parameters", "moments", "color_moments", "best_positions", "best_colors"];

/// What is copied to the device, where it does not share the host's memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Upload {
    /// Tables, inputs and state.
    Everything,
    /// Tables and inputs: what the device itself writes stays.
    Inputs,
    /// `fit_state` alone.
    State,
}

/// All buffers.
#[derive(Debug, Default)]
pub struct Memory {
    pub set: BufferSet,
}

/// The fit's own buffers: name, format, role, bytes.
fn own(plan: &FitPlan, tables: &Tables) -> Vec<(Slot, u64)> {
    use Role::{Input, Output, Workspace};
    use TexelFormat::{Float, Float4, Uint, Uint4};
    let pixel = if plan.has_color { Float4 } else { Float };
    let (vertices, rows) = (u64::from(plan.vertices), u64::from(plan.rows()));
    let groups = rows.div_ceil(GROUP as u64);
    let partials: u64 = plan.levels.iter().map(|l| u64::from(l.blocks * plan.views)).sum();
    let bytes = |words: usize| 4 * words.max(4) as u64;
    let vec4 = |count: u64| 16 * count.max(1);
    let slot = |name, format, role, size| (Slot { name, format, role }, size);
    vec![
        slot("neighbors", Uint, Input, bytes(tables.neighbors.len())),
        slot("flaps", Uint4, Input, bytes(4 * tables.flaps.len())),
        slot("flap_corners", Uint, Input, bytes(tables.flap_corners.len())),
        slot("loss_targets", pixel, Input, bytes(tables.targets.len())),
        slot("loss_weights", Float, Input, bytes(tables.weights.len())),
        slot("loss_scales", Float4, Input, vec4(plan.levels.len() as u64)),
        slot("logit_template", Float4, Input, bytes(4 * tables.logit_template.len())),
        slot("inverse_entries", Float, Input, bytes(tables.inverse.len())),
        slot("parameters", Float4, Output, vec4(rows)),
        slot("moments", Float4, Output, vec4(2 * rows)),
        slot("color_moments", Float4, Output, vec4(if plan.fit_colors { 2 * vertices } else { 1 })),
        slot("best_positions", Float, Output, 12 * vertices.max(2)),
        slot("best_colors", Float, Output, if plan.fit_colors { 12 * vertices.max(2) } else { 16 }),
        slot("fit_state", Uint, Output, u64::from(4 * c::FIT_STATE_WORDS)),
        slot("records", Uint, Output, u64::from(4 * c::RECORD_WORDS) * ROWS as u64),
        slot("pyramid", pixel, Workspace, 4 * (plan.channels() as u64 * u64::from(plan.pyramid_pixels())).max(4)),
        slot("loss_partials", Float4, Workspace, vec4(partials)),
        slot("loss_sums", Float4, Workspace, vec4(u64::from(plan.views) * plan.levels.len() as u64)),
        slot("vertex_penalties", Float4, Workspace, vec4(2 * vertices)),
        slot("flap_gradients", Float4, Workspace, vec4(4 * u64::from(plan.flaps))),
        slot("shape_gradients", Float4, Workspace, vec4(rows)),
        slot("centre_partials", Float4, Workspace, vec4(groups)),
        slot("square_partials", Float4, Workspace, vec4(groups)),
        slot("step_totals", Float4, Workspace, vec4(2)),
        slot("steps", Float4, Workspace, vec4(rows)),
        slot("smooth_odd", Float4, Workspace, vec4(rows)),
        slot("smooth_even", Float4, Workspace, vec4(rows)),
    ]
}

impl Memory {
    /// Makes the fit's own buffers and writes the tables; nothing is uploaded yet.
    ///
    /// # Errors
    /// [`crate::Error::Limit`], [`crate::Error::OutOfMemory`].
    pub fn add_own(&mut self, context: &Context, plan: &FitPlan, tables: &Tables) -> Result<()> {
        for (slot, size) in own(plan, tables) {
            self.set.reserve(context, slot, size)?;
        }
        let scales: Vec<f32> = plan.levels.iter().flat_map(|l| l.scales).collect();
        self.set.write("neighbors", bytemuck::cast_slice(&tables.neighbors))?;
        self.set.write("flaps", bytemuck::cast_slice(&tables.flaps))?;
        self.set.write("flap_corners", bytemuck::cast_slice(&tables.flap_corners))?;
        self.set.write("loss_targets", bytemuck::cast_slice(&tables.targets))?;
        self.set.write("loss_weights", bytemuck::cast_slice(&tables.weights))?;
        self.set.write("loss_scales", bytemuck::cast_slice(&scales))?;
        self.set.write("inverse_entries", bytemuck::cast_slice(&tables.inverse))?;
        self.set.write("logit_template", bytemuck::cast_slice(&tables.logit_template))
    }

    /// The bytes that are bound where the fit has no buffer.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`].
    pub fn unused_parts(&self) -> Result<Parts> {
        let mut parts = Parts::default();
        if let Some(unused) = self.set.unused() {
            for format in [TexelFormat::Float, TexelFormat::Uint] {
                parts.unused.push((format, unused.texel_part(0, UNUSED_SIZE, format)?));
            }
        }
        Ok(parts)
    }

    /// Makes room for a frame and its gradients; true where a buffer is a new one.
    ///
    /// # Errors
    /// As [`add_own`](Self::add_own).
    pub fn reserve(&mut self, context: &Context, frame: &FramePlan, gradients: &GradientPlan) -> Result<bool> {
        let mut renewed = false;
        for slot in FORWARD.into_iter().chain([UNUSED]).chain(BACKWARD) {
            if let Some(needed) = frame.buffer(slot.name).or_else(|| gradients.buffer(slot.name)) {
                renewed |= self.set.reserve(context, slot, needed.size)?;
            }
        }
        Ok(renewed)
    }

    /// Writes what the frame reads, but for positions and colours.
    ///
    /// # Errors
    /// None where there is room.
    pub fn write_inputs(&mut self, inputs: &Inputs) -> Result<()> {
        let fixed = inputs.all().into_iter().filter(|(name, _)| !["positions", "colors"].contains(name));
        fixed.into_iter().try_for_each(|(name, bytes)| self.set.write(name, bytes))
    }

    /// Writes a state, the best as yet unknown.
    ///
    /// # Errors
    /// None where there is room.
    pub fn write_state(&mut self, state: &FitState, uniform_color: Option<&[u8]>) -> Result<()> {
        let fit_state = [0, 0, 0, f32::INFINITY.to_bits()];
        self.set.write("fit_state", bytemuck::cast_slice(&fit_state))?;
        self.set.write("positions", bytemuck::cast_slice(&state.positions))?;
        self.set.write("best_positions", bytemuck::cast_slice(&state.positions))?;
        let texel = |v: &Vec3| [v[0], v[1], v[2], 0.0];
        let texels = |rows: &[Vec3]| rows.iter().flat_map(texel).collect::<Vec<f32>>();
        let pairs = |rows: &[[Vec3; 2]]| rows.iter().flatten().flat_map(texel).collect::<Vec<f32>>();
        self.set.write("parameters", bytemuck::cast_slice(&texels(&state.parameters)))?;
        self.set.write("moments", bytemuck::cast_slice(&pairs(&state.moments)))?;
        match uniform_color {
            Some(bytes) => self.set.write("colors", bytes),
            None => {
                self.set.write("best_colors", bytemuck::cast_slice(&state.colors))?;
                self.set.write("color_moments", bytemuck::cast_slice(&pairs(&state.color_moments)))?;
                self.set.write("colors", bytemuck::cast_slice(&state.colors))
            }
        }
    }

    /// Reads the state as of the last download; steps are the host's own count.
    ///
    /// # Errors
    /// None where there is a frame.
    pub fn read_state(&self, plan: &FitPlan) -> Result<FitState> {
        let rows = plan.rows() as usize;
        let vertices = if plan.fit_colors { plan.vertices as usize } else { 0 };
        let colors = if plan.fit_colors { self.vectors("colors", vertices)? } else { Vec::new() };
        Ok(FitState {
            positions: self.vectors("positions", plan.vertices as usize)?,
            parameters: if plan.logit { self.texels("parameters", rows)? } else { Vec::new() },
            moments: self.pairs("moments", rows)?,
            colors,
            color_moments: self.pairs("color_moments", vertices)?,
            steps: 0,
            color_steps: 0,
        })
    }

    /// x, y, z of so many.
    pub fn vectors(&self, name: &str, count: usize) -> Result<Vec<Vec3>> {
        Ok(self.set.floats(name, 3 * count)?.chunks_exact(3).map(|v| [v[0], v[1], v[2]]).collect())
    }

    fn texels(&self, name: &str, count: usize) -> Result<Vec<Vec3>> {
        Ok(self.set.floats(name, 4 * count)?.chunks_exact(4).map(|v| [v[0], v[1], v[2]]).collect())
    }

    fn pairs(&self, name: &str, count: usize) -> Result<Vec<[Vec3; 2]>> {
        Ok(self.texels(name, 2 * count)?.chunks_exact(2).map(|p| [p[0], p[1]]).collect())
    }

    /// A step's record.
    pub fn record(&self, row: usize) -> Result<[u32; c::RECORD_WORDS as usize]> {
        let mut all = [[0; c::RECORD_WORDS as usize]; ROWS];
        self.set.read("records", bytemuck::cast_slice_mut(&mut all))?;
        Ok(all[row])
    }

    /// Lets steps be taken again: of what the device told last, only that it halted is changed.
    ///
    /// # Errors
    /// None where there is a frame.
    pub fn go_on(&mut self) -> Result<()> {
        let mut words = [0u32; c::FIT_STATE_WORDS as usize];
        self.set.read("fit_state", bytemuck::cast_slice_mut(&mut words))?;
        words[c::FIT_HALTED as usize] = 0;
        self.set.write("fit_state", bytemuck::cast_slice(&words))
    }

    /// Records the upload of what the host wrote.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`].
    pub fn record_upload(&self, recorder: &mut Recorder<'_>, what: Upload) -> Result<()> {
        recorder.barrier();
        for (slot, buffer) in self.set.shared() {
            let is_state = STATE.contains(&slot.name) || slot.name == "fit_state";
            let is_input = slot.role == Role::Input && !is_state && !slot.name.starts_with("upstream");
            let wanted = match what {
                Upload::Everything => is_state || is_input,
                Upload::Inputs => is_input,
                Upload::State => slot.name == "fit_state",
            };
            if wanted {
                buffer.record_upload(recorder)?;
            }
        }
        recorder.barrier();
        Ok(())
    }

    /// Records the download of the state (`state`) or of what a step tells.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`].
    pub fn record_download(&self, recorder: &mut Recorder<'_>, state: bool) -> Result<()> {
        for (slot, buffer) in self.set.shared() {
            let wanted = if state { STATE.contains(&slot.name) } else { ["records", "fit_state"].contains(&slot.name) };
            if wanted {
                buffer.record_download(recorder)?;
            }
        }
        recorder.barrier_to_host();
        Ok(())
    }
}
