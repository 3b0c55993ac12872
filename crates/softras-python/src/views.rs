//! Views of an object, and fits to them as `softras fit` does them.

use crate::arrays::{image, image_array};
use crate::camera::Camera;
use crate::exceptions::Raise;
use crate::fit::{LOSSES, report};
use crate::mesh::Mesh;
use crate::renderer::{Renderer, cameras};
use crate::settings::chosen;
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use softras::scene::Faces;
use softras_fit::{Event, Fit, FitOptions, Preset, Scores, Stage, Template};
use softras_io::{Budget, Views, ViewsOptions};
use std::ops::ControlFlow;
use std::path::PathBuf;

/// Cameras; silhouettes, colours, depths and normals; and the reader's notes.
type Arrays = (Vec<Camera>, [Option<Py<PyAny>>; 4], Vec<String>);

/// Reads pictures with their cameras; see `softras.load_views`.
#[pyfunction]
#[pyo3(signature = (path, *, cameras, masks, fov, depths, depth_unit, normals, allow_outside))]
#[allow(clippy::too_many_arguments)]
pub fn load_views(
    py: Python<'_>,
    path: PathBuf,
    cameras: Option<PathBuf>,
    masks: Option<PathBuf>,
    fov: f64,
    depths: Option<PathBuf>,
    depth_unit: f64,
    normals: Option<PathBuf>,
    allow_outside: bool,
) -> PyResult<Arrays> {
    let options =
        ViewsOptions { cameras, masks, fov, depths, depth_unit, normals, allow_outside, ..ViewsOptions::default() };
    let (views, _, notes) = py.detach(|| Views::open_with(&path, &options, &Budget::new(None))).raise()?;
    let array = |image: Option<softras::Image>| image.map(|image| image_array(py, image)).transpose();
    let images = [array(views.silhouette)?, array(views.color)?, array(views.depth)?, array(views.normal)?];
    Ok((views.cameras.into_iter().map(|camera| Camera { camera }).collect(), images, notes))
}

/// The arguments of a fit to views, all of which `softras.Views.fit` gives.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct FitArguments<'py> {
    cameras: Bound<'py, PyAny>,
    silhouette: Option<Bound<'py, PyAny>>,
    color: Option<Bound<'py, PyAny>>,
    depth: Option<Bound<'py, PyAny>>,
    normal: Option<Bound<'py, PyAny>>,
    fit_colors: bool,
    texture: Option<u32>,
    template: Option<Mesh>,
    begin: String,
    method: String,
    steps: Option<usize>,
    rate: Option<(f64, f64)>,
    sigma: Option<(f64, f64)>,
    gamma: Option<(f64, f64)>,
    loss: String,
    masks: bool,
    front_faces: bool,
    samples: usize,
    views_per_step: usize,
    smoothing: Option<f64>,
    keep_topology: bool,
    keep_views: bool,
    keep_cameras: bool,
    keep_exposure: bool,
    crop: usize,
    hold_out: Option<usize>,
    edge: Option<(f64, f64)>,
    report: Option<PathBuf>,
}

impl FitArguments<'_> {
    fn views(&self) -> PyResult<Views> {
        let array = |value: &Option<Bound<'_, PyAny>>, name: &str, channels: usize, means: &str| {
            value.as_ref().map(|value| image(value, name, channels, means)).transpose()
        };
        Ok(Views {
            cameras: cameras(&self.cameras)?,
            silhouette: array(&self.silhouette, "silhouette", 1, "mask")?,
            color: array(&self.color, "color", 3, "picture")?,
            depth: array(&self.depth, "depth", 1, "place")?,
            normal: array(&self.normal, "normal", 3, "place")?,
            ..Views::default()
        })
    }

    fn options(&self) -> PyResult<FitOptions> {
        let begins = [("auto", Template::Auto), ("hull", Template::Hull), ("sphere", Template::Sphere)];
        let begin = chosen("begin", &self.begin, &begins)?;
        let own = self.template.as_ref().map(|mesh| Template::Mesh(Box::new(mesh.mesh.clone())));
        Ok(FitOptions {
            template: own.unwrap_or(begin),
            color: self.fit_colors,
            texture: self.texture,
            preset: chosen(
                "method",
                &self.method,
                &[("smooth", Preset::Smooth), ("quick", Preset::Quick), ("official", Preset::Official)],
            )?,
            iterations: self.steps,
            rate: self.rate,
            sigma: self.sigma,
            gamma: self.gamma,
            loss: chosen("loss", &self.loss, &LOSSES)?,
            masks: self.masks,
            faces: if self.front_faces { Faces::Front } else { Faces::Both },
            samples: self.samples,
            views_per_step: self.views_per_step,
            smoothing: self.smoothing,
            keep_topology: self.keep_topology,
            keep_views: self.keep_views,
            keep_cameras: self.keep_cameras,
            keep_exposure: self.keep_exposure,
            crop: self.crop,
            hold_out: self.hold_out,
            edge: self.edge,
            ..FitOptions::default()
        })
    }
}

