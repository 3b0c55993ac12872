//! Picture files: their sizes are known, and may be counted, before a pixel is decoded.

use crate::{fault, input, views::Plain};
use image::{
    DynamicImage, ImageDecoder, ImageFormat, ImageReader, ImageResult, Limits, RgbaImage, metadata::Orientation,
};
use softras::{Error, Result};
use std::{
    io::{self, BufReader, Read, Seek},
    path::Path,
};

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

/// The bytes of a picture. One type for files and memory, so that no decoder is compiled twice.
pub(crate) trait Bytes: Read + Seek {}
impl<T: Read + Seek> Bytes for T {}
pub(crate) type Reader<'a> = ImageReader<BufReader<Box<dyn Bytes + 'a>>>;

/// A reader of a picture in memory, or in a file, whose name says the format where its content does not.
///
/// # Errors
/// Those of reading its first bytes.
pub(crate) fn reader<'a>(bytes: impl Bytes + 'a, path: Option<&Path>) -> io::Result<Reader<'a>> {
    let mut reader = Reader::new(BufReader::new(Box::new(bytes)));
    if let Some(format) = path.and_then(|path| ImageFormat::from_path(path).ok()) {
        reader.set_format(format);
    }
    reader.with_guessed_format()
}

/// The pixels of a decoder, within limits.
pub(crate) fn decoded(mut decoder: Box<dyn ImageDecoder + '_>, mut limits: Limits) -> ImageResult<DynamicImage> {
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
    /// The orientation that the file says, and the one that is applied.
    exif: Orientation,
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
        let file = input::open(path)?;
        let file_bytes = file.metadata().map_or(0, |metadata| metadata.len());
        input::refuse_empty(path, file_bytes)?;
        let refuse = |error| refuse(path, &error);
        let io = |error| refuse(image::ImageError::IoError(error));
        let mut reader = reader(file, Some(path)).map_err(io)?;
        let is_lossy = matches!(reader.format(), Some(ImageFormat::Jpeg | ImageFormat::WebP));
        let mut limits = limits();
        // The caller counts pixels; this is for what a decoder needs besides them.
        limits.max_alloc = Some(u64::from(MAX_SIDE) * u64::from(MAX_SIDE) * BYTES_PER_PIXEL);
        reader.limits(limits.clone());
        let mut decoder: Box<dyn ImageDecoder> = Box::new(reader.into_decoder().map_err(refuse)?);
        // An orientation that cannot be read changes nothing.
        let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
        let (width, height) = decoder.dimensions();
        if width.min(height) == 0 || width.max(height) > MAX_SIDE {
            let what = format!("is {width}×{height} pixels");
            return Err(fault(path, what, format!("use 1 to {MAX_SIDE} pixels a side")));
        }
        let exif = orientation;
        let mut file = Self { width, height, file_bytes, is_lossy, exif, orientation, decoder, limits };
        (file.width, file.height) = file.turned();
        Ok(file)
    }

    /// The size as it is stored.
    pub fn stored(&self) -> (u32, u32) {
        self.decoder.dimensions()
    }

    /// The size as the EXIF orientation turns it.
    pub fn turned(&self) -> (u32, u32) {
        let (columns, rows) = self.stored();
        // Those from 5 on exchange rows and columns.
        if self.exif.to_exif() < 5 { (columns, rows) } else { (rows, columns) }
    }

    /// The picture as it is stored, whatever its EXIF orientation says.
    pub fn as_stored(mut self) -> Self {
        (self.width, self.height) = self.stored();
        self.orientation = Orientation::NoTransforms;
        self
    }

    /// Turns a mask of the picture as it is stored, or as its EXIF orientation shows it, to where this picture is.
    pub(crate) fn place(&self, mask: &mut DynamicImage, is_stored: bool) {
        let back = match self.exif {
            Orientation::Rotate90 => Orientation::Rotate270,
            Orientation::Rotate270 => Orientation::Rotate90,
            other => other,
        };
        match self.orientation {
            own if is_stored => mask.apply_orientation(own),
            Orientation::NoTransforms => mask.apply_orientation(back),
            _ => {}
        }
    }

    /// The number of pixels.
    pub fn pixels(&self) -> u64 {
        u64::from(self.width) * u64::from(self.height)
    }

    /// Whether its EXIF orientation turns or mirrors it.
    pub fn is_turned(&self) -> bool {
        self.exif != Orientation::NoTransforms
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

    /// Decodes the pixels, whose alpha is the silhouette of the object that the picture shows: its own, or in an opaque picture what
    /// stands out of a plain background. Without either the picture stays opaque. Notes the latter, and that the picture was turned.
    ///
    /// # Errors
    /// Those of [`PictureFile::decode`].
    pub fn decode_object(self, path: &Path) -> Result<(RgbaImage, Vec<String>)> {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let (is_turned, is_lossy) = (self.is_turned(), self.is_lossy);
        let mut notes = Vec::new();
        if is_turned {
            notes.push(format!("{name}: turned as its EXIF orientation says"));
        }
        let mut picture = self.decode(path)?.into_rgba8();
        if is_opaque(&picture) {
            let plain = Plain::of(&picture, is_lossy);
            plain.iter().for_each(|plain| plain.remove(&mut picture));
            let told = plain.map_or(Some("no alpha and no plain background: all of it is object".into()), |p| p.told());
            notes.extend(told.map(|told| format!("{name}: {told}")));
        }
        Ok((picture, notes))
    }
}

/// Whether nothing of a picture is transparent.
pub(crate) fn is_opaque(picture: &RgbaImage) -> bool {
    picture.pixels().all(|pixel| pixel.0[3] == 255)
}

fn refuse(path: &Path, error: &image::ImageError) -> Error {
    let fix = format!("give a PNG or JPEG file of at most {MAX_SIDE}×{MAX_SIDE} pixels");
    fault(path, format!("not a readable picture ({error})"), fix)
}
