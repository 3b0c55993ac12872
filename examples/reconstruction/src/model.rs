//! What is trained: the network of the paper, or the voxel network that it is compared with.

use crate::config::Config;
use crate::network::Network;
use crate::voxels::VoxelNetwork;
use crate::weights::numbered;
use burn::module::Module;
use burn::tensor::Device;
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
    pub fn new(config: &Config, device: &Device) -> Result<Self> {
        device.seed(config.seed);
        Ok(numbered(Self::blank(config, device)?))
    }

    /// The network of a configuration, whose weights are drawn when they are first needed.
    pub fn blank(config: &Config, device: &Device) -> Result<Self> {
        Ok(if config.voxels {
            Self::Voxels(VoxelNetwork::new(config.width, device)?)
        } else {
            Self::Mesh(Network::new(config.width, config.seen_colors(), device)?)
        })
    }
}
