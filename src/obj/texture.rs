//! Reads image files as textures.

use super::{
    Source,
    material::{Map, check_inside, locate},
};
use crate::{
    error::{Error, Result},
    scene::Texture,
};
use image::{DynamicImage, ImageDecoder, ImageReader, Limits};

/// The largest side of an image.
const MAX_SIDE: u32 = 16384;

/// The most texels of all images of a mesh, 1.5 GiB: an image of a few kilobytes may claim more than that.
pub(super) const MAX_TEXELS: u64 = 1 << 27;

/// Decodes the image that a material names.
///
/// # Errors
/// [`Error::File`] naming the MTL file and line, for an image that is missing, outside the mesh's folder, of more than
/// `room` texels or not an image.
pub(super) fn read(source: &mut Source, map: &Map, room: u64) -> Result<Texture> {
    let path = locate(&map.mtl, &map.name);
    let refuse = |what: String, fix: String| Error::File { path: map.mtl.clone(), line: Some(map.line), what, fix };
    check_inside(source.path, &path, source.options.allow_outside).map_err(|(what, fix)| refuse(what, fix))?;
    let shown = path.display();
    if !path.is_file() {
        let fix = "put the image there or remove the map_Kd line".into();
        return Err(refuse(format!("texture {shown} not found"), fix));
    }
    let undecodable = |error: image::ImageError| {
        let fix = format!("use a PNG or JPEG of at most {MAX_SIDE}×{MAX_SIDE} pixels");
        refuse(format!("texture {shown}: {error}"), fix)
    };
    let unreadable = |error| undecodable(image::ImageError::IoError(error));
    // The format is guessed from the content, because the name may be wrong.
    let mut reader = ImageReader::open(&path).and_then(ImageReader::with_guessed_format).map_err(unreadable)?;
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_SIDE);
    limits.max_image_height = Some(MAX_SIDE);
    reader.limits(limits.clone());
    let mut decoder = reader.into_decoder().map_err(undecodable)?;
    let (width, height) = decoder.dimensions();
    if u64::from(width) * u64::from(height) > room {
        let what = format!("texture {shown}: {width}×{height} pixels are more than the {room} that are left for it");
        return Err(refuse(what, format!("scale the images down to {MAX_TEXELS} pixels in all")));
    }
    limits.reserve(decoder.total_bytes()).and_then(|()| decoder.set_limits(limits)).map_err(undecodable)?;
    let image = DynamicImage::from_decoder(decoder).map_err(undecodable)?;
    let has_alpha = image.color().has_alpha();
    if has_alpha && image.to_rgba8().pixels().any(|pixel| pixel.0[3] != 255) {
        source.notes.push(format!("texture {shown}: transparency is not drawn"));
    }
    let texels = texels(image, source.options.srgb);
    source.files.push(path);
    Texture::new(width, height, texels, map.wrap)
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
fn linear_from_srgb(x: f32) -> f32 {
    if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
}
