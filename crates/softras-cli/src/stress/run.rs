//! One case on the device, and what must hold of it.

use super::draw::{Case, Kind};
use super::promise::{self, Promise};
use softras::reference::render_culled;
use softras::scene::{Appearance, Lights, Parity};
use softras::{Camera, Frame, Gradients, Image, Renderer, RendererOptions, Scene, Settings, Wanted};
use softras::{Error, Result};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Something that must not be.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// Of which kind: "panic", "not finite", "range", "bits", "error", "image", "gradient", "judge" or "validation".
    pub kind: &'static str,
    /// What and where.
    pub what: String,
}

/// What came of a case.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outcome {
    /// The kind of error with which it was refused, where it was.
    pub refused: Option<&'static str>,
    /// What must not be.
    pub findings: Vec<Finding>,
    /// The largest error of what is promised of its images, in units of the tolerance; `None` without a promise.
    pub image_error: Option<f64>,
    /// The largest relative error of its gradients, where they were compared.
    pub gradient_error: Option<f64>,
    /// The largest error of any image of a case without a promise, in units of max(1, |value|).
    pub unpromised_error: Option<f64>,
}

impl Outcome {
    fn find(&mut self, kind: &'static str, what: impl Into<String>) {
        self.findings.push(Finding { kind, what: what.into() });
    }
}

/// A renderer that is put to every case in turn.
#[derive(Debug)]
pub struct Stress {
    renderer: Renderer,
    options: RendererOptions,
    messages: usize,
}

impl Stress {
    /// Opens the device.
    ///
    /// # Errors
    /// As [`Renderer::with_options`].
    pub fn new(options: &RendererOptions) -> Result<Self> {
        Ok(Self { renderer: Renderer::with_options(options)?, options: options.clone(), messages: 0 })
    }

    /// Draws and runs the case of a seed; see [`super::case`].
    ///
    /// # Errors
    /// When the device cannot be opened again after a panic.
    pub fn seed(&mut self, seed: u64, kind: Kind) -> Result<Outcome> {
        match catch_unwind(|| super::case(seed, kind)) {
            Ok(Ok(case)) => self.run(&case),
            Ok(Err(error)) => Ok(refused(&error)),
            Err(panic) => Ok(panicked(&*panic)),
        }
    }

    /// Draws and runs the cases of a seed; see [`super::batch`]. All are rendered and differentiated twice as one batch, and
    /// one of them is run by itself, against the judge as well. Where the batch is refused each is run by itself.
    ///
    /// # Errors
    /// As [`Stress::seed`].
    pub fn batch(&mut self, seed: u64, kind: Kind, count: usize) -> Result<Vec<Outcome>> {
        let drawn = match catch_unwind(|| super::batch(seed, kind, count)) {
            Ok(drawn) => drawn,
            Err(panic) => return Ok(vec![panicked(&*panic)]),
        };
        let (mut cases, mut outcomes) = (Vec::new(), Vec::new());
        for case in drawn {
            match case {
                Ok(case) => cases.push(case),
                Err(error) => outcomes.push(refused(&error)),
            }
        }
        if !cases.is_empty() {
            outcomes.extend(self.together(&cases)?);
        }
        Ok(outcomes)
    }

    /// Runs cases of the same settings as one batch, or both halves of one that is refused.
    fn together(&mut self, cases: &[Case]) -> Result<Vec<Outcome>> {
        let outcome = self.caught(|renderer| judge_batch(renderer, cases))?;
        if outcome.refused.is_some() && cases.len() > 1 {
            if softras::internals::validate::settings(&cases[0].settings).is_err() {
                return Ok(vec![outcome; cases.len()]);
            }
            let (low, high) = cases.split_at(cases.len() / 2);
            let low = self.together(low)?;
            return Ok(low.into_iter().chain(self.together(high)?).collect());
        }
        // One of them in full, another one of every batch.
        let alone = self.run(&cases[(cases[0].seed / 64) as usize % cases.len()])?;
        let findings = outcome.findings.into_iter().chain(alone.findings.iter().cloned()).collect();
        let mut outcomes = vec![Outcome::default(); cases.len() - 1];
        outcomes.push(Outcome { findings, ..alone });
        Ok(outcomes)
    }

