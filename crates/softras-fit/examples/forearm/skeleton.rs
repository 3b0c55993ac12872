//! Bones that turn about joints: forward kinematics and its transpose.

use softras::glam::{DMat3, DQuat, DVec3};

/// A bone, and the joint at its head that it turns about.
pub struct Bone {
    /// The bone that carries it, before it in the skeleton; `None` for a root.
    pub parent: Option<usize>,
    /// Where its joint is at rest, world units.
    pub head: DVec3,
    /// Where it ends at rest.
    pub tail: DVec3,
    /// Unit axes of the joint's angles, as they lie at rest; the first one turns all the others.
    pub axes: Vec<DVec3>,
}

/// Bones, parents first.
pub struct Skeleton {
    pub bones: Vec<Bone>,
}

/// Where a skeleton's bones are; also the loss's gradient by these numbers.
#[derive(Clone)]
pub struct SkeletonPose {
    /// Translation of the whole skeleton, world units.
    pub shift: DVec3,
    /// The angle about every axis of every bone, in their order, radians; 0 at rest.
    pub angles: Vec<f64>,
}

/// A bone where a pose puts it.
pub struct Placed {
    /// From rest axes to the world's.
    rotation: DMat3,
    /// The position of its joint.
    head: DVec3,
    /// World axes of its angles.
    axes: Vec<DVec3>,
}

/// Force and torque on a bone: gradients g by the positions p of the points that it carries, summed.
#[derive(Clone, Copy, Default)]
pub struct Wrench {
    /// Σ g.
    pub force: DVec3,
    /// Σ p × g, about the world's origin.
    pub torque: DVec3,
}

impl Skeleton {
    /// Every bone as it is at rest.
    pub fn rest(&self) -> SkeletonPose {
        let angles = self.bones.iter().map(|bone| bone.axes.len()).sum();
        SkeletonPose { shift: DVec3::ZERO, angles: vec![0.0; angles] }
    }

    /// Which of a pose's angles are a bone's.
    pub fn angles_of(&self, bone: usize) -> std::ops::Range<usize> {
        let count = |bones: &[Bone]| bones.iter().map(|bone| bone.axes.len()).sum::<usize>();
        count(&self.bones[..bone])..count(&self.bones[..=bone])
    }

    /// Degrees between a joint in two poses, each relative to the bone that carries it.
    pub fn degrees_between(&self, a: &SkeletonPose, b: &SkeletonPose, bone: usize) -> f64 {
        let turn = |pose: &SkeletonPose| -> DQuat {
            let axes = self.bones[bone].axes.iter().zip(&pose.angles[self.angles_of(bone)]);
            axes.map(|(axis, angle)| DQuat::from_axis_angle(*axis, *angle)).product()
        };
        let cosine = turn(a).dot(turn(b)).abs().min(1.0);
        2.0 * cosine.acos().to_degrees()
    }

    /// The unit vector from every bone's head to its tail in a pose.
    pub fn directions(&self, pose: &SkeletonPose) -> Vec<DVec3> {
        let one = |(placed, bone): (Placed, &Bone)| placed.rotation * (bone.tail - bone.head).normalize();
        self.place(pose).into_iter().zip(&self.bones).map(one).collect()
    }

    /// Every bone where a pose puts it.
    pub fn place(&self, pose: &SkeletonPose) -> Vec<Placed> {
        let mut placed: Vec<Placed> = Vec::with_capacity(self.bones.len());
        let mut angles = pose.angles.iter();
        for bone in &self.bones {
            let (mut rotation, head) = match bone.parent {
                None => (DMat3::IDENTITY, bone.head + pose.shift),
                Some(parent) => (placed[parent].rotation, self.carried(&placed[parent], parent, bone.head)),
            };
            let mut axes = Vec::with_capacity(bone.axes.len());
            for (&axis, &angle) in bone.axes.iter().zip(&mut angles) {
                axes.push(rotation * axis);
                rotation *= DMat3::from_axis_angle(axis, angle);
            }
            placed.push(Placed { rotation, head, axes });
        }
        placed
    }

    /// Where a bone takes a point that is given at rest.
    pub fn carried(&self, placed: &Placed, bone: usize, point: DVec3) -> DVec3 {
        placed.rotation * (point - self.bones[bone].head) + placed.head
    }

    /// The loss's gradient by the pose, from each bone's force and torque.
    ///
    /// A turn δ about a joint moves every point p that the joint carries by δ × (p - joint). So the gradient by an angle is
    /// the dot product of its axis with the torque about the joint, summed over this bone and all that it carries.
    pub fn pull(&self, placed: &[Placed], mut wrenches: Vec<Wrench>) -> SkeletonPose {
        let mut gradient = self.rest();
        for (i, bone) in self.bones.iter().enumerate().rev() {
            let Wrench { force, torque } = wrenches[i];
            let about_joint = torque - placed[i].head.cross(force);
            let angles = &mut gradient.angles[self.angles_of(i)];
            angles.iter_mut().zip(&placed[i].axes).for_each(|(g, axis)| *g = axis.dot(about_joint));
            match bone.parent {
                None => gradient.shift += force,
                Some(parent) => {
                    wrenches[parent].force += force;
                    wrenches[parent].torque += torque;
                }
            }
        }
        gradient
    }
}
