//! Solids: from silhouettes, and from closed meshes as voxels.

pub mod carved;
pub mod hull;
pub mod voxel;
