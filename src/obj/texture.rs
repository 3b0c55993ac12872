//! Reads image files as textures.

use super::{Source, find::find, material::Map, textures::Room};
use crate::{files::input, scene::Texture};
use image::{DynamicImage, ImageDecoder, ImageReader, Limits};
use std::{
    io::{BufRead, Seek, SeekFrom},
    path::{Path, PathBuf},
};

/// The largest side of an image.
const MAX_SIDE: u32 = 16384;

/// Bytes of a pixel while it is decoded and converted: up to eight as it is in the file, twelve as three floats.
pub(super) const BYTES_PER_PIXEL: u64 = 20;

/// The file of the image that a material names; `None`, with a note, where there is none in the mesh's folder.
pub(super) fn locate(source: &mut Source, map: &Map) -> Option<PathBuf> {
    let found = find(source.path, &map.mtl, &map.name, source.options.allow_outside);
    match found {
        Ok((path, None)) => Some(path),
        Ok((path, Some(note))) => {
            source.notes.add_in(&map.mtl, Some(map.line), format!("texture {note}"));
            Some(path)
        }
        Err(what) => {
            let note = format!("texture {what}: drawn in the material's Kd");
            source.notes.add_in(&map.mtl, Some(map.line), note);
            None
        }
    }
}

/// Decodes the image that a material names, of at most `room` texels; `None`, with a note, for what cannot be decoded.
pub(super) fn read(source: &mut Source, map: &Map, path: &Path, room: Room) -> Option<Texture> {
    let shown = path.display();
    let reader = ImageReader::open(path).map_err(|error| error.to_string());
    match reader.and_then(|reader| decode(reader, source.options.srgb, room)) {
        Ok(Decoded { width, height, texels, is_transparent }) => {
            source.files.push(path.into());
            if is_transparent {
                let note = format!("texture {shown}: transparency is not drawn");
                source.notes.add_in(&map.mtl, Some(map.line), note);
            }
            Texture::new(width, height, texels, map.wrap).ok()
        }
        Err(what) => {
            let note = format!("texture {shown}: {what}: drawn in the material's Kd");
            source.notes.add_in(&map.mtl, Some(map.line), note);
            None
        }
    }
}

/// A decoded image.
pub(crate) struct Decoded {
    pub width: u32,
    pub height: u32,
    pub texels: Vec<[f32; 3]>,
    /// Whether some texel is not opaque.
    pub is_transparent: bool,
}

/// Decodes an image of at most `room` texels, from sRGB to linear values if so asked.
///
/// # Errors
/// What is wrong with it.
pub(crate) fn decode<R: BufRead + Seek>(reader: ImageReader<R>, srgb: bool, room: Room) -> Result<Decoded, String> {
    let undecodable =
        |error: image::ImageError| format!("{error} (use a PNG or JPEG of at most {MAX_SIDE}×{MAX_SIDE} pixels)");
    let format = reader.format();
    let mut file = reader.into_inner();
    let length = file.seek(SeekFrom::End(0)).and_then(|length| file.rewind().map(|()| length));
    let most = room.texels(length.map_err(|error| error.to_string())?);
    let mut reader = ImageReader::new(file);
    if let Some(format) = format {
        reader.set_format(format);
    }
    // The format is guessed from the content, because the name may be wrong.
    let mut reader = reader.with_guessed_format().map_err(|error| error.to_string())?;
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_SIDE);
    limits.max_image_height = Some(MAX_SIDE);
    reader.limits(limits.clone());
    let mut decoder = reader.into_decoder().map_err(undecodable)?;
    let (width, height) = decoder.dimensions();
    let pixels = u64::from(width) * u64::from(height);
    if pixels > most {
        let fix = "scale the images down, or save them with more detail";
        return Err(format!("{width}×{height} pixels are more than the {most} that its file may still have ({fix})"));
    }
    input::room_for("a texture", pixels * BYTES_PER_PIXEL).map_err(|error| error.to_string())?;
    limits.reserve(decoder.total_bytes()).and_then(|()| decoder.set_limits(limits)).map_err(undecodable)?;
    let image = DynamicImage::from_decoder(decoder).map_err(undecodable)?;
    let is_transparent = image.color().has_alpha() && image.to_rgba8().pixels().any(|pixel| pixel.0[3] != 255);
    Ok(Decoded { width, height, texels: texels(image, srgb), is_transparent })
}

/// The texels as value / 255 (or / 65535); `into_rgb32f` rounds differently for grey images.
fn texels(image: DynamicImage, srgb: bool) -> Vec<[f32; 3]> {
    let value = |x: f32| if srgb { linear_from_srgb(x) } else { x };
    match image.color().bytes_per_pixel() / image.color().channel_count() {
        1 => image.into_rgb8().pixels().map(|p| p.0.map(|x| value(f32::from(x) / 255.0))).collect(),
        2 => image.into_rgb16().pixels().map(|p| p.0.map(|x| value(f32::from(x) / 65535.0))).collect(),
        _ => image.into_rgb32f().pixels().map(|p| p.0.map(value)).collect(),
    }
}

/// IEC 61966-2-1.
pub(crate) fn linear_from_srgb(x: f32) -> f32 {
    if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
}
