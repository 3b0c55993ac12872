//! What is trained: the network of the paper, or the voxel network that it is compared with.

use super::config::Config;
use super::network::Network;
use super::voxels::VoxelNetwork;
use super::weights::{self, Weight, numbered};
use burn::module::Module;
use burn::tensor::Device;
use safetensors::SafeTensors;
use softras::Result;

/// A network of either kind.
#[derive(Module, Debug)]
// There is one at a time, and burn derives no module of a boxed network.
#[allow(clippy::large_enum_variant)]
pub enum Model {
    /// Sees a mesh, and learns from pictures.
    Mesh(Network),
    /// Sees voxels, and learns from solids.
    Voxels(VoxelNetwork),
}

impl Model {
    /// A network with the random weights of the configuration's seed.
    ///
    /// # Errors
    /// As [`Network::new`].
    pub fn new(config: &Config, device: &Device) -> Result<Self> {
        device.seed(config.seed);
        Ok(Self::blank(config, device)?.numbered())
    }

    /// The network with the weights of a file; only those that fit are allocated.
    ///
    /// # Errors
    /// As [`Network::new`]; inside, what does not fit, as [`weights::load`] says it.
    pub fn load(config: &Config, file: &SafeTensors, device: &Device) -> Result<Result<Self, String>> {
        let loaded = match Self::blank(config, device)? {
            Self::Mesh(network) => weights::load(network, file, device).map(Self::Mesh),
            Self::Voxels(network) => weights::load(network, file, device).map(Self::Voxels),
        };
        Ok(loaded.map(Self::numbered))
    }

    /// The network of a configuration, whose weights are drawn when they are first needed.
    fn blank(config: &Config, device: &Device) -> Result<Self> {
        Ok(if config.voxels {
            Self::Voxels(VoxelNetwork::new(config.width, device)?)
        } else {
            Self::Mesh(Network::new(config.width, config.seen_colors(), device)?)
        })
    }

    fn numbered(self) -> Self {
        match self {
            Self::Mesh(network) => Self::Mesh(numbered(network)),
            Self::Voxels(network) => Self::Voxels(numbered(network)),
        }
    }

    /// All weights, by name.
    pub fn weights(&self) -> Vec<Weight> {
        match self {
            Self::Mesh(network) => weights::list(network),
            Self::Voxels(network) => weights::list(network),
        }
    }
}
