//! The silhouettes of mask files, whose values are written in many ways.

use crate::{PictureFile, refuse};
use image::{DynamicImage, GrayImage, RgbaImage};
use softras::Result;
use std::path::Path;

/// The largest value, of 255, of a mask that has the numbers of classes.
pub const LABELS: u16 = 64;
/// The most that a channel of a grey pixel differs from another, and that of a black one is, where the format changes pixels.
const LOSSY: u16 = 32;
/// How much more a picture changes across the outline of the better of two masks, where it is sure.
const SURE: f64 = 1.25;

/// The silhouette that a mask file has for a picture that was read from a file, and a note. A mask of the stored size is turned as its
/// picture is, whatever the mask itself says. Where it has the size of the turned picture too, it may lie as that is shown: then its
/// outline is where the picture has edges.
///
/// # Errors
/// [`softras::Error::File`] for what is no picture or has another size.
pub fn read(path: &Path, of: &PictureFile, picture: &RgbaImage) -> Result<(GrayImage, Option<String>)> {
    let file = PictureFile::open(path)?.as_stored();
    let (size, is_lossy) = ((file.width, file.height), file.is_lossy);
    let [stored, turned] = [of.stored(), of.turned()].map(|other| other == size);
    if !(stored || turned) {
        let what = format!("is {}×{} pixels, and its picture {}×{}", size.0, size.1, of.width, of.height);
        return refuse(path, what, "give a mask of the picture's size");
    }
    let mask = file.decode(path)?;
    let placed = |is_stored: bool| {
        let mut mask = mask.clone();
        of.place(&mut mask, is_stored);
        silhouette(&mask, is_lossy)
    };
    if !(of.is_turned() && stored && turned) {
        return Ok(placed(stored));
    }
    let (as_stored, as_shown) = (placed(true), placed(false));
    let is_shown = edges(&as_shown.0, picture) > SURE * edges(&as_stored.0, picture);
    Ok(if is_shown { as_shown } else { as_stored })
}

/// How much a picture changes across the outline of a mask, in the mean.
fn edges(mask: &GrayImage, picture: &RgbaImage) -> f64 {
    let (mut sum, mut count) = (0u64, 0u64);
    for (x, y) in
        (1..mask.height().saturating_sub(2)).flat_map(|y| (1..mask.width().saturating_sub(2)).map(move |x| (x, y)))
    {
        let inside = |x: u32, y: u32| mask[(x, y)].0[0] > 127;
        for (right, down) in [(1, 0), (0, 1)] {
            if inside(x, y) != inside(x + right, y + down) {
                let (a, b) = (picture[(x - right, y - down)].0, picture[(x + 2 * right, y + 2 * down)].0);
                sum += a.iter().zip(b).take(3).map(|(a, b)| u64::from(a.abs_diff(b))).sum::<u64>();
                count += 1;
            }
        }
    }
    sum as f64 / count.max(1) as f64
}

/// The silhouette: alpha, where there is any; else what is not black where there are colours or numbers of classes; else the grey
/// values, of which the largest is 1.
fn silhouette(mask: &DynamicImage, is_lossy: bool) -> (GrayImage, Option<String>) {
    if mask.color().has_alpha() {
        let alpha = mask.to_rgba8();
        let (least, most) = alpha.pixels().fold((u8::MAX, 0), |(a, b), p| (p.0[3].min(a), p.0[3].max(b)));
        if least < 255 && most > 0 {
            let alpha = alpha.pixels().map(|pixel| pixel.0[3]).collect();
            return (gray(mask, alpha), Some("the alpha of mask files is the silhouette".into()));
        }
    }
    let rgb = mask.to_rgb16();
    let near = if is_lossy { 257 * LOSSY } else { 0 };
    let span = |p: &image::Rgb<u16>| (p.0.into_iter().min().unwrap_or(0), p.0.into_iter().max().unwrap_or(0));
    let (most, colored) = rgb
        .pixels()
        .map(span)
        .fold((0, false), |(most, colored), (low, high)| (high.max(most), colored || high - low > near));
    if colored || most < 257 * LABELS {
        let black = if most < 257 * LABELS { 0 } else { near };
        let object = rgb.pixels().map(|pixel| if span(pixel).1 > black { 255 } else { 0 }).collect();
        let note = (most > 0).then(|| {
            let what = if colored { "colours".into() } else { format!("values up to {}", shown(mask, most)) };
            format!("mask files have {what}: all that is not black is object")
        });
        return (gray(mask, object), note);
    }
    let value = |pixel: &image::Rgb<u16>| (255.0 * f64::from(span(pixel).1) / f64::from(most)).round() as u8;
    (gray(mask, rgb.pixels().map(value).collect()), None)
}

/// Makes an alpha that is small everywhere, as 0 and 1 in bytes, that of what is not 0. Whether it was.
pub fn lift_alpha(picture: &mut RgbaImage) -> bool {
    let most = picture.pixels().map(|pixel| u16::from(pixel.0[3])).max().unwrap_or(0);
    let is_small = most > 0 && most < LABELS;
    picture.pixels_mut().filter(|pixel| is_small && pixel.0[3] > 0).for_each(|pixel| pixel.0[3] = 255);
    is_small
}

fn gray(mask: &DynamicImage, values: Vec<u8>) -> GrayImage {
    GrayImage::from_raw(mask.width(), mask.height(), values).unwrap_or_default()
}

/// A value of 16 bits as the file has it.
fn shown(mask: &DynamicImage, value: u16) -> u16 {
    let bits = mask.color().bits_per_pixel() / u16::from(mask.color().channel_count());
    if bits > 8 { value } else { value / 257 }
}
