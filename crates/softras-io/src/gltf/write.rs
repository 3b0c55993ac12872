//! Writes meshes as binary glTF files, with everything in one file.

use crate::{obj::png, several_cells};
use serde_json::{Map, Value, json};
use softras::{
    Mesh, Result,
    scene::{Appearance, Texture, Wrap},
};
use std::collections::HashMap;

/// Numbers of glTF's types: 32-bit floats and unsigned integers; of its modes of wrapping; and of its filters.
const FLOAT: u32 = 5126;
const UNSIGNED: u32 = 5125;
const CLAMP: u32 = 33071;
const REPEAT: u32 = 10497;
const LINEAR: u32 = 9729;
const MIPMAPS: u32 = 9987;

/// The content of a .glb file. Colours and factors are linear in glTF, images are sRGB.
///
/// # Errors
/// [`softras::Error::Mesh`] for surface textures of more than one cell, and texels outside [0, 1].
pub fn glb(mesh: &Mesh, origin: [f64; 3]) -> Result<Vec<u8>> {
    let mut file = File::default();
    let triangles = mesh.triangles();
    let positions = |vertices: &mut dyn Iterator<Item = u32>| -> Vec<[f32; 3]> {
        vertices.map(|vertex| mesh.positions()[vertex as usize]).collect()
    };
    let all = positions(&mut (0..mesh.positions().len() as u32));
    let mut primitives = Vec::new();
    match mesh.appearance() {
        Appearance::Uniform(color) => {
            let material = file.material(json!({ "baseColorFactor": [color[0], color[1], color[2], 1.0] }), false);
            let mut attributes = json!({ "POSITION": file.positions(&all) });
            file.add_normals(mesh, &mut attributes);
            primitives.push(file.primitive(attributes, triangles, material));
        }
        Appearance::VertexColors(colors) => {
            let material = file.material(json!({}), false);
            let mut attributes = json!({ "POSITION": file.positions(&all), "COLOR_0": file.floats(colors, "VEC3") });
            file.add_normals(mesh, &mut attributes);
            primitives.push(file.primitive(attributes, triangles, material));
        }
        Appearance::Surface { resolution: 1, texels } => {
            let material = file.material(json!({}), false);
            let corners = positions(&mut triangles.iter().flatten().copied());
            let colors: Vec<[f32; 3]> = texels.iter().flat_map(|color| [*color; 3]).collect();
            let attributes = json!({ "POSITION": file.positions(&corners), "COLOR_0": file.floats(&colors, "VEC3") });
            let own: Vec<[u32; 3]> = (0..triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
            primitives.push(file.primitive(attributes, &own, material));
        }
        Appearance::Surface { resolution, .. } => return Err(several_cells(*resolution, "glTF")),
        Appearance::Textured { uvs, uv_triangles, textures, texture_of_triangle } => {
            for (index, texture) in textures.iter().enumerate() {
                let of = |t: &usize| texture_of_triangle.get(*t).copied().unwrap_or_default() as usize == index;
                let (mut corners, mut index_of, mut own) = (Vec::new(), HashMap::new(), Vec::new());
                for t in (0..triangles.len()).filter(of) {
                    own.push([0, 1, 2].map(|k| {
                        let corner = (triangles[t][k], uv_triangles[t][k]);
                        *index_of.entry(corner).or_insert_with(|| {
                            corners.push(corner);
                            corners.len() as u32 - 1
                        })
                    }));
                }
                if own.is_empty() {
                    continue;
                }
                // Smaller copies of an image mix charts of single triangles.
                let are_single = corners.len() == 3 * own.len();
                let material = file.textured(texture, !are_single)?;
                // v runs down in glTF.
                let uvs: Vec<[f32; 2]> =
                    corners.iter().map(|(_, uv)| uvs[*uv as usize]).map(|[u, v]| [u, 1.0 - v]).collect();
                let placed = positions(&mut corners.iter().map(|(vertex, _)| *vertex));
                let attributes =
                    json!({ "POSITION": file.positions(&placed), "TEXCOORD_0": file.floats(&uvs, "VEC2") });
                primitives.push(file.primitive(attributes, &own, material));
            }
        }
    }
    Ok(file.finished(primitives, origin))
}

/// A file that is being put together.
#[derive(Default)]
struct File {
    bytes: Vec<u8>,
    root: Map<String, Value>,
}

impl File {
    /// Adds a value to a list of the root, and returns its number.
    fn push(&mut self, list: &str, value: Value) -> usize {
        let list = self.root.entry(list).or_insert(json!([])).as_array_mut();
        list.map_or(0, |list| {
            list.push(value);
            list.len() - 1
        })
    }

    fn view(&mut self, content: &[u8]) -> usize {
        let offset = self.bytes.len();
        self.bytes.extend(content);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.push("bufferViews", json!({ "buffer": 0, "byteOffset": offset, "byteLength": content.len() }))
    }

    fn floats<const N: usize>(&mut self, values: &[[f32; N]], kind: &str) -> usize {
        let bytes: Vec<u8> = values.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
        let view = self.view(&bytes);
        let accessor = json!({ "bufferView": view, "componentType": FLOAT, "count": values.len(), "type": kind });
        self.push("accessors", accessor)
    }

    fn positions(&mut self, positions: &[[f32; 3]]) -> usize {
        let accessor = self.floats(positions, "VEC3");
        let ends = |f: fn(f32, f32) -> f32| {
            let fold = |a: [f32; 3], b: &[f32; 3]| [f(a[0], b[0]), f(a[1], b[1]), f(a[2], b[2])];
            positions.iter().fold(positions.first().copied().unwrap_or_default(), fold)
        };
        self.root["accessors"][accessor]["min"] = json!(ends(f32::min));
        self.root["accessors"][accessor]["max"] = json!(ends(f32::max));
        accessor
    }

    /// Writes the mesh's own normals if every vertex has one. A normal of 0, which leaves it to the triangles, has no form in glTF.
    fn add_normals(&mut self, mesh: &Mesh, attributes: &mut Value) {
        if !mesh.normals().is_empty() && mesh.normals().iter().all(|normal| *normal != [0.0; 3]) {
            attributes["NORMAL"] = self.floats(mesh.normals(), "VEC3").into();
        }
    }

    fn primitive(&mut self, attributes: Value, triangles: &[[u32; 3]], material: usize) -> Value {
        let bytes: Vec<u8> = triangles.as_flattened().iter().flat_map(|i| i.to_le_bytes()).collect();
        let (view, count) = (self.view(&bytes), 3 * triangles.len());
        let accessor = json!({ "bufferView": view, "componentType": UNSIGNED, "count": count, "type": "SCALAR" });
        let indices = self.push("accessors", accessor);
        json!({ "attributes": attributes, "indices": indices, "material": material })
    }

    fn material(&mut self, mut look: Value, blends: bool) -> usize {
        look["metallicFactor"] = 0.into();
        look["roughnessFactor"] = 1.into();
        let mut material = json!({ "pbrMetallicRoughness": look, "doubleSided": true });
        if blends {
            material["alphaMode"] = "BLEND".into();
        }
        self.push("materials", material)
    }

    fn textured(&mut self, texture: &Texture, mipmaps: bool) -> Result<usize> {
        let view = self.view(&png(texture)?);
        let image = self.push("images", json!({ "bufferView": view, "mimeType": "image/png" }));
        let wrap = if texture.wrap() == Wrap::Clamp { CLAMP } else { REPEAT };
        let filter = if mipmaps { MIPMAPS } else { LINEAR };
        let sampler = json!({ "wrapS": wrap, "wrapT": wrap, "magFilter": LINEAR, "minFilter": filter });
        let sampler = self.push("samplers", sampler);
        let index = self.push("textures", json!({ "source": image, "sampler": sampler }));
        Ok(self.material(json!({ "baseColorTexture": { "index": index } }), texture.alpha().is_some()))
    }

    fn finished(mut self, primitives: Vec<Value>, origin: [f64; 3]) -> Vec<u8> {
        let mut node = json!({ "mesh": 0 });
        if origin != [0.0; 3] {
            node["translation"] = json!(origin);
        }
        for (name, value) in [
            ("asset", json!({ "version": "2.0", "generator": "softras" })),
            ("scene", json!(0)),
            ("scenes", json!([{ "nodes": [0] }])),
            ("nodes", json!([node])),
            ("meshes", json!([{ "primitives": primitives }])),
            ("buffers", json!([{ "byteLength": self.bytes.len() }])),
        ] {
            self.root.insert(name.into(), value);
        }
        let mut text = Value::from(self.root).to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let length = 12 + 8 + text.len() + 8 + self.bytes.len();
        let mut file = b"glTF".to_vec();
        file.extend([2u32, length as u32].into_iter().flat_map(u32::to_le_bytes));
        for (kind, content) in [(b"JSON", &text), (b"BIN\0", &self.bytes)] {
            file.extend((content.len() as u32).to_le_bytes());
            file.extend(kind);
            file.extend(content);
        }
        file
    }
}
