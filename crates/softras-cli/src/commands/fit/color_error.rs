//! The error of a mesh's colours.

use super::setup::Setup;
use super::targets::{self, Views};
use softras::parts;
use softras::scene::Outputs;
use softras::{Mesh, Renderer, Result, Scene, Settings};
use softras_fit::pooled;

/// Samples along each side of a pixel.
const SAMPLES: usize = 3;

/// The mean absolute difference between the colours that a mesh shows under the lights of the fit and those of the views, linear
/// and from 0 to 1, over the pixels that the object covers by more than half; `None` where no colours are fitted.
pub fn color_error(mesh: &Mesh, setup: &Setup, views: &Views, renderer: &mut Renderer) -> Result<Option<f64>> {
    let (Some(color), Some(silhouette)) = (&views.targets.color, &views.targets.silhouette) else { return Ok(None) };
    let samples = SAMPLES as u32;
    let settings = Settings {
        width: color.width as u32 * samples,
        height: color.height as u32 * samples,
        sigma: 1e-7,
        gamma: 1e-5,
        outputs: Outputs { color: true, silhouette: false, depth: false, normal: false },
        ..setup.settings(setup.iterations)
    };
    let scene = Scene::new(mesh.clone()).with_lights(setup.lights.clone());
    let (mut sum, mut count) = (0.0, 0usize);
    parts::in_batches(renderer, &scene, &views.targets.cameras, &settings, |range, frame| {
        let Some(shown) = frame.color() else { return Ok(()) };
        let shown = pooled(shown, SAMPLES)?;
        let (color, silhouette) = (targets::some(color, range.clone()), targets::some(silhouette, range));
        let pixels = shown.data.chunks_exact(3).zip(color.data.chunks_exact(3)).zip(&silhouette.data);
        for ((shown, wanted), _) in pixels.filter(|(_, inside)| **inside > 0.5) {
            sum += shown.iter().zip(wanted).map(|(a, b)| f64::from((a - b).abs())).sum::<f64>();
            count += 3;
        }
        Ok(())
    })?;
    Ok((count > 0).then(|| sum / count as f64))
}
