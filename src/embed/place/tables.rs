//! A pass's meshes as the frame's arrays hold them: counts, places, and the tables that the host uploads once.

use crate::constants as c;
use crate::embed::host::geometry::Geometry;
use crate::embed::host::mesh::{MeshLook, PassMesh};
use crate::error::{Error, Result};
use crate::frame::buffers::BufferId;
use crate::frame::pack::{AppearanceShape, MeshShape, push_adjacency};
use crate::scene::Wrap;

/// Bytes that go from the upload buffer into one of the frame's.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Segment {
    pub id: BufferId,
    /// Where they begin in it.
    pub at: u64,
    pub bytes: Vec<u8>,
}

/// Where one mesh of the host lies in the frame's arrays.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Placed {
    /// Its draws, with the first vertex and triangle that they are placed at.
    pub geometry: Geometry,
    /// The first entry of `colors`, in colours; of `uvs`, in pairs; of `uv_indices`, in triangles.
    pub color: u32,
    pub uv: u32,
    pub uv_triangle: u32,
    /// Its part of `texels`.
    pub texel: u32,
    pub look: MeshLook,
}

/// All meshes of a host's in a pass; nothing for a scene, whose tables the pass holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Tables {
    /// Whether they have an adjacency.
    pub adjacency: bool,
    pub shapes: Vec<MeshShape>,
    pub placed: Vec<Placed>,
    pub segments: Vec<Segment>,
}

/// The counts and the tables of all that was laid out so far.
#[derive(Default)]
struct Ends {
    vertices: u32,
    triangles: u32,
    colors: u32,
    uvs: u32,
    uv_triangles: u32,
    texels: u32,
    adjacency: Vec<u32>,
    textures: Vec<[u32; 4]>,
    triangle_textures: Vec<u32>,
}

impl Tables {
    /// Lays out the meshes that each view sees together, `groups` of them, one after the other.
    pub fn new(groups: &[&[PassMesh]], adjacency: bool) -> Result<Self> {
        let mut made = Self { adjacency, ..Self::default() };
        let mut ends = Ends::default();
        let textured = |mesh: &PassMesh| matches!(mesh.look, MeshLook::Texture { .. });
        if groups.iter().any(|group| group.iter().any(textured)) {
            // The texel that a mesh without a texture samples if another mesh has one.
            ends.textures.push([0, 1, 1, c::TEXTURE_CLAMP]);
            made.segment(BufferId::Texels, 0, &[[1.0f32; 4]]);
            ends.texels = 1;
        }
        for group in groups {
            made.push_group(group, &mut ends)?;
        }
        if adjacency {
            made.segment(BufferId::Adjacency, 0, &ends.adjacency);
        }
        made.segment(BufferId::Textures, 0, &ends.textures);
        made.segment(BufferId::TriangleTextures, 0, &ends.triangle_textures);
        if made.shapes.iter().any(|shape| shape.normals) {
            for (placed, mesh) in made.placed.clone().iter().zip(groups.iter().copied().flatten()) {
                // A normal of 0 stands for the mean of the triangles' normals.
                let count = if mesh.has_normals { 0 } else { placed.geometry.vertices() };
                let at = 12 * u64::from(placed.geometry.first_vertex);
                made.segment(BufferId::VertexNormals, at, &vec![[0.0f32; 3]; count as usize]);
            }
        }
        Ok(made)
    }

    fn segment<T: bytemuck::NoUninit>(&mut self, id: BufferId, at: u64, values: &[T]) {
        let bytes = bytemuck::cast_slice(values).to_vec();
        if !bytes.is_empty() {
            self.segments.push(Segment { id, at, bytes });
        }
    }

    fn push_group(&mut self, group: &[PassMesh], ends: &mut Ends) -> Result<()> {
        let first = self.placed.len();
        let mut triangles = Vec::new();
        let (mut vertex, mut triangle) = (0, 0);
        for mesh in group {
            mesh.geometry.validate()?;
            let number = self.placed.len();
            let mut geometry = mesh.geometry.clone();
            geometry.first_vertex = ends.vertices + vertex;
            geometry.first_triangle = ends.triangles + triangle;
            geometry.mesh_vertex = vertex;
            triangles.extend(mesh.placed_triangles(number, vertex)?);
            vertex = sum(vertex, geometry.vertices())?;
            triangle = sum(triangle, geometry.triangles())?;
            let (color, uv, uv_triangle, texel) = (ends.colors, ends.uvs, ends.uv_triangles, 0);
            self.placed.push(Placed { geometry, color, uv, uv_triangle, texel, look: mesh.look });
        }
        self.segment(BufferId::Indices, 12 * u64::from(ends.triangles), &triangles);
        let before = ends.adjacency.len();
        sum(sum(before as u32 + 1, vertex)?, 3 * triangle)?;
        push_adjacency(&mut ends.adjacency, vertex as usize, &triangles);
        let rows = &ends.adjacency[before..=before + vertex as usize];
        let most_corners = rows.windows(2).map(|ends| ends[1] - ends[0]).max().unwrap_or(0);
        let appearance = if group.iter().any(|mesh| matches!(mesh.look, MeshLook::Texture { .. })) {
            self.segment(BufferId::UvIndices, 12 * u64::from(ends.uv_triangles), &triangles);
            self.push_textures(first, vertex, triangle, ends)?
        } else {
            self.push_colors(first, vertex, ends)?
        };
        let normals = group.iter().any(|mesh| mesh.has_normals);
        let (vertices, triangles, features) = (vertex, triangle, 0);
        self.shapes.push(MeshShape { vertices, triangles, most_corners, appearance, normals, features });
        ends.vertices = sum(ends.vertices, vertex)?;
        ends.triangles = sum(ends.triangles, triangle)?;
        Ok(())
    }

