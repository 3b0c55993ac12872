//! Scenes, cameras and lights as the tables that the kernels read.
//!
//! `layout` computes where each mesh lies in the tables, from counts alone. [`MeshTables`] holds the values, and `update`
//! takes over those of a scene with the same layout.

mod layout;
mod update;

pub use layout::{AppearanceShape, MeshLayout, MeshShape, TableLayout};
pub use update::InputChanges;

use crate::constants as c;
use crate::frame::buffers::BufferId;
use crate::frame::plan::split;
use crate::scene::{Appearance, Camera, Lights, Mesh, Projection, Scene, Settings, Texture, Wrap};

/// The meshes of a scene, one after the other, in flat arrays.
#[derive(Debug, Default)]
pub struct MeshTables {
    /// x, y, z of every vertex.
    pub positions: Vec<f32>,
    /// Three vertex numbers (within the mesh) of every triangle.
    pub indices: Vec<u32>,
    /// For each mesh: vertices + 1 absolute offsets, then each vertex's corners in ascending order, each as four times the
    /// triangle's number plus the corner's number (0 to 2).
    pub adjacency: Vec<u32>,
    /// x, y, z of every vertex's normal, 0 for meshes without; empty if no mesh has normals.
    pub normals: Vec<f32>,
    /// r, g, b: one colour for each mesh, or one for each vertex.
    pub colors: Vec<f32>,
    /// Features of every vertex, four a texel and zeros behind a vertex's last.
    pub features: Vec<[f32; 4]>,
    /// u, v.
    pub uvs: Vec<f32>,
    /// Three UV numbers (within the mesh) of every triangle of a textured mesh.
    pub uv_indices: Vec<u32>,
    /// The entry of `textures` of every triangle of a mesh with several.
    pub triangle_textures: Vec<u32>,
    /// Images: first texel, width, height, kind. Surface cells: first texel, resolution, number of texels, kind.
    pub textures: Vec<[u32; 4]>,
    /// r, g, b, alpha.
    pub texels: Vec<[f32; 4]>,
    /// Where each mesh lies in these arrays.
    pub layouts: Vec<MeshLayout>,
    /// The shapes of the meshes.
    pub shapes: Vec<MeshShape>,
    /// The images whose texels are in `texels`; a clone of one is recognized without comparing texels.
    pub(crate) images: Vec<Texture>,
}

impl MeshTables {
    /// Lays out a scene's meshes. `adjacency` is needed for gradients and for smooth shading.
    pub fn new(scene: &Scene, adjacency: bool) -> Self {
        let shapes: Vec<MeshShape> = scene.meshes.iter().map(MeshShape::of).collect();
        let mut tables = Self { layouts: TableLayout::of(&shapes, adjacency).meshes, shapes, ..Self::default() };
        if !tables.shapes.iter().all(MeshShape::is_plain) {
            // The white texel that a mesh without texture samples, if another mesh of the frame has a texture.
            tables.textures.push([0, 1, 1, c::TEXTURE_CLAMP]);
            tables.texels.push([1.0; 4]);
        }
        for mesh in &scene.meshes {
            tables.push(mesh, adjacency);
        }
        if tables.shapes.iter().any(|shape| shape.normals) {
            tables.normals = scene.meshes.iter().flat_map(normal_values).collect();
        }
        tables
    }

    /// Takes over a scene of these shapes, laid out anew where the last one's shapes or triangles were others, and returns the tables that differ. A
    /// [`Texture`] that is a clone of the last one is not compared.
    #[cfg(feature = "renderer")]
    pub(crate) fn renew(&mut self, scene: &Scene, shapes: &[MeshShape], adjacency: bool) -> InputChanges {
        if self.shapes == shapes && (!adjacency || !self.adjacency.is_empty()) && self.has_triangles_of(scene) {
            return self.update(scene);
        }
        *self = Self::new(scene, adjacency);
        InputChanges::ALL
    }

