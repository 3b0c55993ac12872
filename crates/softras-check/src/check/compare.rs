//! Compares one scene between the device and the f64 reference.

use super::scenes::CheckCase;
use crate::agreement::{self, Group, IMAGE_MARGIN, Subject};
use crate::stress::fingerprint;
use softras::{Error, Frame, GradientRequest, Gradients, Image, ImageGradient, Renderer, Result, Settings};
use softras_reference::ReferenceFrame;

/// The tolerance of a value of an image: of a colour in [0, 1], or of a depth in world units.
pub const IMAGE_TOLERANCE: f64 = 1e-4;

/// The images, as the columns of the table name them.
pub const IMAGES: [&str; 4] = ["color", "silh.", "depth", "normal"];
/// The gradients, as the columns of the table name them.
pub const GRADIENTS: [&str; 8] = ["vertex", "color", "texel", "uv", "camera", "light", "backgr", "scalar"];

/// The errors of a scene; `None` where it has no such image or gradient.
pub struct Findings {
    /// The largest error of each of [`IMAGES`], outside the reference's margin.
    pub images: [Option<f64>; 4],
    /// The relative L2 error of each of [`GRADIENTS`].
    pub gradients: [Option<f64>; 8],
    /// Whether a second run gave the same bits.
    pub repeats: bool,
}

impl Findings {
    /// Whether all errors are within the tolerances and the bits repeat.
    pub fn pass(&self, gradient_tolerance: f64) -> bool {
        // An error of NaN fails, because its comparison is false.
        let within = |errors: &[Option<f64>], most: f64| errors.iter().flatten().all(|error| *error <= most);
        self.repeats && within(&self.images, IMAGE_TOLERANCE) && within(&self.gradients, gradient_tolerance)
    }
}

/// Renders and differentiates a scene on the device, twice, and with the reference.
///
/// # Errors
/// Errors of the device.
pub fn compare(renderer: &mut Renderer, case: &CheckCase) -> Result<Findings> {
    let settings = Settings { save: true, ..case.settings.clone() };
    let truth = softras_reference::render_culled(&case.scene, &case.cameras, &settings)?;
    let upstream = upstream(&truth, &settings);
    let subject = Subject { scene: &case.scene, cameras: &case.cameras, settings: &settings };
    let expected = agreement::reference_gradient(subject, &upstream, case.mode)?;
    let mut run = || -> Result<(Frame, Gradients)> {
        let frame = renderer.render(&case.scene, &case.cameras, &settings)?;
        let wanted = GradientRequest { mode: case.mode, ..GradientRequest::ALL };
        let gradients = renderer.backward(&frame, &upstream, &wanted)?;
        Ok((frame, gradients))
    };
    let (frame, ours) = run()?;
    let (again, ours_again) = run()?;
    let bug = |what| Error::Backward { what, fix: "this is a bug in softras: please report it".into() };
    let gradients = gradient_errors(agreement::groups(subject, &ours, &expected).map_err(bug)?);
    let repeats = fingerprint(&frame, &ours) == fingerprint(&again, &ours_again);
    Ok(Findings { images: image_errors(&frame, &truth), gradients, repeats })
}

/// Weights in [-1, 1] for every value of every image, 0 for pixels near a discontinuity.
fn upstream(truth: &ReferenceFrame, settings: &Settings) -> ImageGradient {
    let mut state = 3u64;
    agreement::upstream_of(settings.outputs, [truth.batch, truth.height, truth.width], |_, channels, i| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let random = (state >> 40) as f32 / (1u64 << 23) as f32 - 1.0;
        if truth.margin[i / channels] > IMAGE_MARGIN { random } else { 0.0 }
    })
}

fn image_errors(frame: &Frame, truth: &ReferenceFrame) -> [Option<f64>; 4] {
    let error = |image: softras::Result<&Image>, expected: &[f64]| {
        let differences = agreement::differences(image.ok()?, expected, |pixel| truth.margin[pixel] > IMAGE_MARGIN);
        Some(differences.fold(0.0, |worst: f64, (_, d)| d.max(worst)))
    };
    [
        error(frame.color(), &truth.color),
        error(frame.silhouette(), &truth.silhouette),
        error(frame.depth(), &truth.depth),
        error(frame.normal(), &truth.normal),
    ]
}

/// The column of the table that a gradient belongs to.
fn column(name: &str) -> Option<usize> {
    Some(match name {
        "positions" => 0,
        "colors" => 1,
        "surface texels" | "texture texels" => 2,
        "UVs" => 3,
        "twist" | "projection" => 4,
        "ambient" | "light direction" | "light color" => 5,
        "background" | "epsilon" => 6,
        "sigma" | "gamma" => 7,
        _ => return None,
    })
}

/// The error of each column of the table; `None` where all of its numbers are zeros.
fn gradient_errors(groups: Vec<Group>) -> [Option<f64>; 8] {
    let mut columns = GRADIENTS.map(|name| Group { name, ours: Vec::new(), reference: Vec::new() });
    for Group { name, ours, reference } in groups {
        let Some(column) = column(name) else { continue };
        columns[column].ours.extend(ours);
        columns[column].reference.extend(reference);
    }
    columns.map(|column| {
        let is_empty = column.ours.iter().chain(&column.reference).all(|x| *x == 0.0);
        (!is_empty).then(|| agreement::relative_error(&column, 0.0).unwrap_or(f64::INFINITY))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn anything_wrong_fails() {
        let good = || Findings { images: [Some(1e-5), None, None, None], gradients: [Some(1e-4); 8], repeats: true };
        assert!(good().pass(1e-3));
        assert!(!Findings { repeats: false, ..good() }.pass(1e-3));
        assert!(!Findings { images: [Some(f64::NAN); 4], ..good() }.pass(1e-3));
        assert!(!Findings { gradients: [Some(0.5); 8], ..good() }.pass(1e-3));
    }
}
