//! Writes picture files: PNG, OpenEXR and numpy arrays.

use super::args::Output;
use super::developed::Image;
use super::picture::{Floats, Picture};
use crate::commands::npz::npy;
use exr::prelude::{SpecificChannels, WritableImage};
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
use softras::internals::files;
use softras::{Error, Result};
use std::borrow::Cow;
use std::io::Cursor;
use std::path::Path;

/// The format of a picture file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// 8-bit sRGB with straight alpha.
    Png,
    /// Linear 32-bit float.
    Exr,
    /// numpy float32 `[H, W, C]`.
    Npy,
    /// 256 colours, animated.
    Gif,
}

impl Format {
    /// The format of a path, by its ending in upper or lower case.
    pub fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "png" => Some(Self::Png),
            "exr" => Some(Self::Exr),
            "npy" => Some(Self::Npy),
            "gif" => Some(Self::Gif),
            _ => None,
        }
    }
}

fn failed(path: &Path, e: impl std::error::Error + Send + Sync + 'static) -> Error {
    Error::Io { path: path.into(), source: std::io::Error::other(e) }
}

/// Writes an image as .png, .exr or .npy; returns a sentence on the meaning of the values where they need one.
pub fn write(path: &Path, format: Format, image: &Image, output: Output) -> Result<Option<String>> {
    match image {
        Image::Floats(floats) if format == Format::Exr => write_exr(path, floats, output).map(|()| None),
        Image::Floats(floats) => {
            let shape = [floats.height, floats.width, floats.channels];
            files::write_file(path, &npy::write(&shape, npy::Data::F32(&floats.data))).map(|()| None)
        }
        Image::Picture(picture, depths) => {
            write_png(path, picture)?;
            Ok(depths.map(|(low, high)| format!("white is depth {low:.4}, black is depth {high:.4}")))
        }
    }
}

/// Writes RGBA, or RGB where all is opaque.
pub fn write_png(path: &Path, picture: &Picture) -> Result<()> {
    let (bytes, color): (Cow<[u8]>, _) = if picture.is_opaque() {
        (picture.pixels.iter().flat_map(|p| [p[0], p[1], p[2]]).collect(), ExtendedColorType::Rgb8)
    } else {
        (picture.pixels.as_flattened().into(), ExtendedColorType::Rgba8)
    };
    let mut file = Vec::new();
    let (width, height) = (picture.width as u32, picture.height as u32);
    PngEncoder::new(&mut file).write_image(&bytes, width, height, color).map_err(|e| failed(path, e))?;
    files::write_file(path, &file)
}

/// Channels R, G, B and A for colour, R, G, B for normals, Z for depth, Y for the silhouette.
fn write_exr(path: &Path, floats: &Floats, output: Output) -> Result<()> {
    let (size, channels) = ((floats.width, floats.height), floats.channels);
    let at = |p: exr::prelude::Vec2<usize>, c: usize| floats.data[(p.1 * floats.width + p.0) * channels + c];
    let mut file = Cursor::new(Vec::new());
    let written = match channels {
        4 => {
            let pixels = SpecificChannels::rgba(|p| (at(p, 0), at(p, 1), at(p, 2), at(p, 3)));
            exr::prelude::Image::from_channels(size, pixels).write().non_parallel().to_buffered(&mut file)
        }
        3 => {
            let pixels = SpecificChannels::rgb(|p| (at(p, 0), at(p, 1), at(p, 2)));
            exr::prelude::Image::from_channels(size, pixels).write().non_parallel().to_buffered(&mut file)
        }
        _ => {
            let name = if output == Output::Depth { "Z" } else { "Y" };
            let pixels = SpecificChannels::build().with_channel(name).with_pixel_fn(|p| (at(p, 0),));
            exr::prelude::Image::from_channels(size, pixels).write().non_parallel().to_buffered(&mut file)
        }
    };
    written.map_err(|e| failed(path, e))?;
    files::write_file(path, file.get_ref())
}
