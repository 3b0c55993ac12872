//! Decodes image files to texels.

use crate::{
    input,
    picture_file::{self, BYTES_PER_PIXEL, MAX_SIDE, Reader},
    source::Source,
    textures::Room,
};
use image::{DynamicImage, ImageDecoder};
use softras::{
    Error, Result,
    scene::{Texture, Wrap},
};
use std::{io::Cursor, path::Path};

/// A decoded image.
pub struct Decoded {
    pub width: u32,
    pub height: u32,
    pub texels: Vec<[f32; 3]>,
    /// The alpha of each texel; `None` where all are opaque.
    pub alpha: Option<Vec<f32>>,
}

impl Decoded {
    /// # Errors
    /// As [`Texture::new`] and [`Texture::with_alpha`].
    pub fn texture(self, wrap: Wrap) -> Result<Texture> {
        let texture = Texture::new(self.width, self.height, self.texels, wrap)?;
        self.alpha.map_or_else(|| Ok(texture.clone()), |alpha| texture.clone().with_alpha(alpha))
    }
}

/// Reads an image file, its values from sRGB to linear if so asked, of at most `room` texels, and adds it to the files that were read.
///
/// # Errors
/// A text that tells what is wrong with it.
pub fn read(source: &mut Source, path: &Path, srgb: bool, room: Room) -> std::result::Result<Decoded, String> {
    let file = input::open(path).map_err(|error| match error {
        // The caller names the file.
        Error::File { what, fix, .. } => format!("{what} ({fix})"),
        other => other.to_string(),
    })?;
    let length = file.metadata().map_or(0, |metadata| metadata.len());
    let reader = picture_file::reader(file, Some(path)).map_err(|error| error.to_string())?;
    let decoded = decode(reader, length, srgb, room)?;
    if !source.files.iter().any(|file| file == path) {
        source.files.push(path.into());
    }
    Ok(decoded)
}

/// Decodes an image in memory, as [`read`] one in a file.
///
/// # Errors
/// A text that tells what is wrong with it.
pub fn decode_bytes(bytes: &[u8], srgb: bool, room: Room) -> std::result::Result<Decoded, String> {
    let reader = picture_file::reader(Cursor::new(bytes), None).map_err(|error| error.to_string())?;
    decode(reader, bytes.len() as u64, srgb, room)
}

/// Decodes an image whose file has `length` bytes, of at most `room` texels, from sRGB to linear values if so asked.
fn decode(mut reader: Reader<'_>, length: u64, srgb: bool, room: Room) -> std::result::Result<Decoded, String> {
    let undecodable = |error: image::ImageError| {
        format!("{error} (use a PNG or JPEG of at most {MAX_SIDE}×{MAX_SIDE} pixels: magick IN OUT.png)")
    };
    reader.limits(picture_file::limits());
    let decoder = reader.into_decoder().map_err(undecodable)?;
    let (width, height) = decoder.dimensions();
    make_room(width, height, room.texels(length))?;
    let image = picture_file::decoded(Box::new(decoder), picture_file::limits()).map_err(undecodable)?;
    let alpha = alpha(&image);
    Ok(Decoded { width, height, texels: texels(image, srgb), alpha })
}

/// Makes sure that an image of that size is allowed and fits into memory.
fn make_room(width: u32, height: u32, most: u64) -> std::result::Result<(), String> {
    let pixels = u64::from(width) * u64::from(height);
    if pixels > most {
        let fix = "scale the images down, or compress them less";
        return Err(format!("{width}×{height} pixels are more than the {most} allowed for a file of its size ({fix})"));
    }
    input::room_for("a texture", pixels * BYTES_PER_PIXEL).map_err(|error| error.to_string())
}

/// Whether the largest level of a KTX2 file unpacks to no more than its blocks, which the decoder would believe without a check. The
/// level's offset, length and unpacked length are the first three numbers behind the header of 80 bytes (KTX 2.0, 3.1).
#[cfg(feature = "packed")]
fn level_fits(bytes: &[u8], width: u32, height: u32) -> bool {
    const BLOCK: u64 = 16;
    let number = |i: usize| bytes.get(80 + 8 * i..).and_then(|rest| rest.first_chunk()).map(|b| u64::from_le_bytes(*b));
    let blocks = u64::from(width.div_ceil(4)) * u64::from(height.div_ceil(4));
    number(2).is_some_and(|unpacked| unpacked <= BLOCK * blocks)
}

