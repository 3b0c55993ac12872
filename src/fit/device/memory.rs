//! The buffers of a fit: those of its frame and gradients, and the fit's own.

use super::arithmetic::Vec3;
use super::buffers::{FitBuffer, Own};
use super::host::FitState;
use super::plan::FitPlan;
use super::tables::Tables;
use super::{DeviceFit, ShapeFit, Targets};
use crate::constants as c;
use crate::embed::{FramePlan, GradientPlan, Inputs};
use crate::error::Result;
use crate::frame::buffers::{BufferId, BufferSet, Entry, Parts, Role};
use crate::renderer::Renderer;
use crate::scene::Settings;
use crate::vulkan::{Context, Recorder};

/// The number of records in `records`: steps that may be submitted before the host reads them.
pub const ROWS: usize = 64;

/// The buffers that the host reads back besides records: the state of the fit and its best mesh.
const STATE: [FitBuffer; 7] = [
    FitBuffer::Frame(BufferId::Positions),
    FitBuffer::Frame(BufferId::Colors),
    FitBuffer::Own(Own::Parameters),
    FitBuffer::Own(Own::Moments),
    FitBuffer::Own(Own::ColorMoments),
    FitBuffer::Own(Own::BestPositions),
    FitBuffer::Own(Own::BestColors),
];

const FIT_STATE: FitBuffer = FitBuffer::Own(Own::FitState);

/// Which buffers are copied to a device that does not share the host's memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Upload {
    /// Tables, inputs and state.
    Everything,
    /// Tables and inputs, not the state, which the device has changed.
    Inputs,
    /// `fit_state` alone.
    State,
}

impl DeviceFit {
    /// [`DeviceFit::new`] with room for steps with settings like these.
    ///
    /// # Errors
    /// As [`DeviceFit::new`], and as [`Renderer::render`].
    pub fn with_room(renderer: &Renderer, fit: ShapeFit, targets: &Targets, settings: &Settings) -> Result<Self> {
        let mut fit = Self::new(renderer, fit, targets, None)?;
        let settings = fit.plan.settings(settings);
        fit.prepare(renderer, &settings)?;
        Ok(fit)
    }
}

/// All buffers.
#[derive(Debug, Default)]
pub struct Memory {
    pub set: BufferSet<FitBuffer>,
}

impl Memory {
    /// Makes the fit's own buffers and writes the tables; nothing is uploaded yet.
    ///
    /// # Errors
    /// [`crate::Error::Limit`], [`crate::Error::OutOfMemory`].
    pub fn add_own(&mut self, context: &Context, plan: &FitPlan, tables: &Tables) -> Result<()> {
        for (entry, size) in Own::ALL.map(|own| own.of(plan, tables)) {
            self.set.reserve(context, entry, size)?;
        }
        let scales: Vec<f32> = plan.levels.iter().flat_map(|l| l.scales).collect();
        self.set.write(Own::Neighbors, bytemuck::cast_slice(&tables.neighbors))?;
        self.set.write(Own::Flaps, bytemuck::cast_slice(&tables.flaps))?;
        self.set.write(Own::FlapCorners, bytemuck::cast_slice(&tables.flap_corners))?;
        self.set.write(Own::LossTargets, bytemuck::cast_slice(&tables.targets))?;
        self.set.write(Own::LossWeights, bytemuck::cast_slice(&tables.weights))?;
        self.set.write(Own::LossScales, bytemuck::cast_slice(&scales))?;
        self.set.write(Own::InverseEntries, bytemuck::cast_slice(&tables.inverse))?;
        self.set.write(Own::LogitTemplate, bytemuck::cast_slice(&tables.logit_template))
    }

    /// The bytes that are bound where the fit has no buffer.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`].
    pub fn unused_parts(&self) -> Result<Parts> {
        self.set.parts([BufferId::Unused])
    }

    /// Makes room for a frame and its gradients; returns whether a buffer was replaced.
    ///
    /// # Errors
    /// As [`add_own`](Self::add_own).
    pub fn reserve(&mut self, renderer: &Renderer, frame: &FramePlan, gradients: &GradientPlan) -> Result<bool> {
        renderer.validate_memory(frame.buffers().iter().chain(gradients.buffers()))?;
        let (context, mut renewed) = (renderer.context(), false);
        for needed in frame.buffers().iter().chain(gradients.buffers()) {
            let entry = Entry { id: needed.id.into(), format: needed.format, role: needed.role };
            renewed |= self.set.reserve(context, entry, needed.size)?;
        }
        Ok(renewed)
    }

    /// Writes the frame's inputs except positions and colours, which belong to the state.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`] for a buffer that was not made or is too small.
    pub fn write_inputs(&mut self, inputs: &Inputs) -> Result<()> {
        let fitted = [BufferId::Positions, BufferId::Colors];
        // What the frame does not need is empty, and has no buffer.
        let fixed = inputs.all().into_iter().filter(|(id, bytes)| !fitted.contains(id) && !bytes.is_empty());
        fixed.into_iter().try_for_each(|(id, bytes)| self.set.write(id, bytes))
    }

