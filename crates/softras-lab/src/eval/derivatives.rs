//! Names the gradients, and gives them the shapes of the arrays that they are gradients of.

use super::{Entry, Job, Layout};
use softras::{Projection, Result};
use softras_io::npz::Archive;
use softras_lab::agreement::Numbers;
use std::ops::Range;

/// All gradients of the layout.
///
/// # Errors
/// None for an archive that the job was read from.
pub fn arrays(archive: &Archive, job: &Job, gradient: &Numbers) -> Result<Vec<Entry>> {
    match job.layout {
        Layout::Screen => screen(archive, gradient),
        Layout::World => world(archive, job, gradient),
    }
}

fn shape(archive: &Archive, key: &str) -> Result<Option<Vec<usize>>> {
    Ok(archive.get(key)?.map(|array| array.shape.clone()))
}

/// The values of that name of all meshes, views or lights, one after the other.
fn all(gradient: &Numbers, name: &str) -> Vec<f64> {
    gradient.iter().filter(|(other, _)| *other == name).flat_map(|(_, values)| values.clone()).collect()
}

/// The same, of each the values in a range.
fn parts(gradient: &Numbers, name: &str, range: Range<usize>) -> Vec<f64> {
    gradient.iter().filter(|(other, _)| *other == name).flat_map(|(_, values)| values[range.clone()].to_vec()).collect()
}

/// The gradient by the colours, of the kind that the meshes have.
fn colors(gradient: &Numbers) -> Vec<f64> {
    [all(gradient, "colors"), all(gradient, "surface texels")].concat()
}

fn screen(archive: &Archive, gradient: &Numbers) -> Result<Vec<Entry>> {
    let mut arrays = Vec::new();
    if let Some(shape) = shape(archive, "face_vertices")? {
        arrays.push(("grad_face_vertices", shape, all(gradient, "positions")));
    }
    if let Some(shape) = shape(archive, "textures")? {
        arrays.push(("grad_textures", shape, colors(gradient)));
    }
    Ok(arrays)
}

fn world(archive: &Archive, job: &Job, gradient: &Numbers) -> Result<Vec<Entry>> {
    let mut arrays = Vec::new();
    if let Some(shape) = shape(archive, "vertices")? {
        arrays.push(("grad_vertices", shape, all(gradient, "positions")));
    }
    let shape = shape(archive, "colors")?.unwrap_or_else(|| vec![3]);
    let mut values = colors(gradient);
    if shape.len() < 3 {
        // All meshes share one array, so their gradients add up.
        values = sum(&values, shape.iter().product());
    }
    arrays.push(("grad_colors", shape, values));
    let (views, lights) = (job.cameras.len(), job.scene.lights.directional.len());
    let numbers = if matches!(job.cameras[0].projection(), Projection::Pinhole { .. }) { 4 } else { 1 };
    arrays.extend([
        ("grad_view", vec![views, 6], all(gradient, "twist")),
        ("grad_projection", vec![views, numbers], parts(gradient, "projection", 0..numbers)),
        ("grad_ambient_color", vec![3], parts(gradient, "ambient", 0..3)),
        ("grad_ambient_intensity", vec![], parts(gradient, "ambient", 3..4)),
        ("grad_light_directions", vec![lights, 3], all(gradient, "light direction")),
        ("grad_light_colors", vec![lights, 3], parts(gradient, "light color", 0..3)),
        ("grad_light_intensities", vec![lights], parts(gradient, "light color", 3..4)),
        ("grad_background_color", vec![3], all(gradient, "background")),
        ("grad_sigma", vec![], all(gradient, "sigma")),
        ("grad_gamma", vec![], all(gradient, "gamma")),
        ("grad_epsilon", vec![], all(gradient, "epsilon")),
    ]);
    Ok(arrays)
}

/// The sum of all chunks of `size` values.
fn sum(values: &[f64], size: usize) -> Vec<f64> {
    let mut total = vec![0.0; size];
    for chunk in values.chunks(size.max(1)) {
        total.iter_mut().zip(chunk).for_each(|(total, value)| *total += value);
    }
    total
}