    /// The bytes of each table and the buffer that takes them; empty for a table that the meshes do not need.
    pub(crate) fn all(&self) -> [(BufferId, &[u8]); 11] {
        [
            (BufferId::Positions, bytemuck::cast_slice(&self.positions)),
            (BufferId::Indices, bytemuck::cast_slice(&self.indices)),
            (BufferId::Adjacency, bytemuck::cast_slice(&self.adjacency)),
            (BufferId::VertexNormals, bytemuck::cast_slice(&self.normals)),
            (BufferId::Colors, bytemuck::cast_slice(&self.colors)),
            (BufferId::Features, bytemuck::cast_slice(&self.features)),
            (BufferId::Uvs, bytemuck::cast_slice(&self.uvs)),
            (BufferId::UvIndices, bytemuck::cast_slice(&self.uv_indices)),
            (BufferId::TriangleTextures, bytemuck::cast_slice(&self.triangle_textures)),
            (BufferId::Textures, bytemuck::cast_slice(&self.textures)),
            (BufferId::Texels, bytemuck::cast_slice(&self.texels)),
        ]
    }

    /// Vertices of all meshes.
    pub(crate) fn vertices(&self) -> usize {
        self.layouts.iter().map(|mesh| mesh.vertices as usize).sum()
    }

    fn push(&mut self, mesh: &Mesh, adjacency: bool) {
        self.positions.extend(mesh.positions().iter().flatten());
        self.indices.extend(mesh.triangles().iter().flatten());
        if adjacency {
            push_adjacency(&mut self.adjacency, mesh.positions().len(), mesh.triangles());
        }
        self.features.extend(feature_texels(mesh));
        self.push_appearance(mesh);
    }

    fn push_appearance(&mut self, mesh: &Mesh) {
        match mesh.appearance() {
            Appearance::Uniform(color) => self.colors.extend(color),
            Appearance::VertexColors(colors) => self.colors.extend(colors.iter().flatten()),
            Appearance::Surface { resolution, texels } => {
                self.colors.extend([1.0; 3]);
                let count = texels.len() as u32;
                self.textures.push([self.texels.len() as u32, *resolution, count, c::TEXTURE_SURFACE]);
                self.texels.extend(opaque(texels));
            }
            Appearance::Textured { uvs, uv_triangles, textures, texture_of_triangle } => {
                self.colors.extend([1.0; 3]);
                self.uvs.extend(uvs.iter().flatten());
                self.uv_indices.extend(uv_triangles.iter().flatten());
                let first = self.textures.len() as u32;
                self.triangle_textures.extend(texture_of_triangle.iter().map(|t| first + t));
                textures.iter().for_each(|texture| self.push_texture(texture));
            }
        }
    }

    fn push_texture(&mut self, texture: &Texture) {
        self.textures.push([self.texels.len() as u32, texture.width(), texture.height(), kind_of(texture)]);
        self.texels.extend(rgba(texture));
        self.images.push(texture.clone());
    }
}

/// Appends one mesh's entry of `adjacency`: the corners sorted by vertex (counting sort), so that each vertex's corners ascend.
pub(crate) fn push_adjacency(adjacency: &mut Vec<u32>, vertices: usize, triangles: &[[u32; 3]]) {
    let mut ends = vec![0u32; vertices];
    for &v in triangles.as_flattened() {
        ends[v as usize] += 1;
    }
    let mut next = (adjacency.len() + vertices + 1) as u32;
    adjacency.push(next);
    for end in &mut ends {
        next += *end;
        adjacency.push(next);
        *end = next - *end;
    }
    adjacency.resize(next as usize, 0);
    for (t, triangle) in (0..).zip(triangles) {
        for (corner, &v) in (0..).zip(triangle) {
            let next = &mut ends[v as usize];
            adjacency[*next as usize] = 4 * t + corner;
            *next += 1;
        }
    }
}

/// x, y, z of every vertex's normal, 0 for a mesh without.
fn normal_values(mesh: &Mesh) -> impl Iterator<Item = f32> {
    let missing = if mesh.normals().is_empty() { 3 * mesh.positions().len() } else { 0 };
    mesh.normals().as_flattened().iter().copied().chain(std::iter::repeat_n(0.0, missing))
}

/// A mesh's features, four a texel and zeros behind a vertex's last.
fn feature_texels(mesh: &Mesh) -> impl Iterator<Item = [f32; 4]> {
    let of_vertex = mesh.features().chunks_exact(mesh.feature_channels().max(1) as usize);
    let texel = |part: &[f32]| [0, 1, 2, 3].map(|k| part.get(k).copied().unwrap_or(0.0));
    of_vertex.flat_map(move |features| features.chunks(4).map(texel))
}

