//! Which appearance a mesh gets from its vertex colours, materials and textures.

use super::{
    LoadOptions,
    geometry::Geometry,
    material::{self, Material, Materials},
    scan::Scan,
    texture,
};
use crate::{
    error::Result,
    scene::{Appearance, Texture, Wrap},
};
use std::{
    collections::{HashMap, hash_map::Entry},
    path::{Path, PathBuf},
};

const WHITE: [f32; 3] = [1.0; 3];

/// Textures count before vertex colours, vertex colours before material colours; what loses is noted.
pub(super) fn appearance(
    obj: &Path,
    scan: &Scan,
    geometry: &mut Geometry,
    options: &LoadOptions,
    notes: &mut Vec<String>,
) -> Result<Appearance> {
    let library = material::read_libraries(obj, &scan.libraries, options.allow_outside, notes)?;
    let used = find_used(scan, &library, notes);
    // Per face of the file; `None` is white.
    let material_of_face: Vec<Option<&Material>> =
        scan.faces.iter().map(|face| face.material.and_then(|m| used[m])).collect();
    let is_textured = |face: usize| scan.faces[face].has_uvs && material_of_face[face].is_some_and(|m| m.map.is_some());
    note_textures_without_uvs(scan, &material_of_face, notes);
    let colored = !geometry.colors.is_empty();
    if (0..scan.faces.len()).any(is_textured) {
        if colored {
            notes.push("vertex colours are not used: the materials have textures".into());
        }
        return textured(obj, scan, geometry, &material_of_face, options, notes);
    }
    if !geometry.uvs.is_empty() {
        notes.push("texture coordinates are not kept: no face has a texture".into());
    }
    let color_of_face = material_of_face.iter().map(|m| color(*m));
    if colored {
        if color_of_face.into_iter().any(|color| color != WHITE) {
            notes.push("material colours are not used: the vertices have colours".into());
        }
        return Ok(Appearance::VertexColors(std::mem::take(&mut geometry.colors)));
    }
    let color_of_face: Vec<_> = color_of_face.collect();
    if color_of_face.iter().all(|color| *color == color_of_face[0]) {
        return Ok(Appearance::Uniform(color_of_face[0]));
    }
    let texels = geometry.face_of_triangle.iter().map(|&face| color_of_face[face]).collect();
    Ok(Appearance::Surface { resolution: 1, texels })
}

fn color(material: Option<&Material>) -> [f32; 3] {
    material.and_then(|m| m.color).unwrap_or(WHITE)
}

/// For each name that `usemtl` says, its material.
fn find_used<'a>(scan: &Scan, library: &'a Materials, notes: &mut Vec<String>) -> Vec<Option<&'a Material>> {
    let mut find = |(name, line): &(String, usize)| {
        let material = library.find(name);
        match material {
            None => {
                let place = if scan.libraries.is_empty() { "the file names no mtllib" } else { "in no MTL file" };
                notes.push(format!("line {line}: unknown material {name:?} ({place}): white"));
            }
            Some(Material { color: None, map: None, .. }) => {
                notes.push(format!("line {line}: material {name:?} has neither Kd nor map_Kd: white"));
            }
            _ => {}
        }
        material
    };
    scan.materials.iter().map(&mut find).collect()
}

fn note_textures_without_uvs(scan: &Scan, material_of_face: &[Option<&Material>], notes: &mut Vec<String>) {
    let wants = |material: &Option<&Material>| material.is_some_and(|m| m.map.is_some());
    let faces = scan.faces.iter().zip(material_of_face);
    let mut bare = faces.filter(|(face, material)| wants(material) && !face.has_uvs).map(|(face, _)| face.line);
    if let Some(line) = bare.next() {
        let count = 1 + bare.count();
        notes.push(format!(
            "line {line}: faces with a texture but no UVs are drawn in their material's Kd ({count} in all)"
        ));
    }
}

/// Faces without a texture get a 1×1 image of their colour.
fn textured(
    obj: &Path,
    scan: &Scan,
    geometry: &mut Geometry,
    material_of_face: &[Option<&Material>],
    options: &LoadOptions,
    notes: &mut Vec<String>,
) -> Result<Appearance> {
    let mut textures = Textures::default();
    let mut by_kind: HashMap<(Option<usize>, bool), u32> = HashMap::new();
    let mut texture_of_face = Vec::with_capacity(scan.faces.len());
    for (face, material) in scan.faces.iter().zip(material_of_face) {
        let index = match by_kind.entry((face.material, face.has_uvs)) {
            Entry::Occupied(known) => *known.get(),
            Entry::Vacant(unknown) => {
                let index = match material.and_then(|m| m.map.as_ref()).filter(|_| face.has_uvs) {
                    Some(map) => {
                        let key = Key::File(material::locate(&map.mtl, &map.name), map.wrap);
                        let room = textures.room();
                        textures.find_or(key, || texture::read(obj, map, options, room, notes))?
                    }
                    None => {
                        let color = color(*material);
                        textures.find_or(Key::Color(color), || Texture::new(1, 1, vec![color], Wrap::Repeat))?
                    }
                };
                *unknown.insert(index)
            }
        };
        texture_of_face.push(index);
    }
    let mut uv_triangles = std::mem::take(&mut geometry.uv_triangles);
    for (uvs, &face) in uv_triangles.iter_mut().zip(&geometry.face_of_triangle) {
        if !scan.faces[face].has_uvs {
            // Any will do on a 1×1 image.
            *uvs = [0; 3];
        }
    }
    let texture_of_triangle = match textures.images.len() {
        1 => Vec::new(),
        _ => geometry.face_of_triangle.iter().map(|&face| texture_of_face[face]).collect(),
    };
    let uvs = std::mem::take(&mut geometry.uvs);
    Ok(Appearance::Textured { uvs, uv_triangles, textures: textures.images, texture_of_triangle })
}

#[derive(PartialEq)]
enum Key {
    File(PathBuf, Wrap),
    Color([f32; 3]),
}

/// Each image once, in order of first use.
#[derive(Default)]
struct Textures {
    keys: Vec<Key>,
    images: Vec<Texture>,
}

impl Textures {
    /// Texels that there may still be.
    fn room(&self) -> u64 {
        let used = self.images.iter().map(|image| image.texels().len() as u64).sum();
        texture::MAX_TEXELS.saturating_sub(used)
    }

    fn find_or(&mut self, key: Key, make: impl FnOnce() -> Result<Texture>) -> Result<u32> {
        let index = match self.keys.iter().position(|k| *k == key) {
            Some(index) => index,
            None => {
                self.images.push(make()?);
                self.keys.push(key);
                self.keys.len() - 1
            }
        };
        Ok(index as u32)
    }
}
