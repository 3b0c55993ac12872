//! The work of each subcommand.

use crate::args::{Cli, Command, DataArgs, DemoArgs, EvaluateArgs, PredictArgs, TrainArgs};
use crate::config::Row;
use crate::data::{self, Set};
use crate::network::{Network, meshes};
use crate::official;
use crate::train::Trainer;
use crate::{checkpoint, colors, evaluate, file_error, fit_error, furniture, io_error, picture, sheet, synthesis};
use burn::module::Module;
use burn::tensor::Device;
use clap::Parser;
use softras::{Renderer, Result};
use softras_io::output;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Runs the command.
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
    match (&args.furniture, &args.meshes, &args.class) {
        (Some(from), ..) => furniture::furniture(&mut renderer, &args.output, from),
        (_, Some(meshes), Some(class)) => synthesis::folder(&mut renderer, &args.output, class, meshes),
        _ => {
            let counts = [args.train, args.val, args.test];
            synthesis::families(&mut renderer, &args.output, &args.families, counts, args.seed)
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
    set.map_err(|e| fit_error(format!("Ctrl-C cannot be caught ({e})"), "report this"))?;
    Ok(flag)
}

/// Takes all steps that are left, and keeps what was learned now and then.
fn train(args: &TrainArgs) -> Result<()> {
    if args.every == 0 {
        return Err(fit_error("checkpoints every 0 steps", "use at least 1"));
    }
    let set = data::read(&args.data, "train", &args.classes)?;
    let validation = data::read(&args.data, "val", &args.classes)?;
    let renderer = Renderer::new()?;
    let mut trainer = match &args.resume {
        Some(path) => Trainer::resume(path, renderer)?,
        None => Trainer::new(args.config.clone(), renderer)?,
    };
    std::fs::create_dir_all(&args.output).map_err(|e| io_error(&args.output, e))?;
    eprintln!("{} objects of {} classes, {} weights", set.objects.len(), set.classes.len(), trainer.weights());
    let stop = interruption()?;
    let (start, first) = (Instant::now(), trainer.status().step);
    while !trainer.is_done() && !stop.load(Ordering::Relaxed) {
        let row = trainer.step(&set)?;
        if row.step % 25 == 0 {
            let rate = (row.step - first) as f64 / start.elapsed().as_secs_f64();
            let (steps, loss, overlap) = (trainer.status().config.steps, row.loss(), row.overlap());
            let head = format!("step {}/{steps}: loss {loss:.4}", row.step);
            eprintln!("{head}, IoU of silhouettes {overlap:.3}, {rate:.2} steps a second");
        }
        if row.step % args.every == 0 {
            keep(&mut trainer, &validation, &args.output)?;
        }
    }
    // Keep what the last steps taught, also after an interruption.
    keep(&mut trainer, &validation, &args.output)
}

/// Validates and writes the checkpoints and the curve.
fn keep(trainer: &mut Trainer, validation: &Set, folder: &Path) -> Result<()> {
    let (loss, is_best) = trainer.validate(validation)?;
    trainer.save(&folder.join("last.safetensors"))?;
    if is_best {
        trainer.save(&folder.join("best.safetensors"))?;
    }
    let line = |row: &Row| format!("{},{}\n", row.step, row.losses.map(|loss| loss.to_string()).join(","));
    let curve: String = trainer.status().curve.iter().map(line).collect();
    let head = Row::COLUMNS.join(",");
    output::write_file(&folder.join("curve.csv"), format!("step,{head}\n{curve}").as_bytes())?;
    eprintln!("validation loss {loss:.4}{}", if is_best { ", the best so far" } else { "" });
    Ok(())
}

/// A network that is used and not trained.
fn network(path: &Path, device: &Device) -> Result<Network> {
    if official::is_named(path) {
        return official::read(path, device);
    }
    Ok(checkpoint::read(path, device, None)?.1.valid())
}

fn predict(args: &PredictArgs) -> Result<()> {
    if args.output.extension().and_then(|end| end.to_str()) != Some("obj") {
        return Err(file_error(&args.output, "not the name of an OBJ file", "name it *.obj"));
    }
    for path in [Some(&args.output), args.gif.as_ref()].into_iter().flatten() {
        output::check_writable(path)?;
    }
    let picture = picture::read(&args.image)?;
    let device = Device::flex();
    let network = network(&args.network, &device)?;
    for mesh in meshes(&network, &[&picture], &device)? {
        softras_io::save(&mesh, &args.output)?;
        if let Some(path) = &args.gif {
            sheet::turn(path, &picture, &mesh, &mut Renderer::new()?)?;
        }
    }
    Ok(())
}

fn compare(args: &EvaluateArgs) -> Result<()> {
    let (device, views) = (Device::flex(), usize::from(args.views));
    let test = data::read(&args.data, "test", &args.classes)?;
    if let Some(path) = &args.example {
        picture::pixels(test.objects[0].picture(3)).save(path)?;
    }
    let network = |(name, path): &(String, PathBuf)| Ok((name.clone(), network(path, &device)?));
    let networks = args.networks.iter().map(network).collect::<Result<Vec<_>>>()?;
    let train = data::read(&args.data, "train", &args.classes)?;
    print!("{}", evaluate::table(&train, &test, &networks, views, &device)?);
    if networks.iter().any(|(_, network)| network.is_colored()) {
        let mut renderer = Renderer::new()?;
        print!("\n{}", colors::table(&mut renderer, &train, &test, &networks, views, &device)?);
    }
    match (&args.sheet, networks.first()) {
        (Some(path), Some((_, first))) => sheet::sheet(path, &test, first, &mut Renderer::new()?),
        _ => Ok(()),
    }
}

/// Runs the other subcommands one after another.
fn demo(args: &DemoArgs) -> Result<()> {
    let path = |name: &str| args.output.join(name).into_os_string();
    // A line in which each % stands for the next path.
    let run_line = |line: &str, paths: &[OsString]| {
        let mut paths = paths.iter();
        let word = |word: &str| if word == "%" { paths.next().cloned() } else { Some(word.into()) };
        let words: Vec<OsString> = line.split(' ').filter_map(word).collect();
        run(Cli::parse_from(words))
    };
    let (data, network) = (path("data"), path("network"));
    run_line("- data --train 24 --val 4 --test 6 -o %", std::slice::from_ref(&data))?;
    let train = format!("- train % -o % --width 6 --rate 2e-3 --every 100 --steps {}", args.steps);
    run_line(&train, &[data.clone(), network])?;
    let mut best = OsString::from("network=");
    best.push(path("network/best.safetensors"));
    let pictures = ["sheet.png", "picture.png"].map(path);
    let evaluate = "- evaluate % --network % --views 4 --sheet % --example %";
    run_line(evaluate, &[vec![data, best], pictures.to_vec()].concat())
}
