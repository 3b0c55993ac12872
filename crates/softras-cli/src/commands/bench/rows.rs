//! Measures one scene, size and mode: three rows, one for each pass.

use super::machine::Machine;
use crate::commands::describe;
use serde_json::{Map, Value, json};
use softras::StageTime;
use softras::{Camera, Renderer, Result, Scene, Settings};
use softras_check::measure::Mode;
use softras_check::measure::error::{self, ImageError};
use softras_check::measure::time::{Times, times, upstream};
use softras_reference::Pairs;
use softras_reference::ReferenceFrame;

/// The most pairs for which the reference computes gradients, which takes some seconds.
const GRADIENT_PAIRS: u64 = 3_000_000;

/// A scene, size and mode to measure.
pub struct Job<'a> {
    pub name: &'a str,
    pub scene: &'a Scene,
    pub cameras: &'a [Camera],
    /// The settings of the mode.
    pub settings: Settings,
    pub mode: Mode,
    pub repeats: usize,
}

/// The reference's images of a job.
pub struct Expected {
    pub same_tau: ReferenceFrame,
    pub untruncated: ReferenceFrame,
}

impl Expected {
    /// Renders both with the f64 reference.
    pub fn of(job: &Job<'_>) -> Result<Self> {
        Ok(Self {
            same_tau: softras_reference::render_culled(job.scene, job.cameras, &job.settings)?,
            untruncated: softras_reference::render_untruncated(job.scene, job.cameras, &job.settings)?,
        })
    }
}

/// The measurements of a job.
pub struct Measured {
    pub times: Times,
    pub pairs: Pairs,
    /// Pairs that the forward stage evaluated.
    pub forward_pairs: u64,
    /// Dispatches of a forward frame, of backward, and of both where the frame saves what backward needs.
    pub dispatches: [u32; 3],
    /// Errors against the reference at the same τ, and without truncation.
    pub errors: Option<[ImageError; 2]>,
    pub gradient_error: Option<f64>,
}

/// Measures a job.
pub fn measure(renderer: &mut Renderer, job: &Job<'_>, expected: Option<&Expected>) -> Result<Measured> {
    let pairs = softras_reference::pairs(job.scene, job.cameras, &job.settings)?;
    let times = times(renderer, job.scene, job.cameras, &job.settings, job.mode, job.repeats)?;
    renderer.render(job.scene, job.cameras, &Settings { save: false, ..job.settings.clone() })?;
    let forward_dispatches = renderer.frame_counts()?.dispatches;
    let saved = Settings { save: true, ..job.settings.clone() };
    let frame = renderer.render(job.scene, job.cameras, &saved)?;
    let upstream = upstream(job.mode, job.cameras.len(), &job.settings);
    let gradients = renderer.backward(&frame, &upstream, &job.mode.wanted())?;
    let counts = renderer.frame_counts()?;
    let backward = counts.backward_dispatches;
    let dispatches = [forward_dispatches, backward, counts.dispatches + backward];
    let errors = expected.map(|expected| {
        let same = error::images(&frame, &expected.same_tau, Some(&expected.same_tau.margin));
        [same, error::images(&frame, &expected.untruncated, None)]
    });
    let gradient_error = if expected.is_some() && pairs.total() <= GRADIENT_PAIRS {
        Some(error::gradient(&gradients, job.scene, job.cameras, &job.settings, job.mode)?)
    } else {
        None
    };
    Ok(Measured { times, pairs, forward_pairs: counts.forward_pairs, dispatches, errors, gradient_error })
}

/// One pass of a job.
pub struct Row {
    pub scene: String,
    pub faces: usize,
    pub size: u32,
    pub mode: &'static str,
    pub pass: &'static str,
    pub median: f64,
    /// The median divided by that of the same pass of colour and silhouette, if that was measured.
    pub of_full: Option<f64>,
    pub device: f64,
    pub needed: u64,
    pub evaluated: u64,
    pub dispatches: u32,
    pub error: Option<f64>,
    pub untruncated: Option<f64>,
    stages: Vec<StageTime>,
    common: Value,
}