    /// Runs a case; a panic is a finding.
    ///
    /// # Errors
    /// When the device cannot be opened again after a panic.
    pub fn run(&mut self, case: &Case) -> Result<Outcome> {
        self.caught(|renderer| judge(renderer, case))
    }

    /// What work with the renderer makes of a case; panics and what the validation layers say are findings.
    fn caught(&mut self, work: impl FnOnce(&mut Renderer) -> Outcome) -> Result<Outcome> {
        let renderer = &mut self.renderer;
        let mut outcome = match catch_unwind(AssertUnwindSafe(|| work(renderer))) {
            Ok(outcome) => outcome,
            Err(panic) => {
                // What is left of that renderer is anyone's guess.
                self.renderer = Renderer::with_options(&self.options)?;
                self.messages = 0;
                panicked(&*panic)
            }
        };
        for message in self.renderer.validation_messages().iter().skip(self.messages) {
            outcome.find("validation", message.as_str());
        }
        self.messages = self.renderer.validation_messages().len();
        Ok(outcome)
    }

    /// The renderer, for more frames of the same device.
    pub fn renderer(&mut self) -> &mut Renderer {
        &mut self.renderer
    }
}

fn panicked(panic: &(dyn std::any::Any + Send)) -> Outcome {
    let text = panic.downcast_ref::<String>().map(String::as_str).or_else(|| panic.downcast_ref::<&str>().copied());
    let mut outcome = Outcome::default();
    outcome.find("panic", text.unwrap_or("without a message"));
    outcome
}

/// A case may be refused for what it is, not for what the device or this crate did.
fn refused(error: &Error) -> Outcome {
    let kind = match error {
        Error::Mesh { .. } => "mesh",
        Error::Camera { .. } => "camera",
        Error::Light { .. } => "light",
        Error::Settings { .. } => "settings",
        Error::Scene { .. } => "scene",
        Error::Limit { .. } => "limit",
        Error::NotFinite { .. } => "not finite",
        other => {
            let mut outcome = Outcome::default();
            outcome.find("error", other.to_string());
            return outcome;
        }
    };
    Outcome { refused: Some(kind), ..Outcome::default() }
}

fn judge(renderer: &mut Renderer, case: &Case) -> Outcome {
    let first = match renderer.render(&case.scene, &case.cameras, &case.settings) {
        Ok(frame) => frame,
        Err(error) => return refused(&error),
    };
    let mut outcome = Outcome::default();
    bounds(&first, &case.settings, &[color_hull(case)], &mut outcome);
    let margin = images(case, &first, &mut outcome);
    gradients(renderer, case, &first, margin.as_deref(), &mut outcome);
    outcome
}

/// All cases as one batch, twice.
fn judge_batch(renderer: &mut Renderer, cases: &[Case]) -> Outcome {
    let Some(one) = cases.first() else { return Outcome::default() };
    let scene = Scene {
        meshes: cases.iter().flat_map(|case| case.scene.meshes.clone()).collect(),
        lights: one.scene.lights.clone(),
    };
    let cameras: Vec<Camera> = cases.iter().flat_map(|case| case.cameras.clone()).collect();
    let upstream = promise::upstream_of(cases);
    let wanted = Wanted { mode: one.gradient, ..Wanted::ALL };
    let mut twice = || {
        let frame = renderer.render(&scene, &cameras, &one.settings)?;
        let gradients = renderer.backward(&frame, &upstream, &wanted)?;
        Ok((frame, gradients))
    };
    let ((frame, gradients), (again, gradients_again)) = match twice().and_then(|first| Ok((first, twice()?))) {
        Ok(both) => both,
        Err(error) => return refused(&error),
    };
    let mut outcome = Outcome::default();
    let hulls: Vec<Hull> = cases.iter().map(color_hull).collect();
    bounds(&frame, &one.settings, &hulls, &mut outcome);
    same_bits(&frame, &again, &gradients, &gradients_again, &mut outcome);
    if let Some(name) = not_finite(&gradients) {
        outcome.find("not finite", format!("the batch's gradient by {name}"));
    }
    outcome
}

