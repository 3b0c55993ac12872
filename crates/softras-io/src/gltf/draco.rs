//! Unpacks the meshes of `KHR_draco_mesh_compression`.

use super::{
    GltfWrong, MAX_DRAWN,
    accessor::ComponentType,
    document::{Document, UNPACK},
    json, lacks, of_error,
};
use crate::source::Source;
use std::panic::{AssertUnwindSafe, catch_unwind};

const NAME: &str = "KHR_draco_mesh_compression";

impl Document<'_> {
    /// Unpacks the arrays of a primitive, unless the file has them unpacked too.
    pub fn unpack(&mut self, source: &mut Source, primitive: &json::Primitive) -> Result<(), GltfWrong> {
        let (Some(packed), Some(position)) = (primitive.extensions.get(NAME), primitive.attribute("POSITION")) else {
            return Ok(());
        };
        let most = self.held.max(MAX_DRAWN);
        let is_there = self.root.accessors.get(position).is_some_and(|accessor| accessor.buffer_view.is_some());
        if is_there || self.unpacked.contains_key(&position) {
            return Ok(());
        }
        if self.accessor(position)?.0.count.0 > most {
            return Err((format!("more than {most} vertices"), UNPACK.into()));
        }
        let view = packed["bufferView"].as_u64().ok_or_else(|| lacks("Draco data of view", 0, 0))? as usize;
        let (view, _) = self.view(source, view)?;
        // A decoder of foreign code must not end the process over a broken file.
        let mesh = catch_unwind(AssertUnwindSafe(|| decoded(view.bytes())));
        let wrong = |what: String| (format!("Draco: {what}"), UNPACK.into());
        let mesh = mesh.unwrap_or_else(|_| Err("the decoder failed".into())).map_err(wrong)?;
        if mesh.num_faces() > most || mesh.num_points() > most {
            return Err(wrong(format!("more than {most} vertices or triangles")));
        }
        let ids = packed["attributes"].as_object();
        for (name, id) in ids.into_iter().flatten() {
            let Some(index) = primitive.attribute(name) else { continue };
            let attribute = id.as_u64().and_then(|id| mesh.attribute_by_unique_id(id as u32));
            let attribute = attribute.ok_or_else(|| wrong(format!("no attribute for {name}")))?;
            let (accessor, kind) = self.accessor(index)?;
            if (kind == ComponentType::F32) != (attribute.data_type() == draco_core::DataType::Float32) {
                return Err(wrong(format!("{name} is of another type than its accessor")));
            }
            let components = super::accessor::components(accessor);
            let values = attribute.read_f32s(mesh.num_points(), components);
            let bytes = values.into_iter().flat_map(|x| kind.bytes(x)).collect();
            self.keep(source, index, bytes)?;
        }
        if let Some(indices) = primitive.indices {
            let kind = self.accessor(indices.0)?.1;
            let corners =
                mesh.faces().iter().flatten().flat_map(|corner| corner.0.to_le_bytes().into_iter().take(kind.size()));
            self.keep(source, indices.0, corners.collect())?;
        }
        Ok(())
    }

    fn keep(&mut self, source: &mut Source, accessor: usize, bytes: Vec<u8>) -> Result<(), GltfWrong> {
        source.unpacked(bytes.len()).map_err(of_error)?;
        self.held += bytes.len();
        self.unpacked.insert(accessor, bytes);
        Ok(())
    }
}

fn decoded(bytes: &[u8]) -> Result<draco_core::Mesh, String> {
    let mut mesh = draco_core::Mesh::new();
    let mut buffer = draco_core::DecoderBuffer::new(bytes);
    let status = draco_core::MeshDecoder::new().decode(&mut buffer, &mut mesh);
    status.map(|()| mesh).map_err(|error| error.to_string())
}
