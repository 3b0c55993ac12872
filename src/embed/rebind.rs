//! What of a bound pass can change: cameras, lights and settings in place, all else by binding anew.

use super::builder::{PassBuilder, PassPlan, ViewCamera};
use super::camera::ClipSpace;
use super::memory::PassMemory;
use super::mesh::MeshBuffers;
use super::pass::Pass;
use crate::error::{Error, Result};
use crate::frame::buffers::BufferId;
use crate::scene::{Camera, Lights, Projection, Settings};
use glam::DMat4;

/// What a [`rebind`](Pass::rebind) changed.
#[derive(Debug)]
pub struct Rebound {
    /// The pass as it was: to be dropped, and its memory destroyed, once the commands that it was recorded into have been
    /// executed.
    pub old: Pass,
    /// Buffers that lie elsewhere or have another size: the host's own descriptor sets must name them anew.
    pub moved: Vec<BufferId>,
}

impl Pass {
    /// Other cameras, as many as before, from the next [`write_frame`](Self::write_frame) on.
    ///
    /// # Errors
    /// [`Error::Scene`] for another number of them, [`Error::Host`] where they need other kernels.
    pub fn set_cameras(&mut self, cameras: &[Camera]) -> Result<()> {
        self.set_views(self.plan.builder().cameras(cameras))
    }

    /// The same from matrices, as [`PassBuilder::camera_matrices`](super::PassBuilder::camera_matrices). Near and far stay.
    ///
    /// # Errors
    /// As [`set_cameras`](Self::set_cameras), and [`HostCamera::new`](super::HostCamera::new).
    pub fn set_camera_matrices(&mut self, matrices: &[(DMat4, DMat4)], clip: ClipSpace) -> Result<()> {
        self.set_views(self.plan.builder().camera_matrices(matrices, clip))
    }

    fn set_views(&mut self, builder: PassBuilder) -> Result<()> {
        let cameras = builder.view_cameras(&self.plan.settings)?;
        if cameras.len() != self.plan.cameras.len() {
            return Err(Error::Scene {
                what: format!("{} cameras for a pass of {} views", cameras.len(), self.plan.cameras.len()),
                fix: "plan and rebind for another number of views".into(),
            });
        }
        let distorts = |view: &ViewCamera| matches!(view.camera.projection(), Projection::Official { .. });
        if cameras.iter().any(distorts) && !self.plan.frame.shape.distorted {
            let what = "the pass was planned without cameras that distort".into();
            return Err(Error::Host { what, fix: "plan and rebind with one".into() });
        }
        (self.plan.cameras, self.plan.builder) = (cameras, builder);
        Ok(())
    }

    /// Other settings of the same kernels and sizes: σ, γ, the background colour. What is recorded from now on has them.
    ///
    /// # Errors
    /// [`Error::Host`] where they need other kernels or more memory; as [`PassBuilder::build`](super::PassBuilder::build).
    pub fn set_settings(&mut self, settings: Settings) -> Result<()> {
        let cameras = self.plan.cameras.clone();
        let capacity = self.plan.frame.capacity();
        let plan = self.plan.builder().settings(settings).capacity(capacity).build()?;
        self.frame.fits(&plan.frame)?;
        if let (Some(bindings), Some(gradients)) = (&self.gradients, &plan.gradients) {
            bindings.fits(gradients)?;
        }
        if plan.image_size() != self.plan.image_size() {
            let what = format!("images of {:?} pixels for a pass of {:?}", plan.image_size(), self.plan.image_size());
            return Err(Error::Host { what, fix: "plan and rebind for another size".into() });
        }
        self.plan = PassPlan { cameras, ..plan };
        Ok(())
    }

    /// Other lights, as many as before and of the same shading, from the next [`write_frame`](Self::write_frame) on.
    ///
    /// # Errors
    /// [`Error::Light`]; [`Error::Host`] where they need other kernels.
    pub fn set_lights(&mut self, lights: Lights) -> Result<()> {
        let cameras = self.plan.cameras.clone();
        let capacity = self.plan.frame.capacity();
        let plan = self.plan.builder().lights(lights).capacity(capacity).build()?;
        self.frame.fits(&plan.frame)?;
        if plan.layouts != self.plan.layouts {
            let what = "another number of lights than was planned".into();
            return Err(Error::Host { what, fix: "plan and rebind with as many".into() });
        }
        self.plan = PassPlan { cameras, ..plan };
        Ok(())
    }

    /// Binds another plan in place of this one: more room, other meshes, another size. The inputs must be written and the setup
    /// recorded again. Where it fails, the pass is as it was.
    ///
    /// # Errors
    /// As [`Rasterizer::bind_pass`](super::Rasterizer::bind_pass).
    pub fn rebind(&mut self, plan: PassPlan, memory: PassMemory<'_>, meshes: &[MeshBuffers]) -> Result<Rebound> {
        let new = self.rasterizer.bind_pass(plan, memory, meshes)?;
        let old = std::mem::replace(self, new);
        let mut ids: Vec<BufferId> = old.buffers.iter().chain(&self.buffers).map(|(id, _)| *id).collect();
        ids.sort();
        ids.dedup();
        let moved = ids.into_iter().filter(|id| old.buffer(*id) != self.buffer(*id)).collect();
        Ok(Rebound { old, moved })
    }
}