fn same_bits(a: &Frame, b: &Frame, gradients_a: &Gradients, gradients_b: &Gradients, outcome: &mut Outcome) {
    if !bits(a).eq(bits(b)) {
        outcome.find("bits", "a second frame differs");
    }
    if !gradient_bits(gradients_a).eq(gradient_bits(gradients_b)) {
        outcome.find("bits", "a second gradient differs");
    }
}

/// The images against the judge's; its margin comes back.
fn images(case: &Case, frame: &Frame, outcome: &mut Outcome) -> Option<Vec<f64>> {
    // Three quarters of the cases without a promise are spared the judge's time.
    if case.promise == Promise::Bounds && !case.seed.is_multiple_of(4) {
        return None;
    }
    let judge = match render_culled(&case.scene, &case.cameras, &case.settings) {
        Ok(judge) => judge,
        Err(error) => {
            outcome.find("judge", error.to_string());
            return None;
        }
    };
    let values = [&judge.color, &judge.silhouette, &judge.depth, &judge.normal];
    if values.into_iter().flatten().any(|x| !x.is_finite()) {
        outcome.find("judge", "a value of the f64 judge's image is not finite");
    }
    let [silhouette, all] = promise::errors(frame, &judge, &case.settings);
    let promised = match case.promise {
        Promise::Bounds => {
            outcome.unpromised_error = Some(all);
            return Some(judge.margin);
        }
        Promise::Silhouette => silhouette,
        Promise::Images | Promise::Gradients => all,
    };
    let error = promised / promise::tolerance(case);
    outcome.image_error = Some(error);
    if error > 1.0 {
        outcome.find("image", format!("an image is off by {promised:.1e}, {error:.1} times what is promised"));
    }
    Some(judge.margin)
}

/// Backward, all of it again, and the gradients against the judge's where they are promised.
fn gradients(renderer: &mut Renderer, case: &Case, frame: &Frame, margin: Option<&[f64]>, outcome: &mut Outcome) {
    let upstream = promise::upstream(case, margin);
    let wanted = Wanted { mode: case.gradient, ..Wanted::ALL };
    let first = match renderer.backward(frame, &upstream, &wanted) {
        Ok(gradients) => gradients,
        Err(error) => {
            *outcome = Outcome { findings: std::mem::take(&mut outcome.findings), ..refused(&error) };
            return;
        }
    };
    if let Some(name) = not_finite(&first) {
        outcome.find("not finite", format!("the gradient by {name}"));
    }
    let again = renderer
        .render(&case.scene, &case.cameras, &case.settings)
        .and_then(|frame| renderer.backward(&frame, &upstream, &wanted).map(|gradients| (frame, gradients)));
    match again {
        Ok((again, gradients)) => same_bits(frame, &again, &first, &gradients, outcome),
        Err(error) => outcome.find("bits", format!("a second run fails: {error}")),
    }
    if case.promise == Promise::Gradients && case.seed.is_multiple_of(3) {
        match promise::gradient_error(case, &upstream, &first) {
            Ok((name, error)) => {
                outcome.gradient_error = Some(error);
                if error.is_nan() || error > promise::gradient_tolerance(case) {
                    outcome.find("gradient", format!("by {name} is off by {error:.1e} of its norm"));
                }
            }
            Err(error) => outcome.find("judge", error.to_string()),
        }
    }
}

/// Of each channel the least and the most there can be.
type Hull = [[f64; 2]; 3];

