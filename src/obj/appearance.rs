//! Chooses the appearance of a mesh from its vertex colours, materials and textures.

use super::{
    Source,
    material::{self, Material, Materials},
    parse::Obj,
    texture,
    triangles::Triangles,
};
use crate::{
    error::Result,
    scene::{Appearance, Texture, Wrap},
};
use std::{
    collections::{HashMap, hash_map::Entry},
    mem,
    path::PathBuf,
};

const WHITE: [f32; 3] = [1.0; 3];

/// Textures are preferred to vertex colours and these to material colours; what is not used is noted.
pub(super) fn appearance(source: &mut Source, obj: &mut Obj, triangles: &mut Triangles) -> Result<Appearance> {
    let library = material::read_libraries(source, &obj.libraries)?;
    let used = find_used(obj, &library, &mut source.notes);
    // The material of each face; `None` is white.
    let material_of_face: Vec<Option<&Material>> =
        obj.faces.iter().map(|face| face.material.and_then(|m| used[m])).collect();
    let is_textured = |face: usize| obj.faces[face].has_uvs && material_of_face[face].is_some_and(|m| m.map.is_some());
    note_textures_without_uvs(obj, &material_of_face, &mut source.notes);
    let notes = &mut source.notes;
    let colored = !obj.colors.is_empty();
    if (0..obj.faces.len()).any(is_textured) {
        if colored {
            notes.push("vertex colours are not used: the materials have textures".into());
        }
        return textured(source, obj, triangles, &material_of_face);
    }
    if !obj.uvs.is_empty() {
        notes.push("texture coordinates are not kept: no face has a texture".into());
    }
    let color_of_face = material_of_face.iter().map(|m| color(*m));
    if colored {
        if color_of_face.into_iter().any(|color| color != WHITE) {
            notes.push("material colours are not used: the vertices have colours".into());
        }
        return Ok(Appearance::VertexColors(mem::take(&mut obj.colors)));
    }
    let color_of_face: Vec<_> = color_of_face.collect();
    if color_of_face.iter().all(|color| *color == color_of_face[0]) {
        return Ok(Appearance::Uniform(color_of_face[0]));
    }
    let texels = triangles.faces.iter().map(|&face| color_of_face[face]).collect();
    Ok(Appearance::Surface { resolution: 1, texels })
}

fn color(material: Option<&Material>) -> [f32; 3] {
    material.and_then(|m| m.color).unwrap_or(WHITE)
}

/// The material of each name that `usemtl` gives.
fn find_used<'a>(obj: &Obj, library: &'a Materials, notes: &mut Vec<String>) -> Vec<Option<&'a Material>> {
    let mut find = |(name, line): &(String, usize)| {
        let material = library.find(name);
        match material {
            None => {
                let place = if obj.libraries.is_empty() { "the file names no mtllib" } else { "in no MTL file" };
                notes.push(format!("line {line}: unknown material {name:?} ({place}): white"));
            }
            Some(Material { color: None, map: None, .. }) => {
                notes.push(format!("line {line}: material {name:?} has neither Kd nor map_Kd: white"));
            }
            _ => {}
        }
        material
    };
    obj.materials.iter().map(&mut find).collect()
}

fn note_textures_without_uvs(obj: &Obj, material_of_face: &[Option<&Material>], notes: &mut Vec<String>) {
    let wants = |material: &Option<&Material>| material.is_some_and(|m| m.map.is_some());
    let faces = obj.faces.iter().zip(material_of_face);
    let mut bare = faces.filter(|(face, material)| wants(material) && !face.has_uvs).map(|(face, _)| face.line);
    if let Some(line) = bare.next() {
        let count = 1 + bare.count();
        notes.push(format!(
            "line {line}: faces with a texture but no UVs are drawn in their material's Kd ({count} in all)"
        ));
    }
}

/// The appearance of a mesh with textures; faces without a texture get a 1×1 image of their colour.
fn textured(
    source: &mut Source,
    obj: &mut Obj,
    triangles: &mut Triangles,
    material_of_face: &[Option<&Material>],
) -> Result<Appearance> {
    let mut textures = Textures::default();
    let mut by_kind: HashMap<(Option<usize>, bool), u32> = HashMap::new();
    let mut texture_of_face = Vec::with_capacity(obj.faces.len());
    for (face, material) in obj.faces.iter().zip(material_of_face) {
        let index = match by_kind.entry((face.material, face.has_uvs)) {
            Entry::Occupied(known) => *known.get(),
            Entry::Vacant(unknown) => {
                let index = match material.and_then(|m| m.map.as_ref()).filter(|_| face.has_uvs) {
                    Some(map) => {
                        let key = Key::File(material::locate(&map.mtl, &map.name), map.wrap);
                        let room = textures.room();
                        textures.find_or(key, || texture::read(source, map, room))?
                    }
                    None => {
                        let color = color(*material);
                        textures.find_or(Key::of_color(color), || Texture::new(1, 1, vec![color], Wrap::Repeat))?
                    }
                };
                *unknown.insert(index)
            }
        };
        texture_of_face.push(index);
    }
    let texture_of_triangle = match textures.images.len() {
        1 => Vec::new(),
        _ => triangles.faces.iter().map(|&face| texture_of_face[face]).collect(),
    };
    // Faces without UVs have UV index 0: any position will do on a 1×1 image.
    let (uvs, uv_triangles) = (mem::take(&mut obj.uvs), mem::take(&mut triangles.uvs));
    Ok(Appearance::Textured { uvs, uv_triangles, textures: textures.images, texture_of_triangle })
}

/// What makes two textures the same.
#[derive(PartialEq, Eq, Hash)]
enum Key {
    File(PathBuf, Wrap),
    /// The bits of a colour, with -0 as 0.
    Color([u32; 3]),
}

impl Key {
    fn of_color(color: [f32; 3]) -> Self {
        Self::Color(color.map(|x| (x + 0.0).to_bits()))
    }
}

/// Each image once, in order of first use.
#[derive(Default)]
struct Textures {
    images: Vec<Texture>,
    by_key: HashMap<Key, u32>,
    /// The texels of all images.
    texels: u64,
}

impl Textures {
    /// The number of texels that may still be added.
    fn room(&self) -> u64 {
        texture::MAX_TEXELS.saturating_sub(self.texels)
    }

    fn find_or(&mut self, key: Key, make: impl FnOnce() -> Result<Texture>) -> Result<u32> {
        match self.by_key.entry(key) {
            Entry::Occupied(known) => Ok(*known.get()),
            Entry::Vacant(unknown) => {
                let image = make()?;
                self.texels += image.texels().len() as u64;
                self.images.push(image);
                Ok(*unknown.insert(self.images.len() as u32 - 1))
            }
        }
    }
}
