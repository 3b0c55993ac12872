//! numpy arrays to the library's rows and images, and back.
//!
//! `softras._arrays` says which types and values an array may have, by what its numbers mean: "number", "place", "light",
//! "texture" (light with alpha), "picture" or "mask". The library owns its arrays, so that each is copied once on the way in. Arrays that
//! the library returns are handed over without a copy.

use crate::exceptions::bad_input;
use numpy::{Element, PyArray1, PyArray2, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use softras::Image;

/// A contiguous array of 32-bit floats.
pub fn floats<'py>(value: &Bound<'py, PyAny>, name: &str, means: &str) -> PyResult<PyReadonlyArrayDyn<'py, f32>> {
    read(value, name, means, "float32")
}

/// A contiguous array of 64-bit floats.
pub fn doubles<'py>(value: &Bound<'py, PyAny>, name: &str, means: &str) -> PyResult<PyReadonlyArrayDyn<'py, f64>> {
    read(value, name, means, "float64")
}

fn read<'py, T: Element>(
    value: &Bound<'py, PyAny>,
    name: &str,
    means: &str,
    kind: &str,
) -> PyResult<PyReadonlyArrayDyn<'py, T>> {
    // The positions of every step of a fit need no call.
    if let Ok(array) = value.cast::<PyArrayDyn<T>>()
        // A masked array is a kind of array.
        && value.is_exact_instance_of::<PyArrayDyn<T>>()
        && array.is_c_contiguous()
        && matches!(means, "number" | "place")
    {
        return Ok(array.try_readonly()?);
    }
    let found = value.py().import("softras._arrays")?.call_method1("read", (value, name, means, kind))?;
    Ok(found.cast_into::<PyArrayDyn<T>>()?.try_readonly()?)
}

/// The error of an array of another shape.
fn shape_error(name: &str, shape: &[usize], expected: &str) -> PyErr {
    bad_input(format!("{name} has shape {shape:?}"), &format!("give {expected}"))
}

/// Rows of N floats that are places or directions.
pub fn rows<const N: usize>(value: &Bound<'_, PyAny>, name: &str) -> PyResult<Vec<[f32; N]>> {
    let array = floats(value, name, "place")?;
    match array.shape() {
        [_, columns] if *columns == N => Ok(array.as_slice()?.as_chunks::<N>().0.to_vec()),
        shape => Err(shape_error(name, shape, &format!("[rows, {N}]"))),
    }
}

/// Numbers in double precision, exactly N of them.
pub fn vector<const N: usize>(value: &Bound<'_, PyAny>, name: &str) -> PyResult<[f64; N]> {
    exactly(value, name, "number")
}

/// A colour in double precision.
pub fn color(value: &Bound<'_, PyAny>, name: &str) -> PyResult<[f64; 3]> {
    exactly(value, name, "light")
}

fn exactly<const N: usize>(value: &Bound<'_, PyAny>, name: &str, means: &str) -> PyResult<[f64; N]> {
    let array = doubles(value, name, means)?;
    let found = <[f64; N]>::try_from(array.as_slice()?);
    found.map_err(|_| shape_error(name, array.shape(), &format!("{N} numbers")))
}

/// A matrix in double precision.
pub fn matrix<const R: usize, const C: usize>(value: &Bound<'_, PyAny>, name: &str) -> PyResult<[[f64; C]; R]> {
    let array = doubles(value, name, "number")?;
    let found = <[[f64; C]; R]>::try_from(array.as_slice()?.as_chunks::<C>().0);
    match found {
        Ok(matrix) if array.shape() == [R, C] => Ok(matrix),
        _ => Err(shape_error(name, array.shape(), &format!("[{R}, {C}]"))),
    }
}

/// Indices of any integer type.
pub fn indices(value: &Bound<'_, PyAny>, name: &str) -> PyResult<(Vec<u32>, Vec<usize>)> {
    let array = value.py().import("numpy")?.call_method1("asarray", (value,))?;
    let kind: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
    let empty = array.getattr("size")?.extract::<usize>()? == 0;
    if !["i", "u"].contains(&kind.as_str()) && !empty {
        return Err(bad_input(format!("{name} are no integers"), "give indices of an integer type"));
    }
    if let Ok(array) = array.cast::<PyArrayDyn<u32>>()
        && array.is_c_contiguous()
    {
        return Ok((array.try_readonly()?.as_slice()?.to_vec(), array.shape().to_vec()));
    }
    let whole = read::<i64>(&array, name, "number", "int64")?;
    let negative = |i: i64| bad_input(format!("{name} hold {i}"), "indices are 0 or more and below 2^32");
    let one = |&i: &i64| u32::try_from(i).map_err(|_| negative(i));
    let found = whole.as_slice()?.iter().map(one).collect::<PyResult<_>>()?;
    Ok((found, whole.shape().to_vec()))
}

/// Indices of triangles, `[T, 3]`.
pub fn triangles(value: &Bound<'_, PyAny>, name: &str) -> PyResult<Vec<[u32; 3]>> {
    let (found, shape) = indices(value, name)?;
    match shape[..] {
        [_, 3] => Ok(found.as_chunks::<3>().0.to_vec()),
        _ => Err(shape_error(name, &shape, "[triangles, 3]")),
    }
}

/// A batch of images: `[batch, height, width, channels]`, for one channel also `[batch, height, width]`.
pub fn image(value: &Bound<'_, PyAny>, name: &str, channels: usize, means: &str) -> PyResult<Image> {
    let array = floats(value, name, means)?;
    let (batch, height, width) = match *array.shape() {
        [batch, height, width] if channels == 1 => (batch, height, width),
        [batch, height, width, last] if last == channels => (batch, height, width),
        _ if channels == 1 => return Err(shape_error(name, array.shape(), "[batch, height, width]")),
        _ => return Err(shape_error(name, array.shape(), &format!("[batch, height, width, {channels}]"))),
    };
    Ok(Image { batch, height, width, channels, data: array.as_slice()?.to_vec() })
}

/// An image as an array: `[batch, height, width, 3]`, or `[batch, height, width]` for one channel.
pub fn image_array(py: Python<'_>, image: Image) -> PyResult<Py<PyAny>> {
    shaped(py, image.data, [image.batch, image.height, image.width], image.channels)
}

/// An image of features as an array: `[batch, height, width, channels]`.
pub fn feature_array(py: Python<'_>, image: Image) -> PyResult<Py<PyAny>> {
    let shape = [image.batch, image.height, image.width, image.channels];
    Ok(PyArray1::from_vec(py, image.data).reshape(shape)?.into_any().unbind())
}

/// Values as images of some channels.
pub fn shaped<T: Element>(py: Python<'_>, values: Vec<T>, sides: [usize; 3], channels: usize) -> PyResult<Py<PyAny>> {
    let ([batch, height, width], flat) = (sides, PyArray1::from_vec(py, values));
    let array = match channels {
        1 => flat.reshape([batch, height, width])?.into_any(),
        _ => flat.reshape([batch, height, width, channels])?.into_any(),
    };
    Ok(array.unbind())
}

/// Rows as an array `[rows, N]`, without a copy.
pub fn array<T: Element, const N: usize>(py: Python<'_>, rows: Vec<[T; N]>) -> PyResult<Bound<'_, PyArray2<T>>> {
    let count = rows.len();
    PyArray1::from_vec(py, rows.into_flattened()).reshape([count, N])
}