/// The three rows of a job.
pub fn rows(job: &Job<'_>, found: &Measured) -> Vec<Row> {
    let (times, needed, boxed) = (&found.times, found.pairs.total(), found.pairs.boxed);
    let image = found.errors.map(|errors| errors.map(|error| error.most));
    let (image, gradient) = ([image.map(|e| e[0]), image.map(|e| e[1])], [found.gradient_error, None]);
    let both = found.forward_pairs + boxed;
    let passes = [
        ("forward", times.forward, [needed, found.forward_pairs], image, &times.forward_stages),
        ("backward", times.backward, [needed, boxed], gradient, &times.backward_stages),
        ("frame", times.frame, [2 * needed, both], image, &times.frame_stages),
    ];
    let row = passes.into_iter().zip(found.dispatches);
    row.map(|((pass, median, [needed, evaluated], [error, untruncated], stages), dispatches)| Row {
        scene: job.name.to_string(),
        faces: job.scene.meshes.iter().map(|mesh| mesh.triangles().len()).sum(),
        size: job.settings.height,
        mode: job.mode.name(),
        pass,
        median,
        of_full: None,
        device: stages.iter().map(|t| t.milliseconds).sum(),
        needed,
        evaluated,
        dispatches,
        error,
        untruncated,
        stages: stages.clone(),
        common: common(job, found),
    })
    .collect()
}

/// The fields that tell whether two rows are comparable.
fn common(job: &Job<'_>, found: &Measured) -> Value {
    let s = &job.settings;
    json!({
        "views": job.cameras.len(), "repeats": found.times.repeats, "sigma": s.sigma, "gamma": s.gamma, "tau": s.tau,
        "settings": describe::settings(s), "rms_error": found.errors.map(|e| e[0].rms),
        "rms_error_untruncated": found.errors.map(|e| e[1].rms),
    })
}

impl Row {
    /// The row as JSON, with the machine.
    pub fn json(&self, machine: &Machine) -> Value {
        let stages: Map<String, Value> =
            self.stages.iter().map(|t| (t.stage.to_string(), json!(t.milliseconds))).collect();
        let mut fields = Map::new();
        let own = json!({
            "scene": self.scene, "faces": self.faces, "size": self.size, "mode": self.mode, "pass": self.pass,
            "median_ms": self.median, "of_full": self.of_full, "device_ms": self.device,
            "pairs_needed": self.needed, "pairs_evaluated": self.evaluated,
            "dispatches": self.dispatches, "max_error": self.error, "max_error_untruncated": self.untruncated, "stages_ms": stages,
        });
        for part in [own, machine.json.clone(), self.common.clone()] {
            if let Value::Object(part) = part {
                fields.extend(part);
            }
        }
        Value::Object(fields)
    }

    /// The device's times.
    pub fn stages(&self) -> &[StageTime] {
        &self.stages
    }

    /// Start and end in milliseconds of the `index`th of the named stages in a stacked bar; the last name stands for the rest
    /// of the wall time.
    pub fn span(&self, names: &[String], index: usize) -> (f64, f64) {
        let time = |name: &String| self.stages.iter().filter(|t| t.stage == *name).map(|t| t.milliseconds).sum::<f64>();
        let start: f64 = names[..index].iter().map(time).sum();
        if index + 1 == names.len() { (start, self.median.max(start)) } else { (start, start + time(&names[index])) }
    }

    /// The headings of the columns of [`Row::text`].
    pub fn head() -> String {
        format!(
            "{:12} {:>7} {:>5} {:16} {:8} {:>9} {:>7} {:>9} {:>9} {:>10} {:>5} {:>9}",
            "scene",
            "faces",
            "size",
            "mode",
            "pass",
            "median",
            "of full",
            "device",
            "needed",
            "evaluated",
            "disp.",
            "error"
        )
    }

    /// A line of the table.
    pub fn text(&self) -> String {
        format!(
            "{:12} {:>7} {:>5} {:16} {:8} {:>9.3} {:>7} {:>9.3} {:>9} {:>10} {:>5} {:>9}",
            self.scene,
            self.faces,
            self.size,
            self.mode,
            self.pass,
            self.median,
            self.of_full.map_or("-".to_string(), |share| format!("{share:.2}")),
            self.device,
            self.needed,
            self.evaluated,
            self.dispatches,
            self.error.map_or("-".to_string(), |e| format!("{e:.1e}")),
        )
    }
}
