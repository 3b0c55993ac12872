//! `softras pose --benchmark MESH...`: the search from one picture of each of many rotations of a mesh.

use super::{PoseArgs, View, benchmark::median};
use crate::commands::outputs::Outputs;
use crate::commands::progress::Progress;
use crate::commands::steps::{Loop, each};
use crate::commands::{Failure, say};
use softras_io::text;
use serde_json::{Value, json};
use softras::Renderer;
use softras_fit::Pose;
use softras_io::Budget;
use softras_lab::random::Random;
use std::path::PathBuf;
use std::time::Instant;

/// Side of the pictures in pixels, and of a pixel in samples.
const SIZE: usize = 64;
const SAMPLES: u32 = 8;
/// Rotations up to this many degrees from the true one count as found.
const NEAR: f64 = 2.0;

/// What was found of a mesh.
struct Row {
    mesh: String,
    /// Degrees between the rotation that was found and the true one, of each trial.
    degrees: Vec<f64>,
    seconds: Vec<f64>,
}

/// Searches every mesh, and prints a row for each as soon as it is known.
pub fn run(args: &PoseArgs, meshes: &[PathBuf], renderer: &mut Renderer) -> Result<(), Failure> {
    let budget = Budget::new(args.read.memory.memory);
    let mut report = Vec::new();
    if !args.json {
        say("mesh           pictures  < 2 deg   median  largest  seconds")?;
    }
    for path in meshes {
        let mesh = args.read.read(path, true, &Outputs::default(), &budget)?.mesh;
        let (view, _) = View::around(args, &mesh, SIZE, SIZE)?;
        let mesh = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let row = searched(args, mesh, &view, renderer)?;
        if !args.json {
            say(&row.line())?;
        }
        report.push(row.json());
    }
    if args.json {
        let device = renderer.device_name();
        return say(&json!({ "seed": args.seed, "size": SIZE, "device": device, "meshes": report }).to_string());
    }
    Ok(())
}

fn searched(args: &PoseArgs, mesh: String, view: &View, renderer: &mut Renderer) -> Result<Row, Failure> {
    let mut random = Random::new(args.seed);
    let trials = args.trials.unwrap_or(40);
    let mut row = Row { mesh, degrees: Vec::new(), seconds: Vec::new() };
    let progress = Progress::counted("picture", trials as usize);
    for _ in 0..trials {
        let truth = Pose { rotation: random.rotation(), ..Pose::IDENTITY };
        let Some(target) = view.picture(&truth, SAMPLES, renderer)? else { return Err(Failure::Told) };
        let before = Instant::now();
        let mut search = view.search(args, &target)?;
        let steps = Loop::over(0..search.step_count());
        steps.run(&mut each(|_, renderer| search.step(renderer)), renderer)?;
        row.seconds.push(before.elapsed().as_secs_f64());
        row.degrees.extend(search.found().first().map(|(pose, _)| pose.degrees_to(&truth)));
        progress.step();
    }
    Ok(row)
}

impl Row {
    fn within(&self) -> usize {
        self.degrees.iter().filter(|degrees| **degrees < NEAR).count()
    }

    fn json(&self) -> Value {
        json!({
            "mesh": self.mesh, "pictures": self.degrees.len(), "within_2_degrees": self.within(),
            "degrees": self.degrees, "seconds": self.seconds,
        })
    }

    fn line(&self) -> String {
        let [degrees, seconds] = [&self.degrees, &self.seconds].map(|values| {
            let mut sorted = values.clone();
            sorted.sort_by(f64::total_cmp);
            sorted
        });
        format!(
            "{:<14} {:>8} {:>8} {:>8.2} {:>8.2} {:>8.1}",
            text::name(&self.mesh),
            degrees.len(),
            self.within(),
            median(&degrees),
            degrees.last().copied().unwrap_or(0.0),
            median(&seconds),
        )
    }
}
