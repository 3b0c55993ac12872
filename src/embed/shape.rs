//! What a frame's sizes follow from: counts and kinds, no data.

use crate::error::Result;
use crate::frame::pack::{AppearanceShape, MeshShape};
use crate::frame::plan::{Capacity, DepthSpan, Sampling, ViewSize};
use crate::scene::{Camera, Lights, Mesh, Projection, Scene, Settings};

/// The shape of what a frame draws, from which its plan is made. [`Shape::of`] takes it from a scene; a host that keeps
/// its meshes on the device fills it in.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// The meshes: one that every view sees, or one for each view. At least one.
    pub meshes: Vec<MeshShape>,
    /// How many cameras look. At least one.
    pub views: u32,
    /// The lights. A plan depends on their number, on the shading, on whether they are more than
    /// [`Lights::unlit`], and, for the gradients of texels, on how bright they are at most.
    pub lights: Lights,
    /// How the meshes lie to the near and far planes. `true` is always right, and dearer: triangles that may cross the
    /// near plane take twice the memory.
    pub depth_span: DepthSpan,
    /// Some camera is [`Projection::Official`], which may distort.
    pub distorted: bool,
    /// How far a triangle's support reaches outside it, as a squared distance in units of σ: [`Settings::cutoff`], or
    /// with [`Support::Guaranteed`](crate::scene::Support) what [`Settings::cutoff_of`] says. At most 70.
    pub cutoff: f64,
    /// Room for lists whose length only the device finds out; `None`: estimated. After a frame its
    /// [`Status`](super::Status) tells what it needed.
    pub capacity: Option<Capacity>,
    /// Only the device knows how many of the triangles are drawn; those of the meshes are the most there may be. See
    /// [`Counts`](super::Counts).
    pub device_counts: bool,
}

impl Shape {
    /// The shape of a scene as cameras see it, validated.
    ///
    /// # Errors
    /// [`crate::Error::Scene`], [`crate::Error::Light`], [`crate::Error::Settings`].
    pub fn of(scene: &Scene, cameras: &[Camera], settings: &Settings) -> Result<Self> {
        scene.validate(cameras)?;
        settings.validate()?;
        let bounds: Vec<_> = scene.meshes.iter().map(Mesh::bounds).collect();
        let inside = DepthSpan { crosses_near: false, crosses_far: false };
        let depth_span = cameras.iter().enumerate().fold(inside, |span, (view, camera)| {
            span.or(DepthSpan::of(bounds[scene.mesh_of_view(view)], camera, settings))
        });
        Ok(Self {
            meshes: scene.meshes.iter().map(MeshShape::of).collect(),
            views: cameras.len() as u32,
            lights: scene.lights.clone(),
            depth_span,
            cutoff: settings.cutoff_of(scene, cameras),
            distorted: cameras.iter().any(|c| matches!(c.projection(), Projection::Official { .. })),
            capacity: None,
            device_counts: false,
        })
    }

    /// What each view sees.
    pub(super) fn view_sizes(&self) -> Vec<ViewSize> {
        let size = |mesh: &MeshShape| ViewSize { vertices: mesh.vertices, triangles: mesh.triangles };
        match &self.meshes[..] {
            [one] => vec![size(one); self.views as usize],
            several => several.iter().map(size).collect(),
        }
    }

    pub(super) fn sampling(&self) -> Sampling {
        let any = |f: fn(&AppearanceShape) -> bool| self.meshes.iter().any(|m| f(&m.appearance));
        let surface = any(|a| matches!(a, AppearanceShape::Surface { .. }));
        let image = any(|a| matches!(a, AppearanceShape::Textured { .. }));
        // Beside a textured mesh a plain one samples one white texel.
        let plain = self.meshes.iter().any(MeshShape::is_plain);
        Sampling { surface, image: image || (plain && surface) }
    }

    /// Vertices of all meshes.
    pub(super) fn vertices(&self) -> u64 {
        self.meshes.iter().map(|m| u64::from(m.vertices)).sum()
    }

    /// UV pairs of all meshes.
    pub(super) fn uvs(&self) -> u64 {
        let uvs = |mesh: &MeshShape| match mesh.appearance {
            AppearanceShape::Textured { uvs, .. } => uvs.into(),
            _ => 0,
        };
        self.meshes.iter().map(uvs).sum()
    }

    /// Texels of all meshes, the white one for plain meshes among them. Saturates, since this validates a host's counts.
    pub(super) fn texels(&self) -> u64 {
        let white = u64::from(!self.meshes.iter().all(MeshShape::is_plain));
        self.meshes.iter().map(MeshShape::texels).fold(white, u64::saturating_add)
    }
}
