//! The shapes of meshes, and where each mesh lies in the tables that hold all meshes of a frame one after the other.

use crate::constants as c;
use crate::frame::buffers::TableLengths;
use crate::scene::{Appearance, Mesh};
use std::ops::Range;

/// The counts of one mesh.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MeshShape {
    /// Its vertices.
    pub vertices: u32,
    /// Its triangles.
    pub triangles: u32,
    /// The largest number of triangle corners that share a vertex. A software device refuses to sum over too many of
    /// them ([`crate::Error::Limit`]); if this is less than the real number, it may lose some of them without an error.
    pub most_corners: u32,
    /// Its appearance.
    pub appearance: AppearanceShape,
    /// Whether its vertices have normals ([`Mesh::with_normals`]).
    pub normals: bool,
    /// The features of each vertex ([`Mesh::with_features`]).
    pub features: u32,
}

/// The appearance of a mesh, as far as sizes depend on it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum AppearanceShape {
    /// One colour for the whole mesh.
    Uniform,
    /// A colour for each vertex.
    VertexColors,
    /// `resolution²` cells for each triangle.
    Surface {
        /// Cells along an edge.
        resolution: u32,
    },
    /// Images.
    Textured {
        /// UV pairs.
        uvs: u32,
        /// Width and height of each image in texels.
        textures: Vec<(u32, u32)>,
        /// Each triangle names its image; otherwise all use the first.
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
        let normals = !mesh.normals().is_empty();
        let features = mesh.feature_channels();
        Self { vertices, triangles, most_corners: mesh.most_corners(), appearance, normals, features }
    }

    /// Whether it samples no texture.
    pub(crate) fn is_plain(&self) -> bool {
        matches!(self.appearance, AppearanceShape::Uniform | AppearanceShape::VertexColors)
    }

    /// Texels of each of its textures. Saturates, since a host's counts are validated by their sum.
    fn texels_of_textures(&self) -> Vec<u64> {
        match &self.appearance {
            AppearanceShape::Surface { resolution } => {
                vec![u64::from(self.triangles).saturating_mul(u64::from(*resolution).pow(2))]
            }
            AppearanceShape::Textured { textures, .. } => {
                textures.iter().map(|&(width, height)| u64::from(width) * u64::from(height)).collect()
            }
            _ => Vec::new(),
        }
    }

    /// Texels of all its textures. Saturates.
    pub(crate) fn texels(&self) -> u64 {
        self.texels_of_textures().into_iter().fold(0, u64::saturating_add)
    }
}

/// Where one mesh lies in the tables: its first element in each table, and its counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MeshLayout {
    /// First vertex.
    pub vertex: u32,
    /// Vertices.
    pub vertices: u32,
    /// First triangle.
    pub triangle: u32,
    /// Triangles.
    pub triangles: u32,
    /// First float of `colors`.
    pub color: u32,
    /// The SHAPE_ flag of a mesh with one colour, or 0.
    pub uniform: u32,
    /// First float of `uvs`; all bits set without images.
    pub uv: u32,
    /// First word of `uv_indices`; all bits set without images.
    pub uv_index: u32,
    /// As the kernels read it: the first word of `triangle_textures`; or, if all triangles have the same texture, the
    /// bitwise complement of its number; or all bits set without texture.
    pub texture: u32,
    /// First entry of `textures`.
    pub first_texture: u32,
    /// First texel.
    pub texel: u64,
    /// First word of `adjacency`.
    pub adjacency: u32,
}

impl MeshLayout {
    /// The range of its vertices among those of all meshes.
    pub fn vertex_range(&self) -> Range<usize> {
        self.vertex as usize..(self.vertex + self.vertices) as usize
    }

    /// The ranges of texels of its textures, given the shape that it was made of.
    pub fn texel_ranges(&self, shape: &MeshShape) -> Vec<Range<usize>> {
        let mut next = self.texel as usize;
        let range = |count: u64| {
            let first = next;
            next += count as usize;
            first..next
        };
        shape.texels_of_textures().into_iter().map(range).collect()
    }
}

/// Where every mesh lies in the tables, and how long the tables are.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TableLayout {
    /// The meshes, in order.
    pub meshes: Vec<MeshLayout>,
    /// Elements of each table.
    pub lengths: TableLengths,
}

impl TableLayout {
    /// Lays out meshes one after the other. `adjacency` is needed for gradients and for smooth shading.
    pub fn of(shapes: &[MeshShape], adjacency: bool) -> Self {
        let mut layout = Self::default();
        if !shapes.iter().all(MeshShape::is_plain) {
            // The white texel that a mesh without texture samples, if another mesh has a texture.
            (layout.lengths.textures, layout.lengths.texels) = (1, 1);
        }
        for shape in shapes {
            layout.push(shape, adjacency);
        }
        if shapes.iter().any(|shape| shape.normals) {
            layout.lengths.normals = 3 * layout.lengths.vertices;
        }
        layout
    }

    fn push(&mut self, shape: &MeshShape, adjacency: bool) {
        let next = &mut self.lengths;
        let (vertices, triangles) = (u64::from(shape.vertices), u64::from(shape.triangles));
        let mut mesh = MeshLayout {
            vertex: next.vertices as u32,
            vertices: shape.vertices,
            triangle: next.triangles as u32,
            triangles: shape.triangles,
            color: next.colors as u32,
            uniform: c::SHAPE_UNIFORM_COLOR,
            uv: u32::MAX,
            uv_index: u32::MAX,
            texture: u32::MAX,
            first_texture: next.textures as u32,
            texel: next.texels,
            adjacency: next.adjacency as u32,
        };
        let mut colors = 3;
        match &shape.appearance {
            AppearanceShape::Uniform => {}
            AppearanceShape::VertexColors => (mesh.uniform, colors) = (0, 3 * vertices),
            AppearanceShape::Surface { .. } => {
                mesh.texture = !mesh.first_texture;
                next.textures += 1;
            }
            AppearanceShape::Textured { uvs, textures, of_triangle } => {
                (mesh.uv, mesh.uv_index) = (next.uvs as u32, next.uv_indices as u32);
                mesh.texture = if *of_triangle { next.triangle_textures as u32 } else { !mesh.first_texture };
                next.triangle_textures += if *of_triangle { triangles } else { 0 };
                next.textures += textures.len() as u64;
                next.uvs += 2 * u64::from(*uvs);
                next.uv_indices += 3 * triangles;
            }
        }
        next.meshes += 1;
        next.vertices += vertices;
        next.triangles += triangles;
        next.colors += colors;
        next.features += vertices * u64::from(shape.features.div_ceil(4));
        next.texels = next.texels.saturating_add(shape.texels());
        next.adjacency += if adjacency { vertices + 1 + 3 * triangles } else { 0 };
        self.meshes.push(mesh);
    }
}
