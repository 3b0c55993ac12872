//! The shape of a frame: the counts and kinds that its plan depends on, without data.

use crate::error::Result;
use crate::frame::pack::{AppearanceShape, MeshShape};
use crate::frame::plan::{Capacity, DepthSpan, Lenses, Sampling, ViewSize};
use crate::scene::{Camera, Lights, Mesh, Scene, Settings};

/// The shape of a frame, from which its plan is made. [`FrameShape::of`] takes it from a scene; a pass over a host's own meshes
/// fills it in.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameShape {
    /// The meshes: one that every view sees, or one for each view. At least one.
    pub meshes: Vec<MeshShape>,
    /// The number of cameras; at least 1.
    pub views: u32,
    /// The lights. A plan depends on their number, on the shading, on whether they are [`Lights::unlit`], and, for the
    /// gradients of texels, on their intensities.
    pub lights: Lights,
    /// How the depths of the meshes compare with the near and far planes. `true` is always right but costs more: triangles
    /// that may cross the near plane have two records.
    pub depth_span: DepthSpan,
    /// The kinds of the cameras.
    pub lenses: Lenses,
    /// Some texture has an alpha below 1 ([`Texture::with_alpha`](crate::scene::Texture::with_alpha)), the fourth float of its
    /// texels.
    pub opacity: bool,
    /// How far a triangle's support reaches outside it, as a squared distance in units of σ: [`Settings::cutoff`], or
    /// with [`Support::Guaranteed`](crate::scene::Support) what [`Settings::cutoff_of`] says. At most 70.
    pub cutoff: f64,
    /// The capacities of lists whose lengths are only known on the device; `None`: estimated. After a frame,
    /// its status says what it needed.
    pub capacity: Option<Capacity>,
    /// Whether only the device knows how many triangles are drawn; the counts of the meshes are then upper bounds. See
    /// [`Counts`](crate::embed::Counts).
    pub device_counts: bool,
}

impl FrameShape {
    /// The shape of a valid scene with its cameras.
    ///
    /// # Errors
    /// [`crate::Error::Scene`], [`crate::Error::Light`], [`crate::Error::Settings`].
    pub fn of(scene: &Scene, cameras: &[Camera], settings: &Settings) -> Result<Self> {
        scene.validate(cameras)?;
        settings.validate()?;
        let bounds: Vec<_> = scene.meshes.iter().map(Mesh::bounds).collect();
        let inside = DepthSpan { crosses_near: false, crosses_far: false };
        let depth_span = cameras.iter().enumerate().fold(inside, |span, (view, camera)| {
            let mesh = scene.mesh_of_view(view);
            span.or(DepthSpan::of_mesh(&scene.meshes[mesh], bounds[mesh], camera, settings))
        });
        Ok(Self {
            meshes: scene.meshes.iter().map(MeshShape::of).collect(),
            views: cameras.len() as u32,
            lights: scene.lights.clone(),
            depth_span,
            cutoff: settings.cutoff_of(scene, cameras),
            opacity: scene.meshes.iter().any(Mesh::has_opacity),
            lenses: Lenses::of(cameras),
            capacity: None,
            device_counts: false,
        })
    }

    /// The counts of the mesh that each view sees.
    pub(crate) fn view_sizes(&self) -> Vec<ViewSize> {
        let size = |mesh: &MeshShape| ViewSize { vertices: mesh.vertices, triangles: mesh.triangles };
        match &self.meshes[..] {
            [one] => vec![size(one); self.views as usize],
            several => several.iter().map(size).collect(),
        }
    }

    /// The most corners of one mesh's triangles that share a vertex.
    pub(crate) fn most_corners(&self) -> u32 {
        self.meshes.iter().map(|mesh| mesh.most_corners).max().unwrap_or(0)
    }

    pub(crate) fn sampling(&self) -> Sampling {
        let any = |f: fn(&AppearanceShape) -> bool| self.meshes.iter().any(|m| f(&m.appearance));
        let surface = any(|a| matches!(a, AppearanceShape::Surface { .. }));
        let image = any(|a| matches!(a, AppearanceShape::Textured { .. }));
        // If another mesh has a texture, a mesh without one samples a white image of one texel.
        let plain = self.meshes.iter().any(MeshShape::is_plain);
        Sampling { surface, image: image || (plain && surface), opacity: image && self.opacity }
    }

    /// The features of each vertex of the meshes, which have the same number where they are rendered.
    pub(crate) fn features(&self) -> u32 {
        self.meshes.iter().map(|mesh| mesh.features).max().unwrap_or(0)
    }

    /// Vertices of all meshes.
    pub(crate) fn vertices(&self) -> u64 {
        self.meshes.iter().map(|m| u64::from(m.vertices)).sum()
    }

    /// UV pairs of all meshes.
    pub(crate) fn uvs(&self) -> u64 {
        let uvs = |mesh: &MeshShape| match mesh.appearance {
            AppearanceShape::Textured { uvs, .. } => uvs.into(),
            _ => 0,
        };
        self.meshes.iter().map(uvs).sum()
    }

    /// Texels of all meshes, the white one for plain meshes among them. Saturates, since this validates a host's counts.
    pub(crate) fn texels(&self) -> u64 {
        let white = u64::from(!self.meshes.iter().all(MeshShape::is_plain));
        self.meshes.iter().map(MeshShape::texels).fold(white, u64::saturating_add)
    }
}
