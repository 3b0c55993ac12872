//! The bytes of a frame's inputs, and which of them changed.

use crate::constants as c;
use crate::frame::buffers::BufferId;
use crate::frame::frame_plan::FramePlan;
use crate::frame::pack::{Changes, MeshShape, MeshTables, camera_texels, light_texels};
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
    /// The counts and kinds of the meshes laid out.
    meshes: Vec<MeshShape>,
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
    pub fn update(&mut self, scene: &Scene, cameras: &[Camera], settings: &Settings, plan: &FramePlan) -> Changes {
        let adjacency = scene.lights.shading == Shading::Smooth || settings.save;
        let fits = self.meshes == plan.shape.meshes && (self.adjacent || !adjacency);
        let mut changes = if fits { self.tables.update(scene) } else { None }.unwrap_or_else(|| {
            self.adjacent = adjacency;
            self.meshes.clone_from(&plan.shape.meshes);
            self.tables = MeshTables::new(scene, adjacency);
            Changes::ALL
        });
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
    pub fn all(&self) -> [(BufferId, &[u8]); 14] {
        let tables = &self.tables;
        [
            (BufferId::ViewShapes, bytemuck::cast_slice(&self.shapes)),
            (BufferId::ViewCameras, bytemuck::cast_slice(&self.cameras)),
            (BufferId::Positions, bytemuck::cast_slice(&tables.positions)),
            (BufferId::Indices, bytemuck::cast_slice(&tables.indices)),
            (BufferId::Adjacency, bytemuck::cast_slice(&tables.adjacency)),
            (BufferId::VertexNormals, bytemuck::cast_slice(&tables.normals)),
            (BufferId::Lights, bytemuck::cast_slice(&self.lights)),
            (BufferId::Colors, bytemuck::cast_slice(&tables.colors)),
            (BufferId::Features, bytemuck::cast_slice(&tables.features)),
            (BufferId::Uvs, bytemuck::cast_slice(&tables.uvs)),
            (BufferId::UvIndices, bytemuck::cast_slice(&tables.uv_indices)),
            (BufferId::TriangleTextures, bytemuck::cast_slice(&tables.triangle_textures)),
            (BufferId::Textures, bytemuck::cast_slice(&tables.textures)),
            (BufferId::Texels, bytemuck::cast_slice(&tables.texels)),
        ]
    }
}

/// Replaces the values, and returns whether any bit differed.
fn renew<T: bytemuck::NoUninit>(old: &mut Vec<T>, new: Vec<T>) -> bool {
    let differs = bytemuck::cast_slice::<T, u8>(old) != bytemuck::cast_slice::<T, u8>(&new);
    *old = new;
    differs
}
