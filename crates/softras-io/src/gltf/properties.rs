//! What becomes of each property of glTF 2.0 and of its extensions. A property that is not listed is noted, so that none is
//! lost without a word.

use super::document::UNPACK;
use crate::{
    fate::{Approximated, Drawn, Fate, NotDrawn, Silent},
    source::Source,
};
use serde_json::Value;
use std::collections::{BTreeMap, HashMap};

const REFLECTION: Fate = NotDrawn("reflections are not drawn: softras draws base colours under diffuse light");

/// The properties by their paths: names joined by dots, lists without their numbers. What lies below one that is not `Drawn` has
/// the same fate. Extensions stand below `extensions` wherever they are used.
pub const PROPERTIES: &[(&str, Fate)] = &[
    ("asset", Silent),
    ("scene", Drawn),
    ("scenes.nodes", Drawn),
    ("cameras", Silent),
    ("animations", Silent),
    ("extensionsUsed", Silent),
    ("extensionsRequired", Drawn),
    ("buffers.uri", Drawn),
    ("buffers.byteLength", Drawn),
    ("bufferViews.buffer", Drawn),
    ("bufferViews.byteOffset", Drawn),
    ("bufferViews.byteLength", Drawn),
    ("bufferViews.byteStride", Drawn),
    ("bufferViews.target", Silent),
    ("accessors.bufferView", Drawn),
    ("accessors.byteOffset", Drawn),
    ("accessors.componentType", Drawn),
    ("accessors.normalized", Drawn),
    ("accessors.count", Drawn),
    ("accessors.type", Drawn),
    ("accessors.min", Silent),
    ("accessors.max", Silent),
    ("accessors.sparse", Drawn),
    ("nodes.mesh", Drawn),
    ("nodes.skin", Drawn),
    ("nodes.children", Drawn),
    ("nodes.matrix", Drawn),
    ("nodes.translation", Drawn),
    ("nodes.rotation", Drawn),
    ("nodes.scale", Drawn),
    ("nodes.weights", Drawn),
    ("nodes.camera", Silent),
    ("skins.joints", Drawn),
    ("skins.inverseBindMatrices", Drawn),
    ("skins.skeleton", Silent),
    ("meshes.weights", Drawn),
    ("meshes.primitives.mode", Approximated("lines and points are not drawn")),
    ("meshes.primitives.indices", Drawn),
    ("meshes.primitives.material", Drawn),
    ("meshes.primitives.targets", Drawn),
    ("meshes.primitives.attributes.POSITION", Drawn),
    ("meshes.primitives.attributes.NORMAL", Drawn),
    ("meshes.primitives.attributes.TANGENT", Silent),
    ("meshes.primitives.attributes.TEXCOORD_n", Drawn),
    ("meshes.primitives.attributes.COLOR_0", Approximated("vertex colours times a texture are drawn as a new texture")),
    ("meshes.primitives.attributes.COLOR_n", NotDrawn("vertex colours beyond COLOR_0 are not drawn")),
    ("meshes.primitives.attributes.JOINTS_n", Drawn),
    ("meshes.primitives.attributes.WEIGHTS_n", Drawn),
    ("meshes.primitives.attributes._NAME", Silent),
    ("materials.pbrMetallicRoughness.baseColorFactor", Drawn),
    ("materials.pbrMetallicRoughness.baseColorTexture", Drawn),
    ("materials.pbrMetallicRoughness.metallicFactor", Silent),
    ("materials.pbrMetallicRoughness.roughnessFactor", Silent),
    ("materials.pbrMetallicRoughness.metallicRoughnessTexture", Silent),
    ("materials.normalTexture", NotDrawn("normal maps are not drawn")),
    ("materials.occlusionTexture", Silent),
    ("materials.emissiveFactor", Approximated("emitted light is drawn as colour, which lamps shade")),
    ("materials.emissiveTexture", Approximated("emitted light is drawn as colour, which lamps shade")),
    ("materials.alphaMode", Drawn),
    ("materials.alphaCutoff", Drawn),
    ("materials.doubleSided", Silent),
    ("textures.source", Drawn),
    ("textures.sampler", Drawn),
    ("images.uri", Drawn),
    ("images.bufferView", Drawn),
    ("images.mimeType", Silent),
    ("samplers.magFilter", Approximated("textures are drawn smoothly, not by the nearest texel")),
    ("samplers.minFilter", Silent),
    ("samplers.wrapS", Drawn),
    ("samplers.wrapT", Drawn),
    ("extensions.KHR_mesh_quantization", Silent),
    ("extensions.KHR_texture_transform", Drawn),
    ("extensions.KHR_materials_unlit", Drawn),
    ("extensions.KHR_materials_emissive_strength", Drawn),
    ("extensions.KHR_materials_pbrSpecularGlossiness", Drawn),
    ("extensions.EXT_mesh_gpu_instancing", Drawn),
    ("extensions.EXT_texture_webp", Drawn),
    ("extensions.CESIUM_RTC", Silent),
    ("extensions.KHR_draco_mesh_compression", Drawn),
    ("extensions.EXT_meshopt_compression", Drawn),
    ("extensions.KHR_meshopt_compression", NotDrawn(UNPACK)),
    ("extensions.KHR_texture_basisu", Drawn),
    ("extensions.KHR_lights_punctual", NotDrawn("the lights of the file are not used: give --light")),
    ("extensions.KHR_materials_anisotropy", REFLECTION),
    ("extensions.KHR_materials_clearcoat", REFLECTION),
    ("extensions.KHR_materials_ior", Silent),
    ("extensions.KHR_materials_dispersion", Silent),
    ("extensions.KHR_materials_iridescence", REFLECTION),
    ("extensions.KHR_materials_sheen", REFLECTION),
    ("extensions.KHR_materials_specular", REFLECTION),
    ("extensions.KHR_materials_transmission", NotDrawn("glass is drawn opaque: give the material an alphaMode BLEND")),
    ("extensions.KHR_materials_diffuse_transmission", NotDrawn("light through surfaces is not drawn")),
    ("extensions.KHR_materials_volume", NotDrawn("glass is drawn opaque: give the material an alphaMode BLEND")),
    (
        "extensions.KHR_materials_variants",
        Approximated("the file has variants of its materials: the default one is drawn"),
    ),
    ("extensions.KHR_node_visibility", Drawn),
    ("extensions.KHR_animation_pointer", Silent),
    ("extensions.KHR_xmp_json_ld", Silent),
    ("extensions.KHR_xmp", Silent),
    ("extensions.EXT_mesh_features", Silent),
    ("extensions.EXT_structural_metadata", Silent),
    ("extensions.EXT_instance_features", Silent),
    ("extensions.MSFT_lod", Silent),
];

