//! Scenes, cameras and lights as the tables that the kernels read.

mod update;

pub use update::Changes;

use crate::constants as c;
use crate::frame::plan::{Sampling, split};
use crate::scene::{Appearance, Camera, Lights, Mesh, Projection, Scene, Settings, Texture, Wrap};
use std::ops::Range;

/// The meshes of a scene, one after the other, as flat arrays.
#[derive(Debug, Default)]
pub struct MeshTables {
    /// x, y, z of every vertex.
    pub positions: Vec<f32>,
    /// Three vertex numbers (within the mesh) of every triangle.
    pub indices: Vec<u32>,
    /// Per mesh: vertices + 1 absolute offsets, then each vertex's corners in ascending order, each
    /// as four times its triangle plus its number there.
    pub adjacency: Vec<u32>,
    /// r, g, b: one colour for a mesh, or one a vertex.
    pub colors: Vec<f32>,
    /// u, v.
    pub uvs: Vec<f32>,
    /// Three UV numbers (within the mesh) of every triangle of a textured mesh.
    pub uv_indices: Vec<u32>,
    /// The entry of `textures` of every triangle of a mesh with several.
    pub triangle_textures: Vec<u32>,
    /// First texel, width, height, kind; of surface cells: first texel, resolution, number of texels, kind.
    pub textures: Vec<[u32; 4]>,
    /// r, g, b, 0.
    pub texels: Vec<[f32; 4]>,
    /// Where each mesh lies in these.
    pub layouts: Vec<MeshLayout>,
    /// What each mesh's gradients are by.
    pub appearances: Vec<Appearances>,
    /// Which kinds of texture there are.
    pub sampling: Sampling,
    /// The images laid out, by which unchanged ones are told without looking at their texels.
    images: Vec<Texture>,
}

/// What colours a mesh, as far as gradients need to know.
#[derive(Clone, Debug)]
pub enum Appearances {
    /// One colour.
    Uniform,
    /// One colour a vertex.
    Vertices,
    /// Surface cells.
    Surface {
        /// Their texels.
        texels: Range<usize>,
    },
    /// Images.
    Textured {
        /// The first's place in [`MeshTables::textures`].
        first: u32,
        /// Each image's texels.
        textures: Vec<Range<usize>>,
        /// UV pairs.
        uvs: usize,
        /// Each triangle's three, among [`MeshTables::uv_indices`].
        uv_triangles: Range<usize>,
    },
}

/// Where one mesh lies in [`MeshTables`].
#[derive(Clone, Copy, Debug, Default)]
pub struct MeshLayout {
    vertex_base: u32,
    color_base: u32,
    uniform_color: bool,
    uv_base: i32,
    uv_index_base: i32,
    texture_base: i32,
    /// Vertices of the mesh.
    pub vertices: u32,
    /// Triangles of the mesh.
    pub triangles: u32,
}

impl MeshLayout {
    /// Its vertices among all.
    pub fn vertex_range(&self) -> Range<usize> {
        self.vertex_base as usize..(self.vertex_base + self.vertices) as usize
    }
}

impl MeshTables {
    /// Lays out a scene's meshes; `adjacency` only where gradients or smooth shading need it.
    pub fn new(scene: &Scene, adjacency: bool) -> Self {
        let mut tables = Self::default();
        let plain = |a: &Appearance| matches!(a, Appearance::Uniform(_) | Appearance::VertexColors(_));
        if !scene.meshes.iter().all(|m| plain(m.appearance())) {
            // What a mesh without texture samples when another mesh of the frame has one.
            tables.textures.push([0, 1, 1, c::TEXTURE_CLAMP]);
            tables.texels.push([1.0; 4]);
            tables.sampling.image = scene.meshes.iter().any(|m| plain(m.appearance()));
        }
        for mesh in &scene.meshes {
            tables.push(mesh, adjacency);
        }
        tables
    }

