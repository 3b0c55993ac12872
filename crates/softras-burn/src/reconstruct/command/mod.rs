//! The command `softras-reconstruct`: its arguments, and what each subcommand does.

mod args;

use super::config::{Coloring, Row};
use super::data::{self, Set, Shard};
use super::model::Model;
use super::network::meshes;
use super::official;
use super::team::{Team, processes};
use super::train::Trainer;
use super::{
    checkpoint, colors, curves, evaluate, families, file_error, fit_error, furniture, picture, sheet, synthesis,
};
pub use args::Cli;
use args::{Command, DataArgs, DemoArgs, EvaluateArgs, PredictArgs, TrainArgs, TrainSettings};
use burn::module::Module;
use burn::tensor::Device;
use softras::{Error, Renderer, Result};
use softras_io::output;
use std::path::Path;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Runs the command.
///
/// # Errors
/// What the subcommand's work returns.
pub fn run(cli: Cli) -> Result<()> {
    match cli.command {
        Command::Data(args) => make_data(&args),
        Command::Train(args) => train(&args),
        Command::Predict(args) => predict(&args),
        Command::Evaluate(args) => compare(&args),
        Command::Demo(args) => demo(&args),
    }
}

fn make_data(args: &DataArgs) -> Result<()> {
    let mut renderer = Renderer::new()?;
    let tell = |line: &str| eprintln!("{line}");
    if let Some(from) = &args.furniture {
        return furniture::furniture(&mut renderer, &args.output, from, args.shard, tell);
    }
    match (&args.meshes, &args.class) {
        (Some(meshes), Some(class)) => synthesis::folder(&mut renderer, &args.output, class, meshes, args.shard, tell),
        _ => {
            let counts = [args.train, args.val, args.test];
            synthesis::families(&mut renderer, &args.output, &args.families, counts, args.seed, args.shard, tell)
        }
    }
}

/// Whether Ctrl-C was pressed.
fn interruption() -> Result<Arc<AtomicBool>> {
    let flag = Arc::new(AtomicBool::new(false));
    let handler = flag.clone();
    let set = ctrlc::set_handler(move || {
        // Whoever asks twice does not want to wait for the step.
        if handler.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    });
    set.or_else(|e| fit_error(format!("Ctrl-C cannot be caught ({e})"), "report this"))?;
    Ok(flag)
}

fn train(args: &TrainArgs) -> Result<()> {
    let team = processes()?;
    let trained = train_with(args, team.clone());
    if let (Err(e), true) = (&trained, team.size() > 1) {
        // Nothing is said after the end of all processes.
        eprintln!("error: process {}: {e}", team.rank());
        team.abort();
    }
    trained
}

fn train_with(args: &TrainArgs, team: Rc<dyn Team>) -> Result<()> {
    if args.every == 0 {
        return fit_error("checkpoints every 0 steps", "use at least 1");
    }
    let set = data::read(&args.data, "train", &args.classes)?;
    let validation = data::read(&args.data, "val", &args.classes)?;
    let renderer = Renderer::new()?;
    let trainer = match &args.resume {
        Some(path) => Trainer::resume(path, renderer)?,
        None => Trainer::new(args.settings.config(team.size()), renderer)?,
    };
    let mut trainer = trainer.with_team(team)?;
    if trainer.team().rank() == 0 {
        std::fs::create_dir_all(&args.output).map_err(|source| Error::Io { path: args.output.clone(), source })?;
        eprintln!("{} objects of {} classes, {} weights", set.objects.len(), set.classes.len(), trainer.weights());
    }
    steps(&mut trainer, &set, &validation, args)
}

/// Takes all steps that are left, and keeps what was learned now and then.
fn steps(trainer: &mut Trainer, set: &Set, validation: &Set, args: &TrainArgs) -> Result<()> {
    let stop = interruption()?;
    let (start, first) = (Instant::now(), trainer.status().step);
    while !trainer.is_done() && !trainer.team().any(stop.load(Ordering::Relaxed)) {
        let row = trainer.step(set)?;
        if row.step % 25 == 0 && trainer.team().rank() == 0 {
            let rate = (row.step - first) as f64 / start.elapsed().as_secs_f64();
            let steps = trainer.status().config.steps;
            let overlap = format!(", IoU of silhouettes {:.3}", 1.0 - row.silhouette);
            let overlap = if trainer.status().config.voxels { "" } else { &overlap };
            eprintln!("step {}/{steps}: loss {:.4}{overlap}, {rate:.2} steps a second", row.step, row.loss);
        }
        if row.step % args.every == 0 {
            keep(trainer, validation, &args.output)?;
        }
    }
    // What the last steps taught, and what an interruption leaves.
    keep(trainer, validation, &args.output)
}