    /// Writes a state, which also becomes the best mesh with an infinite loss.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`] for a buffer that was not made or is too small.
    pub fn write_state(&mut self, state: &FitState, uniform_color: Option<&[u8]>) -> Result<()> {
        let fit_state = [0, 0, 0, f32::INFINITY.to_bits()];
        self.set.write(Own::FitState, bytemuck::cast_slice(&fit_state))?;
        self.set.write(BufferId::Positions, bytemuck::cast_slice(&state.positions))?;
        self.set.write(Own::BestPositions, bytemuck::cast_slice(&state.positions))?;
        let texel = |v: &Vec3| [v[0], v[1], v[2], 0.0];
        let texels = |rows: &[Vec3]| rows.iter().flat_map(texel).collect::<Vec<f32>>();
        let pairs = |rows: &[[Vec3; 2]]| rows.iter().flatten().flat_map(texel).collect::<Vec<f32>>();
        self.set.write(Own::Parameters, bytemuck::cast_slice(&texels(&state.parameters)))?;
        self.set.write(Own::Moments, bytemuck::cast_slice(&pairs(&state.moments)))?;
        match uniform_color {
            Some(bytes) => self.set.write(BufferId::Colors, bytes),
            None => {
                self.set.write(Own::BestColors, bytemuck::cast_slice(&state.colors))?;
                self.set.write(Own::ColorMoments, bytemuck::cast_slice(&pairs(&state.color_moments)))?;
                self.set.write(BufferId::Colors, bytemuck::cast_slice(&state.colors))
            }
        }
    }

    /// Reads the state as of the last download, except the numbers of steps, which the host counts.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`] for a buffer that was not made or is too small.
    pub fn read_state(&self, plan: &FitPlan) -> Result<FitState> {
        let rows = plan.rows() as usize;
        let vertices = if plan.fit_colors { plan.vertices as usize } else { 0 };
        let colors = if plan.fit_colors { self.vectors(BufferId::Colors, vertices)? } else { Vec::new() };
        Ok(FitState {
            positions: self.vectors(BufferId::Positions, plan.vertices as usize)?,
            parameters: if plan.logit { self.texels(Own::Parameters, rows)? } else { Vec::new() },
            moments: self.pairs(Own::Moments, rows)?,
            colors,
            color_moments: self.pairs(Own::ColorMoments, vertices)?,
            steps: 0,
            color_steps: 0,
        })
    }

    /// `count` vectors x, y, z of a buffer.
    pub fn vectors(&self, id: impl Into<FitBuffer>, count: usize) -> Result<Vec<Vec3>> {
        Ok(self.set.contents()?.floats(id, 3 * count)?.chunks_exact(3).map(|v| [v[0], v[1], v[2]]).collect())
    }

    fn texels(&self, id: Own, count: usize) -> Result<Vec<Vec3>> {
        Ok(self.set.contents()?.floats(id, 4 * count)?.chunks_exact(4).map(|v| [v[0], v[1], v[2]]).collect())
    }

    fn pairs(&self, id: Own, count: usize) -> Result<Vec<[Vec3; 2]>> {
        Ok(self.texels(id, 2 * count)?.chunks_exact(2).map(|p| [p[0], p[1]]).collect())
    }

    /// A step's record.
    pub fn record(&self, row: usize) -> Result<[u32; c::RECORD_WORDS as usize]> {
        let mut all = [[0; c::RECORD_WORDS as usize]; ROWS];
        self.set.read(Own::Records, bytemuck::cast_slice_mut(&mut all))?;
        Ok(all[row])
    }

    /// Clears the flag by which the device skips steps and leaves the rest of `fit_state` as downloaded.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`] for a buffer that was not made or is too small.
    pub fn go_on(&mut self) -> Result<()> {
        let mut words = [0u32; c::FIT_STATE_WORDS as usize];
        self.set.read(Own::FitState, bytemuck::cast_slice_mut(&mut words))?;
        words[c::FIT_HALTED as usize] = 0;
        self.set.write(Own::FitState, bytemuck::cast_slice(&words))
    }

    /// Records the upload of what the host wrote.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`].
    pub fn record_upload(&self, recorder: &mut Recorder<'_>, what: Upload) -> Result<()> {
        recorder.barrier();
        use BufferId::{UpstreamColor, UpstreamDepths, UpstreamNormals, UpstreamSilhouette};
        let upstream = [UpstreamColor, UpstreamSilhouette, UpstreamDepths, UpstreamNormals].map(FitBuffer::Frame);
        for (Entry { id, role, .. }, buffer) in self.set.shared() {
            let is_state = STATE.contains(&id) || id == FIT_STATE;
            let is_input = role == Role::Input && !is_state && !upstream.contains(&id);
            let wanted = match what {
                Upload::Everything => is_state || is_input,
                Upload::Inputs => is_input,
                Upload::State => id == FIT_STATE,
            };
            if wanted {
                buffer.record_upload(recorder)?;
            }
        }
        recorder.barrier();
        Ok(())
    }

    /// Records the download of the state (`state`), or of records and `fit_state`.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`].
    pub fn record_download(&self, recorder: &mut Recorder<'_>, state: bool) -> Result<()> {
        let told = [Own::Records, Own::FitState].map(FitBuffer::Own);
        for (Entry { id, .. }, buffer) in self.set.shared() {
            let wanted = if state { STATE.contains(&id) } else { told.contains(&id) };
            if wanted {
                buffer.record_download(recorder)?;
            }
        }
        recorder.barrier_to_host();
        Ok(())
    }
}