/// Every value finite and in its range: colours within each view's hull, silhouettes in [0, 1], depths in [0, far],
/// normals no longer than 1.
fn bounds(frame: &Frame, settings: &Settings, hulls: &[Hull], outcome: &mut Outcome) {
    for (name, image, ranges) in [
        ("color", frame.color(), hulls),
        ("silhouette", frame.silhouette(), &[[[0.0, 1.0]; 3]]),
        ("depth", frame.depth(), &[[[0.0, settings.far]; 3]]),
        ("normal", frame.normal(), &[[[-1.0, 1.0]; 3]]),
    ] {
        let Some(image) = image else { continue };
        if let Some(i) = image.data.iter().position(|x| !x.is_finite()) {
            outcome.find("not finite", format!("{name}, value {i} is {}", image.data[i]));
        } else if let Some((i, [low, high])) = outside(image, ranges, name != "silhouette") {
            outcome.find("range", format!("{name}, value {i} is {}, not in {low} to {high}", image.data[i]));
        }
    }
}

/// The first value that is not in its channel's range, of each view or of all, which rounding may exceed where `rounded`.
fn outside(image: &Image, hulls: &[Hull], rounded: bool) -> Option<(usize, [f64; 2])> {
    let size = (image.data.len() / hulls.len()).max(1);
    for ((view, values), hull) in image.data.chunks(size).enumerate().zip(hulls) {
        for (i, (&x, [low, high])) in values.iter().zip(hull.iter().take(image.channels).cycle()).enumerate() {
            let slack = if rounded { 1e-5 * low.abs().max(high.abs()) } else { 0.0 };
            if f64::from(x) < low - slack || f64::from(x) > high + slack {
                return Some((view * size + i, [*low, *high]));
            }
        }
    }
    None
}

/// For each channel the least and the most of the background and of all colours under all lights.
fn color_hull(case: &Case) -> Hull {
    let colors: Vec<[f32; 3]> = case.scene.meshes.iter().flat_map(|mesh| colors_of(mesh.appearance())).collect();
    std::array::from_fn(|channel| {
        let light = light_hull(&case.scene.lights, channel);
        let lit = colors.iter().flat_map(|c| light.map(|light| f64::from(c[channel]) * light));
        let background = case.settings.background_color[channel];
        // The official lookup finds nothing behind the last triangle's cells.
        let nothing = (case.settings.parity == Parity::Official).then_some(0.0);
        lit.chain(nothing).fold([background; 2], |[low, high], x| [low.min(x), high.max(x)])
    })
}

fn colors_of(appearance: &Appearance) -> Vec<[f32; 3]> {
    match appearance {
        Appearance::Uniform(color) => vec![*color],
        Appearance::VertexColors(colors) => colors.clone(),
        Appearance::Surface { texels, .. } => texels.clone(),
        Appearance::Textured { textures, .. } => textures.iter().flat_map(|t| t.texels().to_vec()).collect(),
    }
}

/// Ambient alone, and with every light straight on.
fn light_hull(lights: &Lights, channel: usize) -> [f64; 2] {
    let ambient = lights.ambient_color[channel] * lights.ambient_intensity;
    let direct: f64 = lights.directional.iter().map(|light| light.color[channel] * light.intensity).sum();
    [ambient, ambient + direct]
}

fn bits(frame: &Frame) -> impl Iterator<Item = u32> {
    let images = [frame.color(), frame.silhouette(), frame.depth(), frame.normal()];
    images.into_iter().flatten().flat_map(|image| image.data.iter().map(|x| x.to_bits()))
}

/// The single-precision gradients by name.
fn arrays(gradients: &Gradients) -> Vec<(&'static str, &[f32])> {
    let meshes = gradients.meshes.iter().flat_map(|mesh| {
        let whole: [(&str, &[f32]); 4] = [
            ("positions", mesh.positions.as_flattened()),
            ("colors", mesh.colors.as_flattened()),
            ("surface texels", mesh.surface_texels.as_flattened()),
            ("UVs", mesh.uvs.as_flattened()),
        ];
        whole.into_iter().chain(mesh.texture_texels.iter().map(|t| ("texture texels", t.as_flattened())))
    });
    meshes.collect()
}

