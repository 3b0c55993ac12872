//! A host's meshes as a pass takes them: counts and kinds when it is planned, buffers when it is bound.

use super::geometry::{Draw, Geometry, IndexFormat, Layout};
use super::targets::Floats;
use crate::error::{Error, Result};
use crate::scene::Wrap;
use crate::vulkan::{BufferRef, TextureRef};
use std::sync::Arc;

/// One of a host's meshes: which of its vertices and indices are drawn, and what colours them.
#[derive(Clone, Debug, PartialEq)]
pub struct PassMesh {
    pub(crate) geometry: Geometry,
    pub(crate) indices: Arc<[u32]>,
    pub(crate) look: MeshLook,
    pub(crate) has_normals: bool,
}

/// The colour of a mesh: one for all of it, one for each vertex, or a texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MeshLook {
    /// One colour, linear r, g, b.
    Color([f32; 3]),
    /// A colour for each vertex, from [`MeshBuffers::colors`].
    VertexColors,
    /// An image, from [`MeshBuffers::texels`], at the coordinates of [`MeshBuffers::uvs`].
    Texture {
        /// Texels across and down.
        size: (u32, u32),
        /// How the image goes on outside the unit square.
        wrap: Wrap,
        /// v grows downwards from the image's first row, as in glTF and Vulkan; else upwards from its last one, as in OBJ.
        v_down: bool,
    },
}

/// Where one mesh lies in a host's buffers. Each has the usage STORAGE_BUFFER, at a multiple of
/// minStorageBufferOffsetAlignment. Those that are `None` are not read.
#[derive(Clone, Copy, Debug)]
pub struct MeshBuffers {
    /// Vertices: x, y, z as floats.
    pub positions: (BufferRef, Layout),
    /// r, g, b of each vertex as floats, for [`MeshLook::VertexColors`].
    pub colors: Option<(BufferRef, Layout)>,
    /// u, v of each vertex as floats, for [`MeshLook::Texture`].
    pub uvs: Option<(BufferRef, Layout)>,
    /// One for each instance: three rows of four floats that take (x, y, z, 1) to the world, as VkTransformMatrixKHR;
    /// `None` where vertices are in the world already.
    pub transforms: Option<(BufferRef, Layout)>,
    /// Indices on the device, read in place of those that the mesh was planned with. They must be the same, or at least
    /// have the same triangles at each vertex. One beyond its draw's vertices counts as the last of them.
    pub indices: Option<(BufferRef, IndexFormat)>,
    /// The texture's texels; `None` where a kernel of the host's writes its part of `texels`
    /// ([`Pass::texels`](crate::embed::Pass::texels)).
    pub texels: Option<TexelSource>,
    /// Where the gradients go, in layouts of the host's.
    pub gradients: GeometryGradients,
}

/// Where a host wants the gradients of a mesh, in layouts of its own. Every backward pass overwrites them; what is `None` is not
/// written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GeometryGradients {
    /// dL/dx, dL/dy, dL/dz of each vertex that a draw reads, summed over its instances in their order.
    pub positions: Option<(BufferRef, Layout)>,
    /// dL/dr, dL/dg, dL/db of each, likewise.
    pub colors: Option<(BufferRef, Layout)>,
    /// dL by each number of each transform. Needs [`GradientRequest::positions`](crate::GradientRequest::positions).
    pub transforms: Option<(BufferRef, Layout)>,
}

/// A texture's texels, row 0 at the top.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TexelSource {
    /// An image, decoded as its format says.
    Image(TextureRef),
    /// Four floats each, linear r, g, b and one that is not read. Usage TRANSFER_SRC.
    Floats(BufferRef),
    /// Four bytes each, r in the first one, the fourth not read. Usage STORAGE_BUFFER.
    Bytes {
        /// Where they lie.
        at: BufferRef,
        /// They are encoded as sRGB does.
        srgb: bool,
    },
}