/// Whether a file that requires an extension can be drawn, if only nearly.
pub(super) fn is_readable(extension: &str) -> bool {
    let is_packed = matches!(extension, "KHR_draco_mesh_compression" | "EXT_meshopt_compression");
    let is_unread = extension == "KHR_meshopt_compression" || is_packed && cfg!(not(feature = "packed"));
    let known = |(path, _): &(&str, Fate)| path.strip_prefix("extensions.") == Some(extension);
    PROPERTIES.iter().any(known) && !is_unread
}

/// Notes everything in a file that changes the picture and is not drawn, whatever its value. Values decide on the rest, which the
/// reader notes.
pub fn note_all(source: &mut Source, root: &Value) {
    let mut walk = Walk { fates: PROPERTIES.iter().copied().collect(), found: BTreeMap::new() };
    walk.object(root, &mut String::new(), None);
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
    /// Goes through the properties of an object at a path; `number` is its own in the list that it stands in.
    fn object(&mut self, value: &Value, path: &mut String, number: Option<usize>) {
        let Value::Object(object) = value else { return };
        for (name, value) in object {
            if name == "extras" || name == "name" {
                continue;
            }
            if name == "extensions" {
                for (extension, value) in value.as_object().into_iter().flatten() {
                    let fate = self.fates.get(format!("extensions.{extension}").as_str()).copied();
                    let place = || format!("{}extension {extension}", place(path, number));
                    // A list of lights, variants or metadata changes nothing; what refers to it does.
                    let is_list = path.is_empty() && fate.is_some();
                    if !is_list && value != &Value::Null {
                        self.meet(fate, place);
                    }
                }
                continue;
            }
            let length = path.len();
            let place = || format!("{}{name}", place(path, number));
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
                    Value::Array(all) => all.iter().enumerate().for_each(|(i, one)| self.object(one, path, Some(i))),
                    one if is_parent => self.object(one, path, number),
                    one => {
                        let only = serde_json::json!({ "extensions": one["extensions"] });
                        self.object(&only, path, number);
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
            None => "softras does not know it, so that it is not drawn",
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

/// `materials.pbrMetallicRoughness` of number 3 as `materials[3].pbrMetallicRoughness.`.
fn place(path: &str, number: Option<usize>) -> String {
    let number = number.map_or(String::new(), |number| format!("[{number}]"));
    let short: String = path.chars().take(80).collect();
    match short.split_once('.') {
        Some((first, rest)) => format!("{first}{number}.{rest}."),
        None if short.is_empty() => short,
        None => format!("{short}{number}."),
    }
}

/// The name of an attribute as the table has it: sets but the first of colours by `n`, own names as `_NAME`.
fn general(name: &str) -> String {
    match name.rsplit_once('_') {
        _ if name.starts_with('_') => "_NAME".into(),
        Some((kind @ ("TEXCOORD" | "JOINTS" | "WEIGHTS"), _)) => format!("{kind}_n"),
        Some(("COLOR", set)) if set != "0" => "COLOR_n".into(),
        _ => name.into(),
    }
}
