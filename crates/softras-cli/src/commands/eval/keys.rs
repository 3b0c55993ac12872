//! Reads arrays of expected shapes from an archive, and names the modes in it.

use softras::scene::{
    Background, ColorAggregation, Distance, Faces, FrontFace, Interpolation, Shading, SilhouetteAggregation, Support,
};
use softras::{Error, Result};
use softras_io::npz::{Archive, Array};

pub const COLOR: &[(&str, ColorAggregation)] =
    &[("softmax", ColorAggregation::Softmax), ("hard", ColorAggregation::Hard)];
pub const SILHOUETTE: &[(&str, SilhouetteAggregation)] = &[
    ("product", SilhouetteAggregation::Product),
    ("prod", SilhouetteAggregation::Product),
    ("sum", SilhouetteAggregation::Sum),
    ("hard", SilhouetteAggregation::Hard),
];
pub const DISTANCE: &[(&str, Distance)] =
    &[("euclidean", Distance::Euclidean), ("barycentric", Distance::Barycentric), ("hard", Distance::Hard)];
pub const BACKGROUND: &[(&str, Background)] =
    &[("weighted", Background::Weighted), ("composite", Background::Composite)];
pub const FACES: &[(&str, Faces)] = &[("both", Faces::Both), ("front", Faces::Front)];
pub const FRONT_FACE: &[(&str, FrontFace)] =
    &[("counterclockwise", FrontFace::CounterClockwise), ("clockwise", FrontFace::Clockwise)];
pub const SUPPORT: &[(&str, Support)] = &[("probability", Support::Probability), ("guaranteed", Support::Guaranteed)];
pub const INTERPOLATION: &[(&str, Interpolation)] =
    &[("affine", Interpolation::Affine), ("perspective", Interpolation::Perspective)];
pub const SHADING: &[(&str, Shading)] = &[("flat", Shading::Flat), ("smooth", Shading::Smooth)];

/// The key's error for a shape that is not the expected one.
pub fn misshapen(archive: &Archive, key: &str, array: &Array, expected: &str) -> Error {
    archive.fault(key, &format!("has shape {:?}", array.shape), &format!("expected {expected}"))
}

/// Rows of N finite values as f32; the caller has validated the shape.
pub fn rows<const N: usize>(archive: &Archive, key: &str, array: &Array) -> Result<Vec<[f32; N]>> {
    let numbers = archive.numbers(key, array)?;
    if let Some(i) = numbers.iter().position(|x| !(x as f32).is_finite()) {
        let what = format!("{key}{:?} is {:?}", place(i, &array.shape), numbers.at(i));
        return Err(archive.fault(key, &what, "every value must be a finite float32"));
    }
    let row = |row: usize| std::array::from_fn(|i| numbers.at(N * row + i) as f32);
    Ok((0..numbers.len() / N).map(row).collect())
}

/// The indices of element i along every axis.
fn place(mut i: usize, shape: &[usize]) -> Vec<usize> {
    let mut indices: Vec<usize> = shape.iter().rev().map(|&side| (i % side, i /= side).0).collect();
    indices.reverse();
    indices
}

/// A whole number of pixels, from 1 to the largest side of an image.
pub fn pixels(archive: &Archive, key: &str, number: f64) -> Result<u32> {
    if number.fract() == 0.0 && (1.0..=f64::from(softras::Settings::MAX_SIZE)).contains(&number) {
        return Ok(number as u32);
    }
    Err(archive.fault(key, &format!("is {number:?}"), "a whole number of pixels from 1 to 16384 is expected"))
}

/// Sets a field from a key, if the file has it.
pub fn set<T>(field: &mut T, value: Option<T>) {
    if let Some(value) = value {
        *field = value;
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn places_are_by_axis() {
        assert_eq!(super::place(7, &[2, 2, 3]), [1, 0, 1]);
        assert_eq!(super::place(0, &[]), [0usize; 0]);
    }
}