/// Colours with an alpha of 1.
fn opaque(colors: &[[f32; 3]]) -> impl Iterator<Item = [f32; 4]> {
    colors.iter().map(|c| [c[0], c[1], c[2], 1.0])
}

/// The texels of a texture with their alpha.
fn rgba(texture: &Texture) -> impl Iterator<Item = [f32; 4]> {
    let alpha = texture.alpha().unwrap_or_default().iter().copied().chain(std::iter::repeat(1.0));
    opaque(texture.texels()).zip(alpha).map(|([r, g, b, _], alpha)| [r, g, b, alpha])
}

fn kind_of(texture: &Texture) -> u32 {
    match texture.wrap() {
        Wrap::Repeat => c::TEXTURE_REPEAT,
        Wrap::Clamp => c::TEXTURE_CLAMP,
    }
}

/// The `lights` table: ambient, then each directional light's unit direction and its colour times intensity.
pub fn light_texels(lights: &Lights) -> Vec<[f32; 4]> {
    let rgb = |color: [f64; 3], intensity: f64| {
        let [r, g, b] = color.map(|x| (x * intensity) as f32);
        [r, g, b, 0.0]
    };
    let mut texels = vec![rgb(lights.ambient_color, lights.ambient_intensity)];
    for light in &lights.directional {
        let d = glam::DVec3::from(light.direction).normalize();
        texels.push([d.x as f32, d.y as f32, d.z as f32, 0.0]);
        texels.push(rgb(light.color, light.intensity));
    }
    texels
}

/// The `view_cameras` entry of one camera: rows as double floats, then the projection to pixels.
pub fn camera_texels(camera: &Camera, settings: &Settings) -> [[f32; 4]; c::CAMERA_TEXELS as usize] {
    let (w, h) = (f64::from(settings.width), f64::from(settings.height));
    // Screen units to pixels: column = (x h + w - 1) / 2, row = (h - 1 - y h) / 2.
    let (sx, sy, ox, oy) = match *camera.projection() {
        Projection::Perspective { fov_y } => {
            let f = h / 2.0 / (fov_y / 2.0).tan();
            (f, -f, (w - 1.0) / 2.0, (h - 1.0) / 2.0)
        }
        Projection::Orthographic { half_height } => {
            let f = h / 2.0 / half_height;
            (f, -f, (w - 1.0) / 2.0, (h - 1.0) / 2.0)
        }
        Projection::Pinhole { fx, fy, cx, cy } => (fx, -fy, cx - 0.5, cy - 0.5),
        Projection::Official { original_size, .. } => {
            // Screen x = 2 x'' / S - 1.
            let f = h / original_size;
            (f, -f, (w - 1.0 - h) / 2.0, (h - 1.0 + h) / 2.0)
        }
        Projection::Screen => (h / 2.0, -h / 2.0, (w - 1.0) / 2.0, (h - 1.0) / 2.0),
    };
    let (kind, k) = match *camera.projection() {
        Projection::Orthographic { .. } => (c::PROJECTION_ORTHOGRAPHIC, [0.0; 5]),
        Projection::Official { distortion, .. } => (c::PROJECTION_OFFICIAL, distortion),
        Projection::Screen => (c::PROJECTION_SCREEN, [0.0; 5]),
        _ => (c::PROJECTION_PERSPECTIVE, [0.0; 5]),
    };
    let mut texels = [[0.0; 4]; c::CAMERA_TEXELS as usize];
    for (i, row) in camera.view().iter().enumerate() {
        texels[2 * i] = row.map(|x| split(x).0);
        texels[2 * i + 1] = row.map(|x| split(x).1);
    }
    let [(sx, sx_low), (sy, sy_low), (ox, ox_low), (oy, oy_low)] = [sx, sy, ox, oy].map(split);
    texels[6] = [kind as f32, 0.0, sx, sx_low];
    texels[7] = [sy, sy_low, ox, ox_low];
    texels[8] = [oy, oy_low, 0.0, 0.0];
    texels[9] = [k[0] as f32, k[1] as f32, k[2] as f32, k[3] as f32];
    texels[10] = [k[4] as f32, 0.0, 0.0, 0.0];
    texels
}
