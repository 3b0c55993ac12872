//! Frames: the images of a batch, and their gradients.

use crate::arrays::{feature_array, image, image_array};
use crate::exceptions::exception;
use crate::gradients::{self, Gradients, Shapes};
use crate::opened::Opened;
use crate::settings::wanted;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyDict;
use softras::{GradientRequest, Image, ImageGradient, Scene};
use std::sync::Arc;

/// A rendered batch, with the renderer that made it.
#[pyclass(module = "softras", frozen)]
pub struct Frame {
    frame: softras::Frame,
    shared: Arc<Opened>,
    shapes: Vec<Shapes>,
    saved: bool,
    arrays: [PyOnceLock<Py<PyAny>>; 5],
}

impl Frame {
    pub fn new(frame: softras::Frame, shared: Arc<Opened>, scene: &Scene, saved: bool) -> Self {
        let shapes = if saved { scene.meshes.iter().map(Shapes::of).collect() } else { Vec::new() };
        Self { frame, shared, shapes, saved, arrays: [const { PyOnceLock::new() }; 5] }
    }

    /// The image at one of the places of `images`, as an array that is made once.
    fn array(&self, py: Python<'_>, at: usize) -> PyResult<Option<Py<PyAny>>> {
        let Some(image) = self.images()[at].1 else { return Ok(None) };
        // An image of one channel has no last dimension, but for features.
        let make = || if at == 4 { feature_array(py, image) } else { image_array(py, image) };
        self.arrays[at].get_or_try_init(py, make).map(|array| Some(array.clone_ref(py)))
    }

    fn images(&self) -> [(&'static str, Option<&Image>); 5] {
        let frame = &self.frame;
        [
            ("color", frame.color().ok()),
            ("silhouette", frame.silhouette().ok()),
            ("depth", frame.depth().ok()),
            ("normal", frame.normal().ok()),
            ("features", frame.features().ok()),
        ]
    }
}

#[pymethods]
impl Frame {
    /// [views, height, width, 3] float32, linear, row 0 at the top; None unless asked for.
    #[getter]
    fn color(&self, py: Python<'_>) -> PyResult<Option<Py<PyAny>>> {
        self.array(py, 0)
    }

    /// [views, height, width] float32 in [0, 1]; None unless asked for.
    #[getter]
    fn silhouette(&self, py: Python<'_>) -> PyResult<Option<Py<PyAny>>> {
        self.array(py, 1)
    }

    /// [views, height, width] float32, Σ w z in world units, 0 where no triangle contributes; None unless asked for.
    #[getter]
    fn depth(&self, py: Python<'_>) -> PyResult<Option<Py<PyAny>>> {
        self.array(py, 2)
    }

    /// [views, height, width, 3] float32, Σ w n in world space; None unless asked for.
    #[getter]
    fn normal(&self, py: Python<'_>) -> PyResult<Option<Py<PyAny>>> {
        self.array(py, 3)
    }

    /// [views, height, width, N] float32, Σ w f of the meshes' features (`Mesh.with_features`); None unless asked for.
    #[getter]
    fn features(&self, py: Python<'_>) -> PyResult<Option<Py<PyAny>>> {
        self.array(py, 4)
    }

    /// The gradients of a loss L from dL/dimage of at least one image, each of the image's shape.
    ///
    /// `by` names what to differentiate by: "positions" (the default), "colors", "features", "texels" (surface cells and textures),
    /// "uvs", "cameras", "lights", "background", "scalars" (sigma and gamma). `mode` is "exact", or "paper" for eq. 4 of
    /// the paper alone. A frame can be differentiated any number of times. Raises BackwardError, NotFiniteError.
    #[pyo3(signature = (*, by = None, mode = "exact", **upstream))]
    fn backward(
        &self,
        py: Python<'_>,
        by: Option<&Bound<'_, PyAny>>,
        mode: &str,
        upstream: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Gradients> {
        if !self.saved {
            let text = "backward: the frame was rendered for looking at only: render it with save=True";
            return Err(exception("BackwardError", text));
        }
        let given = self.frame.features().map_or(0, |features| features.channels);
        if given == 0 && upstream.is_some_and(|upstream| upstream.contains("features").unwrap_or(false)) {
            let text = "backward: the frame has no features image: ask for it in Settings.outputs";
            return Err(exception("BackwardError", text));
        }
        let [color, silhouette, depth, normal, features] = gradients::upstream(upstream, |value, name, channels| {
            image(value, name, channels.unwrap_or(given), "number")
        })?;
        let upstream = ImageGradient { color, silhouette, depth, normal, features };
        let wanted = match by {
            Some(by) => wanted(by, mode)?,
            None => GradientRequest { mode: crate::settings::gradient_mode(mode)?, ..GradientRequest::default() },
        };
        let found = self.shared.call(py, |renderer| renderer.backward(&self.frame, &upstream, &wanted))?;
        Gradients::new(py, found, &self.shapes, &wanted)
    }

    fn __repr__(&self) -> String {
        let rendered = self.images().into_iter().filter_map(|(name, image)| image.map(|image| (name, image)));
        let names: Vec<_> = rendered.clone().map(|(name, _)| name).collect();
        let size = rendered.map(|(_, i)| format!("{} views of {}×{}", i.batch, i.width, i.height)).next();
        let saved = if self.saved { ", saved" } else { "" };
        format!("softras.Frame({}: {}{saved})", size.unwrap_or_default(), names.join(", "))
    }
}
