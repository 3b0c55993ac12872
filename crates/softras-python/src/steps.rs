//! The library's own step, to measure what Python adds to it.

use crate::exceptions::bad_input;
use crate::renderer::{Inputs, Renderer};
use pyo3::prelude::*;
use softras::{GradientRequest, ImageGradient};
use std::time::Instant;

/// Milliseconds of each of some steps that the library takes without Python: new positions, a saved frame, the frame's own
/// images as the upstream gradients, and the gradient by positions.
#[pyfunction]
pub fn time_steps(
    py: Python<'_>,
    renderer: &Renderer,
    mesh: &Bound<'_, PyAny>,
    cameras: &Bound<'_, PyAny>,
    settings: &Bound<'_, PyAny>,
    steps: usize,
) -> PyResult<Vec<f64>> {
    let Inputs { mut scene, cameras, settings } = Inputs::new(mesh, cameras, Some(settings), None)?;
    if scene.meshes.len() != 1 {
        return Err(bad_input("several meshes", "give one"));
    }
    renderer.shared.call(py, |renderer| {
        let mut times = Vec::with_capacity(steps);
        for _ in 0..steps {
            let start = Instant::now();
            let positions = scene.meshes[0].positions().to_vec();
            scene.meshes[0].set_positions(positions)?;
            let frame = renderer.render_saved(&scene, &cameras, &settings)?;
            let mut upstream = ImageGradient::default();
            (upstream.color, upstream.silhouette) = (frame.color().ok().cloned(), frame.silhouette().ok().cloned());
            renderer.backward(&frame, &upstream, &GradientRequest::default())?;
            times.push(1e3 * start.elapsed().as_secs_f64());
        }
        Ok(times)
    })
}
