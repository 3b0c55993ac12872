//! What a frame's sizes follow from: counts and kinds, no data.

use crate::constants as c;
use crate::error::Result;
use crate::frame::buffers::TableLengths;
use crate::frame::plan::{Capacity, DepthSpan, Sampling, ViewSize};
use crate::scene::{Appearance, Camera, Lights, Mesh, Projection, Scene, Settings};

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

/// The counts of one mesh.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MeshShape {
    /// Its vertices.
    pub vertices: u32,
    /// Its triangles.
    pub triangles: u32,
    /// The most of its triangles' corners that share a vertex. Sums over them are what a software device may refuse
    /// ([`crate::Error::Limit`]); too small a number, and there it may lose some.
    pub most_corners: u32,
    /// What colours it.
    pub appearance: AppearanceShape,
}

/// What colours a mesh, as far as sizes need to know.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum AppearanceShape {
    /// One colour.
    Uniform,
    /// A colour a vertex.
    VertexColors,
    /// `resolution²` cells a triangle.
    Surface {
        /// Cells along an edge.
        resolution: u32,
    },
    /// Images.
    Textured {
        /// UV pairs.
        uvs: u32,
        /// Width and height of each image.
        textures: Vec<(u32, u32)>,
        /// Each triangle names its image.
        of_triangle: bool,
    },
}

impl MeshShape {
    /// The shape of a mesh.
    pub fn of(mesh: &Mesh) -> Self {
        let appearance = match mesh.appearance() {
            Appearance::Uniform(_) => AppearanceShape::Uniform,
            Appearance::VertexColors(_) => AppearanceShape::VertexColors,
            Appearance::Surface { resolution, .. } => AppearanceShape::Surface { resolution: *resolution },
            Appearance::Textured { uvs, textures, texture_of_triangle, .. } => AppearanceShape::Textured {
                uvs: uvs.len() as u32,
                textures: textures.iter().map(|t| (t.width(), t.height())).collect(),
                of_triangle: !texture_of_triangle.is_empty(),
            },
        };
        let (vertices, triangles) = (mesh.positions().len() as u32, mesh.triangles().len() as u32);
        Self { vertices, triangles, most_corners: mesh.most_corners(), appearance }
    }

    fn is_plain(&self) -> bool {
        matches!(self.appearance, AppearanceShape::Uniform | AppearanceShape::VertexColors)
    }

    fn textures(&self) -> u64 {
        match &self.appearance {
            AppearanceShape::Surface { .. } => 1,
            AppearanceShape::Textured { textures, .. } => textures.len() as u64,
            _ => 0,
        }
    }

    fn texels(&self) -> u64 {
        match &self.appearance {
            AppearanceShape::Surface { resolution } => {
                u64::from(self.triangles).saturating_mul(u64::from(*resolution).pow(2))
            }
            AppearanceShape::Textured { textures, .. } => {
                sum(textures.iter().map(|&(width, height)| u64::from(width) * u64::from(height)))
            }
            _ => 0,
        }
    }
}

/// A host's counts may be anything until the plan has judged their sum.
fn sum(counts: impl Iterator<Item = u64>) -> u64 {
    counts.fold(0, u64::saturating_add)
}

/// Where one mesh lies in the tables, and how large it is.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct MeshEntry {
    pub vertex: u32,
    pub vertices: u32,
    pub triangle: u32,
    pub triangles: u32,
    pub color: u32,
    pub uniform: u32,
    pub uv: u32,
    pub uv_index: u32,
    pub texture: u32,
    pub triangle_texture: u32,
    pub adjacency: u32,
}

impl Shape {
    /// The shape of a scene as cameras see it, judged.
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

    /// Texels of all meshes, the white one for plain meshes among them.
    pub(super) fn texels(&self) -> u64 {
        sum(self.meshes.iter().map(MeshShape::texels)).saturating_add(self.is_sampled().into())
    }

    fn is_sampled(&self) -> bool {
        !self.meshes.iter().all(MeshShape::is_plain)
    }

    /// What of each mesh goes into the entries of `view_shapes`, but for its views' shares of the frame: places in the
    /// tables where meshes follow each other.
    pub(super) fn mesh_entries(&self, adjacency: bool) -> Vec<MeshEntry> {
        let mut next = MeshEntry { texture: u32::from(self.is_sampled()), ..MeshEntry::default() };
        let mut entries = Vec::with_capacity(self.meshes.len());
        for mesh in &self.meshes {
            let (vertices, triangles) = (mesh.vertices, mesh.triangles);
            let mut entry = MeshEntry { vertices, triangles, uniform: c::SHAPE_UNIFORM_COLOR, ..next };
            (entry.uv, entry.uv_index, entry.texture) = (u32::MAX, u32::MAX, u32::MAX);
            let mut colors = 3;
            match &mesh.appearance {
                AppearanceShape::Uniform => {}
                AppearanceShape::VertexColors => {
                    entry.uniform = 0;
                    colors = 3 * vertices;
                }
                AppearanceShape::Surface { .. } => {
                    // An entry of `textures` for all triangles, as -1 minus its number.
                    entry.texture = !next.texture;
                    next.texture += 1;
                }
                AppearanceShape::Textured { uvs, textures, of_triangle } => {
                    (entry.uv, entry.uv_index) = (next.uv, next.uv_index);
                    entry.texture = if *of_triangle { next.triangle_texture } else { !next.texture };
                    next.triangle_texture += if *of_triangle { triangles } else { 0 };
                    next.texture += textures.len() as u32;
                    next.uv += 2 * uvs;
                    next.uv_index += 3 * triangles;
                }
            }
            next.vertex += vertices;
            next.triangle += triangles;
            next.color += colors;
            next.adjacency += if adjacency { vertices + 1 + 3 * triangles } else { 0 };
            entries.push(entry);
        }
        entries
    }

    /// Elements of the tables of all meshes.
    pub(super) fn table_lengths(&self, adjacency: bool) -> TableLengths {
        let sum = |each: fn(&MeshShape) -> u64| self.meshes.iter().map(each).sum::<u64>();
        let textured = |each: fn(&MeshShape, bool) -> u64| -> u64 {
            let counts = self.meshes.iter().map(|mesh| match &mesh.appearance {
                AppearanceShape::Textured { of_triangle, .. } => each(mesh, *of_triangle),
                _ => 0,
            });
            counts.sum()
        };
        let corners = sum(|m| u64::from(m.vertices) + 1 + 3 * u64::from(m.triangles));
        TableLengths {
            meshes: self.meshes.len() as u64,
            vertices: self.vertices(),
            triangles: sum(|m| u64::from(m.triangles)),
            adjacency: if adjacency { corners } else { 0 },
            colors: sum(|m| match m.appearance {
                AppearanceShape::VertexColors => 3 * u64::from(m.vertices),
                _ => 3,
            }),
            uvs: 2 * self.uvs(),
            uv_indices: 3 * textured(|mesh, _| mesh.triangles.into()),
            triangle_textures: textured(|mesh, named| u64::from(named) * u64::from(mesh.triangles)),
            textures: u64::from(self.is_sampled()) + sum(MeshShape::textures),
            texels: self.texels(),
        }
    }
}
