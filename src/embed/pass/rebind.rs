//! Changes of a bound pass: cameras, lights and settings in place, everything else by binding anew.

use super::Pass;
use super::buffers::PassBuffer;
use super::builder::{PassPlan, PassView, cutoff_of};
use super::memory::PassMemory;
use crate::embed::host::camera::{CameraMatrices, ClipSpace};
use crate::embed::host::mesh::MeshBuffers;
use crate::error::{Error, Result};
use crate::frame::plan::Lenses;
use crate::scene::{Camera, Lights, Settings};

/// The result of a [`rebind`](Pass::rebind).
#[derive(Debug)]
pub struct Rebound {
    /// The old pass. Drop it, and destroy its memory, once the commands that it was recorded into have been executed.
    pub old: Pass,
    /// Buffers whose place or size changed: the host's own descriptor sets must be updated.
    pub moved: Vec<PassBuffer>,
}

impl Pass {
    /// Changes the cameras, but not their number: see [`set_camera_matrices`](Self::set_camera_matrices).
    ///
    /// # Errors
    /// [`Error::Scene`] for another number of them, [`Error::Host`] where they need other kernels: an orthographic camera needs a
    /// plan with one.
    pub fn set_cameras(&mut self, cameras: &[Camera]) -> Result<()> {
        self.plan.set_views(cameras.len(), cameras.iter().copied().map(PassView::Camera))?;
        self.forget_frame();
        Ok(())
    }

    /// Changes the cameras to those of matrices, as [`PassBuilder::camera_matrices`](crate::embed::PassBuilder::camera_matrices) takes them;
    /// near and far are theirs, as [`PassBuilder::planes`](crate::embed::PassBuilder::planes) says. The next
    /// [`write_frame`](Self::write_frame) and the next recording use them. Allocates only for an error.
    ///
    /// # Errors
    /// As [`set_cameras`](Self::set_cameras), and [`HostCamera::new`](crate::embed::HostCamera::new).
    pub fn set_camera_matrices(&mut self, matrices: &[CameraMatrices], clip: ClipSpace) -> Result<()> {
        let views = matrices.iter().map(|&matrices| PassView::Matrices(matrices, clip));
        self.plan.set_views(matrices.len(), views)?;
        self.forget_frame();
        Ok(())
    }

    /// Changes settings that need no other kernels or sizes: σ, γ, the background colour. All later recordings use
    /// them, also stores to images that were bound before. Allocates only for an error.
    ///
    /// # Errors
    /// [`Error::Settings`], and [`Error::Host`] where they need other kernels or more memory.
    pub fn set_settings(&mut self, settings: Settings) -> Result<()> {
        let new_size = (settings.width, settings.height);
        let used = self.plan.builder.resolved(&settings, self.plan.cameras.iter().copied())?;
        if new_size != self.plan.image_size() {
            let what = format!("images of {new_size:?} pixels for a pass of {:?}", self.plan.image_size());
            return Err(Error::Host { what, fix: "plan and rebind for another size".into() });
        }
        let cutoff = self.plan.cutoff(self.plan.cameras.iter().map(|view| view.camera), &used)?;
        self.plan.set_frame(used, cutoff, None)?;
        self.plan.builder.settings = settings;
        self.forget_frame();
        Ok(())
    }

    /// Changes the lights, but not their number or shading. The next [`write_frame`](Self::write_frame) and the next
    /// recording use them. Allocates only for an error.
    ///
    /// # Errors
    /// [`Error::Light`]; [`Error::Host`] where they need other kernels.
    pub fn set_lights(&mut self, lights: Lights) -> Result<()> {
        lights.validate()?;
        if lights.directional.len() != self.plan.frame.shape.lights.directional.len() {
            let what = "another number of lights than was planned".into();
            return Err(Error::Host { what, fix: "plan and rebind with as many".into() });
        }
        self.plan.set_frame(self.plan.settings.clone(), self.plan.frame.shape.cutoff, Some(lights))?;
        self.forget_frame();
        Ok(())
    }

    /// Binds another plan in place of this one: more room, other meshes, another size. Afterwards the inputs must be
    /// written, the setup recorded and images bound again. If it fails, the pass stays as it was.
    ///
    /// # Errors
    /// As [`Rasterizer::bind_pass`](crate::embed::Rasterizer::bind_pass).
    pub fn rebind(&mut self, plan: PassPlan, memory: PassMemory<'_>, meshes: &[MeshBuffers]) -> Result<Rebound> {
        let new = self.rasterizer.bind_pass(plan, memory, meshes)?;
        let old = std::mem::replace(self, new);
        let moved = PassBuffer::ALL.iter().copied().filter(|id| old.buffer(*id) != self.buffer(*id)).collect();
        Ok(Rebound { old, moved })
    }
}

impl PassPlan {
    fn set_views(&mut self, count: usize, views: impl Iterator<Item = PassView> + Clone) -> Result<()> {
        if count != self.cameras.len() {
            return Err(Error::Scene {
                what: format!("{count} cameras for a pass of {} views", self.cameras.len()),
                fix: "plan and rebind for another number of views".into(),
            });
        }
        let size = self.image_size();
        for view in views.clone() {
            let camera = view.camera(size)?.camera;
            if !self.frame.shape.lenses.serve(Lenses::of([&camera])) {
                let what = "the pass was planned without cameras that are orthographic, or that distort".into();
                return Err(Error::Host { what, fix: "plan and rebind with one".into() });
            }
        }
        let cameras = || views.clone().filter_map(|view| view.camera(size).ok());
        let settings = self.builder.resolved(&self.builder.settings, cameras())?;
        let cutoff = self.cutoff(cameras().map(|view| view.camera), &settings)?;
        self.set_frame(settings, cutoff, None)?;
        for ((own, camera), view) in self.builder.views.iter_mut().zip(&mut self.cameras).zip(views) {
            (*own, *camera) = (view, view.camera(size)?);
        }
        Ok(())
    }

    /// The squared radius of support with other cameras and settings. Fails if a scene's triangles would cross a plane
    /// that they did not cross in the plan. It allocates only for a scene.
    fn cutoff(&self, cameras: impl Iterator<Item = Camera>, settings: &Settings) -> Result<f64> {
        let Some(scene) = self.scene() else { return Ok(cutoff_of(settings)) };
        Ok(self.shape_of(scene, &cameras.collect::<Vec<_>>(), settings)?.cutoff)
    }

    /// Sets settings with their final near and far, and lights, if these need the same kernels and buffers.
    pub(super) fn set_frame(&mut self, settings: Settings, cutoff: f64, lights: Option<Lights>) -> Result<()> {
        let lights_used = lights.as_ref().unwrap_or(&self.frame.shape.lights);
        let push = self.frame.push_with(&settings, cutoff, lights_used)?.ok_or_else(|| Error::Host {
            what: "outputs, modes, shading or the number of lights are others than were planned".into(),
            fix: "plan and rebind".into(),
        })?;
        if let Some(gradients) = &mut self.gradients {
            gradients.set_push(push, &self.frame, lights_used, self.builder.largest_upstream);
        }
        self.frame.forward.push = push;
        self.frame.shape.cutoff = cutoff;
        if let Some(lights) = lights {
            self.frame.shape.lights = lights;
        }
        self.settings = settings;
        Ok(())
    }
}
