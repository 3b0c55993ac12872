//! The bytes of a frame's inputs, and which of them changed.

use crate::constants as c;
use crate::frame::buffers::BufferId;
use crate::frame::frame_plan::FramePlan;
use crate::frame::pack::{InputChanges, MeshTables, camera_texels, light_texels};
use crate::scene::{Camera, Scene, Settings, Shading};

/// The inputs of a frame as the kernels read them, from a scene that the host has in its memory.
///
/// [`update`](Self::update) returns the inputs that changed since the last frame, so that only these are written: in an
/// optimization of shape, these are the positions.
#[derive(Debug, Default)]
pub struct Inputs {
    /// The meshes.
    pub tables: MeshTables,
    /// Whether the images, `saved`, `tile_bounds` and `tile_marks` still hold what the last frame of the same plan wrote, so
    /// that tiles that were empty and still are need not be written again. Leave it false if you do not know.
    pub background_kept: bool,
    adjacent: bool,
    shapes: Vec<[u32; 4 * c::SHAPE_TEXELS as usize]>,
    cameras: Vec<[[f32; 4]; c::CAMERA_TEXELS as usize]>,
    lights: Vec<[f32; 4]>,
}

/// The word of an entry of `view_shapes` that holds the SHAPE_ flags.
const SHAPE_FLAGS: usize = 11;

impl Inputs {
    /// Lays out the inputs of the next frame, and returns those whose bytes differ from the last frame's. Topology, UVs and
    /// textures are compared and copied only if they differ; a [`Texture`](crate::scene::Texture) that is a clone of the
    /// last one is not compared either.
    pub fn update(&mut self, scene: &Scene, cameras: &[Camera], settings: &Settings, plan: &FramePlan) -> InputChanges {
        let adjacency = scene.lights.shading == Shading::Smooth || settings.save;
        let has_shapes = self.tables.shapes == plan.shape.meshes && (self.adjacent || !adjacency);
        let mut changes = if has_shapes && self.tables.has_triangles_of(scene) {
            self.tables.update(scene)
        } else {
            self.adjacent = adjacency;
            self.tables = MeshTables::new(scene, adjacency);
            InputChanges::ALL
        };
        let mut shapes = plan.view_shapes();
        if self.background_kept {
            shapes.iter_mut().for_each(|shape| shape[SHAPE_FLAGS] |= c::SHAPE_MARKS_VALID);
        }
        let cameras = cameras.iter().map(|camera| camera_texels(camera, settings)).collect();
        changes.note(BufferId::ViewShapes, renew(&mut self.shapes, shapes));
        changes.note(BufferId::ViewCameras, renew(&mut self.cameras, cameras));
        changes.note(BufferId::Lights, renew(&mut self.lights, light_texels(&scene.lights)));
        changes
    }

    /// The id and the bytes of every input; empty for an input that the frame does not need.
    pub fn all(&self) -> impl Iterator<Item = (BufferId, &[u8])> {
        let of_frame: [(_, &[u8]); 3] = [
            (BufferId::ViewShapes, bytemuck::cast_slice(&self.shapes)),
            (BufferId::ViewCameras, bytemuck::cast_slice(&self.cameras)),
            (BufferId::Lights, bytemuck::cast_slice(&self.lights)),
        ];
        of_frame.into_iter().chain(self.tables.all())
    }
}

/// Replaces the values, and returns whether any bit differed.
fn renew<T: bytemuck::NoUninit>(old: &mut Vec<T>, new: Vec<T>) -> bool {
    let differs = bytemuck::cast_slice::<T, u8>(old) != bytemuck::cast_slice::<T, u8>(&new);
    *old = new;
    differs
}
