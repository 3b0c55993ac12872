//! The command `softras-reconstruct`: its arguments, and what each subcommand does.

use super::checkpoint;
use super::data::{self, Set, Shard};
use super::network::Network;
use super::train::{Config, Row, Trainer, meshes};
use super::{curves, evaluate, families, file_error, fit_error, picture, synthesis};
use burn::module::Module;
use burn::tensor::Device;
use clap::{Args, Parser, Subcommand};
use softras::internals::files;
use softras::{Error, Renderer, Result};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Learn shape from pictures alone: make pictures, train the network, look at what it sees, and compare.
#[derive(Debug, Parser)]
#[command(name = "softras-reconstruct", version)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Make sets of pictures and solids in the official format, from procedural families or a folder of meshes
    Data(DataArgs),
    /// Train a network on the set `train` of a folder; Ctrl-C ends it and keeps what was learned
    Train(TrainArgs),
    /// Make a mesh of one picture
    Predict(PredictArgs),
    /// Print the table of the set `test`: networks beside what needs no network
    Evaluate(EvaluateArgs),
    /// Make data, train a small network for some minutes, and draw what it sees: sheet.png
    Demo(DemoArgs),
}

#[derive(Debug, Args)]
struct DataArgs {
    /// The folder to write <class>_<set>_images.npz and <class>_<set>_voxels.npz into
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    /// Procedural families
    #[arg(long, value_delimiter = ',', default_values_t = families::NAMES.map(String::from))]
    families: Vec<String>,
    /// Objects of each family to train with
    #[arg(long, default_value_t = 60)]
    train: usize,
    /// Objects of each family that choose the best checkpoint
    #[arg(long, default_value_t = 8)]
    val: usize,
    /// Objects of each family to evaluate with
    #[arg(long, default_value_t = 16)]
    test: usize,
    /// Seed of the families' objects, below a million
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u64).range(..1_000_000))]
    seed: u64,
    /// Make only this part, `I/N` with I from 0; parts may be made anywhere and in any order
    #[arg(long, value_name = "I/N", default_value = "0/1", value_parser = parse_shard)]
    shard: Shard,
    /// Take the mesh files of this folder in place of the families
    #[arg(long, value_name = "FOLDER", requires = "class")]
    meshes: Option<PathBuf>,
    /// The name of the class that the meshes are
    #[arg(long, value_name = "NAME")]
    class: Option<String>,
}

#[derive(Clone, Debug, Args)]
struct TrainArgs {
    /// The folder of the data
    data: PathBuf,
    /// The folder for best.checkpoint, last.checkpoint and curve.csv
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    /// Classes to train on [default: all that the folder has]
    #[arg(long, value_delimiter = ',')]
    classes: Vec<String>,
    /// Go on from a checkpoint, with its settings
    #[arg(long, value_name = "CHECKPOINT")]
    resume: Option<PathBuf>,
    /// Steps between checkpoints
    #[arg(long, default_value_t = 250)]
    every: usize,
    #[command(flatten)]
    settings: TrainSettings,
}

#[derive(Clone, Debug, Args)]
struct TrainSettings {
    /// Channels of the first convolution; the official network has 64
    #[arg(long, default_value_t = 8)]
    width: usize,
    /// Steps in all
    #[arg(long, default_value_t = 1500)]
    steps: usize,
    /// Objects of a step, each in two views
    #[arg(long, default_value_t = 8)]
    pairs: usize,
    /// Adam's rate; × 0.3 after three fifths of the steps
    #[arg(long, default_value_t = 1e-3)]
    rate: f64,
    /// σ of the renderings
    #[arg(long, default_value_t = 1e-4)]
    sigma: f64,
    /// Weight of the Laplacian loss
    #[arg(long, default_value_t = 5e-3)]
    laplacian: f64,
    /// Weight of the flatten loss
    #[arg(long, default_value_t = 5e-4)]
    flatten: f64,
    /// Weight of the colour loss; 0 learns from silhouettes alone
    #[arg(long, default_value_t = 1.0)]
    color: f64,
    /// Compare hard images, whose gradient is that of an edge one pixel wide
    #[arg(long)]
    hard: bool,
    /// Decides the first weights and the order of the pictures
    #[arg(long, default_value_t = 0)]
    seed: u64,
}

impl TrainSettings {
    fn config(&self) -> Config {
        let Self { width, steps, pairs, rate, sigma, laplacian, flatten, color, hard, seed } = *self;
        Config { width, steps, pairs, rate, sigma, laplacian, flatten, color, hard, seed }
    }
}

#[derive(Debug, Args)]
struct PredictArgs {
    /// A PNG picture of 64 by 64 pixels with a transparent background
    image: PathBuf,
    /// The checkpoint of a network
    #[arg(long, value_name = "CHECKPOINT")]
    network: PathBuf,
    /// The mesh to write, an OBJ file
    #[arg(short, long, value_name = "MESH.obj")]
    output: PathBuf,
}

#[derive(Debug, Args)]
struct EvaluateArgs {
    /// The folder of the data
    data: PathBuf,
    /// Checkpoints of networks, each with the name of its row before it: `full=runs/full/best.checkpoint`
    #[arg(long = "network", value_name = "NAME=CHECKPOINT", value_parser = parse_network)]
    networks: Vec<(String, PathBuf)>,
    /// Classes to evaluate [default: all that the folder has]
    #[arg(long, value_delimiter = ',')]
    classes: Vec<String>,
    /// Views of each object, spread evenly
    #[arg(long, default_value_t = 24)]
    views: usize,
    /// A picture of what the first network sees in some objects
    #[arg(long, value_name = "SHEET.png", requires = "networks")]
    sheet: Option<PathBuf>,
    /// The curves of the networks' trainings
    #[arg(long, value_name = "CURVES.svg", requires = "networks")]
    curves: Option<PathBuf>,
    /// A picture of the first object to try `predict` with
    #[arg(long, value_name = "PICTURE.png")]
    example: Option<PathBuf>,
}

