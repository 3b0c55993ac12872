//! Triangle meshes: their connectivity, and other meshes of the same surface.

pub mod atlas;
pub mod regions;
pub mod remesh;
pub mod specks;
pub mod subdivision;
pub mod topology;