    /// One colour if all meshes of the group have the same, else one for each vertex.
    fn push_colors(&mut self, first: usize, vertices: u32, ends: &mut Ends) -> Result<AppearanceShape> {
        let looks: Vec<MeshLook> = self.placed[first..].iter().map(|placed| placed.look).collect();
        if let [MeshLook::Color(color), rest @ ..] = &looks[..]
            && rest.iter().all(|look| *look == looks[0])
        {
            self.segment(BufferId::Colors, 12 * u64::from(ends.colors), &[*color]);
            ends.colors = sum(ends.colors, 1)?;
            return Ok(AppearanceShape::Uniform);
        }
        let mut at = ends.colors;
        for (i, look) in looks.into_iter().enumerate() {
            let count = self.placed[first + i].geometry.vertices();
            self.placed[first + i].color = at;
            if let MeshLook::Color(color) = look {
                self.segment(BufferId::Colors, 12 * u64::from(at), &vec![color; count as usize]);
            }
            at = sum(at, count)?;
        }
        ends.colors = sum(ends.colors, vertices)?;
        Ok(AppearanceShape::VertexColors)
    }

    /// One texture for each mesh, of one texel if the mesh has one colour.
    fn push_textures(
        &mut self,
        first: usize,
        vertices: u32,
        triangles: u32,
        ends: &mut Ends,
    ) -> Result<AppearanceShape> {
        let mut textures = Vec::new();
        let of_triangle = self.placed.len() - first > 1;
        let mut uv = ends.uvs;
        for number in first..self.placed.len() {
            let (look, texel) = (self.placed[number].look, ends.texels);
            let (width, height, kind) = match look {
                MeshLook::Texture { size: (width, height), wrap, .. } => {
                    (width, height, if wrap == Wrap::Repeat { c::TEXTURE_REPEAT } else { c::TEXTURE_CLAMP })
                }
                MeshLook::Color([r, g, b]) => {
                    self.segment(BufferId::Texels, 16 * u64::from(texel), &[[r, g, b, 0.0]]);
                    // The host gives no coordinates for it; any finite ones show its one texel.
                    let count = self.placed[number].geometry.vertices();
                    self.segment(BufferId::Uvs, 8 * u64::from(uv), &vec![[0.0f32; 2]; count as usize]);
                    (1, 1, c::TEXTURE_CLAMP)
                }
                MeshLook::VertexColors => {
                    return Err(Error::Scene {
                        what: format!("mesh {number} of the pass has vertex colours beside a textured mesh"),
                        fix: "give all meshes that one view sees colours, or textures or one colour each".into(),
                    });
                }
            };
            if width == 0 || height == 0 {
                let (what, fix) = (format!("the texture of mesh {number} of the pass has no texels"), "give its size");
                return Err(Error::Scene { what, fix: fix.into() });
            }
            let placed = &mut self.placed[number];
            (placed.texel, placed.uv) = (texel, uv);
            placed.uv_triangle = ends.uv_triangles + placed.geometry.first_triangle - ends.triangles;
            uv = sum(uv, placed.geometry.vertices())?;
            if of_triangle {
                let texture = ends.textures.len() as u32;
                let named = std::iter::repeat_n(texture, placed.geometry.triangles() as usize);
                ends.triangle_textures.extend(named);
            }
            ends.textures.push([texel, width, height, kind]);
            ends.texels = sum(texel, width.saturating_mul(height))?;
            textures.push((width, height));
        }
        self.segment(BufferId::Colors, 12 * u64::from(ends.colors), &[[1.0f32; 3]]);
        ends.colors = sum(ends.colors, 1)?;
        ends.uvs = uv;
        ends.uv_triangles = sum(ends.uv_triangles, triangles)?;
        Ok(AppearanceShape::Textured { uvs: vertices, textures, of_triangle })
    }
}

/// Kernels index with 32 bits, signed.
fn sum(count: u32, more: u32) -> Result<u32> {
    count.checked_add(more).filter(|&sum| sum <= i32::MAX as u32).ok_or_else(|| Error::Limit {
        what: "the meshes of one pass".into(),
        needed: u64::from(count) + u64::from(more),
        unit: "elements",
        limit_name: "32-bit index",
        limit: i32::MAX as u64,
        fix: "spread them over several passes".into(),
    })
}
