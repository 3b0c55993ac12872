//! Bones that turn about joints and stretch: forward kinematics and its transpose.

use super::bad;
use glam::{DMat3, DQuat, DVec3};
use softras::Result;

/// A bone, and the joint at its head that it turns about.
#[derive(Clone, Debug, PartialEq)]
pub struct Bone {
    /// What it is called.
    pub name: &'static str,
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
#[derive(Clone, Debug, PartialEq)]
pub struct Skeleton {
    bones: Vec<Bone>,
}

/// Where a skeleton's bones are; also dL by these numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct SkeletonPose {
    /// Of the whole, world units.
    pub shift: DVec3,
    /// Of every axis of every bone in their order, radians; 0 at rest.
    pub angles: Vec<f64>,
    /// Length of every bone as a part of its length at rest.
    pub lengths: Vec<f64>,
}

/// A bone where a pose puts it.
#[derive(Clone, Debug)]
pub(super) struct Placed {
    /// From rest axes to the world's.
    pub rotation: DMat3,
    /// Its joint.
    pub head: DVec3,
    /// World axes of its angles.
    pub axes: Vec<DVec3>,
}

/// What pulls at a bone, summed over the points that it carries.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Wrench {
    /// Σ g.
    pub force: DVec3,
    /// Σ p × g, about the world's origin.
    pub torque: DVec3,
    /// dL by the bone's length as far as the points that it carries itself go.
    pub stretch: f64,
}

impl Bone {
    /// Unit vector from head to tail.
    fn direction(&self) -> DVec3 {
        (self.tail - self.head).normalize_or_zero()
    }

    /// A point at rest, relative to the head, after the bone is stretched.
    fn stretched(&self, point: DVec3, length: f64) -> DVec3 {
        let direction = self.direction();
        let from = point - self.head;
        from + (length - 1.0) * direction.dot(from) * direction
    }
}

impl Skeleton {
    /// Validates the bones.
    ///
    /// # Errors
    /// [`softras::Error::Fit`] for a parent that is not before its bone, or an axis that is not of length 1.
    pub fn new(bones: Vec<Bone>) -> Result<Self> {
        for (i, bone) in bones.iter().enumerate() {
            if bone.parent.is_some_and(|parent| parent >= i) {
                return bad(format!("bone {i} ({}) comes before its parent", bone.name), "list parents first");
            }
            let finite = bone.head.is_finite() && bone.tail.is_finite();
            if !finite || bone.axes.iter().any(|axis| !axis.is_normalized()) {
                let what = format!("bone {i} ({}) has an axis or an end that is none", bone.name);
                return bad(what, "use finite ends and axes of length 1");
            }
        }
        Ok(Self { bones })
    }

    /// The bones.
    pub fn bones(&self) -> &[Bone] {
        &self.bones
    }

    /// The bone of a name.
    pub fn find(&self, name: &str) -> Option<usize> {
        self.bones.iter().position(|bone| bone.name == name)
    }

    /// Every bone as it is at rest.
    pub fn rest(&self) -> SkeletonPose {
        let angles = self.bones.iter().map(|bone| bone.axes.len()).sum();
        SkeletonPose { shift: DVec3::ZERO, angles: vec![0.0; angles], lengths: vec![1.0; self.bones.len()] }
    }

    /// Which of a pose's angles are a bone's.
    pub fn angles_of(&self, bone: usize) -> std::ops::Range<usize> {
        let count = |bones: &[Bone]| bones.iter().map(|bone| bone.axes.len()).sum::<usize>();
        let end = (bone + 1).min(self.bones.len());
        count(&self.bones[..end.saturating_sub(1)])..count(&self.bones[..end])
    }

    /// How far a joint is turned, relative to the bone that carries it; none beyond the skeleton.
    pub fn turn(&self, pose: &SkeletonPose, bone: usize) -> DQuat {
        let Some(axes) = self.bones.get(bone).map(|bone| &bone.axes) else { return DQuat::IDENTITY };
        let angles = pose.angles.get(self.angles_of(bone)).unwrap_or_default();
        axes.iter().zip(angles).map(|(axis, angle)| DQuat::from_axis_angle(*axis, *angle)).product()
    }

