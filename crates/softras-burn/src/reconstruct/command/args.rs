//! The arguments of the command `softras-reconstruct`.

use crate::reconstruct::config::{Coloring, Config, Hard};
use crate::reconstruct::data::Shard;
use crate::reconstruct::families;
use clap::{Args, Parser, Subcommand};
use std::path::PathBuf;

/// Learn shape from pictures alone: make pictures, train the network, look at what it sees, and compare.
#[derive(Debug, Parser)]
#[command(name = "softras-reconstruct", version)]
pub struct Cli {
    #[command(subcommand)]
    pub(super) command: Command,
}

#[derive(Debug, Subcommand)]
pub(super) enum Command {
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
pub(super) struct DataArgs {
    /// The folder to write <class>_<set>_images.npz and <class>_<set>_voxels.npz into
    #[arg(short, long, value_name = "FOLDER")]
    pub(super) output: PathBuf,
    /// Procedural families
    #[arg(long, value_delimiter = ',', default_values_t = families::NAMES.map(String::from))]
    pub(super) families: Vec<String>,
    /// Objects of each family to train with
    #[arg(long, default_value_t = 60)]
    pub(super) train: usize,
    /// Objects of each family that choose the best checkpoint
    #[arg(long, default_value_t = 8)]
    pub(super) val: usize,
    /// Objects of each family to evaluate with
    #[arg(long, default_value_t = 16)]
    pub(super) test: usize,
    /// Seed of the families' objects, below a million
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u64).range(..1_000_000))]
    pub(super) seed: u64,
    /// Make only this part, `I/N` with I from 0; parts may be made anywhere and in any order
    #[arg(long, value_name = "I/N", default_value = "0/1", value_parser = parse_shard)]
    pub(super) shard: Shard,
    /// Take the furniture in the archives *.sh3f of this folder in place of the families: cabinets, chairs, sofas and tables.
    /// Debian's package sweethome3d-furniture has /usr/share/sweethome3d/furniture
    #[arg(long, value_name = "FOLDER", conflicts_with = "meshes")]
    pub(super) furniture: Option<PathBuf>,
    /// Take the mesh files of this folder in place of the families
    #[arg(long, value_name = "FOLDER", requires = "class")]
    pub(super) meshes: Option<PathBuf>,
    /// The name of the class that the meshes are
    #[arg(long, value_name = "NAME")]
    pub(super) class: Option<String>,
}

#[derive(Clone, Debug, Args)]
pub(super) struct TrainArgs {
    /// The folder of the data
    pub(super) data: PathBuf,
    /// The folder for best.safetensors, last.safetensors and curve.csv
    #[arg(short, long, value_name = "FOLDER")]
    pub(super) output: PathBuf,
    /// Classes to train on [default: all that the folder has]
    #[arg(long, value_delimiter = ',')]
    pub(super) classes: Vec<String>,
    /// Go on from a checkpoint, with its settings
    #[arg(long, value_name = "CHECKPOINT")]
    pub(super) resume: Option<PathBuf>,
    /// Steps between checkpoints
    #[arg(long, default_value_t = 250)]
    pub(super) every: usize,
    #[command(flatten)]
    pub(super) settings: TrainSettings,
}

#[derive(Clone, Debug, Args)]
pub(super) struct TrainSettings {
    /// Channels of the first convolution; the official network has 64
    #[arg(long, default_value_t = 8)]
    pub(super) width: usize,
    /// Steps in all
    #[arg(long, default_value_t = 4000)]
    pub(super) steps: usize,
    /// Objects of a step, each in two views
    #[arg(long, default_value_t = 8)]
    pub(super) pairs: usize,
    /// Shares of a step, each with batch norms of its own; several processes divide them [default: one for each process]
    #[arg(long)]
    pub(super) shares: Option<usize>,
    /// Adam's rate; × 0.3 after three fifths of the steps
    #[arg(long, default_value_t = 1e-3)]
    pub(super) rate: f64,
    /// σ of the renderings
    #[arg(long, default_value_t = 1e-4)]
    pub(super) sigma: f64,
    /// Weight of the Laplacian loss; officially 5e-3, for 250,000 steps of 64 pairs
    #[arg(long, default_value_t = 3e-2)]
    pub(super) laplacian: f64,
    /// Weight of the flatten loss
    #[arg(long, default_value_t = 5e-4)]
    pub(super) flatten: f64,
    /// Weight of the colour loss; 0 learns from silhouettes alone
    #[arg(long, default_value_t = 1.0)]
    pub(super) color: f64,
    /// How colours are seen
    #[arg(long, default_value = "palette")]
    pub(super) coloring: Coloring,
    /// Compare hard images, differentiated in this way
    #[arg(long)]
    pub(super) hard: Option<Hard>,
    /// Train a voxel network from the training objects' solids in place of a mesh network from pictures
    #[arg(long)]
    pub(super) voxels: bool,
    /// Decides the first weights and the order of the pictures
    #[arg(long, default_value_t = 0)]
    pub(super) seed: u64,
}

impl TrainSettings {
    pub(super) fn config(&self, processes: usize) -> Config {
        let Self { width, steps, pairs, shares, rate, sigma, laplacian, flatten, color, coloring, hard, voxels, seed } =
            *self;
        let shares = shares.unwrap_or(processes);
        Config { width, steps, pairs, shares, rate, sigma, laplacian, flatten, color, coloring, hard, voxels, seed }
    }
}

#[derive(Debug, Args)]
pub(super) struct PredictArgs {
    /// A PNG picture of 64 by 64 pixels with a transparent background
    pub(super) image: PathBuf,
    /// The checkpoint of a network, or a checkpoint_*.pth.tar of the official PyTorch code
    #[arg(long, value_name = "CHECKPOINT")]
    pub(super) network: PathBuf,
    /// The mesh to write, an OBJ file
    #[arg(short, long, value_name = "MESH.obj")]
    pub(super) output: PathBuf,
    /// A film of the mesh that turns once, beside the picture
    #[arg(long, value_name = "TURN.gif")]
    pub(super) gif: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(super) struct EvaluateArgs {
    /// The folder of the data
    pub(super) data: PathBuf,
    /// Checkpoints of networks, each with the name of its row before it: `full=runs/full/best.safetensors`; several of one
    /// name are the runs of one row. A checkpoint_*.pth.tar of the official PyTorch code is read, too
    #[arg(long = "network", value_name = "NAME=CHECKPOINT", value_parser = parse_network)]
    pub(super) networks: Vec<(String, PathBuf)>,
    /// Classes to evaluate [default: all that the folder has]
    #[arg(long, value_delimiter = ',')]
    pub(super) classes: Vec<String>,
    /// Views of each object, spread evenly
    #[arg(long, default_value_t = 24)]
    pub(super) views: usize,
    /// A picture of what the first mesh network sees in some objects
    #[arg(long, value_name = "SHEET.png", requires = "networks")]
    pub(super) sheet: Option<PathBuf>,
    /// The curves of the mesh networks' trainings
    #[arg(long, value_name = "CURVES.svg", requires = "networks")]
    pub(super) curves: Option<PathBuf>,
    /// A picture of the first object to try `predict` with
    #[arg(long, value_name = "PICTURE.png")]
    pub(super) example: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(super) struct DemoArgs {
    /// The folder for everything that is made
    #[arg(short, long, value_name = "FOLDER")]
    pub(super) output: PathBuf,
    /// Steps of the training
    #[arg(long, default_value_t = 600)]
    pub(super) steps: usize,
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
