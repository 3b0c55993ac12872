//! Series of measurements: over τ, and over the size of one input at a time.

use super::time::times;
use super::{Mode, error, subject};
use softras::scene::{Background, Support};
use softras::{Camera, Error, Mesh, Renderer, Result, Scene, Settings, shapes};

/// The measurement at one τ.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// The threshold τ.
    pub tau: f64,
    /// Median milliseconds of a forward frame that saves nothing for backward.
    pub forward: f64,
    /// Median milliseconds of a whole frame, forward and backward.
    pub milliseconds: f64,
    /// Largest error of colour and silhouette against the untruncated model.
    pub error: f64,
}

/// Run time and error of one kind of support.
#[derive(Clone, Debug)]
pub struct Curve {
    /// `probability` or `guaranteed`.
    pub name: &'static str,
    /// In the order of τ, largest first, without those at which the kernels cannot guarantee the support.
    pub points: Vec<Point>,
}

const TAUS: [f64; 7] = [1e-1, 3e-2, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6];
/// A γ at which the support can be guaranteed in single precision, with near and far close around the mesh.
const FRONT_GAMMA: f64 = 0.02;

/// The given settings with a composite background and with near and far close around the mesh, so that D alone decides at
/// the outline and both kinds of support are possible.
pub fn front_settings(settings: &Settings) -> Settings {
    Settings {
        background: Background::Composite,
        near: subject::DISTANCE - 1.0,
        far: subject::DISTANCE + 1.0,
        gamma: FRONT_GAMMA,
        ..Mode::ColorSilhouette.of(settings)
    }
}

/// Measures time and error over τ for each kind of support.
///
/// # Errors
/// As [`Renderer::render`].
pub fn front(
    renderer: &mut Renderer,
    scene: &Scene,
    cameras: &[Camera],
    settings: &Settings,
    repeats: usize,
) -> Result<Vec<Curve>> {
    let exact = softras_reference::render_untruncated(scene, cameras, settings)?;
    let mut curves = Vec::new();
    for (support, name) in [(Support::Probability, "probability"), (Support::Guaranteed, "guaranteed")] {
        let mut points = Vec::new();
        for tau in TAUS {
            let settings = Settings { tau, support, ..settings.clone() };
            let found = match times(renderer, scene, cameras, &settings, Mode::ColorSilhouette, repeats) {
                Err(Error::Settings { field: "support", .. }) => continue,
                found => found?,
            };
            let frame = renderer.render(scene, cameras, &settings)?;
            let error = error::images(&frame, &exact, None).most;
            points.push(Point { tau, forward: found.forward, milliseconds: found.frame, error });
        }
        curves.push(Curve { name, points });
    }
    Ok(curves)
}

/// Times as one input grows.
#[derive(Clone, Debug)]
pub struct Growth {
    /// The input that grows.
    pub name: &'static str,
    /// The size of the input, and the median of a whole frame in milliseconds.
    pub points: Vec<(f64, f64)>,
}

impl Growth {
    /// The slope of the least-squares line through the logarithms of the points; NaN for fewer than two points.
    pub fn exponent(&self) -> f64 {
        let logs: Vec<(f64, f64)> = self.points.iter().map(|p| (p.0.ln(), p.1.ln())).collect();
        let n = logs.len() as f64;
        let mean = logs.iter().fold((0.0, 0.0), |m, p| (m.0 + p.0 / n, m.1 + p.1 / n));
        let (covariance, variance) =
            logs.iter().fold((0.0, 0.0), |s, p| (s.0 + (p.0 - mean.0) * (p.1 - mean.1), s.1 + (p.0 - mean.0).powi(2)));
        covariance / variance
    }
}

/// Times of whole frames of colour and silhouette as one input at a time grows from `settings`: the faces of a sphere that
/// covers the same pixels; then, for `mesh`, the pixels of the image, the pixels covered in an image of one size, σ, and the
/// views of one frame. With `full` the series reach a million faces and 2048² pixels.
///
/// # Errors
/// As [`Renderer::render`].
pub fn growth(
    renderer: &mut Renderer,
    mesh: &Mesh,
    settings: &Settings,
    repeats: usize,
    full: bool,
) -> Result<Vec<Growth>> {
    let scene = subject::scene(mesh)?;
    let mode = Mode::ColorSilhouette;
    let base = mode.of(settings);
    let mut frame = |scene: &Scene, views: u32, settings: &Settings| -> Result<f64> {
        Ok(times(renderer, scene, &subject::cameras(views)?, settings, mode, repeats)?.frame)
    };
    let mut faces = Vec::new();
    for subdivisions in 3..=if full { 8 } else { 6 } {
        let sphere = shapes::icosphere(subdivisions)?;
        let count = sphere.triangles().len() as f64;
        faces.push((count, frame(&subject::scene(&sphere)?, 1, &base)?));
    }
    let mut pixels = Vec::new();
    for size in [64, 128, 256, 512, 1024, 2048].into_iter().take(if full { 6 } else { 5 }) {
        pixels
            .push((f64::from(size * size), frame(&scene, 1, &Settings { width: size, height: size, ..base.clone() })?));
    }
    let mut coverage = Vec::new();
    for share in [0.25f32, 0.5, 1.0] {
        let smaller = scene.meshes[0].positions().iter().map(|p| p.map(|x| x * share)).collect();
        let smaller = Mesh::new(smaller, mesh.triangles().to_vec())?;
        let smaller = smaller.with_appearance(scene.meshes[0].appearance().clone())?;
        coverage.push((f64::from(share * share), frame(&Scene::new(smaller), 1, &base)?));
    }
    let mut sigma = Vec::new();
    for value in [1e-6, 1e-5, 1e-4, 1e-3] {
        sigma.push((value, frame(&scene, 1, &Settings { sigma: value, ..base.clone() })?));
    }
    let mut views = Vec::new();
    for count in [1, 2, 4, 8] {
        views.push((f64::from(count), frame(&scene, count, &base)?));
    }
    Ok(vec![
        Growth { name: "faces of a sphere", points: faces },
        Growth { name: "pixels", points: pixels },
        Growth { name: "pixels covered", points: coverage },
        Growth { name: "sigma", points: sigma },
        Growth { name: "views", points: views },
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponents_are_slopes() {
        let power = |e: f64| Growth { name: "", points: [1.0f64, 3.0, 10.0].map(|x| (x, 7.0 * x.powf(e))).to_vec() };
        assert!((power(0.75).exponent() - 0.75).abs() < 1e-12);
        assert!((power(2.0).exponent() - 2.0).abs() < 1e-12);
        assert!(Growth { name: "", points: vec![(1.0, 1.0)] }.exponent().is_nan());
    }
}
