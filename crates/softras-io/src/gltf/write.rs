//! Writes meshes as binary glTF files, with everything in one file.

use crate::{obj::png, several_cells, written::Written};
use glam::DVec3;
use serde_json::{Map, Value, json};
use softras::{
    Result,
    scene::{Appearance, Texture, Wrap},
};
use std::collections::BTreeMap;

/// Numbers of glTF's types: 32-bit floats and unsigned integers; of its modes of wrapping; and of its filters.
const FLOAT: u32 = 5126;
const UNSIGNED: u32 = 5125;
const CLAMP: u32 = 33071;
const REPEAT: u32 = 10497;
const LINEAR: u32 = 9729;
const MIPMAPS: u32 = 9987;

/// A vertex of the file: those of the mesh and of its UVs, and the bits of its normal and of its colour with alpha.
type Corner = (u32, u32, [u32; 3], [u32; 4]);

/// The traits that the triangles of a primitive share: their texture, and whether they blend, have normals, show only their front.
type PrimitiveTraits = (Option<usize>, bool, bool, bool);

/// The content of a .glb file. Colours and factors are linear in glTF, images are sRGB. A vertex is repeated for each of its UVs,
/// normals and colours.
///
/// # Errors
/// [`softras::Error::Mesh`] for surface textures of more than one cell, and texels outside [0, 1].
pub fn glb(written: &mut Written) -> Result<Vec<u8>> {
    written.lose_single_normals();
    let mesh = &written.mesh;
    if let Appearance::Surface { resolution, .. } = mesh.appearance()
        && *resolution > 1
    {
        return Err(several_cells(*resolution, "glTF"));
    }
    let mut groups: BTreeMap<PrimitiveTraits, Vec<usize>> = BTreeMap::new();
    for t in 0..mesh.triangles().len() {
        let is_single = written.single_sided.get(t) == Some(&true);
        let group = (written.texture_of(t), written.opacity_of(t) < 1.0, written.normals_of(t).is_some(), is_single);
        groups.entry(group).or_default().push(t);
    }
    let mut file = File::default();
    let primitives = groups.into_iter().map(|(look, group)| file.primitive(written, look, &group));
    let primitives = primitives.collect::<Result<_>>()?;
    Ok(file.finished(primitives, written))
}

/// A file that is being put together.
#[derive(Default)]
struct File {
    bytes: Vec<u8>,
    root: Map<String, Value>,
    /// The textures that are written, with their places in the file.
    textures: BTreeMap<usize, usize>,
}

