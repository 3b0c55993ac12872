//! Pictures that a network is given, as PNG files.

use super::data::PICTURE;
use super::{SIZE, file_error};
use image::{ImageFormat, RgbaImage};
use softras::{Error, Result};
use softras_io::{input, output};
use std::io::Cursor;
use std::path::Path;

/// Reads a picture of 64×64 pixels with alpha as the four planes that networks are given, colours over black.
///
/// # Errors
/// [`Error::Io`]; [`Error::File`] for what is no PNG, another size, or a picture without transparency.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    let reader = image::ImageReader::with_format(std::io::BufReader::new(input::open(path)?), ImageFormat::Png);
    let decoded = reader.decode().or_else(|e| file_error(path, e.to_string(), "give a PNG picture"))?;
    let size = [decoded.width(), decoded.height()];
    if size != [SIZE as u32; 2] {
        let what = format!("the picture has {} by {} pixels", size[0], size[1]);
        return file_error(path, what, "give one of 64 by 64, the object in the middle");
    }
    if !decoded.color().has_alpha() {
        return file_error(path, "the picture has no alpha", "make its background transparent");
    }
    let pixels = decoded.to_rgba8();
    let mut planes = vec![0; PICTURE];
    for (i, pixel) in pixels.pixels().enumerate() {
        let [r, g, b, alpha] = pixel.0;
        let over = |value: u8| ((u32::from(value) * u32::from(alpha) + 127) / 255) as u8;
        for (plane, value) in [over(r), over(g), over(b), alpha].into_iter().enumerate() {
            planes[plane * SIZE * SIZE + i] = value;
        }
    }
    Ok(planes)
}

/// Writes a picture of a set as [`read`] takes it.
///
/// # Errors
/// [`Error::Io`].
pub fn write(path: &Path, picture: &[u8]) -> Result<()> {
    let mut pixels = RgbaImage::new(SIZE as u32, SIZE as u32);
    for (i, pixel) in pixels.pixels_mut().enumerate() {
        let [r, g, b, alpha] = [0, 1, 2, 3].map(|plane| picture[plane * SIZE * SIZE + i]);
        let apart = |value: u8| ((u32::from(value) * 255) / u32::from(alpha.max(1))).min(255) as u8;
        pixel.0 = [apart(r), apart(g), apart(b), alpha];
    }
    let mut bytes = Cursor::new(Vec::new());
    let io = |e: image::ImageError| Error::Io { path: path.into(), source: std::io::Error::other(e) };
    pixels.write_to(&mut bytes, ImageFormat::Png).map_err(io)?;
    output::write_file(path, bytes.get_ref())
}