#[derive(Debug, Args)]
struct DemoArgs {
    /// The folder for everything that is made
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    /// Steps of the training
    #[arg(long, default_value_t = 600)]
    steps: usize,
}

fn parse_shard(text: &str) -> Result<Shard, String> {
    let parsed = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
    match parsed {
        Some((index, count)) if index < count && count <= 10_000 => Ok(Shard { index, count }),
        _ => Err("I/N with I below N, N at most 10000".into()),
    }
}

fn parse_network(text: &str) -> Result<(String, PathBuf), String> {
    let parsed = text.split_once('=').filter(|(name, path)| !name.is_empty() && !path.is_empty());
    parsed.map(|(name, path)| (name.into(), path.into())).ok_or("NAME=CHECKPOINT is expected".into())
}

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
    if args.every == 0 {
        return fit_error("checkpoints every 0 steps", "use at least 1");
    }
    let set = data::read(&args.data, "train", &args.classes)?;
    let validation = data::read(&args.data, "val", &args.classes)?;
    let renderer = Renderer::new()?;
    let mut trainer = match &args.resume {
        Some(path) => Trainer::resume(path, renderer)?,
        None => Trainer::new(args.settings.config(), renderer)?,
    };
    std::fs::create_dir_all(&args.output).map_err(|source| Error::Io { path: args.output.clone(), source })?;
    let stop = interruption()?;
    eprintln!("{} objects of {} classes, {} weights", set.objects.len(), set.classes.len(), trainer.weights());
    let (start, first) = (Instant::now(), trainer.status().step);
    while !trainer.is_done() && !stop.load(Ordering::Relaxed) {
        let row = trainer.step(&set)?;
        if row.step % 25 == 0 {
            let rate = (row.step - first) as f64 / start.elapsed().as_secs_f64();
            let steps = trainer.status().config.steps;
            eprintln!(
                "step {}/{steps}: loss {:.4}, IoU of silhouettes {:.3}, {rate:.2} steps a second",
                row.step,
                row.loss,
                1.0 - row.silhouette
            );
        }
        if row.step % args.every == 0 {
            keep(&mut trainer, &validation, &args.output)?;
        }
    }
    // What the last steps taught, and what an interruption leaves.
    keep(&mut trainer, &validation, &args.output)
}

/// Validates and writes the checkpoints and the curve.
fn keep(trainer: &mut Trainer, validation: &Set, folder: &Path) -> Result<()> {
    let (loss, is_best) = trainer.validate(validation)?;
    trainer.save(&folder.join("last.checkpoint"))?;
    if is_best {
        trainer.save(&folder.join("best.checkpoint"))?;
    }
    let line = |r: &Row| format!("{},{},{},{},{},{}\n", r.step, r.loss, r.silhouette, r.color, r.laplacian, r.flatten);
    let curve: String = trainer.status().curve.iter().map(line).collect();
    let head = "step,loss,silhouette,color,laplacian,flatten\n";
    files::write_file(&folder.join("curve.csv"), format!("{head}{curve}").as_bytes())?;
    eprintln!("validation loss {loss:.4}{}", if is_best { ", the best so far" } else { "" });
    Ok(())
}

/// A network for looking at, and the curve of its training.
fn network(path: &Path, device: &Device) -> Result<(Network, Vec<Row>)> {
    let (status, network, _) = checkpoint::read(path, device, None)?;
    Ok((network.valid(), status.curve))
}

fn predict(args: &PredictArgs) -> Result<()> {
    if args.output.extension().and_then(|end| end.to_str()) != Some("obj") {
        return file_error(&args.output, "not the name of an OBJ file", "name it *.obj");
    }
    files::check_writable(&args.output)?;
    let picture = picture::read(&args.image)?;
    let device = Device::flex();
    let (network, _) = network(&args.network, &device)?;
    for mesh in meshes(&network, &[&picture], &device)? {
        softras::obj::write_obj(&mesh, &args.output)?;
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
        networks.push((name.clone(), network));
        trainings.push((name.clone(), curve));
    }
    if let Some(path) = &args.curves {
        curves::draw(path, &trainings)?;
    }
    let train = data::read(&args.data, "train", &args.classes)?;
    print!("{}", evaluate::table(&train, &test, &networks, args.views, &device)?);
    let (Some(path), Some((_, first))) = (&args.sheet, networks.first()) else { return Ok(()) };
    picture::sheet(path, &test, first, &some_of_each(&test, 1), &mut Renderer::new()?)
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
        meshes: None,
        class: None,
    })?;
    let settings = TrainSettings {
        width: 6,
        steps: args.steps,
        pairs: 8,
        rate: 2e-3,
        sigma: 1e-4,
        // Few steps leave a surface rough under the official weight.
        laplacian: 3e-2,
        flatten: 5e-4,
        color: 1.0,
        hard: false,
        seed: 0,
    };
    let [data, output] = [folder.clone(), args.output.join("network")];
    train(&TrainArgs { data, output: output.clone(), classes: Vec::new(), resume: None, every: 100, settings })?;
    compare(&EvaluateArgs {
        data: folder,
        networks: vec![("network".into(), output.join("best.checkpoint"))],
        classes: Vec::new(),
        views: 4,
        sheet: Some(args.output.join("sheet.png")),
        curves: Some(args.output.join("curves.svg")),
        example: Some(args.output.join("picture.png")),
    })
}