/// Decodes a KTX2 image of Basis Universal, as [`decode_bytes`].
///
/// # Errors
/// A text that tells what is wrong with it.
pub fn decode_basis(bytes: &[u8], srgb: bool, room: Room) -> std::result::Result<Decoded, String> {
    const UNPACK: &str = "(npx @gltf-transform/cli ktxdecompress IN.glb OUT.glb)";
    #[cfg(feature = "packed")]
    {
        use basisu::{DecodeFlags, TargetFormat, Transcoder};
        let wrong = |error: basisu::Error| format!("a KTX2 image that is not read: {error:?} {UNPACK}");
        let unpack = || {
            let file = Transcoder::new(bytes).map_err(wrong)?;
            let (width, height) = file.base_dimensions();
            if width.max(height) > MAX_SIDE {
                return Err(format!("{width}×{height} pixels, more than {MAX_SIDE} a side"));
            }
            make_room(width, height, room.texels(bytes.len() as u64))?;
            if !level_fits(bytes, width, height) {
                return Err(format!("a KTX2 image whose data is of another size {UNPACK}"));
            }
            Ok((width, height, file.transcode(0, TargetFormat::Rgba32, DecodeFlags::NONE).map_err(wrong)?))
        };
        // A decoder of foreign code must not end the process over a broken file.
        let unpacked = std::panic::catch_unwind(std::panic::AssertUnwindSafe(unpack));
        let (width, height, rgba) =
            unpacked.unwrap_or_else(|_| Err(format!("a KTX2 image that the decoder failed on {UNPACK}")))?;
        let image = image::RgbaImage::from_raw(width, height, rgba).map(DynamicImage::ImageRgba8);
        let image = image.ok_or_else(|| format!("a KTX2 image of another size {UNPACK}"))?;
        let alpha = alpha(&image);
        Ok(Decoded { width, height, texels: texels(image, srgb), alpha })
    }
    #[cfg(not(feature = "packed"))]
    {
        let _ = (bytes, srgb, room);
        Err(format!("a KTX2 image, which this build does not read {UNPACK}"))
    }
}

/// The alpha of each texel as value / 255 (or / 65535); `None` where all are opaque.
fn alpha(image: &DynamicImage) -> Option<Vec<f32>> {
    let alpha: Vec<f32> = match image {
        DynamicImage::ImageLumaA8(image) => image.pixels().map(|p| f32::from(p.0[1]) / 255.0).collect(),
        DynamicImage::ImageRgba8(image) => image.pixels().map(|p| f32::from(p.0[3]) / 255.0).collect(),
        DynamicImage::ImageLumaA16(image) => image.pixels().map(|p| f32::from(p.0[1]) / 65535.0).collect(),
        DynamicImage::ImageRgba16(image) => image.pixels().map(|p| f32::from(p.0[3]) / 65535.0).collect(),
        DynamicImage::ImageRgba32F(image) => image.pixels().map(|p| p.0[3].clamp(0.0, 1.0)).collect(),
        _ => return None,
    };
    alpha.iter().any(|a| *a < 1.0).then_some(alpha)
}

/// The texels as value / 255 (or / 65535); `into_rgb32f` rounds differently for grey images.
fn texels(image: DynamicImage, srgb: bool) -> Vec<[f32; 3]> {
    let value = |x: f32| if srgb { linear_from_srgb(x) } else { x };
    match image.color().bytes_per_pixel() / image.color().channel_count() {
        1 => {
            let of_byte: [f32; 256] = std::array::from_fn(|byte| value(byte as f32 / 255.0));
            image.into_rgb8().pixels().map(|p| p.0.map(|x| of_byte[usize::from(x)])).collect()
        }
        2 => image.into_rgb16().pixels().map(|p| p.0.map(|x| value(f32::from(x) / 65535.0))).collect(),
        _ => image.into_rgb32f().pixels().map(|p| p.0.map(value)).collect(),
    }
}

/// IEC 61966-2-1.
pub fn linear_from_srgb(x: f32) -> f32 {
    if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
}

/// The inverse, also beyond [0, 1].
pub fn srgb_from_linear(x: f32) -> f32 {
    if x <= 0.003_130_8 { x * 12.92 } else { (1.055 * f64::from(x).powf(1.0 / 2.4) - 0.055) as f32 }
}
