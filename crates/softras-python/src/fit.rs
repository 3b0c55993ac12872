//! Fits of a mesh's shape and colours to images.

use crate::arrays::image;
use crate::exceptions::{Raise, bad_input};
use crate::mesh::Mesh;
use crate::renderer::{Renderer, cameras};
use crate::settings::{self, chosen};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use softras::scene::{Background, Interpolation};
use softras::{Scene, Settings};
use softras_fit::{ImageLoss, Parametrization, Regularizer, Schedule, ShapeFit, ShapeOptions, ShapeRun, StepLosses};
use softras_io::Views;

/// The arguments of a fit, all of which `softras.deform` gives.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct DeformArguments<'py> {
    cameras: Bound<'py, PyAny>,
    silhouette: Option<Bound<'py, PyAny>>,
    color: Option<Bound<'py, PyAny>>,
    steps: usize,
    rate: (f64, f64),
    color_rate: (f64, f64),
    sigma: (f64, f64),
    gamma: (f64, f64),
    method: String,
    loss: String,
    smoothing: Option<f64>,
    laplacian: Option<f64>,
    flatten: Option<f64>,
    normals: Option<f64>,
    fit_colors: bool,
    fit_positions: bool,
    views_per_step: usize,
    settings: Option<Bound<'py, PyAny>>,
    lights: Option<Bound<'py, PyAny>>,
}

/// The losses of images by their names.
pub const LOSSES: [(&str, ImageLoss); 3] =
    [("iou", ImageLoss::NegativeIou), ("l1", ImageLoss::L1), ("l2", ImageLoss::L2)];

impl DeformArguments<'_> {
    fn targets(&self) -> PyResult<Views> {
        let silhouette = self.silhouette.as_ref().map(|value| image(value, "silhouette", 1, "mask")).transpose()?;
        let color = self.color.as_ref().map(|value| image(value, "color", 3, "picture")).transpose()?;
        Ok(Views { cameras: cameras(&self.cameras)?, silhouette, color, ..Views::default() })
    }

    fn options(&self) -> PyResult<ShapeOptions> {
        let official = chosen("method", &self.method, &[("smooth", false), ("official", true)])?;
        let mut options = if official { ShapeOptions::official() } else { ShapeOptions::smooth() };
        if let Some(lambda) = self.smoothing {
            options.parametrization = Parametrization::Smoothed { lambda };
        }
        let mut weights = options.regularizers.clone();
        weights.push((Regularizer::NormalConsistency, 0.0));
        let given = [self.laplacian, self.flatten, self.normals];
        weights.iter_mut().zip(given).for_each(|(weight, given)| weight.1 = given.unwrap_or(weight.1));
        options.regularizers = weights.into_iter().filter(|(_, weight)| *weight > 0.0).collect();
        options.silhouette.0 = chosen("loss", &self.loss, &LOSSES)?;
        (options.fit_colors, options.fit_positions) = (self.fit_colors, self.fit_positions);
        options.views_per_step = self.views_per_step;
        Ok(options)
    }

    /// The settings that all steps have in common, without the softness.
    fn base(&self, mesh: &softras::Mesh, targets: &Views) -> PyResult<Settings> {
        let given = settings::settings(self.settings.as_ref())?;
        if self.settings.is_some() {
            return Ok(given);
        }
        Ok(Settings {
            background: Background::Composite,
            interpolation: Interpolation::Perspective,
            ..given.with_depths_of(&Scene::new(mesh.clone()), &targets.cameras, 0.5)
        })
    }

    /// The settings of a step.
    fn at(&self, base: &Settings, step: usize) -> Settings {
        Settings {
            sigma: Schedule::from(self.sigma).at_step(step, self.steps),
            gamma: Schedule::from(self.gamma).at_step(step, self.steps),
            ..base.clone()
        }
    }
}

/// The losses of steps as one list each.
pub fn report<'a>(py: Python<'_>, steps: impl Iterator<Item = &'a StepLosses> + Clone) -> PyResult<Py<PyDict>> {
    let report = PyDict::new(py);
    let column = |value: fn(&StepLosses) -> f64| PyArray1::from_vec(py, steps.clone().map(value).collect());
    report.set_item("loss", column(|step| step.loss))?;
    report.set_item("silhouette", column(|step| step.silhouette))?;
    report.set_item("color", column(|step| step.color))?;
    Ok(report.unbind())
}

/// The best mesh, its step, the last mesh, and the losses.
type Deformed = (Mesh, usize, Mesh, Py<PyDict>);

#[pyfunction]
pub fn fit<'py>(
    py: Python<'py>,
    mesh: &Mesh,
    renderer: &Renderer,
    plan: DeformArguments<'py>,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<Deformed> {
    if plan.steps == 0 {
        return Err(bad_input("a fit of 0 steps", "take at least one"));
    }
    let (targets, lights) = (plan.targets()?, settings::lights(plan.lights.as_ref())?);
    let base = plan.base(&mesh.mesh, &targets)?;
    let shape = ShapeFit::new(mesh.mesh.clone(), lights, plan.options()?).raise()?;
    let shared = &renderer.shared;
    let mut fit = ShapeRun::new(shape, &targets);
    let mut losses: Vec<StepLosses> = Vec::with_capacity(plan.steps);
    for step in 0..plan.steps {
        let settings = plan.at(&base, step);
        let [rate, color_rate] =
            [plan.rate, plan.color_rate].map(|rate| Schedule::from(rate).at_step(step, plan.steps));
        let found = shared.call(py, |renderer| fit.step(renderer, &settings, rate, color_rate))?;
        py.check_signals()?;
        if let Some(progress) = &progress {
            progress.call1((step + 1, found.loss))?;
        }
        losses.push(found);
    }
    let last = fit.shape().mesh().clone();
    let (best, at) = fit.best().map_or_else(|| (last.clone(), plan.steps - 1), |(mesh, at)| (mesh.clone(), at));
    Ok((best.into(), at, last.into(), report(py, losses.iter())?))
}
