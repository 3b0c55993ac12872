//! `softras bench`: measures the time and the error of frames.

pub mod args;
mod machine;
mod plots;
mod rows;

use super::outputs::Outputs;
use super::progress::Progress;
use super::{Failure, say};
use args::BenchArgs;
use machine::Machine;
use rows::{Expected, Job, Row, measure, rows};
use serde_json::Value;
use softras::{Camera, Error, Mesh, Renderer, Scene, shapes};
use softras_check::measure::{Mode, subject, sweep};
use softras_io::Budget;
use softras_io::output;
use std::path::Path;

pub fn run(args: &BenchArgs) -> Result<(), Failure> {
    let outputs = Outputs::new(&args.json, [])?;
    for size in args.sizes() {
        args.settings(size).validate()?;
    }
    if let Some(folder) = &args.plots {
        let io = |source| Error::Io { path: folder.clone(), source };
        std::fs::create_dir_all(folder).map_err(io)?;
    }
    let meshes = meshes(args, &outputs)?;
    let mut renderer = super::open_device(args.device.as_deref(), args.read.memory)?;
    let machine = Machine::of(&renderer);
    machine.lines.iter().try_for_each(|line| say(line))?;
    let s = args.settings(256);
    say(&format!(
        "sigma {:e}, gamma {:e}, tau {:e}, background {:?}; medians of {} runs, milliseconds",
        s.sigma,
        s.gamma,
        s.tau,
        s.background,
        args.repeats()
    ))?;
    say(&Row::head())?;
    let cameras = subject::cameras(args.frame.batch)?;
    let mut all = Vec::new();
    for (name, mesh) in &meshes {
        let scene = subject::scene(mesh)?;
        for size in args.sizes() {
            all.extend(size_rows(args, &mut renderer, name, &scene, &cameras, size)?);
        }
    }
    if let Some(path) = &args.json {
        let list = Value::Array(all.iter().map(|row| row.json(&machine)).collect());
        output::write_file(path, format!("{list:#}\n").as_bytes())?;
    }
    match (&args.plots, meshes.first()) {
        (Some(folder), Some((name, mesh))) => pictures(args, folder, &mut renderer, &machine, (name, mesh), &all),
        _ => Ok(()),
    }
}

/// Measures what the pictures show beside the rows, prints it and draws the pictures.
fn pictures(
    args: &BenchArgs,
    folder: &Path,
    renderer: &mut Renderer,
    machine: &Machine,
    (name, mesh): (&str, &Mesh),
    all: &[Row],
) -> Result<(), Failure> {
    let size = args.sizes().into_iter().filter(|size| *size <= 256).max().unwrap_or(256);
    let spinner = Progress::spinner("measuring for the plots");
    let s = sweep::front_settings(&args.settings(size));
    let curves = sweep::front(renderer, &subject::scene(mesh)?, &subject::cameras(1)?, &s, args.repeats())?;
    let growths = sweep::growth(renderer, mesh, &args.settings(256), args.repeats(), false)?;
    drop(spinner);
    say(&format!(
        "run time against error: {name}, {size} pixels, sigma {:e}, gamma {:e}, near {:.3}, far {:.3}, background {:?}",
        s.sigma, s.gamma, s.near, s.far, s.background
    ))?;
    for curve in &curves {
        for p in &curve.points {
            say(&format!("  {:12} tau {:7.0e} {:9.3} ms  error {:.1e}", curve.name, p.tau, p.milliseconds, p.error))?;
        }
    }
    say("growth of the time of a frame (256 pixels, but for pixels)")?;
    for growth in &growths {
        let points: Vec<_> = growth.points.iter().map(|p| format!("{:e}: {:.2} ms", p.0, p.1)).collect();
        say(&format!("  {:18} exponent {:5.2}  {}", growth.name, growth.exponent(), points.join(", ")))?;
    }
    let caption = |what: &str| format!("{what}: {name} on {}", machine.device);
    plots::front(&folder.join("front.svg"), &caption("run time against error"), &curves)?;
    plots::growth(&folder.join("growth.svg"), &caption("growth"), &growths)?;
    plots::stages(&folder.join("stages.svg"), &caption("a frame, forward and backward"), all)?;
    say(&format!("{}: front.svg, growth.svg, stages.svg", folder.display()))
}

/// Measures all modes at one size and prints each row when it is done.
fn size_rows(
    args: &BenchArgs,
    renderer: &mut Renderer,
    name: &str,
    scene: &Scene,
    cameras: &[Camera],
    size: u32,
) -> Result<Vec<Row>, Failure> {
    let mut all: Vec<Row> = Vec::new();
    for mode in args.measured_modes() {
        let settings = mode.of(&args.settings(size));
        let job = Job { name, scene, cameras, settings, mode, repeats: args.repeats() };
        let spinner = Progress::spinner(&format!("{name} {size} {}", mode.name()));
        let expected = if args.no_errors { None } else { Some(Expected::of(&job)?) };
        let found = measure(renderer, &job, expected.as_ref())?;
        drop(spinner);
        let mut rows = rows(&job, &found);
        for row in &mut rows {
            let full = all.iter().find(|full| full.mode == Mode::ColorSilhouette.name() && full.pass == row.pass);
            row.of_full = full.map(|full| row.median / full.median);
        }
        rows.iter().try_for_each(|row| say(&row.text()))?;
        all.extend(rows);
    }
    Ok(all)
}

/// The given mesh, or the built-in ones.
fn meshes(args: &BenchArgs, outputs: &Outputs) -> Result<Vec<(String, Mesh)>, Failure> {
    if let Some(path) = &args.mesh {
        let loaded = args.read.read(path, false, outputs, &Budget::new(args.read.memory))?;
        let name = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
        return Ok(vec![(name, loaded.mesh)]);
    }
    let mut meshes = vec![("fish".to_string(), shapes::fish()?)];
    if !args.quick {
        for subdivisions in [3, 5] {
            meshes.push((format!("icosphere{subdivisions}"), shapes::icosphere(subdivisions)?));
        }
    }
    Ok(meshes)
}
