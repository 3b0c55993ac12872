//! The textures that materials name.

use super::{material::MapStatement, statement::before_comment};
use crate::{
    find::find,
    source::Source,
    texture::{self, Decoded},
    textures::Room,
};
use softras::scene::Texture;
use std::path::{Path, PathBuf};

/// The words of a note that tell how a face is drawn whose image is missing.
pub(super) const IN_KD: &str = "drawn without it, in the material's Kd or the vertices' colours";

/// The file of the image that a material names; `None`, with a note, where there is none in the mesh's folder.
pub(super) fn locate(source: &mut Source, map: &MapStatement, without: &str) -> Option<PathBuf> {
    let locate = |name: &str| find(source.path, &map.mtl, name, source.options.allow_outside);
    // A name may hold a `#`: the text after it is a comment only if there is no such file.
    let found = locate(&map.name).or_else(|what| match before_comment(&map.name) {
        name if name == map.name => Err(what),
        name => locate(name),
    });
    match found {
        Ok((path, None)) => Some(path),
        Ok((path, Some(note))) => {
            source.notes.add_in(&map.mtl, Some(map.line), format!("texture {note}"));
            Some(path)
        }
        Err(what) => {
            let note = format!("texture {what}: {without}");
            source.notes.add_in(&map.mtl, Some(map.line), note);
            None
        }
    }
}

/// Decodes the image that a material names for its colour, of at most `room` texels; `None`, with a note, for what cannot be
/// decoded.
pub(super) fn read(source: &mut Source, map: &MapStatement, path: &Path, room: Room) -> Option<Texture> {
    let decoded = decoded(source, map, path, source.options.srgb, room, IN_KD)?;
    decoded.texture(map.wrap).ok()
}

/// Gives a texture the alpha of an image (`map_d`): its alpha channel if it has one, else its grey or red values. A texture of one
/// texel takes the size of the image; an image of another size than the texture is noted and not used.
pub(super) fn faded(
    source: &mut Source,
    texture: Texture,
    map: &MapStatement,
    path: &Path,
    room: Room,
) -> Option<Texture> {
    let Some(decoded) = decoded(source, map, path, false, room, "drawn opaque") else { return Some(texture) };
    let Decoded { width, height, texels, alpha } = decoded;
    let alpha = alpha.unwrap_or_else(|| texels.iter().map(|texel| texel[0].clamp(0.0, 1.0)).collect());
    let texture = match texture.texels() {
        [color] => Texture::new(width, height, vec![*color; alpha.len()], map.wrap).ok()?,
        _ => texture,
    };
    if (texture.width(), texture.height()) != (width, height) {
        let sizes =
            format!("{width}×{height} texels, the texture of the colour {}×{}", texture.width(), texture.height());
        source.notes.add_in(&map.mtl, Some(map.line), format!("map_d of {sizes}: not used"));
        return Some(texture);
    }
    texture.with_alpha(alpha).ok()
}

fn decoded(
    source: &mut Source,
    map: &MapStatement,
    path: &Path,
    srgb: bool,
    room: Room,
    without: &str,
) -> Option<Decoded> {
    let decoded = texture::read(source, path, srgb, room);
    let note = |what: String| format!("texture {}: {what}: {without}", path.display());
    decoded.map_err(|what| source.notes.add_in(&map.mtl, Some(map.line), note(what))).ok()
}
