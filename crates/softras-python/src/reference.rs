//! The f64 reference: images and gradients on the host, at inputs in double precision.

use crate::arrays::{array, doubles, shaped};
use crate::exceptions::{Raise, bad_input};
use crate::gradients::{self, Gradients, IMAGES, MeshGradients};
use crate::renderer::Inputs;
use crate::settings::gradient_mode;
use numpy::{PyArray1, PyArrayMethods};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use softras::scene::Appearance;
use softras::{Lights, Mesh};
use softras_fit::on_all_cores;
use softras_reference::render_at;
use softras_reference::{Parameters, Upstream};

/// Where the arrays of a mesh begin among the parameters, whose order is that of [`Parameters::values`].
fn starts(parameters: &Parameters, inputs: &Inputs) -> Vec<(usize, usize)> {
    let mut at = 0;
    let textures = |mesh: &Mesh| match mesh.appearance() {
        Appearance::Textured { textures, .. } => textures.len(),
        _ => 0,
    };
    let one = |(i, mesh): (usize, &Mesh)| {
        let positions = parameters.positions(i).len();
        let found = (at, at + positions);
        let texels: usize = (0..textures(mesh))
            .map(|t| parameters.texture_texels(i, t).len() + parameters.texture_alpha(i, t).len())
            .sum();
        at += positions + parameters.colors(i).len() + parameters.surface_texels(i).len() + parameters.uvs(i).len();
        at += texels;
        found
    };
    inputs.scene.meshes.iter().enumerate().map(one).collect()
}

/// Replaces an array of the parameters by values in double precision.
fn replace(
    values: &mut [f64],
    start: usize,
    count: usize,
    by: &Bound<'_, PyAny>,
    [name, means]: [&str; 2],
) -> PyResult<()> {
    let array = doubles(by, name, means)?;
    let given = array.as_slice()?;
    if given.len() != count {
        let what = format!("{name} has {} values, the mesh {count}", given.len());
        return Err(bad_input(what, "give one for each of the mesh's"));
    }
    values[start..start + count].copy_from_slice(given);
    Ok(())
}

/// The parameters of a scene, with positions and colours in double precision where they are given.
fn parameters<'py>(
    inputs: &Inputs,
    positions: Option<&Bound<'py, PyAny>>,
    colors: Option<&Bound<'py, PyAny>>,
) -> PyResult<Parameters> {
    let mut all = Parameters::new(&inputs.scene, &inputs.cameras, &inputs.settings);
    let starts = starts(&all, inputs);
    let each = |given: Option<&Bound<'py, PyAny>>| -> PyResult<Vec<Bound<'py, PyAny>>> {
        given.map_or(Ok(Vec::new()), |given| given.try_iter()?.collect())
    };
    let (positions, colors) = (each(positions)?, each(colors)?);
    for (i, (at_positions, at_colors)) in starts.into_iter().enumerate() {
        let counts = [all.positions(i).len(), all.colors(i).len()];
        if let Some(given) = positions.get(i) {
            replace(all.values_mut(), at_positions, counts[0], given, ["positions", "place"])?;
        }
        if let Some(given) = colors.get(i) {
            replace(all.values_mut(), at_colors, counts[1], given, ["colors", "light"])?;
        }
    }
    Ok(all)
}

#[pyfunction]
#[pyo3(signature = (meshes, cameras, settings = None, lights = None, *, positions = None, colors = None))]
pub fn reference_render<'py>(
    py: Python<'py>,
    meshes: &Bound<'py, PyAny>,
    cameras: &Bound<'py, PyAny>,
    settings: Option<&Bound<'py, PyAny>>,
    lights: Option<&Bound<'py, PyAny>>,
    positions: Option<&Bound<'py, PyAny>>,
    colors: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let inputs = Inputs::new(meshes, cameras, settings, lights)?;
    let at = parameters(&inputs, positions, colors)?;
    let Inputs { scene, cameras, settings } = &inputs;
    let frame = py.detach(|| on_all_cores(|| render_at(scene, cameras, settings, &at))).raise()?;
    let images = PyDict::new(py);
    let sides = [frame.batch, frame.height, frame.width];
    let all = [frame.color, frame.silhouette, frame.depth, frame.normal];
    for ((name, channels), data) in IMAGES.into_iter().zip(all) {
        if let Some(channels) = channels.filter(|_| !data.is_empty()) {
            images.set_item(name, shaped(py, data, sides, channels)?)?;
        }
    }
    Ok(images)
}

/// The strongest triangles of each pixel, [views, height, width, count] int32, -1 behind the last.
#[pyfunction]
pub fn strongest<'py>(
    py: Python<'py>,
    meshes: &Bound<'py, PyAny>,
    cameras: &Bound<'py, PyAny>,
    settings: Option<&Bound<'py, PyAny>>,
    count: usize,
) -> PyResult<Bound<'py, PyAny>> {
    let Inputs { scene, cameras, settings } = Inputs::new(meshes, cameras, settings, None)?;
    let found =
        py.detach(|| on_all_cores(|| softras_reference::strongest(&scene, &cameras, &settings, count))).raise()?;
    let numbers = found.into_iter().map(|triangle| triangle.map_or(-1, |triangle| triangle as i32)).collect();
    let shape = [cameras.len(), settings.height as usize, settings.width as usize, count];
    Ok(PyArray1::<i32>::from_vec(py, numbers).reshape(shape)?.into_any())
}