/// The others by name.
fn numbers(gradients: &Gradients) -> Vec<(&'static str, f64)> {
    let mut all = vec![("sigma", gradients.sigma), ("gamma", gradients.gamma), ("epsilon", gradients.epsilon)];
    all.extend(gradients.background_color.map(|x| ("background", x)));
    for camera in &gradients.cameras {
        all.extend(camera.twist.map(|x| ("the camera's twist", x)));
        all.extend(camera.projection.map(|x| ("the projection", x)));
    }
    if let Some(lights) = &gradients.lights {
        all.extend(lights.ambient_color.map(|x| ("ambient colour", x)));
        all.push(("ambient intensity", lights.ambient_intensity));
        for (direction, color, intensity) in &lights.directional {
            all.extend(direction.map(|x| ("a light's direction", x)));
            all.extend(color.map(|x| ("a light's colour", x)));
            all.push(("a light's intensity", *intensity));
        }
    }
    all
}

fn not_finite(gradients: &Gradients) -> Option<String> {
    let array = arrays(gradients).into_iter().find_map(|(name, values)| {
        let i = values.iter().position(|x| !x.is_finite())?;
        Some(format!("{name}, value {i} is {}", values[i]))
    });
    array.or_else(|| numbers(gradients).into_iter().find(|(_, x)| !x.is_finite()).map(|(n, x)| format!("{n} is {x}")))
}

fn gradient_bits(gradients: &Gradients) -> impl Iterator<Item = u64> {
    let arrays = arrays(gradients).into_iter().flat_map(|(_, values)| values.iter().map(|x| x.to_bits().into()));
    arrays.chain(numbers(gradients).into_iter().map(|(_, x)| x.to_bits()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_out_of_range_are_found() {
        let image = |data: Vec<f32>| Image { batch: 1, height: 1, width: data.len(), channels: 1, data };
        assert_eq!(outside(&image(vec![0.0, 1.0]), &[[[0.0, 1.0]; 3]], false), None);
        assert_eq!(outside(&image(vec![0.0, 1.0000001]), &[[[0.0, 1.0]; 3]], false), Some((1, [0.0, 1.0])));
        assert_eq!(outside(&image(vec![-1e-7]), &[[[0.0, 1.0]; 3]], true), None);
        let (narrow, wide) = ([[0.0, 1.0]; 3], [[0.0, 2.0]; 3]);
        assert_eq!(outside(&image(vec![1.0, 1.5, 1.5, 1.5]), &[narrow, wide], true), Some((1, [0.0, 1.0])));
        assert_eq!(outside(&image(vec![1.0, 1.0, 1.5, 1.5]), &[narrow, wide], true), None);
        assert_eq!(outside(&image(vec![1.1]), &[[[0.0, 1.0]; 3]], true), Some((0, [0.0, 1.0])));
    }

    #[test]
    fn gradients_that_are_not_numbers_are_found() {
        let mut gradients = Gradients::default();
        assert_eq!(not_finite(&gradients), None);
        gradients.sigma = f64::NAN;
        assert!(not_finite(&gradients).is_some_and(|text| text.contains("sigma")));
        gradients.sigma = 0.0;
        let same = gradients.clone();
        gradients.gamma = -0.0;
        assert!(!gradient_bits(&gradients).eq(gradient_bits(&same)) && gradient_bits(&same).eq(gradient_bits(&same)));
    }

    #[test]
    fn what_the_device_did_is_no_refusal() {
        let call = "vkQueueSubmit";
        let outcome = refused(&Error::Vulkan { call, result: "ERROR_DEVICE_LOST".into() });
        assert!(outcome.refused.is_none() && outcome.findings[0].what.contains(call));
        let panic = catch_unwind(|| assert!(std::hint::black_box(false), "broken")).err();
        assert!(panic.is_some_and(|panic| panicked(&*panic).findings[0].what == "broken"));
    }
}
