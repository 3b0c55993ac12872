//! The command line: subcommands, exit codes and output to the terminal.

mod bench;
mod check;
mod complete;
mod convert;
mod describe;
mod devices;
mod fit;
mod grad;
mod info;
mod iou;
mod mesh;
mod mesh_file;
mod outputs;
mod parse;
mod pose;
mod progress;
mod render;
mod stress;
mod svg;

use clap::{Parser, Subcommand};
use std::io::Write;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// The `softras` command.
#[derive(Debug, Parser)]
#[command(
    name = "softras",
    version,
    about = "Differentiable soft mesh rasterization on any Vulkan device",
    after_help = "\
Exit codes: 0 success; 1 failure, with one line that says why and how to fix it;
2 invalid arguments; 130 ended by Ctrl-C, with the best so far written."
)]
pub struct Cli {
    /// The subcommand.
    #[command(subcommand)]
    pub command: Command,
    /// Print errors and results alone: no notes, no progress
    #[arg(short, long, global = true, help_heading = "Messages")]
    pub quiet: bool,
    /// Print more: the files read, sizes, the device, seconds
    #[arg(short, long, global = true, conflicts_with = "quiet", help_heading = "Messages")]
    pub verbose: bool,
}

/// How much is told besides results and errors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Loudness {
    Quiet,
    Usual,
    Verbose,
}

static LOUDNESS: OnceLock<Loudness> = OnceLock::new();

fn loudness() -> Loudness {
    LOUDNESS.get().copied().unwrap_or(Loudness::Usual)
}

/// The subcommands.
#[derive(Debug, Subcommand)]
pub enum Command {
    Render(Box<render::args::RenderArgs>),
    Fit(Box<fit::args::FitArgs>),
    Grad(Box<grad::args::GradArgs>),
    Pose(Box<pose::args::PoseArgs>),
    Mesh(mesh::MeshArgs),
    Convert(convert::ConvertArgs),
    Info(info::InfoArgs),
    Iou(iou::IouArgs),
    Devices(devices::DevicesArgs),
    Check(check::CheckArgs),
    Bench(Box<bench::args::BenchArgs>),
    Stress(stress::StressArgs),
    Completions(complete::CompletionsArgs),
    Man(complete::ManArgs),
}

/// Why a command failed.
#[derive(Debug)]
pub enum Failure {
    /// The arguments contradict each other.
    Usage(String),
    /// Anything else.
    Error(softras::Error),
    /// The failure has been reported already.
    Told,
    /// The results cannot be written to standard output.
    Output(std::io::Error),
    /// The reader of the output has closed it.
    Closed,
    /// Ctrl-C ended the work early; what there was has been written.
    Interrupted,
}

impl Failure {
    /// The failure to write results: a full disk loses them, a reader that went away has seen enough.
    pub fn of_output(error: std::io::Error) -> Self {
        if error.kind() == std::io::ErrorKind::BrokenPipe { Self::Closed } else { Self::Output(error) }
    }
}

impl From<softras::Error> for Failure {
    fn from(e: softras::Error) -> Self {
        Self::Error(e)
    }
}

/// Runs a command.
pub fn run(cli: &Cli) -> Result<(), Failure> {
    let start = Instant::now();
    let loudness = match (cli.quiet, cli.verbose) {
        (true, _) => Loudness::Quiet,
        (_, true) => Loudness::Verbose,
        _ => Loudness::Usual,
    };
    // Only the first call of a process counts, and there is one.
    let _ = LOUDNESS.set(loudness);
    let outcome = run_command(cli);
    detail(&format!("{:.2} seconds", start.elapsed().as_secs_f64()));
    outcome
}

fn run_command(cli: &Cli) -> Result<(), Failure> {
    match &cli.command {
        Command::Render(args) => render::run(args),
        Command::Grad(args) => grad::run(args),
        Command::Check(args) => check::run(args),
        Command::Stress(args) => stress::run(args),
        Command::Bench(args) => bench::run(args),
        Command::Devices(args) => devices::run(args),
        Command::Mesh(args) => mesh::run(args),
        Command::Fit(args) => fit::run(args),
        Command::Convert(args) => convert::run(args),
        Command::Info(args) => info::run(args),
        Command::Iou(args) => iou::run(args),
        Command::Pose(args) => pose::run(args),
        Command::Completions(args) => complete::completions(args),
        Command::Man(args) => complete::man(args),
    }
}

/// Prints a line, or several, for the user.
fn say(line: &str) -> Result<(), Failure> {
    let mut stdout = std::io::stdout().lock();
    let written = writeln!(stdout, "{}", softras_io::text::harmless(line, true)).and_then(|()| stdout.flush());
    written.map_err(Failure::of_output)
}

/// Prints a note on stderr, about something that did not stop the work.
fn note(text: &str) {
    if loudness() > Loudness::Quiet {
        // With stderr closed there is nowhere to report to.
        let _ = writeln!(std::io::stderr(), "note: {}", softras_io::text::harmless(text, false));
    }
}

/// Prints on stderr what is told with --verbose alone.
fn detail(text: &str) {
    if loudness() == Loudness::Verbose {
        let _ = writeln!(std::io::stderr(), "{}", softras_io::text::harmless(text, false));
    }
}

/// The mesh with textures that the device holds; smaller ones are noted.
fn held(mesh: softras::Mesh, renderer: &softras::Renderer) -> softras::Result<softras::Mesh> {
    let (mesh, about) = softras_view::shrunk(mesh, &renderer.device_info().limits)?;
    about.iter().for_each(|text| note(text));
    Ok(mesh)
}

/// The device that a selector names, or the best one. `memory` is the most that a frame may take there.
fn open_device(selector: Option<&str>, memory: Option<u64>) -> softras::Result<softras::Renderer> {
    let device = selector.map(str::to_owned);
    let renderer = softras::Renderer::with_options(&softras::RendererOptions { device, memory, ..Default::default() })?;
    detail(&format!("device: {}", renderer.device_name()));
    Ok(renderer)
}

/// A flag that Ctrl-C sets.
fn interrupted() -> Result<&'static AtomicBool, Failure> {
    static RAISED: AtomicBool = AtomicBool::new(false);
    // A process can take the signal over once, and a fit has several loops.
    static TAKEN: OnceLock<Result<(), String>> = OnceLock::new();
    // A second Ctrl-C ends the process at once, even if a step hangs.
    let handler = || {
        if RAISED.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    };
    match TAKEN.get_or_init(|| ctrlc::set_handler(handler).map_err(|error| error.to_string())) {
        Ok(()) => Ok(&RAISED),
        Err(e) => {
            Err(softras::Error::Fit { what: format!("Ctrl-C cannot be caught ({e})"), fix: "report this".into() }
                .into())
        }
    }
}