fn measures(py: Python<'_>, scores: &Scores) -> PyResult<Py<PyDict>> {
    let report = PyDict::new(py);
    report.set_item("mask_iou", PyArray1::from_slice(py, &scores.masks))?;
    report.set_item("covered_mask_iou", PyArray1::from_slice(py, &scores.covered))?;
    report.set_item("soft_iou", scores.soft)?;
    report.set_item("parts", scores.parts)?;
    report.set_item("genus", scores.genus)?;
    report.set_item("color_error", scores.color)?;
    report.set_item("held_out", PyArray1::from_iter(py, scores.held_out.iter().map(|&view| view as i64)))?;
    report.set_item("held_out_mask_iou", scores.held_out_mask_iou())?;
    report.set_item("held_out_color_error", scores.color_held_out)?;
    Ok(report.unbind())
}

/// Who hears what a fit tells, while it works without the interpreter's lock.
struct Ear {
    progress: Option<Py<PyAny>>,
    /// The exception that ends the fit: of Ctrl-C, or of `progress`.
    failed: Option<PyErr>,
}

impl Ear {
    fn hear(&mut self, event: Event<'_>) -> ControlFlow<()> {
        match Python::attach(|py| self.call(py, event)) {
            Ok(()) => ControlFlow::Continue(()),
            Err(error) => {
                self.failed = Some(error);
                ControlFlow::Break(())
            }
        }
    }

    fn call(&self, py: Python<'_>, event: Event<'_>) -> PyResult<()> {
        py.check_signals()?;
        let Some(progress) = self.progress.as_ref().map(|progress| progress.bind(py)) else { return Ok(()) };
        match event {
            Event::Plan(text) | Event::Note(text) if progress.hasattr("note")? => {
                progress.call_method1("note", (text,))?
            }
            Event::Progress(at) => match (at.stage, at.loss) {
                (Stage::Shape, Some(loss)) => progress.call1((at.taken, loss))?,
                (Stage::Shape | Stage::Texture | Stage::Scores, _) => return Ok(()),
                _ => progress.call1((0, f64::NAN))?,
            },
            _ => return Ok(()),
        };
        Ok(())
    }
}

/// The mesh, the losses, the measures and the notes.
type FittedViews = (Mesh, Py<PyDict>, Py<PyDict>, Vec<String>);

#[pyfunction]
pub fn fit_views<'py>(
    py: Python<'py>,
    renderer: &Renderer,
    plan: FitArguments<'py>,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<FittedViews> {
    let fit = Fit::new(plan.views()?).raise()?.options(plan.options()?);
    let (shared, page) = (&renderer.shared, plan.report);
    let mut ear = Ear { progress: progress.map(Bound::unbind), failed: None };
    let fitted = shared.call(py, |renderer| fit.run(renderer, |event| ear.hear(event)));
    if let Some(error) = ear.failed {
        return Err(error);
    }
    let fitted = fitted?;
    if let Some(path) = &page {
        let page = shared.call(py, |renderer| fitted.report("A fit", renderer))?;
        py.detach(|| softras_io::output::write_file(path, page.as_bytes())).raise()?;
    }
    let losses = report(py, fitted.steps.iter().map(|taken| &taken.losses))?;
    Ok((fitted.mesh.into(), losses, measures(py, &fitted.scores)?, fitted.notes))
}
