//! The error of a frame and of its gradient against the f64 reference.

use super::Mode;
use super::time::upstream;
use crate::agreement::{self, IMAGE_MARGIN};
use crate::gradients;
use softras::{Camera, Frame, Gradients, Image, Result, Scene, Settings};
use softras_reference::{GradientMode, ReferenceFrame};

/// The largest errors of a frame's images.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ImageError {
    /// The largest error of any value of any image.
    pub most: f64,
    /// That of colour alone; 0 without a colour image.
    pub color: f64,
    /// That of the silhouette alone; 0 without one.
    pub silhouette: f64,
    /// The root mean square over all values.
    pub rms: f64,
}

/// Compares a frame with the reference's. Errors are infinite where a value is NaN or the sizes differ; with `margin`, pixels
/// below [`IMAGE_MARGIN`] are left out.
pub fn images(frame: &Frame, expected: &ReferenceFrame, margin: Option<&[f64]>) -> ImageError {
    let parts = [
        (frame.color(), &expected.color),
        (frame.silhouette(), &expected.silhouette),
        (frame.depth(), &expected.depth),
        (frame.normal(), &expected.normal),
    ];
    let each = parts.map(|(image, expected)| image.map_or((0.0, 0.0, 0), |image| one(image, expected, margin)));
    let (square, count) = each.iter().fold((0.0, 0), |(sum, n), e| (sum + e.1, n + e.2));
    ImageError {
        most: each.iter().fold(0.0, |most, e| e.0.max(most)),
        color: each[0].0,
        silhouette: each[1].0,
        rms: (square / count.max(1) as f64).sqrt(),
    }
}

/// The largest difference, the sum of squares, and the number of values that counted.
fn one(image: &Image, expected: &[f64], margin: Option<&[f64]>) -> (f64, f64, usize) {
    let counts = |pixel: usize| margin.is_none_or(|m| m.get(pixel).is_some_and(|&m| m >= IMAGE_MARGIN));
    let differences = agreement::differences(image, expected, counts);
    differences.fold((0.0, 0.0, 0), |(most, sum, n), (_, d)| (d.max(most), sum + d * d, n + 1))
}

/// The error |ours - reference| / |reference| of the gradient by the inputs of the mode ([`Mode::wanted`]), for the
/// upstream gradient of [`super::time::times`]. The reference takes about 20 µs a (pixel, triangle) pair.
///
/// # Errors
/// As [`softras_reference::gradient`].
pub fn gradient(ours: &Gradients, scene: &Scene, cameras: &[Camera], settings: &Settings, mode: Mode) -> Result<f64> {
    let upstream = gradients::upstream(&upstream(mode, cameras.len(), settings));
    let expected = softras_reference::gradient(scene, cameras, settings, &upstream, GradientMode::Exact)?;
    let (mut error, mut norm) = (0.0, 0.0);
    for (index, mesh) in ours.meshes.iter().enumerate() {
        let colors = if mode.wanted().colors { expected.colors(index) } else { &[] };
        let pairs = mesh.positions.as_flattened().iter().zip(expected.positions(index));
        for (&ours, reference) in pairs.chain(mesh.colors.as_flattened().iter().zip(colors)) {
            error += (f64::from(ours) - reference).powi(2);
            norm += reference * reference;
        }
    }
    for (view, camera) in ours.cameras.iter().enumerate() {
        for (ours, reference) in camera.twist.iter().zip(expected.twist(view)) {
            error += (ours - reference).powi(2);
            norm += reference * reference;
        }
    }
    let relative = (error / norm).sqrt();
    // Without an error the quotient may be 0 / 0: nothing was wanted and nothing came back.
    Ok(if error == 0.0 { 0.0 } else { relative })
}