    /// Degrees between a joint in two poses, each relative to the bone that carries it.
    pub fn degrees_between(&self, a: &SkeletonPose, b: &SkeletonPose, bone: usize) -> f64 {
        let cosine = self.turn(a, bone).dot(self.turn(b, bone)).abs().min(1.0);
        2.0 * cosine.acos().to_degrees()
    }

    /// The unit vector from a bone's head to its tail in a pose; zero beyond the skeleton, or for a pose of another one.
    pub fn direction(&self, pose: &SkeletonPose, bone: usize) -> DVec3 {
        match self.bones.get(bone) {
            Some(rest) if self.validate(pose).is_ok() => self.place(pose)[bone].rotation * rest.direction(),
            _ => DVec3::ZERO,
        }
    }

    /// # Errors
    /// [`softras::Error::Fit`] for a pose of another skeleton, or one that is not finite.
    pub(super) fn validate(&self, pose: &SkeletonPose) -> Result<()> {
        let rest = self.rest();
        let counts = [pose.angles.len(), pose.lengths.len()];
        let finite = pose.shift.is_finite() && pose.angles.iter().chain(&pose.lengths).all(|x| x.is_finite());
        if !finite || counts != [rest.angles.len(), rest.lengths.len()] {
            let what = format!("a pose of {counts:?} angles and lengths, finite: {finite}");
            let fix = format!("give {} finite angles and {} lengths", rest.angles.len(), rest.lengths.len());
            return bad(what, &fix);
        }
        Ok(())
    }

    /// Every bone where a validated pose puts it.
    pub(super) fn place(&self, pose: &SkeletonPose) -> Vec<Placed> {
        let mut placed: Vec<Placed> = Vec::with_capacity(self.bones.len());
        let mut angles = pose.angles.iter();
        for bone in &self.bones {
            let (mut rotation, head) = match bone.parent {
                None => (DMat3::IDENTITY, bone.head + pose.shift),
                Some(parent) => {
                    let at = self.carried(&placed[parent], parent, bone.head, pose.lengths[parent]);
                    (placed[parent].rotation, at)
                }
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
    pub(super) fn carried(&self, placed: &Placed, bone: usize, point: DVec3, length: f64) -> DVec3 {
        placed.rotation * self.bones[bone].stretched(point, length) + placed.head
    }

    /// How far a bone moves a point for a growth of its length by 1.
    pub(super) fn by_length(&self, placed: &Placed, bone: usize, point: DVec3) -> DVec3 {
        let direction = self.bones[bone].direction();
        placed.rotation * (direction.dot(point - self.bones[bone].head) * direction)
    }

    /// dL by the pose from what pulls at each bone.
    ///
    /// A turn δ about a joint moves every point p that the joint carries by δ × (p - joint), so dL by an angle is its
    /// axis times the torque about the joint of all bones from there on; a longer bone shifts all that it carries.
    pub(super) fn pull(&self, placed: &[Placed], mut wrenches: Vec<Wrench>) -> SkeletonPose {
        let mut gradient = self.rest();
        for (i, bone) in self.bones.iter().enumerate().rev() {
            let Wrench { force, torque, stretch } = wrenches[i];
            let about_joint = torque - placed[i].head.cross(force);
            let angles = &mut gradient.angles[self.angles_of(i)];
            angles.iter_mut().zip(&placed[i].axes).for_each(|(g, axis)| *g = axis.dot(about_joint));
            gradient.lengths[i] = stretch;
            match bone.parent {
                None => gradient.shift += force,
                Some(parent) => {
                    let by_length = self.by_length(&placed[parent], parent, bone.head);
                    let carrier = &mut wrenches[parent];
                    carrier.force += force;
                    carrier.torque += torque;
                    carrier.stretch += by_length.dot(force);
                }
            }
        }
        gradient
    }
}
