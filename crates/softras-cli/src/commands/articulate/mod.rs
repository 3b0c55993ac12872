//! `softras articulate`: fits the pose of a jointed figure to one picture in which a limb is hidden.

pub mod args;
mod trial;

use super::outputs::Outputs;
use super::progress::Progress;
use super::{Failure, say};
use args::ArticulateArgs;
use serde_json::json;
use softras::{Error, Renderer, Result};
use softras_io::Curve;
use softras_io::Picture;
use softras_lab::articulated::SkeletonPose;
use softras_lab::random::Random;
use softras_view as sheet;
use std::path::Path;
use trial::{Found, HIDDEN, Method, Stage, Trial};

/// Pixels of each panel of the picture.
const PANEL: (u32, u32) = (216, 240);

/// Runs the command.
pub fn run(args: &ArticulateArgs) -> Result<(), Failure> {
    Outputs::new(&args.out, &args.obj)?;
    let mut renderer = super::open_device(args.device.as_deref(), None)?;
    let stage = Stage::new(args.size)?;
    let methods = trial::methods(args);
    let mut random = Random::new(args.seed);
    let mut rows = vec![Row::new("no optimisation")];
    rows.extend(methods.iter().map(|method| Row::new(method.name)));
    let mut seen = Vec::new();
    let progress = Progress::counted("fit", args.trials as usize * methods.len());
    for index in 0..args.trials {
        let Some(trial) = stage.draw(&mut random, &mut renderer)? else {
            let what = "no pose was drawn in which the arm is hidden at first and not quite at last";
            return Err(Error::Fit { what: what.into(), fix: "use another seed or more pixels".into() }.into());
        };
        seen.push(trial.seen);
        rows[0].add(&stage, &trial, &Found { pose: trial.start.clone(), seconds: 0.0 });
        let mut found = Vec::with_capacity(methods.len());
        for (method, row) in methods.iter().zip(&mut rows[1..]) {
            let fitted = stage.fit(&trial, method, &mut renderer)?;
            row.add(&stage, &trial, &fitted);
            found.push(fitted);
            progress.step();
        }
        if index == 0 {
            show(args, &stage, &trial, &methods, &found, &mut renderer)?;
        }
    }
    drop(progress);
    tell(args, &rows, &seen, renderer.device_name())
}

/// The errors of a method in all trials.
struct Row {
    name: &'static str,
    /// Degrees by which the hidden joint is wrong.
    hidden: Vec<f64>,
    /// The mean error of all other joints, degrees.
    others: Vec<f64>,
    seconds: f64,
}

impl Row {
    fn new(name: &'static str) -> Self {
        Self { name, hidden: Vec::new(), others: Vec::new(), seconds: 0.0 }
    }

    fn add(&mut self, stage: &Stage, trial: &Trial, found: &Found) {
        let [hidden, others] = stage.errors(&found.pose, &trial.truth);
        self.hidden.push(hidden);
        self.others.push(others);
        self.seconds += found.seconds;
    }
}

/// Writes the requested files of the first trial.
fn show(
    args: &ArticulateArgs,
    stage: &Stage,
    trial: &Trial,
    methods: &[Method],
    found: &[Found],
    renderer: &mut Renderer,
) -> Result<()> {
    let of = |name: &str| methods.iter().zip(found).find(|(m, _)| m.name == name).map(|(_, found)| &found.pose);
    let (Some(visible), Some(soft)) = (of("visible only"), of("soft")) else { return Ok(()) };
    if let Some(path) = &args.obj {
        softras_io::save(&stage.figure.posed(soft)?, path)?;
    }
    match &args.out {
        Some(path) => picture(path, stage, trial, visible, soft, renderer),
        None => Ok(()),
    }
}

/// Writes the picture of target, start and two fits, from the camera and from behind.
fn picture(
    path: &Path,
    stage: &Stage,
    trial: &Trial,
    visible: &SkeletonPose,
    soft: &SkeletonPose,
    renderer: &mut Renderer,
) -> Result<()> {
    const SAMPLES: u32 = 3;
    let mut panels = Vec::new();
    for behind in [false, true] {
        let poses = [("target", &trial.truth), ("start", &trial.start), ("visible only", visible), ("soft", soft)];
        for (name, pose) in poses {
            let frame =
                stage.look(renderer, &stage.figure.posed(pose)?, behind, (SAMPLES * PANEL.0, SAMPLES * PANEL.1))?;
            let (Some(color), Some(alpha)) = (frame.color(), frame.silhouette()) else { continue };
            let pooled = |image| softras_fit::pooled(image, SAMPLES as usize);
            let (color, alpha) = (pooled(color)?, pooled(alpha)?);
            let byte = |c: f32, a: f32| (Curve::Srgb.encode(f64::from(c + 1.0 - a)) * 255.0).round() as u8;
            let pixel = |(c, &a): (&[f32], &f32)| [byte(c[0], a), byte(c[1], a), byte(c[2], a), 255];
            let pixels = color.data.chunks_exact(3).zip(&alpha.data).map(pixel).collect();
            let error = stage.errors(pose, &trial.truth)[0];
            let label = match (behind, name) {
                (true, "target") => "from behind".into(),
                (true, _) => format!("hidden elbow {error:.1}"),
                (false, _) => name.into(),
            };
            panels.push((Picture { width: PANEL.0 as usize, height: PANEL.1 as usize, pixels }, label));
        }
    }
    (sheet::sheet(&panels, [255; 3])).save(path)
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    if n == 0 { 0.0 } else { 0.5 * (sorted[n / 2] + sorted[(n - 1) / 2]) }
}

fn tell(args: &ArticulateArgs, rows: &[Row], seen: &[f64], device: &str) -> Result<(), Failure> {
    let count = |row: &Row, right: fn(f64) -> bool| row.hidden.iter().filter(|e| right(**e)).count();
    if args.json {
        let each = rows.iter().map(|row| {
            json!({
                "method": row.name, "hidden_joint_degrees": row.hidden, "median_degrees": median(&row.hidden),
                "mean_degrees": mean(&row.hidden), "within_10_degrees": count(row, |e| e <= 10.0),
                "beyond_30_degrees": count(row, |e| e > 30.0), "other_joints_mean_degrees": mean(&row.others),
                "seconds": row.seconds,
            })
        });
        let whole = json!({
            "trials": args.trials, "seed": args.seed, "iterations": args.iterations, "size": args.size,
            "hidden_joint": HIDDEN, "limb_seen_in_target": seen, "device": device,
            "methods": each.collect::<Vec<_>>(),
        });
        return say(&whole.to_string());
    }
    let columns = ["median", "mean", "<= 10 deg", "> 30 deg", "others", "seconds"];
    let [a, b, c, d, e, f] = columns;
    say(&format!("{:<24} {a:>8} {b:>8} {c:>10} {d:>9} {e:>8} {f:>8}", "hidden elbow, degrees"))?;
    rows.iter().try_for_each(|row| {
        let (within, beyond) = (count(row, |e| e <= 10.0), count(row, |e| e > 30.0));
        let (name, middle, average) = (row.name, median(&row.hidden), mean(&row.hidden));
        let (others, seconds) = (mean(&row.others), row.seconds);
        say(&format!("{name:<24} {middle:>8.2} {average:>8.2} {within:>10} {beyond:>9} {others:>8.2} {seconds:>8.1}"))
    })
}
