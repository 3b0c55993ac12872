//! Animated GIF files, with one palette for all frames so that colours do not flicker.

use crate::{Picture, failed, output};
use ::gif::{DisposalMethod, Encoder, Frame, Repeat};
use color_quant::NeuQuant;
use softras::Result;
use std::borrow::Cow;
use std::collections::HashMap;
use std::path::Path;

/// Colours in the palette; the last of the 256 entries means that a pixel is as in the frame before.
const COLORS: usize = 255;
/// The most pixels that the palette is computed from.
const SAMPLES: usize = 1 << 19;

/// Writes opaque frames of one size as an endless loop, with `delay` hundredths of a second between frames.
///
/// # Errors
/// [`softras::Error::Io`] when the file cannot be written.
pub fn write_gif(path: &Path, frames: &[Picture], delay: u16) -> Result<()> {
    let bytes = encode(frames, delay).map_err(|error| failed(path, error))?;
    output::write_file(path, &bytes)
}

fn encode(frames: &[Picture], delay: u16) -> std::result::Result<Vec<u8>, ::gif::EncodingError> {
    let mut file = Vec::new();
    let Some(first) = frames.first() else { return Ok(file) };
    let (width, height) = (first.width as u16, first.height as u16);
    let mut palette = Palette::of(frames);
    let mut encoder = Encoder::new(&mut file, width, height, &palette.bytes)?;
    encoder.set_repeat(Repeat::Infinite)?;
    let mut before: Option<Vec<u8>> = None;
    for picture in frames {
        let indices = palette.indices(picture);
        encoder.write_frame(&changed(&indices, before.as_deref(), picture.width, delay))?;
        before = Some(indices);
    }
    drop(encoder);
    Ok(file)
}

/// The box of the pixels that differ from the frame before; pixels within it that do not differ are transparent.
fn changed<'a>(indices: &[u8], before: Option<&[u8]>, width: usize, delay: u16) -> Frame<'a> {
    let height = indices.len() / width.max(1);
    let differs = |i: usize| before.is_none_or(|b| b[i] != indices[i]);
    let any_in_row = |r: &usize| (0..width).any(|c| differs(r * width + c));
    let any_in_column = |c: &usize| (0..height).any(|r| differs(r * width + c));
    let (top, bottom) = ((0..height).find(any_in_row).unwrap_or(0), (0..height).rfind(any_in_row).unwrap_or(0));
    let (left, right) = ((0..width).find(any_in_column).unwrap_or(0), (0..width).rfind(any_in_column).unwrap_or(0));
    let pixels = (top..=bottom).flat_map(|r| (left..=right).map(move |c| r * width + c));
    let buffer: Vec<u8> = pixels.map(|i| if differs(i) { indices[i] } else { COLORS as u8 }).collect();
    Frame {
        delay,
        dispose: DisposalMethod::Keep,
        transparent: Some(COLORS as u8),
        left: left as u16,
        top: top as u16,
        width: (right + 1 - left) as u16,
        height: (bottom + 1 - top) as u16,
        buffer: Cow::Owned(buffer),
        ..Frame::default()
    }
}

/// 255 colours, exact when the frames have no more, and the look-up of the nearest one.
struct Palette {
    bytes: Vec<u8>,
    nearest: HashMap<[u8; 4], u8>,
    quantizer: Option<NeuQuant>,
}

impl Palette {
    fn of(frames: &[Picture]) -> Self {
        let mut nearest = HashMap::new();
        for pixel in frames.iter().flat_map(|f| &f.pixels) {
            let next = nearest.len();
            nearest.entry(*pixel).or_insert(next as u8);
            if nearest.len() > COLORS {
                return Self::quantized(frames);
            }
        }
        let mut bytes = vec![0; 3 * 256];
        for (color, &index) in &nearest {
            bytes[3 * usize::from(index)..][..3].copy_from_slice(&color[..3]);
        }
        Self { bytes, nearest, quantizer: None }
    }

    fn quantized(frames: &[Picture]) -> Self {
        let total: usize = frames.iter().map(|f| f.pixels.len()).sum();
        // An odd step visits every column of an image of even width.
        let step = (total / SAMPLES).max(1) | 1;
        let samples: Vec<u8> = frames.iter().flat_map(|f| &f.pixels).step_by(step).flatten().copied().collect();
        let quantizer = NeuQuant::new(1, COLORS, &samples);
        let mut bytes = quantizer.color_map_rgb();
        bytes.resize(3 * 256, 0);
        Self { bytes, nearest: HashMap::new(), quantizer: Some(quantizer) }
    }

    fn indices(&mut self, picture: &Picture) -> Vec<u8> {
        let find = |pixel: &[u8; 4]| {
            let search = |q: &NeuQuant| q.index_of(pixel) as u8;
            *self.nearest.entry(*pixel).or_insert_with(|| self.quantizer.as_ref().map_or(0, search))
        };
        picture.pixels.iter().map(find).collect()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn few_colours_come_back_exactly_and_unchanged_pixels_are_left_out() {
        let mut second = Picture::filled(8, 6, [250, 240, 230, 255]);
        let first = second.clone();
        second.pixels[2 * 8 + 3] = [1, 2, 3, 255];
        let bytes = encode(&[first.clone(), second.clone(), second.clone()], 5).unwrap();
        let mut options = ::gif::DecodeOptions::new();
        options.set_color_output(::gif::ColorOutput::RGBA);
        let mut decoder = options.read_info(&bytes[..]).unwrap();
        let frame = decoder.read_next_frame().unwrap().unwrap();
        assert_eq!(frame.delay, 5);
        assert_eq!(frame.buffer[..], first.pixels.concat()[..]);
        let frame = decoder.read_next_frame().unwrap().unwrap();
        assert_eq!((frame.left, frame.top, frame.width, frame.height), (3, 2, 1, 1));
        assert_eq!(frame.buffer[..], [1, 2, 3, 255]);
        assert!(decoder.read_next_frame().unwrap().is_some() && decoder.read_next_frame().unwrap().is_none());
    }

    #[test]
    fn many_colours_come_back_closely() {
        let pixels: Vec<[u8; 4]> =
            (0..4096u32).map(|i| [(i / 16) as u8, (i / 16) as u8, (i / 32) as u8, 255]).collect();
        let picture = Picture { width: 64, height: 64, pixels };
        let mut palette = Palette::of(std::slice::from_ref(&picture));
        let indices = palette.indices(&picture);
        let error = |(pixel, &index): (&[u8; 4], &u8)| {
            (0..3).map(|k| pixel[k].abs_diff(palette.bytes[3 * usize::from(index) + k])).max().unwrap()
        };
        assert!(picture.pixels.iter().zip(&indices).map(error).max().unwrap() <= 8);
    }
}
