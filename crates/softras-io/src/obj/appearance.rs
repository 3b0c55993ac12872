//! Chooses the appearance of a mesh from its vertex colours, materials and textures.

use super::{
    material::{self, MapStatement, Materials, MtlMaterial},
    parse::{FARTHEST_UV, Obj},
    texture,
    triangles::Triangles,
};
use crate::{
    input,
    notes::Notes,
    paint::{self, Patch, Sheet},
    source::Source,
    text,
    textures::Textures,
};
use softras::{
    Result,
    scene::{Appearance, Texture, Wrap},
};
use std::{
    collections::{HashMap, hash_map::Entry},
    mem,
    path::PathBuf,
};

const WHITE: [f32; 3] = [1.0; 3];

/// The appearance of a mesh, and the opacity of each triangle's material, empty where all are 1. Textures are preferred to
/// vertex colours and these to material colours; what is not used is noted.
///
/// # Errors
/// A lack of memory for what each face or triangle takes.
pub(super) fn appearance(
    source: &mut Source,
    obj: &mut Obj,
    triangles: &mut Triangles,
) -> Result<(Appearance, Vec<f32>)> {
    // The look of a face whose material has no colour, in the words of the notes.
    let plain = if obj.colors.is_empty() { "white" } else { "in the vertices' colours" };
    let library = material::read_libraries(source, &obj.libraries, plain);
    let used = find_used(obj, &library, plain, &mut source.notes);
    // A file without `usemtl` means its only material.
    let only = library.only().filter(|_| obj.materials.is_empty());
    if obj.materials.is_empty() && !library.is_empty() {
        let taken = if only.is_some() { "its only material is taken".into() } else { format!("its faces are {plain}") };
        source.notes.add(None, format!("materials without a `usemtl`: {taken}"));
    }
    source.materials = used.iter().copied().flatten().chain(only).map(|material| material.name.clone()).collect();
    // The material of each face; `None` is white.
    let material_of_face = collected(source, obj.faces.iter().map(|face| face.material.map_or(only, |m| used[m])))?;
    if let Some(MtlMaterial { name, .. }) = material_of_face.iter().flatten().find(|material| material.opacity() == 0.0)
    {
        source
            .notes
            .add(None, format!("material \"{}\" is wholly transparent: its faces are invisible", text::name(name)));
    }
    let opacity = |material: &Option<&MtlMaterial>| material.map_or(1.0, MtlMaterial::opacity);
    let is_transparent = material_of_face.iter().any(|material| opacity(material) < 1.0);
    let shown = if is_transparent { &triangles.faces[..] } else { &[] };
    let opacity = collected(source, shown.iter().map(|&face| opacity(&material_of_face[face])))?;
    Ok((colors(source, obj, triangles, &material_of_face)?, opacity))
}

/// The values in a vector.
///
/// # Errors
/// A lack of memory for them.
fn collected<T>(source: &Source, values: impl ExactSizeIterator<Item = T>) -> Result<Vec<T>> {
    let mut all = input::vector(source.path, values.len())?;
    all.extend(values);
    Ok(all)
}

/// Whether a material has a texture.
fn has_map(material: &Option<&MtlMaterial>) -> bool {
    material.is_some_and(|m| m.map.is_some() || m.alpha_map.is_some())
}

fn colors(
    source: &mut Source,
    obj: &mut Obj,
    triangles: &mut Triangles,
    material_of_face: &[Option<&MtlMaterial>],
) -> Result<Appearance> {
    let is_textured = |face: usize| obj.faces[face].has_uvs && has_map(&material_of_face[face]);
    note_textures_without_uvs(obj, material_of_face, &mut source.notes);
    let colored = !obj.colors.is_empty();
    if (0..obj.faces.len()).any(is_textured)
        && let Some(appearance) = textured(source, obj, triangles, material_of_face)?
    {
        return Ok(appearance);
    }
    let notes = &mut source.notes;
    if colored {
        if material_of_face.iter().any(|material| color(*material) != WHITE) {
            notes.add(None, "material colours are not used: the vertices have colours");
        }
        return Ok(Appearance::VertexColors(mem::take(&mut obj.colors)));
    }
    let first = color(material_of_face.first().copied().flatten());
    if material_of_face.iter().all(|material| color(*material) == first) {
        return Ok(Appearance::Uniform(first));
    }
    let texels = collected(source, triangles.faces.iter().map(|&face| color(material_of_face[face])))?;
    Ok(Appearance::Surface { resolution: 1, texels })
}

