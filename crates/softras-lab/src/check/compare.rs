//! Compares one scene between the device and the f64 reference.

use super::scenes::Case;
use crate::agreement::{self, IMAGE_MARGIN, norm};
use crate::gradients;
use softras::{Frame, GradientRequest, Image, ImageGradient, Renderer, Result, Settings};
use softras_reference::{Parameters, ReferenceFrame};

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
pub fn compare(renderer: &mut Renderer, case: &Case) -> Result<Findings> {
    let settings = Settings { save: true, ..case.settings.clone() };
    let truth = softras_reference::render_culled(&case.scene, &case.cameras, &settings)?;
    let upstream = upstream(&truth, &settings);
    let weights = gradients::upstream(&upstream);
    let expected = softras_reference::gradient(&case.scene, &case.cameras, &settings, &weights, case.mode)?;
    let mut run = || -> Result<(Frame, Parameters)> {
        let frame = renderer.render(&case.scene, &case.cameras, &settings)?;
        let wanted = GradientRequest { mode: case.mode, ..GradientRequest::ALL };
        let gradients = renderer.backward(&frame, &upstream, &wanted)?;
        let gradients = gradients::as_parameters(&gradients, &case.scene, &case.cameras, &settings)?;
        Ok((frame, gradients))
    };
    let (frame, ours) = run()?;
    let (again, ours_again) = run()?;
    let errors = groups(&ours, case).into_iter().zip(groups(&expected, case));
    let mut gradients = [None; 8];
    gradients.iter_mut().zip(errors).for_each(|(field, (ours, expected))| *field = relative(&ours, &expected));
    let repeats = bits(&frame, &ours) == bits(&again, &ours_again);
    Ok(Findings { images: image_errors(&frame, &truth), gradients, repeats })
}

/// Weights in [-1, 1] for every value of every image, 0 for pixels near a discontinuity.
fn upstream(truth: &ReferenceFrame, settings: &Settings) -> ImageGradient {
    let mut state = 3u64;
    let mut weights = |channels: usize| {
        let weight = |i: usize| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let random = (state >> 40) as f32 / (1u64 << 23) as f32 - 1.0;
            if truth.margin[i / channels] > IMAGE_MARGIN { random } else { 0.0 }
        };
        let data = (0..truth.margin.len() * channels).map(weight).collect();
        Image { batch: truth.batch, height: truth.height, width: truth.width, channels, data }
    };
    let outputs = settings.outputs;
    ImageGradient {
        color: outputs.color.then(|| weights(3)),
        silhouette: outputs.silhouette.then(|| weights(1)),
        depth: outputs.depth.then(|| weights(1)),
        normal: outputs.normal.then(|| weights(3)),
    }
}

fn image_errors(frame: &Frame, truth: &ReferenceFrame) -> [Option<f64>; 4] {
    let error = |image: Option<&Image>, expected: &[f64]| {
        let differences = agreement::differences(image?, expected, |pixel| truth.margin[pixel] > IMAGE_MARGIN);
        Some(differences.fold(0.0, |worst: f64, (_, d)| d.max(worst)))
    };
    [
        error(frame.color(), &truth.color),
        error(frame.silhouette(), &truth.silhouette),
        error(frame.depth(), &truth.depth),
        error(frame.normal(), &truth.normal),
    ]
}

/// The gradients by the columns of the table.
fn groups(all: &Parameters, case: &Case) -> [Vec<f64>; 8] {
    let (meshes, views) = (0..case.scene.meshes.len(), 0..case.cameras.len());
    let texels = |mesh: usize| match case.scene.meshes[mesh].appearance() {
        softras::scene::Appearance::Textured { .. } => all.texture_texels(mesh, 0),
        _ => all.surface_texels(mesh),
    };
    let each = |values: &dyn Fn(usize) -> Vec<f64>| meshes.clone().flat_map(values).collect::<Vec<f64>>();
    let lights = (0..case.scene.lights.directional.len())
        .flat_map(|l| [all.light_direction(l), all.light_color(l), &[all.light_intensity(l)]].concat());
    [
        each(&|mesh| all.positions(mesh).to_vec()),
        each(&|mesh| all.colors(mesh).to_vec()),
        each(&|mesh| texels(mesh).to_vec()),
        each(&|mesh| all.uvs(mesh).to_vec()),
        views.flat_map(|view| [all.twist(view), all.projection(view)].concat()).collect(),
        [all.ambient_color(), &[all.ambient_intensity()]].concat().into_iter().chain(lights).collect(),
        [all.background(), &[all.epsilon()]].concat(),
        vec![all.sigma(), all.gamma()],
    ]
}

/// |ours - expected| / |expected|; `None` if both are all zeros.
fn relative(ours: &[f64], expected: &[f64]) -> Option<f64> {
    if ours.iter().chain(expected).all(|x| *x == 0.0) {
        return None;
    }
    let difference: Vec<f64> = ours.iter().zip(expected).map(|(a, b)| a - b).collect();
    let error = norm(&difference) / norm(expected);
    Some(if error.is_nan() { f64::INFINITY } else { error })
}

fn bits(frame: &Frame, gradients: &Parameters) -> (Vec<u32>, Vec<u64>) {
    let images = [frame.color(), frame.silhouette(), frame.depth(), frame.normal()];
    let values = images.into_iter().flatten().flat_map(|image| &image.data);
    (values.map(|x| x.to_bits()).collect(), gradients.values().iter().map(|x| x.to_bits()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrong_gradients_are_far_off() {
        assert_eq!(relative(&[0.0], &[0.0]), None);
        assert_eq!(relative(&[1.0, 2.0], &[1.0, 2.0]), Some(0.0));
        assert_eq!(relative(&[f64::NAN], &[1.0]), Some(f64::INFINITY));
        assert_eq!(relative(&[1.0], &[0.0]), Some(f64::INFINITY));
    }

    #[test]
    fn anything_wrong_fails() {
        let good = || Findings { images: [Some(1e-5), None, None, None], gradients: [Some(1e-4); 8], repeats: true };
        assert!(good().pass(1e-3));
        assert!(!Findings { repeats: false, ..good() }.pass(1e-3));
        assert!(!Findings { images: [Some(f64::NAN); 4], ..good() }.pass(1e-3));
        assert!(!Findings { gradients: [Some(0.5); 8], ..good() }.pass(1e-3));
    }
}
