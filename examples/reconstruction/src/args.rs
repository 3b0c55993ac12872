//! The arguments of the command `softras-reconstruct`.

use crate::config::Config;
use crate::families;
use clap::{Args, Parser, Subcommand};
use std::path::PathBuf;

/// Learn shape from pictures alone: make pictures, train the network, look at what it sees, and compare.
#[derive(Debug, Parser)]
#[command(name = "softras-reconstruct", version)]
pub struct Cli {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Debug, Subcommand)]
pub enum Command {
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
pub struct DataArgs {
    /// The folder to write <class>_<set>_images.npz and <class>_<set>_voxels.npz into
    #[arg(short, long, value_name = "FOLDER")]
    pub output: PathBuf,
    /// Procedural families
    #[arg(long, value_delimiter = ',', default_values_t = families::NAMES.map(String::from))]
    pub families: Vec<String>,
    /// Objects of each family to train with
    #[arg(long, default_value_t = 60)]
    pub train: usize,
    /// Objects of each family that choose the best checkpoint
    #[arg(long, default_value_t = 8)]
    pub val: usize,
    /// Objects of each family to evaluate with
    #[arg(long, default_value_t = 16)]
    pub test: usize,
    /// Seed of the families' objects, below a million
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u64).range(..1_000_000))]
    pub seed: u64,
    /// Take the furniture in the archives *.sh3f of this folder in place of the families: cabinets, chairs, sofas and tables.
    /// Debian's package sweethome3d-furniture has /usr/share/sweethome3d/furniture
    #[arg(long, value_name = "FOLDER", conflicts_with = "meshes")]
    pub furniture: Option<PathBuf>,
    /// Take the mesh files of this folder in place of the families
    #[arg(long, value_name = "FOLDER", requires = "class")]
    pub meshes: Option<PathBuf>,
    /// The name of the class that the meshes are
    #[arg(long, value_name = "NAME")]
    pub class: Option<String>,
}

#[derive(Debug, Args)]
pub struct TrainArgs {
    /// The folder of the data
    pub data: PathBuf,
    /// The folder for best.safetensors, last.safetensors and curve.csv
    #[arg(short, long, value_name = "FOLDER")]
    pub output: PathBuf,
    /// Classes to train on [default: all that the folder has]
    #[arg(long, value_delimiter = ',')]
    pub classes: Vec<String>,
    /// Go on from a checkpoint, with its settings
    #[arg(long, value_name = "CHECKPOINT")]
    pub resume: Option<PathBuf>,
    /// Steps between checkpoints
    #[arg(long, default_value_t = 250)]
    pub every: usize,
    #[command(flatten)]
    pub config: Config,
}

#[derive(Debug, Args)]
pub struct PredictArgs {
    /// A PNG picture of 64 by 64 pixels with a transparent background
    pub image: PathBuf,
    /// The checkpoint of a network, or a checkpoint_*.pth.tar of the official PyTorch code
    #[arg(long, value_name = "CHECKPOINT")]
    pub network: PathBuf,
    /// The mesh to write, an OBJ file
    #[arg(short, long, value_name = "MESH.obj")]
    pub output: PathBuf,
    /// A film of the mesh that turns once, beside the picture
    #[arg(long, value_name = "TURN.gif")]
    pub gif: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub struct EvaluateArgs {
    /// The folder of the data
    pub data: PathBuf,
    /// Checkpoints of networks, each with the name of its row before it: `full=runs/full/best.safetensors`; several of one
    /// name are the runs of one row. A checkpoint_*.pth.tar of the official PyTorch code is read, too
    #[arg(long = "network", value_name = "NAME=CHECKPOINT", value_parser = parse_network)]
    pub networks: Vec<(String, PathBuf)>,
    /// Classes to evaluate [default: all that the folder has]
    #[arg(long, value_delimiter = ',')]
    pub classes: Vec<String>,
    /// Views of each object, spread evenly
    #[arg(long, default_value_t = 24, value_parser = clap::value_parser!(u8).range(1..=24))]
    pub views: u8,
    /// A picture of what the first network sees in some objects
    #[arg(long, value_name = "SHEET.png", requires = "networks")]
    pub sheet: Option<PathBuf>,
    /// A picture of the first object to try `predict` with
    #[arg(long, value_name = "PICTURE.png")]
    pub example: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub struct DemoArgs {
    /// The folder for everything that is made
    #[arg(short, long, value_name = "FOLDER")]
    pub output: PathBuf,
    /// Steps of the training
    #[arg(long, default_value_t = 600)]
    pub steps: usize,
}

fn parse_network(text: &str) -> Result<(String, PathBuf), String> {
    let parsed = text.split_once('=').filter(|(name, path)| !name.is_empty() && !path.is_empty());
    parsed.map(|(name, path)| (name.into(), path.into())).ok_or("NAME=CHECKPOINT is expected".into())
}
