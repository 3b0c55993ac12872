//! Names the gradients, and gives them the shapes of the arrays that they are gradients of.

use super::{Entry, Job, Layout};
use softras::Result;
use softras_io::npz::Archive;
use softras_reference::Parameters;

/// All gradients of the layout.
///
/// # Errors
/// None for an archive that the job was read from.
pub fn arrays(archive: &Archive, job: &Job, gradient: &Parameters) -> Result<Vec<Entry>> {
    match job.layout {
        Layout::Screen => screen(archive, job, gradient),
        Layout::World => world(archive, job, gradient),
    }
}

fn shape(archive: &Archive, key: &str) -> Result<Option<Vec<usize>>> {
    Ok(archive.get(key)?.map(|array| array.shape.clone()))
}

/// The values of all meshes, one after the other.
fn each(job: &Job, values: impl Fn(usize) -> Vec<f64>) -> Vec<f64> {
    (0..job.scene.meshes.len()).flat_map(values).collect()
}

/// The gradient by the colours, of the kind that the mesh has.
fn colors(gradient: &Parameters, mesh: usize) -> Vec<f64> {
    [gradient.colors(mesh), gradient.surface_texels(mesh)].concat()
}

fn screen(archive: &Archive, job: &Job, gradient: &Parameters) -> Result<Vec<Entry>> {
    let mut arrays = Vec::new();
    if let Some(shape) = shape(archive, "face_vertices")? {
        arrays.push(("grad_face_vertices", shape, each(job, |mesh| gradient.positions(mesh).to_vec())));
    }
    if let Some(shape) = shape(archive, "textures")? {
        arrays.push(("grad_textures", shape, each(job, |mesh| colors(gradient, mesh))));
    }
    Ok(arrays)
}

fn world(archive: &Archive, job: &Job, gradient: &Parameters) -> Result<Vec<Entry>> {
    let mut arrays = Vec::new();
    if let Some(shape) = shape(archive, "vertices")? {
        arrays.push(("grad_vertices", shape, each(job, |mesh| gradient.positions(mesh).to_vec())));
    }
    let shape = shape(archive, "colors")?.unwrap_or_else(|| vec![3]);
    let mut values = each(job, |mesh| colors(gradient, mesh));
    if shape.len() < 3 {
        // All meshes share one array, so their gradients add up.
        values = sum(&values, shape.iter().product());
    }
    arrays.push(("grad_colors", shape, values));
    let views = job.cameras.len();
    let twists = (0..views).flat_map(|view| gradient.twist(view).to_vec()).collect();
    arrays.push(("grad_view", vec![views, 6], twists));
    let numbers = gradient.projection(0).len();
    let projections = (0..views).flat_map(|view| gradient.projection(view).to_vec()).collect();
    arrays.push(("grad_projection", vec![views, numbers], projections));
    arrays.extend(lights(job.scene.lights.directional.len(), gradient));
    arrays.push(("grad_background_color", vec![3], gradient.background().to_vec()));
    arrays.push(("grad_sigma", vec![], vec![gradient.sigma()]));
    arrays.push(("grad_gamma", vec![], vec![gradient.gamma()]));
    arrays.push(("grad_epsilon", vec![], vec![gradient.epsilon()]));
    Ok(arrays)
}

fn lights(count: usize, gradient: &Parameters) -> [Entry; 5] {
    let rows = |row: &dyn Fn(usize) -> Vec<f64>| (0..count).flat_map(row).collect::<Vec<f64>>();
    [
        ("grad_ambient_color", vec![3], gradient.ambient_color().to_vec()),
        ("grad_ambient_intensity", vec![], vec![gradient.ambient_intensity()]),
        ("grad_light_directions", vec![count, 3], rows(&|light| gradient.light_direction(light).to_vec())),
        ("grad_light_colors", vec![count, 3], rows(&|light| gradient.light_color(light).to_vec())),
        ("grad_light_intensities", vec![count], rows(&|light| vec![gradient.light_intensity(light)])),
    ]
}

/// The sum of all chunks of `size` values.
fn sum(values: &[f64], size: usize) -> Vec<f64> {
    let mut total = vec![0.0; size];
    for chunk in values.chunks(size.max(1)) {
        total.iter_mut().zip(chunk).for_each(|(total, value)| *total += value);
    }
    total
}
