//! `softras stress`: tests a device with random difficult scenes.

mod map;
mod tally;

use super::parse;
use super::progress::Progress;
use super::{Failure, say};
use clap::Args;
use serde_json::json;
use softras::{Error, RendererOptions, Result};
use softras_check::stress::{FORMS, Kind, Stress, batch, form};
use softras_io::output;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;
use tally::Tally;

/// Test a device with random difficult scenes and print a report
#[derive(Args, Debug)]
#[command(after_help = "\
Every scene is rendered and differentiated twice. It passes if it is refused
with an error that says why, or if every value is finite and in its range, both
runs have the same bits, and the model in f64 agrees where accuracy is promised.
A fault is printed with the seed of its scene; the exit code is then 1.

Examples:
  softras stress --cases 20000 --seed 1
  softras stress --cases 1 --seed 4711            # one scene again
  softras stress --cases 1000000 --batch 64       # 64 scenes in one submission
  softras stress --cases 0 --map accuracy.svg     # error by sigma and gamma")]
pub struct StressArgs {
    /// Number of scenes
    #[arg(long, value_name = "N", default_value_t = 1000)]
    cases: u64,
    /// The seed of the first scene; others follow
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Number of combinations of modes to compile
    #[arg(long, value_name = "N", default_value_t = FORMS as u64, value_parser = clap::value_parser!(u64).range(1..=FORMS as u64))]
    forms: u64,
    /// Render N scenes of one size at once; one is checked with f64
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=1024))]
    batch: u64,
    /// Images of 64 to 512 pixels a side, meshes of up to 6000 triangles
    #[arg(long)]
    realistic: bool,
    /// Number of threads that render at the same time
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u64).range(1..=64))]
    jobs: u64,
    /// Run under the Vulkan validation layers, and count their messages
    #[arg(long)]
    validation: bool,
    /// Vulkan device: its index or a part of its name (`softras devices`)
    #[arg(long, value_name = "DEVICE")]
    device: Option<String>,
    /// Draw the error of images by sigma and gamma: .svg
    #[arg(long, value_name = "FILE", value_parser = parse::file_ending("svg"))]
    map: Option<PathBuf>,
    /// Print the first wrong scene, reduced to the fewest triangles
    #[arg(long)]
    shrink: bool,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

impl StressArgs {
    fn kind(&self) -> Kind {
        Kind { forms: self.forms as usize, realistic: self.realistic }
    }
}

pub fn run(args: &StressArgs) -> std::result::Result<(), Failure> {
    if args.cases == 0 && args.map.is_none() {
        let what = "--cases 0: nothing would be tested: give a number above 0, or --map as well";
        return Err(Failure::Usage(what.into()));
    }
    if let Some(path) = &args.map {
        output::check_writable(path)?;
    }
    let start = Instant::now();
    let options =
        RendererOptions { device: args.device.clone(), validation: args.validation, ..RendererOptions::default() };
    // All devices are created before the first frame and destroyed after the last one, because the validation layers crash
    // otherwise.
    let mut stresses =
        (0..args.jobs.min(args.cases).max(1)).map(|_| Stress::new(&options)).collect::<Result<Vec<_>>>()?;
    let device = stresses[0].renderer().device_name().to_string();
    // A panic is reported as a finding, so the default message is switched off.
    std::panic::set_hook(Box::new(|_| {}));
    let tally = at_length(args, stresses)?;
    let least = if args.shrink { tally.first() } else { None };
    let least = least.map(|(seed, kind)| shrunk(&options, args, seed, kind)).transpose()?;
    let _ = std::panic::take_hook();
    let seconds = start.elapsed().as_secs_f64();
    if args.json {
        let mut object = tally.json();
        object["device"] = json!(device);
        object["seed"] = json!(args.seed);
        object["forms"] = json!(args.forms);
        object["batch"] = json!(args.batch);
        object["realistic"] = json!(args.realistic);
        object["validation"] = json!(args.validation);
        object["seconds"] = json!(seconds);
        say(&format!("{object:#}"))?;
    } else {
        if args.cases > 0 {
            say(&format!("{device}; {} scenes from seed {}, {:.0} s", args.cases, args.seed, seconds))?;
            tally.lines().iter().try_for_each(|line| say(line))?;
        }
        least.iter().try_for_each(|case| say(case))?;
    }
    if let Some(path) = &args.map {
        map::draw(path, &mut Stress::new(&options)?)?;
        if !args.json {
            say(&format!("{}: the map of errors", path.display()))?;
        }
    }
    if tally.is_clean() { Ok(()) } else { Err(Failure::Told) }
}

/// The reduced scene of a finding, as text.
fn shrunk(options: &RendererOptions, args: &StressArgs, seed: u64, kind: &str) -> Result<String> {
    let mut stress = Stress::new(options)?;
    for case in batch(seed, args.kind(), args.batch as usize).into_iter().flatten() {
        if !stress.run(&case)?.findings.iter().any(|finding| finding.kind == kind) {
            continue;
        }
        let case = stress.shrink(&case, kind)?;
        let findings = stress.run(&case)?.findings;
        let texts = findings.iter().map(|finding| format!("{}: {}\n", finding.kind, finding.what)).collect::<String>();
        return Ok(format!("{texts}{case:#?}"));
    }
    Ok(format!("seed {seed}: no scene of the batch shows it by itself"))
}

/// The first cases of the batches, sorted by combination of modes: compiling the kernels of one takes longer than a hundred
/// batches, and a renderer keeps the kernels of one or two.
fn order(args: &StressArgs) -> Vec<u64> {
    let mut starts: Vec<u64> = (0..args.cases).step_by(args.batch as usize).collect();
    starts.sort_by_cached_key(|start| form(args.seed.wrapping_add(*start), args.kind()));
    starts
}

/// Runs all cases on several renderers; the tally does not depend on the order in which they end.
fn at_length(args: &StressArgs, mut stresses: Vec<Stress>) -> Result<Tally> {
    let next = AtomicUsize::new(0);
    let starts = order(args);
    let progress = Progress::counted("scene", args.cases as usize);
    let work = |stress: &mut Stress| -> Result<Tally> {
        let mut tally = Tally::default();
        loop {
            let Some(&start) = starts.get(next.fetch_add(1, Ordering::Relaxed)) else {
                return Ok(tally);
            };
            let seed = args.seed.wrapping_add(start);
            let count = args.batch.min(args.cases - start);
            if args.batch == 1 {
                tally.add(seed, &stress.seed(seed, args.kind())?);
            } else {
                let outcomes = stress.batch(seed, args.kind(), count as usize)?;
                outcomes.iter().for_each(|outcome| tally.add(seed, outcome));
            }
            (0..count).for_each(|_| progress.step());
        }
    };
    std::thread::scope(|scope| {
        let work = &work;
        let workers: Vec<_> = stresses.iter_mut().map(|stress| scope.spawn(move || work(stress))).collect();
        let mut all = Tally::default();
        for worker in workers {
            let lost = |_| Error::Vulkan { call: "softras stress", result: "a worker ended in a panic".into() };
            all.merge(worker.join().map_err(lost)??);
        }
        Ok(all)
    })
}