impl PassMesh {
    /// A mesh of `vertices` vertices and all triangles of `indices`, white, drawn once. The indices are those of the host's
    /// index buffer, of 16 or 32 bits.
    pub fn new<T: Copy + Into<u32>>(vertices: u32, indices: &[T]) -> Self {
        // If the count is no multiple of 3, the last triangle is incomplete, which the plan refuses.
        let triangles = u32::try_from(indices.len().div_ceil(3)).unwrap_or(u32::MAX);
        let draw = Draw { first_vertex: 0, vertices, first_index: 0, triangles, instances: 1 };
        Self {
            geometry: Geometry::new(vec![draw]),
            indices: indices.iter().map(|&index| index.into()).collect(),
            look: MeshLook::Color([1.0; 3]),
            has_normals: false,
        }
    }

    /// The mesh of several draws over one vertex and one index buffer, each with instances.
    pub fn of_draws<T: Copy + Into<u32>>(draws: Vec<Draw>, indices: &[T]) -> Self {
        Self { geometry: Geometry::new(draws), ..Self::new(0, indices) }
    }

    /// Draws the mesh `instances` times, each time with the next of [`MeshBuffers::transforms`].
    pub fn with_instances(mut self, instances: u32) -> Self {
        let draws = self.geometry.draws().iter().map(|draw| Draw { instances, ..*draw }).collect();
        self.geometry = Geometry::new(draws);
        self
    }

    /// Gives the mesh other colours.
    pub fn with_look(self, look: MeshLook) -> Self {
        Self { look, ..self }
    }

    /// Gives the mesh the host's vertex normals for smooth shading, which its kernels write into [`Pass::normals`](crate::embed::Pass::normals).
    pub fn with_normals(self) -> Self {
        Self { has_normals: true, ..self }
    }

    /// The three vertices of every placed triangle, counted from `base`.
    pub(crate) fn placed_triangles(&self, mesh: usize, base: u32) -> Result<Vec<[u32; 3]>> {
        let read = self.geometry.source_indices();
        if read > self.indices.len() as u64 {
            let what = format!("there are {} indices, and draws read {read}", self.indices.len());
            return bad_index(mesh, self.indices.len(), what);
        }
        let mut triangles = Vec::with_capacity(self.geometry.triangles() as usize);
        for (draw, row) in self.geometry.draws().iter().zip(self.geometry.table()) {
            for instance in 0..draw.instances {
                let first = base + row[0] + instance * draw.vertices;
                for corner in (0..draw.triangles).map(|t| (draw.first_index + 3 * t) as usize) {
                    let Some(&[a, b, c]) = self.indices.get(corner..corner + 3) else {
                        return bad_index(mesh, corner, "there is no such index".into());
                    };
                    if let Some(index) = [a, b, c].into_iter().find(|&index| index >= draw.vertices) {
                        return bad_index(mesh, corner, format!("a triangle of vertex {index}, of {}", draw.vertices));
                    }
                    triangles.push([first + a, first + b, first + c]);
                }
            }
        }
        Ok(triangles)
    }
}

fn bad_index<T>(mesh: usize, corner: usize, what: String) -> Result<T> {
    let place = format!("mesh {mesh} of the pass, index {corner}");
    Err(Error::Mesh { what, place, fix: "give the indices that its draws read, each below the draw's vertices".into() })
}

impl MeshBuffers {
    /// The arrays that are read, as far as draws read them.
    pub(crate) fn sources(&self, geometry: &Geometry) -> impl Iterator<Item = Floats> {
        let (first, end) = geometry.source_vertices();
        let vertices = move |array: (BufferRef, Layout), floats| Floats::new(&array, first, end - first, floats);
        let transforms = self.transforms.map(|array| Floats::new(&array, 0, geometry.instances(), 12));
        let texels = match self.texels {
            Some(TexelSource::Floats(at) | TexelSource::Bytes { at, .. }) => Some(Floats::whole(&at)),
            Some(TexelSource::Image(_)) | None => None,
        };
        let indices = self.indices.map(|(at, _)| Floats::whole(&at));
        let by_vertex =
            [Some(vertices(self.positions, 3)), self.colors.map(|a| vertices(a, 3)), self.uvs.map(|a| vertices(a, 2))];
        by_vertex.into_iter().chain([transforms, texels, indices]).flatten()
    }

    /// A mesh of positions alone.
    pub fn new(positions: BufferRef, layout: Layout) -> Self {
        Self {
            positions: (positions, layout),
            colors: None,
            uvs: None,
            transforms: None,
            indices: None,
            texels: None,
            gradients: GeometryGradients::default(),
        }
    }
}
