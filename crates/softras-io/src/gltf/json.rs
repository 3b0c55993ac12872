//! The JSON of glTF files: the parts that softras reads.
//!
//! The crate gltf-json is not used, because it refuses files that are valid (extras that are no object, scenes without nodes,
//! 4.0 for 4) or wrong where nothing depends on it (animations), and keeps the places of nodes in 32 bits.

use serde::{Deserialize, Deserializer, de::Error as _};
use serde_json::{Map, Value};
use std::borrow::Cow;

/// A whole number, also one that is written as 4.0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Whole(pub usize);

impl<'de> Deserialize<'de> for Whole {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = f64::deserialize(deserializer)?;
        let is_whole = value >= 0.0 && value.fract() == 0.0;
        if is_whole { Ok(Self(value as usize)) } else { Err(D::Error::custom(format!("{value} is no whole number"))) }
    }
}

/// The extensions of an object by name.
pub type Extensions = Map<String, Value>;

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", default)]
#[derive(Default)]
pub struct Root<'a> {
    pub extensions_required: Vec<String>,
    pub scene: Option<Whole>,
    pub scenes: Vec<Scene>,
    pub nodes: Vec<Node>,
    pub meshes: Vec<Mesh>,
    pub materials: Vec<Material>,
    pub textures: Vec<Texture>,
    #[serde(borrow)]
    pub images: Vec<Image<'a>>,
    pub samplers: Vec<Sampler>,
    pub skins: Vec<Skin>,
    pub accessors: Vec<Accessor>,
    pub buffer_views: Vec<BufferView>,
    #[serde(borrow)]
    pub buffers: Vec<Buffer<'a>>,
    pub extensions: Extensions,
}

#[derive(Deserialize, Default)]
#[serde(default)]
pub struct Scene {
    pub nodes: Vec<Whole>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
pub struct Node {
    pub mesh: Option<Whole>,
    pub skin: Option<Whole>,
    pub children: Vec<Whole>,
    pub matrix: Option<[f64; 16]>,
    pub translation: Option<[f64; 3]>,
    pub rotation: Option<[f64; 4]>,
    pub scale: Option<[f64; 3]>,
    pub weights: Vec<f64>,
    pub extensions: Extensions,
}

#[derive(Deserialize, Default)]
#[serde(default)]
pub struct Mesh {
    pub primitives: Vec<Primitive>,
    pub weights: Vec<f64>,
}

/// Accessors by the names of attributes.
pub type Attributes = std::collections::BTreeMap<String, Whole>;

#[derive(Deserialize, Default)]
#[serde(default)]
pub struct Primitive {
    pub attributes: Attributes,
    pub indices: Option<Whole>,
    pub material: Option<Whole>,
    pub mode: Option<Whole>,
    pub targets: Vec<Attributes>,
    pub extensions: Extensions,
}

impl Primitive {
    /// The accessor of an attribute.
    pub fn attribute(&self, name: &str) -> Option<usize> {
        self.attributes.get(name).map(|index| index.0)
    }
}

#[derive(Deserialize, Default)]
#[serde(rename_all = "camelCase", default)]
pub struct Material {
    pub name: String,
    pub pbr_metallic_roughness: Pbr,
    pub emissive_factor: [f64; 3],
    pub emissive_texture: Option<TextureInfo>,
    pub alpha_mode: String,
    pub alpha_cutoff: Option<f64>,
    pub double_sided: bool,
    pub extensions: Extensions,
}

#[derive(Deserialize, Clone, Default)]
#[serde(rename_all = "camelCase", default)]
pub struct Pbr {
    #[serde(alias = "diffuseFactor")]
    pub base_color_factor: Option<[f64; 4]>,
    #[serde(alias = "diffuseTexture")]
    pub base_color_texture: Option<TextureInfo>,
}

#[derive(Deserialize, Clone, PartialEq)]
#[serde(rename_all = "camelCase")]
pub struct TextureInfo {
    pub index: Whole,
    #[serde(default)]
    pub tex_coord: Whole,
    #[serde(default)]
    pub extensions: Extensions,
}

/// KHR_texture_transform.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub struct Transform {
    pub offset: [f64; 2],
    pub rotation: f64,
    pub scale: [f64; 2],
    pub tex_coord: Option<Whole>,
}

impl Default for Transform {
    fn default() -> Self {
        Self { offset: [0.0; 2], rotation: 0.0, scale: [1.0; 2], tex_coord: None }
    }
}

#[derive(Deserialize, Default)]
#[serde(default)]
pub struct Texture {
    pub source: Option<Whole>,
    pub sampler: Option<Whole>,
    pub extensions: Extensions,
}

#[derive(Deserialize, Default)]
#[serde(rename_all = "camelCase", default)]
pub struct Sampler {
    pub mag_filter: Option<Whole>,
    pub wrap_s: Option<Whole>,
    pub wrap_t: Option<Whole>,
}

#[derive(Deserialize, Default)]
#[serde(rename_all = "camelCase", default)]
pub struct Image<'a> {
    #[serde(borrow)]
    pub uri: Option<Cow<'a, str>>,
    pub buffer_view: Option<Whole>,
}

#[derive(Deserialize, Default)]
#[serde(rename_all = "camelCase", default)]
pub struct Skin {
    pub joints: Vec<Whole>,
    pub inverse_bind_matrices: Option<Whole>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Accessor {
    pub buffer_view: Option<Whole>,
    #[serde(default)]
    pub byte_offset: Whole,
    pub component_type: Whole,
    #[serde(default)]
    pub normalized: bool,
    pub count: Whole,
    #[serde(rename = "type")]
    pub kind: String,
    pub sparse: Option<Sparse>,
}

#[derive(Deserialize)]
pub struct Sparse {
    pub count: Whole,
    pub indices: SparsePart,
    pub values: SparsePart,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct SparsePart {
    pub buffer_view: Whole,
    #[serde(default)]
    pub byte_offset: Whole,
    /// The type of indices; values have that of the accessor.
    #[serde(default)]
    pub component_type: Whole,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct BufferView {
    pub buffer: Whole,
    #[serde(default)]
    pub byte_offset: Whole,
    pub byte_length: Whole,
    #[serde(default)]
    pub byte_stride: Whole,
    #[cfg(feature = "packed")]
    #[serde(default)]
    pub extensions: Extensions,
}

#[derive(Deserialize, Default)]
#[serde(default)]
pub struct Buffer<'a> {
    #[serde(borrow)]
    pub uri: Option<Cow<'a, str>>,
}