    fn push(&mut self, mesh: &Mesh, adjacency: bool) {
        let mut layout = MeshLayout {
            vertex_base: self.positions.len() as u32 / 3,
            color_base: self.colors.len() as u32,
            uniform_color: true,
            uv_base: -1,
            uv_index_base: -1,
            texture_base: -1,
            vertices: mesh.positions().len() as u32,
            triangles: mesh.triangles().len() as u32,
        };
        self.positions.extend(mesh.positions().iter().flatten());
        self.indices.extend(mesh.triangles().iter().flatten());
        if adjacency {
            self.push_adjacency(mesh);
        }
        self.push_appearance(mesh, &mut layout);
        self.layouts.push(layout);
    }

    /// Compressed rows: counting sort of corners by vertex, so that each row ascends.
    fn push_adjacency(&mut self, mesh: &Mesh) {
        let vertices = mesh.positions().len();
        let start = self.adjacency.len() + vertices + 1;
        let mut ends = vec![0u32; vertices];
        for &v in mesh.triangles().iter().flatten() {
            ends[v as usize] += 1;
        }
        let mut next = start as u32;
        self.adjacency.push(next);
        for end in &mut ends {
            next += *end;
            self.adjacency.push(next);
            *end = next - *end;
        }
        self.adjacency.resize(next as usize, 0);
        for (t, triangle) in mesh.triangles().iter().enumerate() {
            for (corner, &v) in triangle.iter().enumerate() {
                let place = &mut ends[v as usize];
                self.adjacency[*place as usize] = 4 * t as u32 + corner as u32;
                *place += 1;
            }
        }
    }

    fn push_appearance(&mut self, mesh: &Mesh, layout: &mut MeshLayout) {
        match mesh.appearance() {
            Appearance::Uniform(color) => {
                self.colors.extend(color);
                self.appearances.push(Appearances::Uniform);
            }
            Appearance::VertexColors(colors) => {
                layout.uniform_color = false;
                self.colors.extend(colors.iter().flatten());
                self.appearances.push(Appearances::Vertices);
            }
            Appearance::Surface { resolution, texels } => {
                self.colors.extend([1.0; 3]);
                self.sampling.surface = true;
                layout.texture_base = -1 - self.textures.len() as i32;
                let count = texels.len() as u32;
                self.textures.push([self.texels.len() as u32, *resolution, count, c::TEXTURE_SURFACE]);
                let first = self.texels.len();
                self.texels.extend(texels.iter().map(|t| [t[0], t[1], t[2], 0.0]));
                self.appearances.push(Appearances::Surface { texels: first..self.texels.len() });
            }
            Appearance::Textured { uvs, uv_triangles, textures, texture_of_triangle } => {
                self.colors.extend([1.0; 3]);
                self.sampling.image = true;
                layout.uv_base = self.uvs.len() as i32;
                layout.uv_index_base = self.uv_indices.len() as i32;
                self.uvs.extend(uvs.iter().flatten());
                let first = self.uv_indices.len();
                self.uv_indices.extend(uv_triangles.iter().flatten());
                let uv_triangles = first..self.uv_indices.len();
                let first = self.textures.len() as u32;
                if texture_of_triangle.is_empty() {
                    layout.texture_base = -1 - first as i32;
                } else {
                    layout.texture_base = self.triangle_textures.len() as i32;
                    self.triangle_textures.extend(texture_of_triangle.iter().map(|t| first + t));
                }
                let ranges = textures.iter().map(|texture| self.push_texture(texture)).collect();
                self.appearances.push(Appearances::Textured { first, textures: ranges, uvs: uvs.len(), uv_triangles });
            }
        }
    }

    fn push_texture(&mut self, texture: &Texture) -> Range<usize> {
        let first = self.texels.len();
        self.textures.push([self.texels.len() as u32, texture.width(), texture.height(), kind_of(texture)]);
        self.texels.extend(texture.texels().iter().map(|t| [t[0], t[1], t[2], 0.0]));
        self.images.push(texture.clone());
        first..self.texels.len()
    }
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
