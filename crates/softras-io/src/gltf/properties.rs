//! The fate of each property of glTF 2.0 and of its extensions. A property that is not listed is noted, so that none is
//! lost without a word.

use super::document::UNPACK;
use crate::{
    fate::{self, Approximated, Drawn, Fate, Fates, NotDrawn, Silent},
    source::Source,
    text,
};
use serde_json::Value;
use std::collections::{BTreeMap, HashMap};

/// The properties by their paths: names joined by dots, lists without their numbers. All that lies below one that is not `Drawn`
/// has its fate. Extensions stand below `extensions` wherever they are used.
pub const PROPERTIES: &Fates = &[
    (
        "asset cameras animations extensionsUsed bufferViews.target accessors.min accessors.max nodes.camera \
         skins.skeleton meshes.primitives.attributes.TANGENT meshes.primitives.attributes._NAME \
         materials.pbrMetallicRoughness.metallicFactor materials.pbrMetallicRoughness.roughnessFactor \
         materials.pbrMetallicRoughness.metallicRoughnessTexture materials.occlusionTexture images.mimeType samplers.minFilter extensions.KHR_mesh_quantization extensions.CESIUM_RTC \
         extensions.KHR_materials_ior extensions.KHR_materials_dispersion extensions.KHR_animation_pointer \
         extensions.KHR_xmp_json_ld extensions.KHR_xmp extensions.EXT_mesh_features \
         extensions.EXT_structural_metadata extensions.EXT_instance_features extensions.MSFT_lod \
         extensions.FB_geometry_metadata extensions.AGI_articulations extensions.AGI_stk_metadata \
         extensions.GODOT_single_root extensions.KHR_node_hoverability extensions.KHR_node_selectability \
         extensions.KHR_interactivity extensions.KHR_physics_rigid_bodies extensions.KHR_implicit_shapes \
         extensions.KHR_audio_emitter extensions.EXT_mesh_manifold extensions.VRM extensions.VRMC_vrm \
         extensions.VRMC_springBone extensions.VRMC_node_constraint",
        Silent,
    ),
    (
        "scene scenes.nodes extensionsRequired buffers.uri buffers.byteLength bufferViews.buffer \
         bufferViews.byteOffset bufferViews.byteLength bufferViews.byteStride accessors.bufferView \
         accessors.byteOffset accessors.componentType accessors.normalized accessors.count accessors.type \
         accessors.sparse nodes.mesh nodes.skin nodes.children nodes.matrix nodes.translation nodes.rotation \
         nodes.scale nodes.weights skins.joints skins.inverseBindMatrices meshes.weights \
         meshes.primitives.indices meshes.primitives.material meshes.primitives.targets \
         meshes.primitives.attributes.POSITION meshes.primitives.attributes.NORMAL \
         meshes.primitives.attributes.TEXCOORD_n meshes.primitives.attributes.JOINTS_n \
         meshes.primitives.attributes.WEIGHTS_n materials.pbrMetallicRoughness.baseColorFactor \
         materials.pbrMetallicRoughness.baseColorTexture materials.alphaMode materials.alphaCutoff materials.doubleSided \
         textures.source textures.sampler images.uri images.bufferView samplers.wrapS samplers.wrapT \
         extensions.KHR_texture_transform extensions.KHR_materials_unlit \
         extensions.KHR_materials_emissive_strength extensions.KHR_materials_pbrSpecularGlossiness \
         extensions.EXT_mesh_gpu_instancing extensions.EXT_texture_webp extensions.KHR_draco_mesh_compression \
         extensions.EXT_meshopt_compression extensions.KHR_texture_basisu extensions.KHR_node_visibility",
        Drawn,
    ),
    ("meshes.primitives.mode", Approximated("lines and points are not drawn")),
    ("meshes.primitives.attributes.COLOR_0", Approximated("vertex colours times a texture are drawn as a new texture")),
    ("meshes.primitives.attributes.COLOR_n", NotDrawn("vertex colours beyond COLOR_0 are not drawn")),
    ("materials.normalTexture", NotDrawn("normal maps are not drawn")),
    (
        "materials.emissiveFactor materials.emissiveTexture",
        Approximated("emitted light is drawn as a colour that is shaded"),
    ),
    ("samplers.magFilter", Approximated("textures are drawn smoothly, not by the nearest texel")),
    ("extensions.KHR_meshopt_compression", NotDrawn(UNPACK)),
    (
        "extensions.KHR_lights_punctual extensions.EXT_lights_ies extensions.EXT_lights_image_based",
        NotDrawn("the lights of the file are not used (--light gives others)"),
    ),
    (
        "extensions.KHR_materials_anisotropy extensions.KHR_materials_clearcoat \
         extensions.KHR_materials_iridescence extensions.KHR_materials_sheen extensions.KHR_materials_specular",
        NotDrawn("reflections are not drawn: softras draws base colours under diffuse light"),
    ),
    (
        "extensions.KHR_materials_transmission extensions.KHR_materials_volume",
        NotDrawn("light that glass lets through is not drawn: only the base colour's alpha makes it transparent"),
    ),
    (
        "extensions.KHR_materials_diffuse_transmission extensions.KHR_materials_volume_scatter",
        NotDrawn("light through surfaces is not drawn"),
    ),
    (
        "extensions.KHR_materials_variants",
        Approximated("the file has variants of its materials: the default one is drawn"),
    ),
    (
        "extensions.CESIUM_primitive_outline extensions.EXT_mesh_primitive_edge_visibility",
        NotDrawn("outlines are not drawn"),
    ),
    ("extensions.KHR_gaussian_splatting", NotDrawn("splats are not drawn")),
    (
        "extensions.VRMC_materials_mtoon extensions.NV_materials_mdl extensions.KHR_techniques_webgl",
        NotDrawn("materials of another program are not drawn"),
    ),
    (
        "extensions.MSFT_texture_dds extensions.EXT_texture_avif",
        NotDrawn("DDS and AVIF images are not read: a texture is drawn by its other image, if it has one"),
    ),
];

