//! A figure with joints: a mesh on a skeleton, posed until its image is the target.
//!
//! - [`Skeleton`]: bones, joint angles and bone lengths.
//! - [`Figure`]: a mesh that follows a skeleton by linear blend skinning; from poses to vertices, and gradients back.
//! - [`mannequin`]: a figure to try it on.
//! - [`FigureFit`]: a pose from one image. Where a limb is hidden, a hard renderer has no gradient for it; the soft
//!   image's gradient reaches it, because hidden triangles weigh something too (section 4.3 of the SoftRas paper).

mod fit;
mod mannequin;
mod skeleton;
mod visible;

pub use fit::{FigureFit, FigureOptions, Sight};
pub use mannequin::mannequin;
pub use skeleton::{Bone, Skeleton, SkeletonPose};
pub use visible::visible_triangles;

use glam::DVec3;
use skeleton::Wrench;
use softras::{Error, Mesh, Result};

fn bad<T>(what: impl Into<String>, fix: &str) -> Result<T> {
    Err(Error::Fit { what: what.into(), fix: fix.into() })
}

/// The bones that carry a vertex, with their weights.
pub type Weights = Vec<(usize, f64)>;

/// A mesh on a skeleton: a vertex at v goes to Σ w_k M_k v, M_k the motion of bone k (linear blend skinning; Magnenat-
/// Thalmann et al. 1988).
#[derive(Clone, Debug)]
pub struct Figure {
    mesh: Mesh,
    skeleton: Skeleton,
    weights: Vec<Weights>,
}

impl Figure {
    /// From a mesh at rest, and for each vertex the bones that carry it.
    ///
    /// # Errors
    /// [`softras::Error::Fit`] unless every vertex has weights of bones that exist, none negative, 1 in all.
    pub fn new(mesh: Mesh, skeleton: Skeleton, weights: Vec<Weights>) -> Result<Self> {
        if weights.len() != mesh.positions().len() {
            let what = format!("weights of {} vertices for {}", weights.len(), mesh.positions().len());
            return bad(what, "give the weights of every vertex");
        }
        let right = |weights: &Weights| {
            let sum: f64 = weights.iter().map(|w| w.1).sum();
            (sum - 1.0).abs() < 1e-6 && weights.iter().all(|&(k, w)| k < skeleton.bones().len() && w >= 0.0)
        };
        if let Some(i) = weights.iter().position(|weights| !right(weights)) {
            let what = format!("vertex {i} has the weights {:?}", weights[i]);
            return bad(what, "name bones that exist, with weights of at least 0 and 1 in all");
        }
        Ok(Self { mesh, skeleton, weights })
    }

    /// The mesh at rest.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// The skeleton.
    pub fn skeleton(&self) -> &Skeleton {
        &self.skeleton
    }

    /// Which bone weighs most for each triangle, all corners together.
    pub fn bone_of_triangle(&self) -> Vec<usize> {
        let one = |triangle: &[u32; 3]| {
            let mut sums = vec![0.0; self.skeleton.bones().len()];
            triangle.iter().flat_map(|&i| &self.weights[i as usize]).for_each(|&(k, w)| sums[k] += w);
            (0..sums.len()).max_by(|&a, &b| sums[a].total_cmp(&sums[b])).unwrap_or(0)
        };
        self.mesh.triangles().iter().map(one).collect()
    }

    /// Where a pose takes every vertex.
    ///
    /// # Errors
    /// [`softras::Error::Fit`] for a pose of another skeleton, or one that is not finite.
    pub fn positions(&self, pose: &SkeletonPose) -> Result<Vec<DVec3>> {
        self.skeleton.validate(pose)?;
        let placed = self.skeleton.place(pose);
        let one = |(p, weights): (&[f32; 3], &Weights)| {
            let at_rest = DVec3::from(p.map(f64::from));
            let by = |&(k, w): &(usize, f64)| w * self.skeleton.carried(&placed[k], k, at_rest, pose.lengths[k]);
            weights.iter().map(by).sum()
        };
        Ok(self.mesh.positions().iter().zip(&self.weights).map(one).collect())
    }

    /// The mesh in a pose.
    ///
    /// # Errors
    /// As [`Figure::positions`].
    pub fn posed(&self, pose: &SkeletonPose) -> Result<Mesh> {
        let mut mesh = self.mesh.clone();
        mesh.set_positions(self.positions(pose)?.iter().map(|p| p.as_vec3().to_array()).collect())?;
        Ok(mesh)
    }

    /// dL by a pose, from dL by every vertex.
    ///
    /// # Errors
    /// As [`Figure::positions`]; [`softras::Error::Fit`] unless there is one gradient for each vertex.
    pub fn pull(&self, pose: &SkeletonPose, gradient: &[DVec3]) -> Result<SkeletonPose> {
        self.skeleton.validate(pose)?;
        if gradient.len() != self.weights.len() {
            let what = format!("{} gradients for {} vertices", gradient.len(), self.weights.len());
            return bad(what, "give one for each vertex");
        }
        let placed = self.skeleton.place(pose);
        let mut wrenches = vec![Wrench::default(); placed.len()];
        for ((p, weights), &g) in self.mesh.positions().iter().zip(&self.weights).zip(gradient) {
            let at_rest = DVec3::from(p.map(f64::from));
            for &(k, w) in weights {
                let point = self.skeleton.carried(&placed[k], k, at_rest, pose.lengths[k]);
                wrenches[k].force += w * g;
                wrenches[k].torque += w * point.cross(g);
                wrenches[k].stretch += w * self.skeleton.by_length(&placed[k], k, at_rest).dot(g);
            }
        }
        Ok(self.skeleton.pull(&placed, wrenches))
    }
}