fn color(material: Option<&MtlMaterial>) -> [f32; 3] {
    let glow = material.map_or([0.0; 3], |m| m.glow);
    let base = material.and_then(|m| m.color).unwrap_or(WHITE);
    [0, 1, 2].map(|k| base[k] + glow[k])
}

/// The material of each name that `usemtl` gives.
fn find_used<'a>(obj: &Obj, library: &'a Materials, plain: &str, notes: &mut Notes) -> Vec<Option<&'a MtlMaterial>> {
    let mut find = |(name, line): &(String, usize)| {
        let material = library.find(name);
        match material {
            // A library that cannot be read has been noted already.
            None if library.is_whole() => {
                let place = if obj.libraries.is_empty() { "the file names no mtllib" } else { "in no MTL file" };
                notes.add(Some(*line), format!("unknown material \"{}\" ({place}): {plain}", text::name(name)));
            }
            Some(MtlMaterial { color: None, map: None, alpha_map: None, .. }) => {
                notes.add(Some(*line), format!("material \"{}\" has neither Kd nor map_Kd: {plain}", text::name(name)));
            }
            _ => {}
        }
        material
    };
    obj.materials.iter().map(&mut find).collect()
}

fn note_textures_without_uvs(obj: &Obj, material_of_face: &[Option<&MtlMaterial>], notes: &mut Notes) {
    let faces = obj.faces.iter().zip(material_of_face);
    for (face, _) in faces.filter(|(face, material)| has_map(material) && !face.has_uvs) {
        notes.count(face.line, "faces with a texture but no UVs are drawn in their material's Kd");
    }
}

/// The appearance of a mesh with textures; faces without a texture get a 1×1 image of their colour. `None` where no texture
/// can be read.
fn textured(
    source: &mut Source,
    obj: &mut Obj,
    triangles: &mut Triangles,
    material_of_face: &[Option<&MtlMaterial>],
) -> Result<Option<Appearance>> {
    let mut textures = Textures::new(source.room());
    let mut by_kind: HashMap<(Option<usize>, bool), u32> = HashMap::new();
    let mut texture_of_face = input::vector(source.path, obj.faces.len())?;
    let mut any_file = false;
    for (face, material) in obj.faces.iter().zip(material_of_face) {
        let index = match by_kind.entry((face.material, face.has_uvs)) {
            Entry::Occupied(known) => *known.get(),
            Entry::Vacant(unknown) => {
                let color = color(*material);
                let image = material.filter(|_| face.has_uvs).and_then(|m| image(source, &mut textures, m, color));
                any_file |= image.is_some();
                let plain = |_| Texture::new(1, 1, vec![color], Wrap::Repeat).ok();
                let Some(index) = image.or_else(|| textures.find_or(AppearanceKey::of_color(color), plain)) else {
                    return Ok(None);
                };
                *unknown.insert(index)
            }
        };
        texture_of_face.push(index);
    }
    if !any_file {
        return Ok(None);
    }
    let texture_of_triangle = collected(source, triangles.faces.iter().map(|&face| texture_of_face[face]))?;
    let (mut uvs, mut uv_triangles) = (mem::take(&mut obj.uvs), mem::take(&mut triangles.uvs));
    // A file without UVs has no UV indices yet, and then no face has a texture.
    uv_triangles.resize(triangles.faces.len(), [0; 3]);
    let map = |face: usize| material_of_face[face].and_then(|m| m.map.as_ref().or(m.alpha_map.as_ref()));
    place_uvs(&mut uvs, &mut uv_triangles, |t| map(triangles.faces[t]));
    let mut sheet = Sheet { uvs, uv_triangles, textures: textures.images, texture_of_triangle };
    if !obj.colors.is_empty() {
        let is_image = |face: usize| obj.faces[face].has_uvs && map(face).is_some();
        let bare: Vec<usize> = (0..triangles.faces.len()).filter(|&t| !is_image(triangles.faces[t])).collect();
        if bare.len() < triangles.faces.len() {
            source.notes.add(None, "vertex colours are not used where a material has a texture");
        }
        let patch = |&t: &usize| Patch { colors: triangles.vertices[t].map(|v| obj.colors[v as usize]), image: None };
        let patches: Vec<Patch> = bare.iter().map(patch).collect();
        if !patches.is_empty()
            && let Ok(made) = paint::patches(&patches, u64::MAX)
        {
            sheet.add(bare, made);
        }
    }
    // Faces without UVs have UV index 0: any position will do on a 1×1 image.
    Ok(Some(sheet.appearance()))
}

