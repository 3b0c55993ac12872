//! Compares a mesh's colours with those of the views: their error, and the one colour that fits best.

use super::subject::{Subject, samples};
use crate::{finer, optimize::shape::reached, pooled, sized};
use softras::{
    Mesh, Renderer, Result, Scene, Settings, parts,
    scene::{Appearance, Background, Outputs},
};

/// The mean absolute difference between the colours that a mesh shows under the lights of the fit and those of the views, linear
/// and from 0 to 1, over the pixels of some views that the object covers by more than half; `None` where no colours are fitted.
pub fn color_error(
    mesh: &Mesh,
    settings: &Settings,
    subject: &Subject,
    views: &[usize],
    renderer: &mut Renderer,
) -> Result<Option<f64>> {
    let views = subject.views.some(views);
    let (Some(color), Some(silhouette)) = (&views.color, &views.silhouette) else { return Ok(None) };
    let samples = samples((color.height, color.width));
    let settings = Settings {
        sigma: 1e-7,
        gamma: 1e-5,
        outputs: Outputs { color: true, ..Outputs::NOTHING },
        ..sized(settings, (color.height, color.width), samples)
    };
    let scene = Scene::new(mesh.clone()).with_lights(subject.lights.clone());
    let (mut sum, mut count) = (0.0, 0usize);
    let cameras = finer(&views.cameras, samples)?;
    parts::in_batches(renderer, &scene, &cameras, &settings, |range, frame| {
        let shown = pooled(frame.color()?, samples)?;
        let (color, silhouette) = (reached(&color.views(range.clone()), &shown), silhouette.views(range));
        let pixels = shown.data.chunks_exact(3).zip(color.data.chunks_exact(3)).zip(&silhouette.data);
        for ((shown, wanted), _) in pixels.filter(|(_, inside)| **inside > 0.5) {
            sum += shown.iter().zip(wanted).map(|(a, b)| f64::from((a - b).abs())).sum::<f64>();
            count += 3;
        }
        Ok(())
    })?;
    Ok((count > 0).then(|| sum / count as f64))
}

/// The one colour with which a mesh under the lights looks most like the targets, by least squares over the object's pixels. The
/// mesh may be a rough one, such as a sphere, if on average it is as much lit as the object.
pub fn color_under_light(mesh: &Mesh, subject: &Subject, renderer: &mut Renderer) -> Result<[f32; 3]> {
    let targets = &subject.views;
    let (Some(color), Some(silhouette)) = (&targets.color, &targets.silhouette) else { return Ok([0.8; 3]) };
    let settings = Settings {
        near: subject.depths.0,
        far: subject.depths.1,
        background: Background::Composite,
        ..sized(&Settings::default(), targets.size()?, 1)
    };
    let white = mesh.clone().with_appearance(Appearance::Uniform([1.0; 3]))?;
    let scene = Scene::new(white).with_lights(subject.lights.clone());
    let (mut by_light, mut of_light) = ([0.0; 3], [0.0; 3]);
    parts::in_batches(renderer, &scene, &targets.cameras, &settings, |range, frame| {
        let (light, alpha) = (frame.color()?, frame.silhouette()?);
        let targets = range.flat_map(|view| color.view(view).chunks_exact(3).zip(silhouette.view(view)));
        let lights = light.data.chunks_exact(3).zip(&alpha.data);
        for ((target, inside), (light, covered)) in targets.zip(lights) {
            if *inside > 0.99 && *covered > 0.99 {
                for k in 0..3 {
                    by_light[k] += f64::from(target[k]) * f64::from(light[k]);
                    of_light[k] += f64::from(light[k]).powi(2);
                }
            }
        }
        Ok(())
    })?;
    Ok([0, 1, 2].map(|k| if of_light[k] > 0.0 { (by_light[k] / of_light[k]).clamp(0.0, 1.0) as f32 } else { 0.8 }))
}
