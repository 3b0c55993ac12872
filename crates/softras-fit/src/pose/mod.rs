//! The rotation and translation of a rigid mesh from an image of it.
//!
//! Many poses are fitted at once, as many cameras looking at one mesh. σ and γ shrink during the fit: blurred images
//! have few local minima besides the right pose (section 4.3 of the SoftRas paper). Lights turn with the mesh, so
//! images are best compared unlit.

mod descent;
mod picture;
mod search;
mod target;

pub use descent::{Pose, PoseFit, PoseOptions, rotations};
pub use search::PoseSearch;
pub use target::PoseTarget;
