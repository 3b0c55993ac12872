//! Unpacks the views of `EXT_meshopt_compression`.

use super::{
    AGAIN, GltfWrong,
    document::{Document, UNPACK},
    of_error,
};
use crate::source::Source;
use meshopt_rs::{
    index::{buffer::decode_index_buffer, sequence::decode_index_sequence},
    vertex::{buffer::decode_vertex_buffer, filter},
};
use serde_json::Value;
use std::{
    f32::consts::FRAC_1_SQRT_2,
    panic::{AssertUnwindSafe, catch_unwind},
};

/// The most bytes that one packed byte unpacks to: a byte of sixteen elements in a row takes at least two bits.
const MOST_PER_BYTE: usize = 64;

impl Document<'_> {
    /// The bytes of a view that the extension `packed` describes.
    pub fn unpacked_view(&mut self, source: &mut Source, packed: &Value) -> Result<Vec<u8>, GltfWrong> {
        let number = |name: &str| packed[name].as_f64().unwrap_or(0.0) as usize;
        let buffer = self.buffer(source, number("buffer"))?;
        let (start, length) = (number("byteOffset"), number("byteLength"));
        let bytes = buffer
            .get(start..start.saturating_add(length))
            .ok_or_else(|| ("it ends beyond its buffer".into(), AGAIN.into()))?;
        let (count, stride) = (number("count"), number("byteStride"));
        let size = count.saturating_mul(stride);
        if size > MOST_PER_BYTE * length {
            return Err((format!("{count} elements, more than {length} bytes hold"), AGAIN.into()));
        }
        source.unpacked(size).map_err(of_error)?;
        self.held += size;
        // A decoder of foreign code must not end the process over a broken file.
        let decoded = catch_unwind(AssertUnwindSafe(|| decoded(bytes, packed, count, stride)));
        decoded.unwrap_or_else(|_| Err("the decoder failed".into())).map_err(|what| (what, UNPACK.into()))
    }
}

fn decoded(bytes: &[u8], packed: &Value, count: usize, stride: usize) -> Result<Vec<u8>, String> {
    let mode = packed["mode"].as_str().unwrap_or_default();
    let outcome = match (mode, stride) {
        ("ATTRIBUTES", _) => {
            let mut values = elements(bytes, count, stride)?;
            undo_filter(&mut values, packed["filter"].as_str().unwrap_or("NONE"), stride)?;
            return Ok(values);
        }
        ("TRIANGLES", 2 | 4) if count.is_multiple_of(3) => {
            let mut indices = vec![0; count];
            decode_index_buffer::<u32>(&mut indices, bytes).map(|()| indices)
        }
        ("INDICES", 2 | 4) => {
            let mut indices = vec![0; count];
            decode_index_sequence::<u32>(&mut indices, bytes).map(|()| indices)
        }
        _ => return Err(format!("unknown mode {mode:.20?} of {count} elements of {stride} bytes")),
    };
    let indices = outcome.map_err(|error| format!("{error:?}"))?;
    Ok(indices.into_iter().flat_map(|index| index.to_le_bytes().into_iter().take(stride)).collect())
}

/// Elements of 4 to 256 bytes. The crate has the size of an element as a type parameter.
fn elements(bytes: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, String> {
    macro_rules! of_words {
        ($($words:literal)*) => {
            match (stride / 4, stride % 4) {
                $(($words, 0) => {
                    let mut values = vec![[[0; 4]; $words]; count];
                    decode_vertex_buffer(&mut values, bytes).map(|()| values.as_flattened().as_flattened().to_vec())
                })*
                _ => return Err(format!("elements of {stride} bytes")),
            }
        };
    }
    let outcome = of_words!(1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32
        33 34 35 36 37 38 39 40 41 42 43 44 45 46 47 48 49 50 51 52 53 54 55 56 57 58 59 60 61 62 63 64);
    outcome.map_err(|error| format!("{error:?}"))
}

fn undo_filter(values: &mut [u8], name: &str, stride: usize) -> Result<(), String> {
    match (name, stride) {
        ("NONE", _) => {}
        ("OCTAHEDRAL", 4) => filter::decode_filter_oct_8(values.as_chunks_mut().0),
        ("OCTAHEDRAL" | "QUATERNION", 8) => {
            for bytes in values.as_chunks_mut::<8>().0 {
                let four = [0, 2, 4, 6].map(|at| u16::from_le_bytes([bytes[at], bytes[at + 1]]));
                let mut four = [four];
                match name {
                    "QUATERNION" => four[0] = quaternion(four[0].map(|x| x as i16)),
                    _ => filter::decode_filter_oct_16(&mut four),
                }
                bytes.copy_from_slice(four[0].map(u16::to_le_bytes).as_flattened());
            }
        }
        ("EXPONENTIAL", _) => {
            for bytes in values.as_chunks_mut::<4>().0 {
                let word = i32::from_le_bytes(*bytes);
                *bytes = ((f64::from(word << 8 >> 8) * f64::from(word >> 24).exp2()) as f32).to_le_bytes();
            }
        }
        _ => return Err(format!("unknown filter {name:.20?} of elements of {stride} bytes")),
    }
    Ok(())
}

/// A unit quaternion of three components and their scale, whose last two bits are the place of the fourth and greatest component.
/// The crate's own filter loses the signs.
fn quaternion([x, y, z, scale]: [i16; 4]) -> [u16; 4] {
    let three = [x, y, z].map(|x| f32::from(x) * FRAC_1_SQRT_2 / f32::from(scale | 3));
    let fourth = (1.0 - three.iter().map(|x| x * x).sum::<f32>()).max(0.0).sqrt();
    let mut all = [three[0], three[1], three[2], fourth].map(|x| (x * 32767.0).round() as i16 as u16);
    // `scale` may be negative.
    all.rotate_right((scale & 3) as usize + 1);
    all
}
