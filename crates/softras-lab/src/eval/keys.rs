//! Reads arrays of expected shapes from an archive, and names the modes in it.

use softras::scene::{
    Background, ColorAggregation, Distance, Faces, FrontFace, Interpolation, Shading, SilhouetteAggregation, Support,
    SurfacePoint,
};
use softras::{Error, Result};
use softras_io::npy::Array;
use softras_io::npz::Archive;
use softras_io::text::name as shown;

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
pub const SURFACE_POINT: &[(&str, SurfacePoint)] = &[("nearest", SurfacePoint::Nearest), ("clip", SurfacePoint::Clip)];
pub const SHADING: &[(&str, Shading)] = &[("flat", Shading::Flat), ("smooth", Shading::Smooth)];

/// A single finite number: 0-d or with one element.
pub fn number(archive: &Archive, key: &str) -> Result<Option<f64>> {
    let Some(array) = archive.get(key)? else { return Ok(None) };
    match archive.numbers(key, array)?.all() {
        Some([x]) if x.is_finite() => Ok(Some(x)),
        Some([x]) => Err(archive.fault(key, &format!("is {x}"), "a finite number is expected")),
        None => Err(archive.fault(key, &format!("has shape {:?}", array.shape), "a single number is expected")),
    }
}

/// A single text.
pub fn text(archive: &Archive, key: &str) -> Result<Option<String>> {
    let Some(array) = archive.get(key)? else { return Ok(None) };
    match array.texts().filter(|_| array.len() == 1).and_then(|mut texts| texts.next()) {
        Some(text) => Ok(Some(text)),
        None => {
            let what = format!("is {} of shape {:?}", array.dtype(), array.shape);
            Err(archive.fault(key, &what, "a single text is expected"))
        }
    }
}

/// A text that must be one of the given choices.
pub fn choice<T: Copy>(archive: &Archive, key: &str, choices: &[(&str, T)]) -> Result<Option<T>> {
    let Some(text) = text(archive, key)? else { return Ok(None) };
    match choices.iter().find(|(name, _)| *name == text) {
        Some((_, value)) => Ok(Some(*value)),
        None => {
            let names: Vec<_> = choices.iter().map(|(name, _)| *name).collect();
            Err(archive.fault(key, &format!("is \"{}\"", shown(&text)), &format!("use one of {}", names.join(", "))))
        }
    }
}

/// True or false: a bool, or the numbers 0 and 1.
pub fn flag(archive: &Archive, key: &str) -> Result<Option<bool>> {
    match number(archive, key)? {
        None => Ok(None),
        Some(0.0) => Ok(Some(false)),
        Some(1.0) => Ok(Some(true)),
        Some(x) => Err(archive.fault(key, &format!("is {x:?}"), "True or False is expected")),
    }
}

/// Three numbers, or one for all three.
pub fn triple(archive: &Archive, key: &str) -> Result<Option<[f64; 3]>> {
    let Some(array) = archive.get(key)? else { return Ok(None) };
    let numbers = archive.numbers(key, array)?;
    match numbers.all().map(|[x]| [x; 3]).or(numbers.all()) {
        Some(triple) => Ok(Some(triple)),
        None => Err(archive.fault(key, &format!("has shape {:?}", array.shape), "three numbers are expected")),
    }
}

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
