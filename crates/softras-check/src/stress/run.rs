//! Runs cases on the device and checks what must hold of them.

use super::bits::{bits, gradient_bits};
use super::draw::{Case, Kind, Promise};
use super::outcome::Outcome;
use super::promise;
use super::range::{Hull, bounds, color_hull};
use crate::agreement::not_finite;
use softras::{Camera, Frame, GradientRequest, Gradients, Renderer, RendererOptions, Scene};
use softras::{Error, Result};
use softras_reference::render_culled;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// A renderer that runs one case after another.
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

    /// Draws and runs the case of a seed; see [`super::batch`].
    ///
    /// # Errors
    /// When the device cannot be opened again after a panic.
    pub fn seed(&mut self, seed: u64, kind: Kind) -> Result<Outcome> {
        match catch_unwind(|| super::batch(seed, kind, 1).remove(0)) {
            Ok(Ok(case)) => self.run(&case),
            Ok(Err(error)) => Ok(refused(&error)),
            Err(panic) => Ok(panicked(&*panic)),
        }
    }

    /// Draws and runs the cases of a seed; see [`super::batch`]. All are rendered and differentiated twice as one batch, and
    /// one of them is run by itself and compared with the reference as well. Where the batch is refused each case is run by
    /// itself.
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

    /// Runs cases of the same settings as one batch; a batch that is refused is split in halves.
    fn together(&mut self, cases: &[Case]) -> Result<Vec<Outcome>> {
        let outcome = self.caught(|renderer| check_batch(renderer, cases))?;
        if outcome.refused.is_some() && cases.len() > 1 {
            if cases[0].settings.validate().is_err() {
                return Ok(vec![outcome; cases.len()]);
            }
            let (low, high) = cases.split_at(cases.len() / 2);
            let low = self.together(low)?;
            return Ok(low.into_iter().chain(self.together(high)?).collect());
        }
        // One case of each batch is checked in full; which one depends on the seed.
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
        self.caught(|renderer| check(renderer, case))
    }

    /// Calls `work` with the renderer; panics and messages of the validation layers become findings.
    fn caught(&mut self, work: impl FnOnce(&mut Renderer) -> Outcome) -> Result<Outcome> {
        let renderer = &mut self.renderer;
        let mut outcome = match catch_unwind(AssertUnwindSafe(|| work(renderer))) {
            Ok(outcome) => outcome,
            Err(panic) => {
                // After a panic the renderer's state is unknown, so it is replaced.
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

/// The outcome of an error: a refusal when the case itself is at fault, a finding when the device or this crate is.
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

fn check(renderer: &mut Renderer, case: &Case) -> Outcome {
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

/// Renders and differentiates all cases as one batch, twice.
fn check_batch(renderer: &mut Renderer, cases: &[Case]) -> Outcome {
    let Some(one) = cases.first() else { return Outcome::default() };
    let scene = Scene {
        meshes: cases.iter().flat_map(|case| case.scene.meshes.clone()).collect(),
        lights: one.scene.lights.clone(),
    };
    let cameras: Vec<Camera> = cases.iter().flat_map(|case| case.cameras.clone()).collect();
    let upstream = promise::upstream_of(cases);
    let wanted = GradientRequest { mode: one.gradient, ..GradientRequest::ALL };
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

/// Compares the images with the reference's and returns the reference's margin.
fn images(case: &Case, frame: &Frame, outcome: &mut Outcome) -> Option<Vec<f64>> {
    // The reference is slow, so it runs for a quarter of the cases without a promise only.
    if case.promise == Promise::Bounds && !case.seed.is_multiple_of(4) {
        return None;
    }
    let reference = match render_culled(&case.scene, &case.cameras, &case.settings) {
        Ok(reference) => reference,
        Err(error) => {
            outcome.find("reference", error.to_string());
            return None;
        }
    };
    let values = [&reference.color, &reference.silhouette, &reference.depth, &reference.normal];
    if values.into_iter().flatten().any(|x| !x.is_finite()) {
        outcome.find("reference", "a value of the f64 reference's image is not finite");
    }
    let [silhouette, all] = promise::errors(frame, &reference, &case.settings);
    let promised = match case.promise {
        Promise::Bounds => {
            outcome.unpromised_error = Some(all);
            return Some(reference.margin);
        }
        Promise::Silhouette => silhouette,
        Promise::Images | Promise::Gradients => all,
    };
    let error = promised / promise::tolerance(case);
    outcome.image_error = Some(error);
    if error > 1.0 {
        outcome.find("image", format!("an image is off by {promised:.1e}, {error:.1} times what is promised"));
    }
    Some(reference.margin)
}

/// Differentiates the frame, repeats the whole run, and compares promised gradients with the reference's.
fn gradients(renderer: &mut Renderer, case: &Case, frame: &Frame, margin: Option<&[f64]>, outcome: &mut Outcome) {
    let upstream = promise::upstream(case, margin);
    let wanted = GradientRequest { mode: case.gradient, ..GradientRequest::ALL };
    let first = match renderer.backward(frame, &upstream, &wanted) {
        Ok(gradients) => gradients,
        Err(error) => {
            let mut ended = refused(&error);
            ended.findings.append(&mut outcome.findings);
            // Where gradients are promised, they are finite.
            if let (Promise::Gradients, Error::NotFinite { .. }) = (case.promise, &error) {
                ended.find("not finite", error.to_string());
            }
            *outcome = ended;
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
                if error > promise::gradient_tolerance(case) {
                    outcome.find("gradient", format!("by {name} is off by {error:.1e} of its norm"));
                }
            }
            Err(error) => outcome.find("reference", error),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_device_did_is_no_refusal() {
        let call = "vkQueueSubmit";
        let outcome = refused(&Error::Vulkan { call, result: "ERROR_DEVICE_LOST".into() });
        assert!(outcome.refused.is_none() && outcome.findings[0].what.contains(call));
        let panic = catch_unwind(|| assert!(std::hint::black_box(false), "broken")).err();
        assert!(panic.is_some_and(|panic| panicked(&*panic).findings[0].what == "broken"));
    }
}
