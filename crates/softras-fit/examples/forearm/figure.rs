//! A mesh that follows a skeleton: from poses to vertices, and gradients back.

use super::skeleton::{Skeleton, SkeletonPose, Wrench};
use softras::glam::DVec3;
use softras::{Mesh, Result};

/// The bones that move a vertex, with weights whose sum is 1.
pub type Weights = Vec<(usize, f64)>;

/// A mesh on a skeleton: a vertex at v goes to Σ w_k M_k v, where M_k is the motion of bone k (linear blend skinning;
/// Magnenat-Thalmann et al. 1988).
pub struct Figure {
    /// The mesh at rest, with vertex colours.
    pub mesh: Mesh,
    /// The bones.
    pub skeleton: Skeleton,
    /// The bones of every vertex.
    pub weights: Vec<Weights>,
}

impl Figure {
    /// Which bone weighs most for each triangle, all corners together.
    pub fn bone_of_triangle(&self) -> Vec<usize> {
        let one = |triangle: &[u32; 3]| {
            let mut sums = vec![0.0; self.skeleton.bones.len()];
            triangle.iter().flat_map(|&i| &self.weights[i as usize]).for_each(|&(k, w)| sums[k] += w);
            (0..sums.len()).max_by(|&a, &b| sums[a].total_cmp(&sums[b])).unwrap_or(0)
        };
        self.mesh.triangles().iter().map(one).collect()
    }

    /// Where a pose takes every vertex.
    pub fn positions(&self, pose: &SkeletonPose) -> Vec<DVec3> {
        let placed = self.skeleton.place(pose);
        let one = |(p, weights): (&[f32; 3], &Weights)| {
            let at_rest = DVec3::from(p.map(f64::from));
            weights.iter().map(|&(k, w)| w * self.skeleton.carried(&placed[k], k, at_rest)).sum()
        };
        self.mesh.positions().iter().zip(&self.weights).map(one).collect()
    }

    /// The mesh in a pose.
    pub fn posed(&self, pose: &SkeletonPose) -> Result<Mesh> {
        let mut mesh = self.mesh.clone();
        mesh.set_positions(self.positions(pose).iter().map(|p| p.as_vec3().to_array()).collect())?;
        Ok(mesh)
    }

    /// The loss's gradient by a pose, from its gradient by every vertex.
    pub fn pull(&self, pose: &SkeletonPose, gradient: &[DVec3]) -> SkeletonPose {
        let placed = self.skeleton.place(pose);
        let mut wrenches = vec![Wrench::default(); placed.len()];
        for ((p, weights), &g) in self.mesh.positions().iter().zip(&self.weights).zip(gradient) {
            let at_rest = DVec3::from(p.map(f64::from));
            for &(k, w) in weights {
                let point = self.skeleton.carried(&placed[k], k, at_rest);
                wrenches[k].force += w * g;
                wrenches[k].torque += w * point.cross(g);
            }
        }
        self.skeleton.pull(&placed, wrenches)
    }
}
