//! Measures of meshes and masks, and the tools around fits.

use crate::arrays::{self, image, image_array};
use crate::exceptions::{Raise, bad_input, exception};
use crate::mesh::Mesh;
use crate::renderer::Renderer;
use crate::settings::chosen;
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use softras::glam::DVec3;
use softras::{Scene, Settings};
use softras_check::check::{CheckCase, cases, compare};
use softras_fit::{Regularizer, Topology, Voxels, on_all_cores};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// The volume of the intersection of two solids over that of their union, counted in resolution³ voxels around both.
#[pyfunction]
#[pyo3(signature = (a, b, resolution = 64))]
pub fn iou(py: Python<'_>, a: &Mesh, b: &Mesh, resolution: usize) -> PyResult<f64> {
    py.detach(|| softras_fit::voxel_iou(&a.mesh, &b.mesh, resolution)).raise()
}

/// The intersection over union of each view's masks, the pixels above 1/2: [views] float64. Raises FitError.
#[pyfunction]
pub fn mask_iou<'py>(
    prediction: &Bound<'py, PyAny>,
    target: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let py = prediction.py();
    let (prediction, target) = (image(prediction, "prediction", 1, "mask")?, image(target, "target", 1, "mask")?);
    let found = py.detach(|| softras_fit::mask_iou(&prediction, &target)).raise()?;
    Ok(PyArray1::from_vec(py, found))
}

/// The soft silhouette at sigma of a surface with the outline of a mask [views, height, width].
///
/// `sheets` is the number of triangles at each point of the outline: 2 for a closed surface. Raises FitError.
#[pyfunction]
#[pyo3(signature = (mask, sigma, sheets = 2.0))]
pub fn blurred_mask(mask: &Bound<'_, PyAny>, sigma: f64, sheets: f64) -> PyResult<Py<PyAny>> {
    let py = mask.py();
    let mask = image(mask, "mask", 1, "mask")?;
    let soft = py.detach(|| softras_fit::soft_target(&mask, sigma, sheets)).raise()?;
    image_array(py, soft)
}

/// The mesh with triangles of about the given edge length; vertices come in a new order. Raises FitError.
#[pyfunction]
pub fn remesh(py: Python<'_>, mesh: &Mesh, edge_length: f64) -> PyResult<Mesh> {
    let (mesh, stopped) = (mesh.mesh.clone(), Arc::new(AtomicBool::new(false)));
    let seen = stopped.clone();
    let goes_on = move || !seen.load(Ordering::Relaxed);
    let work = std::thread::spawn(move || softras_fit::remeshed_while(&mesh, edge_length..=edge_length, &goes_on));
    while !work.is_finished() {
        // After Ctrl-C the thread ends by itself, with its step.
        py.check_signals().inspect_err(|_| stopped.store(true, Ordering::Relaxed))?;
        py.detach(|| std::thread::sleep(Duration::from_millis(2)));
    }
    let found = work.join().map_err(|_| exception("Error", "the mesh cannot be remeshed: report it with the mesh"))?;
    found.raise().map(Mesh::from)
}

/// A regularizer's penalty of positions [V, 3], and its gradient.
#[pyfunction]
pub fn regularizer<'py>(
    name: &str,
    triangles: &Bound<'py, PyAny>,
    positions: &Bound<'py, PyAny>,
) -> PyResult<(f64, Bound<'py, PyArray2<f64>>)> {
    let known = [("normals", Regularizer::NormalConsistency), ("flatten", Regularizer::Flatten)];
    let penalty = chosen("regularizer", name, &known)?;
    let array = arrays::doubles(positions, "vertices", "place")?;
    let points: Vec<DVec3> = array.as_slice()?.as_chunks::<3>().0.iter().copied().map(DVec3::from).collect();
    if !points.iter().all(|p| p.is_finite()) {
        return Err(bad_input("vertices that are not finite", "give finite ones"));
    }
    let topology = Topology::new(points.len(), &arrays::triangles(triangles, "faces")?).raise()?;
    let mut gradient = vec![DVec3::ZERO; points.len()];
    let value = penalty.add(&topology, &points, 1.0, &mut gradient).raise()?;
    Ok((value, arrays::array(positions.py(), gradient.iter().map(DVec3::to_array).collect())?))
}

/// A case of `softras check`: its name, the errors of images and gradients, whether it repeats to the bit, and whether it passes.
type Checked = (&'static str, [Option<f64>; 4], [Option<f64>; 8], bool, bool);

/// Compares a device with the reference on small scenes; see `softras.check`.
#[pyfunction]
pub fn check(py: Python<'_>, renderer: &Renderer) -> PyResult<Vec<Checked>> {
    let one = |case: CheckCase| {
        py.check_signals()?;
        let found = renderer.shared.call(py, |renderer| on_all_cores(|| compare(renderer, &case)))?;
        let passes = found.pass(case.gradient_tolerance);
        Ok((case.name, found.images, found.gradients, found.repeats, passes))
    };
    cases().raise()?.into_iter().map(one).collect()
}

/// Whether every edge is used by as many triangles in one direction as in the other.
#[pyfunction]
pub fn is_closed(py: Python<'_>, mesh: &Mesh) -> PyResult<bool> {
    py.detach(|| softras_fit::is_closed(&mesh.mesh)).raise()
}

/// Whether the centres of voxels are inside of the mesh: [resolution]³ bools, indexed x, y, z.
///
/// The voxels fill the cube of side `side` whose lowest corner is `low`. Raises FitError.
#[pyfunction]
#[pyo3(signature = (mesh, resolution, low, side))]
pub fn voxelize<'py>(
    py: Python<'py>,
    mesh: &Mesh,
    resolution: usize,
    low: &Bound<'_, PyAny>,
    side: f64,
) -> PyResult<Bound<'py, PyArray3<bool>>> {
    let low = arrays::vector::<3>(low, "low")?;
    let voxels = py.detach(|| Voxels::new(&mesh.mesh, low, side, resolution)).raise()?;
    let inside = PyArray1::from_slice(py, voxels.inside()).reshape([resolution; 3])?;
    // The library's x runs fastest.
    inside.permute(Some([2, 1, 0]))
}

/// The near and far that lie close around what the cameras see.
#[pyfunction]
#[pyo3(signature = (meshes, cameras, margin))]
pub fn depths_of(meshes: &Bound<'_, PyAny>, cameras: &Bound<'_, PyAny>, margin: f64) -> PyResult<(f64, f64)> {
    let scene = Scene::batch(crate::mesh::meshes(meshes)?);
    let settings = Settings::default().with_depths_of(&scene, &crate::renderer::cameras(cameras)?, margin);
    Ok((settings.near, settings.far))
}
