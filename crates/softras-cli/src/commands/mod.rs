//! The command line: subcommands, exit codes and output to the terminal.

mod articulate;
mod bench;
mod check;
mod color;
mod describe;
mod devices;
mod eval;
mod fit;
mod grad;
mod gradients;
mod iou;
mod mesh;
mod mesh_file;
mod npz;
mod outputs;
mod parse;
mod pose;
mod progress;
mod render;
mod stress;
mod svg;

use clap::{Parser, Subcommand};
use std::io::Write;

const ABOUT: &str = "\
Differentiable soft mesh rasterization (SoftRas) on any Vulkan device.

Exit codes: 0 success; 1 failure, with one line that says why and how to fix it;
2 invalid arguments.";

/// The `softras` command.
#[derive(Debug, Parser)]
#[command(name = "softras", version, about = "Soft mesh rasterization on any Vulkan device", long_about = ABOUT)]
pub struct Cli {
    /// The subcommand.
    #[command(subcommand)]
    pub command: Command,
}

/// The subcommands.
#[derive(Debug, Subcommand)]
pub enum Command {
    Render(Box<render::args::RenderArgs>),
    Eval(eval::EvalArgs),
    Check(check::CheckArgs),
    Stress(stress::StressArgs),
    Bench(Box<bench::args::BenchArgs>),
    Grad(Box<grad::args::GradArgs>),
    Devices(devices::DevicesArgs),
    Mesh(mesh::MeshArgs),
    Fit(Box<fit::args::FitArgs>),
    Iou(iou::IouArgs),
    Pose(Box<pose::args::PoseArgs>),
    Articulate(articulate::args::ArticulateArgs),
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
    /// The reader of the output has closed it.
    Closed,
}

impl From<softras::Error> for Failure {
    fn from(e: softras::Error) -> Self {
        Self::Error(e)
    }
}

/// Runs a command.
pub fn run(cli: &Cli) -> Result<(), Failure> {
    match &cli.command {
        Command::Render(args) => render::run(args),
        Command::Eval(args) => eval::run(args),
        Command::Grad(args) => grad::run(args),
        Command::Check(args) => check::run(args),
        Command::Stress(args) => stress::run(args),
        Command::Bench(args) => bench::run(args),
        Command::Devices(args) => devices::run(args),
        Command::Mesh(args) => mesh::run(args),
        Command::Fit(args) => fit::run(args),
        Command::Iou(args) => iou::run(args),
        Command::Pose(args) => pose::run(args),
        Command::Articulate(args) => articulate::run(args),
    }
}

/// Prints a line for the user.
fn say(line: &str) -> Result<(), Failure> {
    writeln!(std::io::stdout(), "{line}").map_err(|_| Failure::Closed)
}

/// Prints a note on stderr, about something that did not stop the work.
fn note(text: &str) {
    // With stderr closed there is nowhere to report to.
    let _ = writeln!(std::io::stderr(), "note: {text}");
}
