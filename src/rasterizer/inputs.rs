//! The bytes of a frame's inputs, for a host to write into its own memory.

use super::plan::FramePlan;
use crate::constants as c;
use crate::pack::{MeshTables, camera_texels, light_texels};
use crate::scene::{Camera, Scene, Settings, Shading};

/// The inputs of a frame as the kernels read them, from a scene that the host has in its memory.
///
/// What changes from frame to frame can be written alone: `view_cameras` ([`camera_texels`]), `lights`
/// ([`light_texels`]), `positions` (x, y, z of every vertex of every mesh, tightly packed floats), `colors`.
#[derive(Debug)]
pub struct Inputs {
    /// The meshes.
    pub tables: MeshTables,
    shapes: Vec<[u32; 4 * c::SHAPE_TEXELS as usize]>,
    cameras: Vec<[[f32; 4]; c::CAMERA_TEXELS as usize]>,
    lights: Vec<[f32; 4]>,
}

impl Inputs {
    /// Lays out what a scene's frame reads. The plan is one of this scene's [`Shape`](super::Shape).
    pub fn new(scene: &Scene, cameras: &[Camera], settings: &Settings, plan: &FramePlan) -> Self {
        let tables = MeshTables::new(scene, scene.lights.shading == Shading::Smooth || settings.save);
        Self {
            shapes: tables.view_shapes(scene, &plan.plan),
            cameras: cameras.iter().map(|camera| camera_texels(camera, settings)).collect(),
            lights: light_texels(&scene.lights),
            tables,
        }
    }

    /// Every input's name and bytes; empty for one that the frame does not need.
    pub fn all(&self) -> [(&'static str, &[u8]); 12] {
        let tables = &self.tables;
        [
            ("view_shapes", bytemuck::cast_slice(&self.shapes)),
            ("view_cameras", bytemuck::cast_slice(&self.cameras)),
            ("positions", bytemuck::cast_slice(&tables.positions)),
            ("indices", bytemuck::cast_slice(&tables.indices)),
            ("adjacency", bytemuck::cast_slice(&tables.adjacency)),
            ("lights", bytemuck::cast_slice(&self.lights)),
            ("colors", bytemuck::cast_slice(&tables.colors)),
            ("uvs", bytemuck::cast_slice(&tables.uvs)),
            ("uv_indices", bytemuck::cast_slice(&tables.uv_indices)),
            ("triangle_textures", bytemuck::cast_slice(&tables.triangle_textures)),
            ("textures", bytemuck::cast_slice(&tables.textures)),
            ("texels", bytemuck::cast_slice(&tables.texels)),
        ]
    }

    /// One input's bytes.
    pub fn get(&self, name: &str) -> Option<&[u8]> {
        self.all().into_iter().find(|(n, _)| *n == name).map(|(_, bytes)| bytes)
    }
}