/// Gives the triangles whose image is scaled or moved (`-s`, `-o`) UVs of their own.
fn place_uvs<'a>(
    uvs: &mut Vec<[f32; 2]>,
    uv_triangles: &mut [[u32; 3]],
    map_of: impl Fn(usize) -> Option<&'a MapStatement>,
) {
    let mut known = HashMap::new();
    for (t, triangle) in uv_triangles.iter_mut().enumerate() {
        let Some(map) = map_of(t).filter(|map| map.scale != [1.0; 2] || map.offset != [0.0; 2]) else { continue };
        *triangle = triangle.map(|uv| {
            let place =
                |k: usize| (uvs[uv as usize][k] * map.scale[k] + map.offset[k]).clamp(-FARTHEST_UV, FARTHEST_UV);
            let placed = [place(0), place(1)];
            *known.entry((uv, placed.map(f32::to_bits))).or_insert_with(|| {
                uvs.push(placed);
                uvs.len() as u32 - 1
            })
        });
    }
}

/// The number of the texture of a material, of its image files; `None` where there are none or they cannot be read.
fn image(
    source: &mut Source,
    textures: &mut Textures<AppearanceKey>,
    material: &MtlMaterial,
    color: [f32; 3],
) -> Option<u32> {
    let mut locate = |map: &Option<MapStatement>, without: &str| {
        Some((map.clone()?, texture::locate(source, map.as_ref()?, without)?))
    };
    let (map, alpha) = (locate(&material.map, texture::IN_KD), locate(&material.alpha_map, "drawn opaque"));
    let wrap = map.as_ref().or(alpha.as_ref())?.0.wrap;
    let path = |map: &Option<(MapStatement, PathBuf)>| map.as_ref().map(|(_, path)| path.clone());
    // The colour counts only if the material has no image for it.
    let bits = if map.is_some() { [0; 3] } else { bits(color) };
    textures.find_or(AppearanceKey::Files(path(&map), path(&alpha), wrap, bits), |room| {
        let texture = match &map {
            Some((map, path)) => texture::read(source, map, path, room)?,
            None => Texture::new(1, 1, vec![color], wrap).ok()?,
        };
        match &alpha {
            Some((map, path)) => texture::faded(source, texture, map, path, room),
            None => Some(texture),
        }
    })
}

/// The bits of a colour, with -0 as 0.
fn bits(color: [f32; 3]) -> [u32; 3] {
    color.map(|x| (x + 0.0).to_bits())
}

/// The key by which equal textures are found.
#[derive(PartialEq, Eq, Hash)]
enum AppearanceKey {
    /// The files of the colour and of the alpha, and the bits of the colour that stands in for the first.
    Files(Option<PathBuf>, Option<PathBuf>, Wrap, [u32; 3]),
    /// The bits of a colour, with -0 as 0.
    Color([u32; 3]),
}

impl AppearanceKey {
    fn of_color(color: [f32; 3]) -> Self {
        Self::Color(bits(color))
    }
}
