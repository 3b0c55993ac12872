//! The error of a mesh's colours.

use crate::{pooled, setup::Setup, subject::Subject};
use softras::{Mesh, Renderer, Result, Scene, Settings, parts, scene::Outputs};

/// Samples along each side of a pixel.
const SAMPLES: usize = 3;

/// The mean absolute difference between the colours that a mesh shows under the lights of the fit and those of the views, linear
/// and from 0 to 1, over the pixels that the object covers by more than half; `None` where no colours are fitted.
pub fn color_error(mesh: &Mesh, setup: &Setup, subject: &Subject, renderer: &mut Renderer) -> Result<Option<f64>> {
    let (Some(color), Some(silhouette)) = (&subject.views.color, &subject.views.silhouette) else { return Ok(None) };
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
    parts::in_batches(renderer, &scene, &subject.views.cameras, &settings, |range, frame| {
        let shown = pooled(frame.color()?, SAMPLES)?;
        let (color, silhouette) = (color.views(range.clone()), silhouette.views(range));
        let pixels = shown.data.chunks_exact(3).zip(color.data.chunks_exact(3)).zip(&silhouette.data);
        for ((shown, wanted), _) in pixels.filter(|(_, inside)| **inside > 0.5) {
            sum += shown.iter().zip(wanted).map(|(a, b)| f64::from((a - b).abs())).sum::<f64>();
            count += 3;
        }
        Ok(())
    })?;
    Ok((count > 0).then(|| sum / count as f64))
}
