//! The kernels on a device, from which frames are planned, bound and recorded.

use super::bindings::{FrameBindings, GradientBindings};
use super::buffers::Parts;
use super::frame_plan::{FramePlan, GradientPlan};
use super::passes::{self, BACKWARD_COUNT, BackwardStage, FORWARD_COUNT, ForwardStage};
use super::pipelines::{Pipelines, Request};
use crate::constants as c;
use crate::error::{Error, Result};
use crate::vulkan::{Device, HostDevice, Pipeline, PipelineCache, Recorder, TimestampPool};
use std::sync::{Arc, Mutex, PoisonError};

/// The kernels on a device, from which frames are planned, bound and recorded. It owns no memory, no queue and no command
/// buffer.
///
/// It may be shared between threads, and clones share its kernels; see the module's documentation.
#[derive(Clone)]
pub struct Rasterizer {
    pub(crate) device: Device,
    cache: Option<PipelineCache>,
    pipelines: Arc<Mutex<Pipelines>>,
    pub(crate) lanes: u32,
}

impl std::fmt::Debug for Rasterizer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Rasterizer").field("device", &self.device).field("lanes", &self.lanes).finish_non_exhaustive()
    }
}

impl Rasterizer {
    /// A rasterizer on a host's device. Kernels are compiled when a plan is first bound, or by
    /// [`prepare_pass`](Self::prepare_pass).
    ///
    /// # Errors
    /// [`Error::NoDevice`] for a device of Vulkan 1.0; [`Error::Host`] for null handles.
    pub fn new(host: &HostDevice) -> Result<Self> {
        let device = Device::from_host(host)?;
        Ok(Self::on(&device, PipelineCache::of_host(&device, host)))
    }

    /// A rasterizer on a device of a host's or of our own.
    pub(crate) fn on(device: &Device, cache: Option<PipelineCache>) -> Self {
        Self { device: device.clone(), cache, pipelines: Arc::default(), lanes: passes::default_lanes(device) }
    }

    /// Sets the number of invocations that share a tile: a power of two from 1 to 32. The default is the size of a subgroup
    /// on software devices (8 if that is unusable) and 32 elsewhere. Images do not depend on it.
    ///
    /// # Errors
    /// [`Error::Settings`] for another number.
    pub fn with_lanes(mut self, lanes: u32) -> Result<Self> {
        if !(lanes.is_power_of_two() && lanes <= c::TILE_WIDTH * c::TILE_HEIGHT) {
            let fix = "use a power of two from 1 to 32".into();
            return Err(Error::Settings { field: "lanes", value: lanes.to_string(), fix });
        }
        self.lanes = lanes;
        Ok(self)
    }

    pub(crate) fn bind_parts(&self, plan: &FramePlan, parts: Parts) -> Result<FrameBindings> {
        FrameBindings::new(&self.device, self.forward_pipelines(plan)?, plan, parts)
    }

    pub(crate) fn bind_backward_parts(
        &self,
        plan: &GradientPlan,
        parts: &Parts,
        frame: &FrameBindings,
    ) -> Result<GradientBindings> {
        GradientBindings::new(&self.device, self.backward_pipelines(plan)?, plan, parts, frame)
    }

    pub(crate) fn forward(
        &self,
        recorder: &mut Recorder<'_>,
        plan: &FramePlan,
        bindings: &FrameBindings,
        times: Option<&TimestampPool>,
    ) -> Result<()> {
        bindings.fits(plan)?;
        let FrameBindings { stages, status, bin_bits, tile_counts, .. } = bindings;
        passes::record_forward(recorder, &plan.forward, stages, status, bin_bits, tile_counts, times)
    }

    pub(crate) fn backward(
        &self,
        recorder: &mut Recorder<'_>,
        plan: &GradientPlan,
        bindings: &GradientBindings,
        times: Option<&TimestampPool>,
    ) -> Result<()> {
        bindings.fits(plan)?;
        let GradientBindings { stages, texel_sums, item_counts, tile_counts, cleared, .. } = bindings;
        if plan.device_counts {
            recorder.barrier();
            for part in cleared {
                recorder.fill(part, 0, part.range() / 4 * 4, 0)?;
            }
        }
        passes::record_backward(recorder, &plan.backward, stages, texel_sums, item_counts, tile_counts, times)
    }

    pub(crate) fn forward_pipelines(&self, plan: &FramePlan) -> Result<[Pipeline; FORWARD_COUNT]> {
        let modes = &plan.forward.modes.list();
        self.pipelines(ForwardStage::ALL.map(|stage| {
            Request {
                // A stage that is never recorded is not compiled.
                kernel: if stage.is_needed(&plan.forward) { stage } else { ForwardStage::Vertex }
                    .kernel(&self.device, self.lanes),
                modes,
                lanes: match stage {
                    ForwardStage::BinCoarse => self.lanes.max(plan.forward.coarse_lanes),
                    ForwardStage::ForwardSoftLong | ForwardStage::ForwardLong => c::WORD_BITS,
                    _ => self.lanes,
                },
            }
        }))
    }

    pub(crate) fn backward_pipelines(&self, plan: &GradientPlan) -> Result<[Pipeline; BACKWARD_COUNT]> {
        let lanes = self.lanes;
        let small_lanes = passes::small_lanes(&self.device, lanes);
        let [small_shown, small_outline] = passes::small_pixels(&self.device, lanes);
        let of_all = plan.backward.modes.list().into_iter().chain([
            ("SMALL_LANES", small_lanes),
            ("SMALL_SHOWN_PIXELS", small_shown),
            ("SMALL_OUTLINE_PIXELS", small_outline),
        ]);
        let modes = BackwardStage::ALL.map(|stage| of_all.clone().chain(stage.modes()).collect::<Vec<_>>());
        self.pipelines(BackwardStage::ALL.map(|stage| Request {
            // As for frames, stages that are never recorded are not compiled.
            kernel:
                if stage.is_needed(&plan.backward) { stage } else { BackwardStage::Cull }.kernel(&self.device, lanes),
            modes: &modes[stage as usize],
            lanes: if stage.takes_small_items() { small_lanes } else { lanes },
        }))
    }

    pub(crate) fn pipelines<const N: usize>(&self, requests: [Request<'_>; N]) -> Result<[Pipeline; N]> {
        let mut pipelines = self.pipelines.lock().unwrap_or_else(PoisonError::into_inner);
        pipelines.get(&self.device, self.cache.as_ref(), requests)
    }
}