/// A flat array in some shape; `None` for an empty one.
fn flat(py: Python<'_>, values: &[f64], shape: &[usize]) -> PyResult<Option<Py<PyAny>>> {
    if values.is_empty() {
        return Ok(None);
    }
    PyArray1::from_slice(py, values).reshape(shape.to_vec())?.into_py_any(py).map(Some)
}

fn mesh_gradients(py: Python<'_>, found: &Parameters, i: usize, mesh: &Mesh) -> PyResult<MeshGradients> {
    let (mut textures, mut alphas, mut cells) = (Vec::new(), Vec::new(), 0);
    match mesh.appearance() {
        Appearance::Textured { textures: images, .. } => {
            for (t, image) in images.iter().enumerate() {
                let (height, width) = (image.height() as usize, image.width() as usize);
                textures.extend(flat(py, found.texture_texels(i, t), &[height, width, 3])?);
                alphas.push(flat(py, found.texture_alpha(i, t), &[height, width])?);
            }
        }
        Appearance::Surface { resolution, .. } => cells = (*resolution as usize).pow(2),
        _ => {}
    }
    let colors = found.colors(i);
    let colors = match mesh.appearance() {
        Appearance::Uniform(_) => flat(py, colors, &[3])?,
        _ => flat(py, colors, &[colors.len() / 3, 3])?,
    };
    Ok(MeshGradients {
        positions: flat(py, found.positions(i), &[mesh.positions().len(), 3])?,
        colors,
        features: None,
        surface: flat(py, found.surface_texels(i), &[mesh.triangles().len(), cells, 3])?,
        textures: Some(textures).filter(|all| !all.is_empty()),
        alphas: Some(alphas).filter(|all| all.iter().any(Option::is_some)),
        uvs: flat(py, found.uvs(i), &[found.uvs(i).len() / 2, 2])?,
    })
}

/// The gradients by the lights: directions, colours, intensities.
type LightArrays = (Py<PyAny>, Py<PyAny>, Py<PyAny>);

fn light_gradients(py: Python<'_>, found: &Parameters, lights: &Lights) -> PyResult<LightArrays> {
    let count = 0..lights.directional.len();
    let row = |values: &[f64]| [values[0], values[1], values[2]];
    let directions = count.clone().map(|i| row(found.light_direction(i))).collect();
    let colors = count.clone().map(|i| row(found.light_color(i))).collect();
    let intensities: Vec<f64> = count.map(|i| found.light_intensity(i)).collect();
    Ok((
        array(py, directions)?.into_py_any(py)?,
        array(py, colors)?.into_py_any(py)?,
        PyArray1::from_vec(py, intensities).into_py_any(py)?,
    ))
}

#[pyfunction]
#[pyo3(signature = (meshes, cameras, settings = None, lights = None, *, mode = "exact", **upstream))]
pub fn reference_gradient<'py>(
    py: Python<'py>,
    meshes: &Bound<'py, PyAny>,
    cameras: &Bound<'py, PyAny>,
    settings: Option<&Bound<'py, PyAny>>,
    lights: Option<&Bound<'py, PyAny>>,
    mode: &str,
    upstream: Option<&Bound<'py, PyDict>>,
) -> PyResult<Gradients> {
    let inputs = Inputs::new(meshes, cameras, settings, lights)?;
    let read = |value: &Bound<'_, PyAny>, name: &str, _| Ok(doubles(value, name, "number")?.as_slice()?.to_vec());
    let [d_color, d_silhouette, d_depth, d_normal, features] = gradients::upstream(upstream, read)?;
    if features.is_some() {
        return Err(bad_input(
            "an upstream gradient of features",
            "give the reference three of them at a time as colours",
        ));
    }
    let upstream = Upstream { d_color, d_silhouette, d_depth, d_normal };
    let mode = gradient_mode(mode)?;
    let Inputs { scene, cameras, settings } = &inputs;
    let found = py
        .detach(|| on_all_cores(|| softras_reference::gradient(scene, cameras, settings, &upstream, mode)))
        .raise()?;
    let one = |(i, mesh)| Py::new(py, mesh_gradients(py, &found, i, mesh)?);
    let meshes = scene.meshes.iter().enumerate().map(one).collect::<PyResult<_>>()?;
    let twist = |view| <[f64; 6]>::try_from(found.twist(view)).unwrap_or_default();
    let projection = |view| {
        let mut all = [0.0; 4];
        all.iter_mut().zip(found.projection(view)).for_each(|(to, from)| *to = *from);
        all
    };
    let views = 0..cameras.len();
    let (directions, colors, intensities) = light_gradients(py, &found, &scene.lights)?;
    Ok(Gradients {
        meshes,
        twists: Some(array(py, views.clone().map(twist).collect())?.into_py_any(py)?),
        projections: Some(array(py, views.map(projection).collect())?.into_py_any(py)?),
        ambient_color: flat(py, found.ambient_color(), &[3])?,
        ambient_intensity: Some(found.ambient_intensity()),
        light_directions: Some(directions),
        light_colors: Some(colors),
        light_intensities: Some(intensities),
        background: flat(py, found.background(), &[3])?,
        epsilon: Some(found.epsilon()),
        sigma: Some(found.sigma()),
        gamma: Some(found.gamma()),
    })
}
