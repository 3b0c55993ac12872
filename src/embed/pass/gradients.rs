//! The gradients of a pass from the bytes that it read back.

use super::Pass;
#[cfg(doc)]
use super::buffers::PassBuffer;
use super::builder::PassPlan;
use crate::error::{Error, Result};
use crate::frame::buffers::BufferId;
use crate::frame::decode::{Decoder, ReadFloats};
use crate::frame::frame_plan::GradientPlan;
use crate::frame::pack::MeshTables;
use crate::gradients::{GradientRequest, Gradients};
use crate::scene::Camera;

impl Pass {
    /// The gradients in the readback buffer's bytes once the device is done, to be decoded before the next `set_` call: those of
    /// the buffers that [`PassBuilder::read_back`](crate::embed::PassBuilder::read_back) named; all of them after
    /// [`read_back_gradients`](crate::embed::PassBuilder::read_back_gradients). [`PassBuffer::Totals`] has those by cameras, lights,
    /// background and scalars, [`PassBuffer::VertexGradients`] those by positions and colours of each view's placed vertices,
    /// [`PassBuffer::TexelSums`] those by texels, [`PassBuffer::CornerGradients`] those by UVs.
    ///
    /// # Errors
    /// [`Error::Backward`] for a pass without gradients; [`Error::Host`] for fewer bytes than the readback buffer has, or bytes
    /// that do not begin at a multiple of 4; [`Error::NotFinite`] if a gradient overflows single precision.
    pub fn decode_gradients(&self, readback: &[u8]) -> Result<Gradients> {
        let has = |id| self.plan.layouts.gradients.outputs.iter().any(|copy| copy.id == id);
        let (vertices, totals) = (has(BufferId::VertexGradients), has(BufferId::Totals));
        let asked = self.gradient_plan()?.wanted;
        let wanted = GradientRequest {
            positions: asked.positions && vertices,
            colors: asked.colors && vertices,
            texels: asked.texels && has(BufferId::TexelSums),
            uvs: asked.uvs && has(BufferId::CornerGradients),
            camera: asked.camera && totals,
            lights: asked.lights && totals,
            background: asked.background && totals,
            scalars: asked.scalars && totals,
            ..asked
        };
        self.decode(&wanted, &|id, count| {
            let part = self.plan.part_read_back(id).map(|(at, size)| at as usize..(at + size) as usize);
            let fail = |what: String| Err(Error::Host { what, fix: "give the whole readback buffer".into() });
            match part.and_then(|part| readback.get(part)?.get(..4 * count)).map(bytemuck::try_cast_slice) {
                None => fail(format!("{} bytes, of which `{id}` lies beyond the last", readback.len())),
                Some(Err(error)) => fail(format!("the bytes of `{id}`: {error}")),
                Some(Ok(floats)) => Ok(floats),
            }
        })
    }

    /// The plan of its gradients.
    ///
    /// # Errors
    /// [`Error::Backward`] for a pass without gradients.
    pub(crate) fn gradient_plan(&self) -> Result<&GradientPlan> {
        self.plan.gradients.as_ref().ok_or_else(|| Error::Backward {
            what: "the pass computes no gradients".into(),
            fix: "plan it with PassBuilder::gradients".into(),
        })
    }

    /// The wanted gradients from the buffers' floats.
    pub(crate) fn decode(&self, wanted: &GradientRequest, floats: ReadFloats<'_>) -> Result<Gradients> {
        let plan = self.gradient_plan()?;
        let PassPlan { frame, settings, cameras, .. } = &self.plan;
        let of_meshes;
        let tables = if let Some(scene) = &self.scene {
            scene
        } else {
            of_meshes = self.plan.tables_of_meshes();
            &of_meshes
        };
        let cameras: Vec<Camera> = cameras.iter().map(|view| view.camera).collect();
        let lights = &frame.shape.lights;
        Decoder { frame, plan, wanted, tables, cameras: &cameras, settings, lights }.decode_floats(floats)
    }
}

impl PassPlan {
    /// The tables of a host's meshes, as far as gradients are decoded by them.
    fn tables_of_meshes(&self) -> MeshTables {
        let uv_indices = self.tables.segments.iter().filter(|segment| segment.id == BufferId::UvIndices);
        MeshTables {
            layouts: self.frame.layouts.clone(),
            shapes: self.frame.shape.meshes.clone(),
            uv_indices: uv_indices.flat_map(|s| s.bytes.as_chunks().0).map(|&word| u32::from_ne_bytes(word)).collect(),
            ..MeshTables::default()
        }
    }
}
