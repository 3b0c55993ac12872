//! Changes of a pass's scene, of which only what differs is uploaded.

use super::builder::{Content, PassPlan};
use super::{Pass, SETUP, put};
use crate::error::{Error, Result};
use crate::frame::buffers::BufferId;
use crate::frame::pack::InputChanges;
use crate::frame::shape::FrameShape;
use crate::scene::{Camera, Scene, Settings};
use crate::vulkan::{HostCommands, Recorder};
use std::sync::Arc;

impl Pass {
    /// Changes the scene, with its lights: positions, normals, colours, features, UVs and texels, but no triangles, sizes or numbers.
    /// Returns which inputs differ from the scene before. They are to be uploaded by [`write_scene`](Self::write_scene) and
    /// [`record_scene`](Self::record_scene), and the lights by [`write_frame`](Self::write_frame), before the next frame. If it
    /// fails, the pass stays as it was.
    ///
    /// # Errors
    /// [`Error::Host`] for a pass over a host's meshes, and for a scene that needs another plan; [`Error::Scene`] and
    /// [`Error::Light`] for one that cannot be rendered.
    pub fn set_scene(&mut self, scene: Scene) -> Result<InputChanges> {
        let refused = |what: &str, fix: &str| Err(Error::Host { what: what.into(), fix: fix.into() });
        let Some(tables) = &mut self.scene else {
            return refused("the pass draws a host's meshes, no scene", "plan it with Rasterizer::scene_pass");
        };
        let plan = &mut self.plan;
        let cameras: Vec<Camera> = plan.cameras.iter().map(|view| view.camera).collect();
        let shape = plan.shape_of(&scene, &cameras, &plan.settings)?;
        let planned = &plan.frame.shape;
        if shape.meshes != planned.meshes || shape.opacity != planned.opacity || !tables.has_triangles_of(&scene) {
            let what = "the scene's triangles, sizes or numbers are others than were planned";
            return refused(what, "plan and rebind with the scene");
        }
        if shape.lights.directional.len() != planned.lights.directional.len() {
            return refused("another number of lights than was planned", "plan and rebind with the scene");
        }
        plan.set_frame(plan.settings.clone(), shape.cutoff, Some(shape.lights))?;
        let changes = tables.update(&scene);
        plan.builder.content = Content::Scene(Some(Arc::new(scene)));
        self.forget_frame();
        Ok(changes)
    }

    /// Writes what differs of the scene into the mapped bytes of the upload buffer. No setup and no earlier change that reads them
    /// may be in flight.
    ///
    /// # Errors
    /// As [`write_inputs`](Self::write_inputs).
    pub fn write_scene(&self, upload: &mut [u8], changes: InputChanges) -> Result<()> {
        self.put_scene(upload, |id| changes.has(id))
    }

    pub(super) fn put_scene(&self, upload: &mut [u8], is_wanted: impl Fn(BufferId) -> bool) -> Result<()> {
        for (id, bytes) in self.scene.iter().flat_map(|tables| tables.all()) {
            let copy = self.plan.layouts.setup.iter().find(|copy| copy.id == id && is_wanted(id));
            copy.map_or(Ok(()), |copy| put(upload, copy.mapped, bytes))?;
        }
        Ok(())
    }

    /// Records the copies of what differs of the scene, which [`write_scene`](Self::write_scene) wrote. Begins and ends with
    /// barriers, as every call here.
    ///
    /// # Errors
    /// [`Error::Host`] where no setup was recorded before.
    pub fn record_scene(&self, commands: &mut HostCommands, changes: InputChanges) -> Result<()> {
        self.needs(SETUP, "record_setup")?;
        let mut recorder = Recorder::on_host(&self.rasterizer.device, commands);
        recorder.begin_label("scene");
        recorder.barrier();
        let copies = self.plan.layouts.setup.iter().filter(|copy| changes.has(copy.id));
        self.copy_in(&mut recorder, &self.staging, copies)?;
        recorder.barrier();
        recorder.end_label();
        Ok(())
    }
}

impl PassPlan {
    /// The scene that it draws; `None` for a host's meshes.
    pub(super) fn scene(&self) -> Option<&Scene> {
        match &self.builder.content {
            Content::Scene(scene) => scene.as_deref(),
            Content::Meshes { .. } => None,
        }
    }

    /// The shape of a scene with other cameras or settings. Fails if its triangles would cross a plane that they did not cross in
    /// the plan.
    pub(super) fn shape_of(&self, scene: &Scene, cameras: &[Camera], settings: &Settings) -> Result<FrameShape> {
        let shape = FrameShape::of(scene, cameras, settings)?;
        let planned = self.frame.shape.depth_span;
        if planned.or(shape.depth_span) != planned {
            let what = "with these cameras the scene crosses the near or the far plane".into();
            return Err(Error::Host { what, fix: "plan and rebind with them".into() });
        }
        Ok(shape)
    }
}
