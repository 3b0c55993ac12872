//! Frames: the images of a batch, and their gradients.

use crate::arrays::{feature_array, image, image_array};
use crate::exceptions::exception;
use crate::gradients::{self, Gradients, Shapes};
use crate::opened::Opened;
use crate::settings::wanted;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use softras::{GradientRequest, ImageGradient, Scene};
use std::sync::Arc;

/// A rendered batch, with the renderer that made it.
#[pyclass(module = "softras", frozen)]
pub struct Frame {
    frame: softras::Frame,
    shared: Arc<Opened>,
    shapes: Vec<Shapes>,
    saved: bool,
    images: Vec<(&'static str, Py<PyAny>)>,
    /// Views, height and width.
    sides: [usize; 3],
    /// The channels of the image of features, 0 without one.
    channels: usize,
}

impl Frame {
    pub fn new(
        py: Python<'_>,
        mut frame: softras::Frame,
        shared: Arc<Opened>,
        scene: &Scene,
        saved: bool,
    ) -> PyResult<Self> {
        let shapes = if saved { scene.meshes.iter().map(Shapes::of).collect() } else { Vec::new() };
        let channels = frame.features().map_or(0, |features| features.channels);
        let (mut images, mut sides) = (Vec::new(), [0; 3]);
        for (name, image) in frame.take_images() {
            sides = [image.batch, image.height, image.width];
            images.push((name, if name == "features" { feature_array(py, image)? } else { image_array(py, image)? }));
        }
        Ok(Self { frame, shared, shapes, saved, images, sides, channels })
    }

    fn image(&self, py: Python<'_>, name: &str) -> Option<Py<PyAny>> {
        self.images.iter().find(|(of, _)| *of == name).map(|(_, array)| array.clone_ref(py))
    }
}

#[pymethods]
impl Frame {
    /// [views, height, width, 3] float32, linear, row 0 at the top; None unless asked for.
    #[getter]
    fn color(&self, py: Python<'_>) -> Option<Py<PyAny>> {
        self.image(py, "color")
    }

    /// [views, height, width] float32 in [0, 1]; None unless asked for.
    #[getter]
    fn silhouette(&self, py: Python<'_>) -> Option<Py<PyAny>> {
        self.image(py, "silhouette")
    }

    /// [views, height, width] float32, Σ w z in world units, 0 where no triangle contributes; None unless asked for.
    #[getter]
    fn depth(&self, py: Python<'_>) -> Option<Py<PyAny>> {
        self.image(py, "depth")
    }

    /// [views, height, width, 3] float32, Σ w n in world space; None unless asked for.
    #[getter]
    fn normal(&self, py: Python<'_>) -> Option<Py<PyAny>> {
        self.image(py, "normal")
    }

    /// [views, height, width, N] float32, Σ w f of the meshes' features (`Mesh.with_features`); None unless asked for.
    #[getter]
    fn features(&self, py: Python<'_>) -> Option<Py<PyAny>> {
        self.image(py, "features")
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
        let given = self.channels;
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
        let names: Vec<_> = self.images.iter().map(|(name, _)| *name).collect();
        let [views, height, width] = self.sides;
        let saved = if self.saved { ", saved" } else { "" };
        format!("softras.Frame({views} views of {width}×{height}: {}{saved})", names.join(", "))
    }
}