impl File {
    /// Adds some triangles of one kind.
    fn primitive(
        &mut self,
        written: &Written,
        (texture, blends, has_normals, is_single): PrimitiveTraits,
        group: &[usize],
    ) -> Result<Value> {
        let (mesh, appearance) = (&written.mesh, written.mesh.appearance());
        let is_varied = matches!(appearance, Appearance::VertexColors(_) | Appearance::Surface { .. });
        let has_colors = is_varied || !written.opacity.is_empty();
        let corner = |t: usize, k: usize| -> Corner {
            let vertex = mesh.triangles()[t][k];
            let uv = if let Appearance::Textured { uv_triangles, .. } = appearance { uv_triangles[t][k] } else { 0 };
            let normal = if let Some(normals) = written.normals_of(t) { unit(normals[k]) } else { [0.0; 3] };
            let [r, g, b] = match appearance {
                Appearance::VertexColors(colors) => colors[vertex as usize],
                Appearance::Surface { texels, .. } => texels[t],
                _ => [1.0; 3],
            };
            (vertex, uv, normal.map(f32::to_bits), [r, g, b, written.opacity_of(t)].map(f32::to_bits))
        };
        let mut index: BTreeMap<Corner, u32> =
            group.iter().flat_map(|&t| [0, 1, 2].map(|k| (corner(t, k), 0))).collect();
        index.values_mut().zip(0..).for_each(|(index, i)| *index = i);
        let triangles: Vec<[u32; 3]> = group.iter().map(|&t| [0, 1, 2].map(|k| index[&corner(t, k)])).collect();
        let corners: Vec<Corner> = index.into_keys().collect();
        let positions: Vec<[f32; 3]> = corners.iter().map(|corner| mesh.positions()[corner.0 as usize]).collect();
        let mut attributes = json!({ "POSITION": self.positions(&positions) });
        if let Appearance::Textured { uvs, .. } = appearance {
            // v runs down in glTF.
            let flipped = |corner: &Corner| [uvs[corner.1 as usize][0], 1.0 - uvs[corner.1 as usize][1]];
            attributes["TEXCOORD_0"] = self.floats(&corners.iter().map(flipped).collect::<Vec<_>>(), "VEC2").into();
        }
        if has_normals {
            let normals: Vec<[f32; 3]> = corners.iter().map(|corner| corner.2.map(f32::from_bits)).collect();
            attributes["NORMAL"] = self.floats(&normals, "VEC3").into();
        }
        let colors = corners.iter().map(|corner| corner.3.map(f32::from_bits));
        if has_colors && written.opacity.is_empty() {
            let colors: Vec<[f32; 3]> = colors.map(|[r, g, b, _]| [r, g, b]).collect();
            attributes["COLOR_0"] = self.floats(&colors, "VEC3").into();
        } else if has_colors {
            attributes["COLOR_0"] = self.floats(&colors.collect::<Vec<_>>(), "VEC4").into();
        }
        let (mut look, mut blends) = (json!({}), blends);
        match (appearance, texture) {
            (Appearance::Textured { textures, .. }, Some(i)) => {
                // Smaller copies of an image mix charts of single triangles.
                let are_single = corners.len() == 3 * group.len();
                look["baseColorTexture"]["index"] = self.texture(i, &textures[i], !are_single)?.into();
                blends |= textures[i].alpha().is_some();
            }
            (Appearance::Uniform([r, g, b]), _) => look["baseColorFactor"] = json!([r, g, b, 1.0]),
            _ => {}
        }
        let material = self.material(look, blends, is_single, written.unlit);
        let bytes: Vec<u8> = triangles.as_flattened().iter().flat_map(|i| i.to_le_bytes()).collect();
        let (view, count) = (self.view(&bytes), 3 * triangles.len());
        let accessor = json!({ "bufferView": view, "componentType": UNSIGNED, "count": count, "type": "SCALAR" });
        let indices = self.push("accessors", accessor);
        Ok(json!({ "attributes": attributes, "indices": indices, "material": material }))
    }

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

    fn material(&mut self, mut look: Value, blends: bool, is_single: bool, unlit: bool) -> usize {
        look["metallicFactor"] = 0.into();
        look["roughnessFactor"] = 1.into();
        let mut material = json!({ "pbrMetallicRoughness": look, "doubleSided": !is_single });
        if blends {
            material["alphaMode"] = "BLEND".into();
        }
        if unlit {
            material["extensions"]["KHR_materials_unlit"] = json!({});
        }
        self.push("materials", material)
    }

    fn texture(&mut self, number: usize, texture: &Texture, mipmaps: bool) -> Result<usize> {
        if let Some(known) = self.textures.get(&number) {
            return Ok(*known);
        }
        let view = self.view(&png(texture)?);
        let image = self.push("images", json!({ "bufferView": view, "mimeType": "image/png" }));
        let wrap = if texture.wrap() == Wrap::Clamp { CLAMP } else { REPEAT };
        let filter = if mipmaps { MIPMAPS } else { LINEAR };
        let sampler = json!({ "wrapS": wrap, "wrapT": wrap, "magFilter": LINEAR, "minFilter": filter });
        let sampler = self.push("samplers", sampler);
        let index = self.push("textures", json!({ "source": image, "sampler": sampler }));
        self.textures.insert(number, index);
        Ok(index)
    }

    fn finished(mut self, primitives: Vec<Value>, written: &Written) -> Vec<u8> {
        let mut node = json!({ "mesh": 0 });
        if written.origin != [0.0; 3] {
            node["translation"] = json!(written.origin);
        }
        if written.unlit {
            self.root.insert("extensionsUsed".into(), json!(["KHR_materials_unlit"]));
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

/// A normal as glTF has it, of length 1.
fn unit(normal: [f32; 3]) -> [f32; 3] {
    DVec3::from(normal.map(f64::from)).normalize_or_zero().as_vec3().to_array()
}