/// Whether a file that requires an extension can be drawn, if only nearly.
pub(super) fn is_readable(extension: &str) -> bool {
    let is_packed = matches!(extension, "KHR_draco_mesh_compression" | "EXT_meshopt_compression");
    let is_unread = extension == "KHR_meshopt_compression" || is_packed && cfg!(not(feature = "packed"));
    fate::of(PROPERTIES, &format!("extensions.{extension}")).is_some() && !is_unread
}

/// Notes everything in a file that changes the picture and is not drawn, whatever its value. Values decide on the rest, which the
/// reader notes.
pub fn note_all(source: &mut Source, root: &Value) {
    let mut walk = Walk { fates: fate::names(PROPERTIES).collect(), found: BTreeMap::new() };
    walk.object(root, &mut String::new(), "");
    for (text, (place, count)) in walk.found {
        let count = if count > 1 { format!(" ({count} in all)") } else { String::new() };
        source.notes.add(None, format!("{place}: {text}{count}"));
    }
}

struct Walk {
    fates: HashMap<&'static str, Fate>,
    /// The first place of each note, and the number of places.
    found: BTreeMap<String, (String, usize)>,
}

impl Walk {
    /// Goes through the properties of an object at a path; `own` is its number in the list that it stands in, and its name.
    fn object(&mut self, value: &Value, path: &mut String, own: &str) {
        let Value::Object(object) = value else { return };
        for (name, value) in object {
            if name == "extras" || name == "name" {
                continue;
            }
            if name == "extensions" {
                for (extension, value) in value.as_object().into_iter().flatten() {
                    let fate = self.fates.get(format!("extensions.{extension}").as_str()).copied();
                    let place = || format!("{}extension {extension}", place(path, own));
                    // A list of lights, variants or metadata changes nothing; what refers to it does.
                    let is_list = path.is_empty() && fate.is_some();
                    if !is_list && value != &Value::Null {
                        self.meet(fate, place);
                    }
                }
                continue;
            }
            let length = path.len();
            let place = || format!("{}{name}", place(path, own));
            let general = if path == "meshes.primitives.attributes" { general(name) } else { name.clone() };
            let whole = if path.is_empty() { general } else { format!("{path}.{general}") };
            let fate = self.fates.get(whole.as_str()).copied();
            let is_parent = fate.is_none() && self.fates.keys().any(|known| is_below(known, &whole));
            if !is_parent {
                self.meet(fate, place);
            }
            if fate.is_some_and(|fate| !matches!(fate, Drawn | Approximated(_))) {
                continue;
            }
            if is_parent || value.get("extensions").is_some() {
                path.clear();
                path.push_str(&whole);
                match value {
                    Value::Array(all) => {
                        for (i, one) in all.iter().enumerate() {
                            let name =
                                one["name"].as_str().map_or(String::new(), |name| format!(" \"{}\"", text::name(name)));
                            self.object(one, path, &format!("[{i}]{name}"));
                        }
                    }
                    one if is_parent => self.object(one, path, own),
                    one => {
                        let only = serde_json::json!({ "extensions": one["extensions"] });
                        self.object(&only, path, own);
                    }
                }
                path.truncate(length);
            }
        }
    }

    fn meet(&mut self, fate: Option<Fate>, place: impl FnOnce() -> String) {
        let text = match fate {
            Some(NotDrawn(text)) => text,
            Some(_) => return,
            None => "softras does not know it and does not draw it",
        };
        // A broken file may hold any number of names.
        if self.found.len() < 32 || self.found.contains_key(text) {
            self.found.entry(text.into()).or_insert_with(|| (place(), 0)).1 += 1;
        }
    }
}

fn is_below(known: &str, path: &str) -> bool {
    known.strip_prefix(path).is_some_and(|rest| rest.starts_with('.'))
}

/// `materials.pbrMetallicRoughness` of `[3] "wood"` as `materials[3] "wood".pbrMetallicRoughness.`.
fn place(path: &str, own: &str) -> String {
    let short: String = path.chars().take(80).collect();
    match short.split_once('.') {
        Some((first, rest)) => format!("{first}{own}.{rest}."),
        None if short.is_empty() => short,
        None => format!("{short}{own}."),
    }
}

/// The name of an attribute as the table has it: the number of a set is `n`, except for `COLOR_0`, and an application's own name is
/// `_NAME`.
fn general(name: &str) -> String {
    match name.rsplit_once('_') {
        _ if name.starts_with('_') => "_NAME".into(),
        Some((kind @ ("TEXCOORD" | "JOINTS" | "WEIGHTS"), _)) => format!("{kind}_n"),
        Some(("COLOR", set)) if set != "0" => "COLOR_n".into(),
        _ => name.into(),
    }
}
