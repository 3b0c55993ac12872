//! PNG and JPEG files: their sizes are known, and may be counted, before a pixel is decoded.

use crate::{fault, input};
use image::{
    DynamicImage, ImageDecoder, ImageFormat, ImageReader, ImageResult, Limits, RgbaImage, metadata::Orientation,
};
use softras::{Error, Result};
use std::path::Path;

/// The largest side of a picture.
pub const MAX_SIDE: u32 = 16384;

/// Bytes of a pixel while it is decoded and converted: up to eight as it is in the file and sixteen as four floats.
pub(crate) const BYTES_PER_PIXEL: u64 = 24;

/// The limits of any picture.
pub(crate) fn limits() -> Limits {
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_SIDE);
    limits.max_image_height = Some(MAX_SIDE);
    limits
}

/// The pixels of a decoder, within limits.
pub(crate) fn decoded(mut decoder: impl ImageDecoder, mut limits: Limits) -> ImageResult<DynamicImage> {
    limits.reserve(decoder.total_bytes())?;
    decoder.set_limits(limits)?;
    DynamicImage::from_decoder(decoder)
}

/// A picture of which only the header has been read.
pub struct PictureFile {
    /// Columns, from 1 to 16384, of the picture as its EXIF orientation turns it.
    pub width: u32,
    /// Rows, from 1 to 16384.
    pub height: u32,
    /// Bytes of the file.
    pub file_bytes: u64,
    /// Whether its format changes the pixels, as JPEG does.
    pub is_lossy: bool,
    orientation: Orientation,
    decoder: Box<dyn ImageDecoder>,
    limits: Limits,
}

impl PictureFile {
    /// Reads the header. The content tells the format rather than the name, which may be wrong.
    ///
    /// # Errors
    /// As [`input::open`]; [`Error::File`] for what is no picture or has sides of 0 or more than 16384 pixels.
    pub fn open(path: &Path) -> Result<Self> {
        let file_bytes = input::open(path)?.metadata().map_or(0, |metadata| metadata.len());
        input::refuse_empty(path, file_bytes)?;
        let refuse = |error| refuse(path, &error);
        let io = |error| refuse(image::ImageError::IoError(error));
        let mut reader = ImageReader::open(path).and_then(ImageReader::with_guessed_format).map_err(io)?;
        let is_lossy = matches!(reader.format(), Some(ImageFormat::Jpeg | ImageFormat::WebP));
        let mut limits = limits();
        // The caller counts pixels; this is for what a decoder needs besides them.
        limits.max_alloc = Some(u64::from(MAX_SIDE) * u64::from(MAX_SIDE) * BYTES_PER_PIXEL);
        reader.limits(limits.clone());
        let mut decoder: Box<dyn ImageDecoder> = Box::new(reader.into_decoder().map_err(refuse)?);
        // What cannot be read of the orientation changes nothing.
        let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
        let is_upright = matches!(
            orientation,
            Orientation::NoTransforms
                | Orientation::Rotate180
                | Orientation::FlipHorizontal
                | Orientation::FlipVertical
        );
        let (columns, rows) = decoder.dimensions();
        let (width, height) = if is_upright { (columns, rows) } else { (rows, columns) };
        if width.min(height) == 0 || width.max(height) > MAX_SIDE {
            let what = format!("is {width}×{height} pixels");
            return Err(fault(path, what, format!("use 1 to {MAX_SIDE} pixels a side")));
        }
        Ok(Self { width, height, file_bytes, is_lossy, orientation, decoder, limits })
    }

    /// The number of pixels.
    pub fn pixels(&self) -> u64 {
        u64::from(self.width) * u64::from(self.height)
    }

    /// Whether its EXIF orientation turns or mirrors it.
    pub fn is_turned(&self) -> bool {
        self.orientation != Orientation::NoTransforms
    }

    /// Decodes the pixels, turned as the EXIF orientation says.
    ///
    /// # Errors
    /// [`Error::File`] for a malformed picture; [`Error::OutOfMemory`].
    pub fn decode(self, path: &Path) -> Result<DynamicImage> {
        input::room_for(&format!("the picture {}", path.display()), self.pixels() * BYTES_PER_PIXEL)?;
        let mut picture = decoded(self.decoder, self.limits).map_err(|error| refuse(path, &error))?;
        picture.apply_orientation(self.orientation);
        Ok(picture)
    }

    /// Decodes the pixels, and the silhouette of the object that a picture shows: its alpha, or in an opaque picture what is not
    /// black. Notes the latter, and that the picture was turned.
    ///
    /// # Errors
    /// Those of [`PictureFile::decode`].
    pub fn decode_object(self, path: &Path) -> Result<(RgbaImage, Vec<f64>, [Option<String>; 2])> {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let turned = self.is_turned().then(|| format!("{name}: turned as its EXIF orientation says"));
        let black = if self.is_lossy { LOSSY_BLACK } else { 0 };
        let picture = self.decode(path)?.into_rgba8();
        let is_opaque = picture.pixels().all(|p| p.0[3] == 255);
        let alpha = || picture.pixels().map(|p| f64::from(p.0[3]) / 255.0).collect();
        let silhouette = if is_opaque { matte(&picture, black) } else { alpha() };
        let cut = (is_opaque && black > 0).then(|| {
            format!(
                "{name}: values up to {LOSSY_BLACK} of 255 are taken as background (a PNG with alpha says it exactly)"
            )
        });
        Ok((picture, silhouette, [cut, turned]))
    }
}

/// The brightest value of the background in a picture of a format that changes pixels: beside an edge JPEG leaves traces of it.
const LOSSY_BLACK: u8 = 32;

/// The silhouette of an opaque picture over black: 0 up to `black`, and 1 where no pixel around is as dark. A pixel of the outline
/// shows some of the background, so its silhouette is its brightness divided by that of the brightest pixel around.
fn matte(picture: &RgbaImage, black: u8) -> Vec<f64> {
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let brightest: Vec<u8> = picture.pixels().map(|p| p.0[0].max(p.0[1]).max(p.0[2])).collect();
    let alpha = |at: usize| {
        let (row, column) = (at / width, at % width);
        let rows = row.saturating_sub(1)..(row + 2).min(height);
        let around =
            rows.flat_map(|r| brightest[r * width..][column.saturating_sub(1)..(column + 2).min(width)].iter());
        let (least, most) = around.fold((u8::MAX, 0), |(least, most), x| (least.min(*x), most.max(*x)));
        match brightest[at] {
            own if own <= black => 0.0,
            _ if least > black => 1.0,
            own => f64::from(own) / f64::from(most),
        }
    };
    (0..width * height).map(alpha).collect()
}

fn refuse(path: &Path, error: &image::ImageError) -> Error {
    let fix = format!("give a PNG or JPEG file of at most {MAX_SIDE}×{MAX_SIDE} pixels");
    fault(path, format!("not a readable picture ({error})"), fix)
}