/// Validates and writes the checkpoints and the curve, which the first process does for all.
fn keep(trainer: &mut Trainer, validation: &Set, folder: &Path) -> Result<()> {
    trainer.gather();
    if trainer.team().rank() > 0 {
        return Ok(());
    }
    let (loss, is_best) = trainer.validate(validation)?;
    trainer.save(&folder.join("last.safetensors"))?;
    if is_best {
        trainer.save(&folder.join("best.safetensors"))?;
    }
    let line = |row: &Row| format!("{},{}\n", row.step, row.losses().map(|loss| loss.to_string()).join(","));
    let curve: String = trainer.status().curve.iter().map(line).collect();
    let head = Row::COLUMNS.join(",");
    output::write_file(&folder.join("curve.csv"), format!("{head}\n{curve}").as_bytes())?;
    eprintln!("validation loss {loss:.4}{}", if is_best { ", the best so far" } else { "" });
    Ok(())
}

/// A network for looking at, and the curve of its training where the file has it.
fn network(path: &Path, device: &Device) -> Result<(Model, Vec<Row>)> {
    if official::is_named(path) {
        return Ok((Model::Mesh(official::read(path, device)?), Vec::new()));
    }
    let (status, network, _) = checkpoint::read(path, device, None)?;
    Ok((network.valid(), status.curve))
}

fn predict(args: &PredictArgs) -> Result<()> {
    if args.output.extension().and_then(|end| end.to_str()) != Some("obj") {
        return file_error(&args.output, "not the name of an OBJ file", "name it *.obj");
    }
    for path in [Some(&args.output), args.gif.as_ref()].into_iter().flatten() {
        output::check_writable(path)?;
    }
    let picture = picture::read(&args.image)?;
    let device = Device::flex();
    let (Model::Mesh(network), _) = network(&args.network, &device)? else {
        return file_error(
            &args.network,
            "it is a voxel network, which sees no mesh",
            "give a network trained without --voxels",
        );
    };
    for mesh in meshes(&network, &[&picture], &device)? {
        softras_io::save(&mesh, &args.output)?;
        if let Some(path) = &args.gif {
            sheet::turn(path, &picture, &mesh, &mut Renderer::new()?)?;
        }
    }
    Ok(())
}

fn compare(args: &EvaluateArgs) -> Result<()> {
    let device = Device::flex();
    let test = data::read(&args.data, "test", &args.classes)?;
    if let Some(path) = &args.example {
        picture::write(path, test.objects[0].picture(3))?;
    }
    let (mut networks, mut trainings) = (Vec::new(), Vec::new());
    for (name, path) in &args.networks {
        let (network, curve) = network(path, &device)?;
        if matches!(network, Model::Mesh(_)) && !curve.is_empty() {
            trainings.push((name.clone(), curve));
        }
        networks.push((name.clone(), network));
    }
    if let Some(path) = &args.curves {
        if let (true, Some((_, first))) = (trainings.is_empty(), args.networks.first()) {
            let fix = "name a checkpoint that `train` has written of a mesh network, or leave --curves out";
            return file_error(first, "no network has a curve of silhouettes, neither this one nor one after it", fix);
        }
        curves::draw(path, &trainings)?;
    }
    let train = data::read(&args.data, "train", &args.classes)?;
    print!("{}", evaluate::table(&train, &test, &networks, args.views, &device)?);
    if networks.iter().any(|(_, network)| matches!(network, Model::Mesh(network) if network.is_colored())) {
        let renderer = &mut Renderer::new()?;
        print!("\n{}", colors::table(renderer, &train, &test, &networks, args.views, &device)?);
    }
    let Some(path) = &args.sheet else { return Ok(()) };
    let first =
        networks.iter().find_map(|(_, network)| if let Model::Mesh(first) = network { Some(first) } else { None });
    let Some(first) = first else { return fit_error("a sheet without a mesh network", "name one with --network") };
    sheet::sheet(path, &test, first, &some_of_each(&test, 1), &mut Renderer::new()?)
}

/// The first objects of each class.
fn some_of_each(set: &Set, count: usize) -> Vec<usize> {
    let of = |class: usize| {
        set.objects.iter().enumerate().filter(move |(_, o)| o.class == class).map(|(i, _)| i).take(count)
    };
    (0..set.classes.len()).flat_map(of).collect()
}

fn demo(args: &DemoArgs) -> Result<()> {
    let folder = args.output.join("data");
    make_data(&DataArgs {
        output: folder.clone(),
        families: families::NAMES.map(String::from).to_vec(),
        train: 24,
        val: 4,
        test: 6,
        seed: 0,
        shard: Shard::WHOLE,
        furniture: None,
        meshes: None,
        class: None,
    })?;
    let settings = TrainSettings {
        width: 6,
        steps: args.steps,
        pairs: 8,
        shares: None,
        rate: 2e-3,
        sigma: 1e-4,
        laplacian: 3e-2,
        flatten: 5e-4,
        color: 1.0,
        coloring: Coloring::Palette,
        hard: None,
        voxels: false,
        seed: 0,
    };
    let [data, output] = [folder.clone(), args.output.join("network")];
    train(&TrainArgs { data, output: output.clone(), classes: Vec::new(), resume: None, every: 100, settings })?;
    compare(&EvaluateArgs {
        data: folder,
        networks: vec![("network".into(), output.join("best.safetensors"))],
        classes: Vec::new(),
        views: 4,
        sheet: Some(args.output.join("sheet.png")),
        curves: Some(args.output.join("curves.svg")),
        example: Some(args.output.join("picture.png")),
    })
}
