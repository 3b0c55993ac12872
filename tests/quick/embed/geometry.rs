//! A host's own geometry: interleaved vertices, instances with transforms, and the gradients that should come back.
// Loops use indices as the formulas do, and comparisons count NaN as a failure.
#![allow(clippy::needless_range_loop, clippy::neg_cmp_op_on_partial_ord)]

use crate::common::scenes::{Case, Kind, random_case};
use crate::host::engine::{Buffer, Engine};
use ash::vk;
use gpu_allocator::MemoryLocation;
use softras::MeshGradients;
use softras::embed::{Draw, Layout};
use softras::scene::Appearance;
use softras::{Camera, Lights, Mesh, Projection, Scene, shapes};

pub type Transform = [[f32; 4]; 3];

/// Vertices as an engine has them: a normal, a position, a colour, one word more.
pub const VERTEX: u32 = 40;
pub const POSITION: Layout = Layout { stride: VERTEX, offset: 12 };
pub const COLOR: Layout = Layout { stride: VERTEX, offset: 24 };
/// Transforms lie in records of 64 bytes, behind a word.
pub const TRANSFORM: Layout = Layout { stride: 64, offset: 4 };

/// Two meshes in one vertex and one index buffer, drawn three times and twice.
pub struct Engines {
    pub meshes: [Mesh; 2],
    pub draws: Vec<Draw>,
    pub transforms: Vec<Transform>,
}

/// Turned by a quarter, halved or doubled, and moved: each placed coordinate is one product, exact, and one sum, so that
/// it does not matter in which order it is computed.
fn transform(i: usize) -> Transform {
    let scale = [0.5, 0.25, -0.5, 0.5, 0.25][i];
    let axes = [[0, 1, 2], [1, 2, 0], [0, 2, 1], [2, 0, 1], [1, 0, 2]][i];
    let moved = [[0.1, -0.3, 0.2], [-0.7, 0.4, 0.0], [0.6, 0.6, -0.3], [-0.5, -0.6, 0.1], [0.7, -0.5, 0.3]][i];
    std::array::from_fn(|row| {
        let mut r = [0.0, 0.0, 0.0, moved[row]];
        r[axes[row]] = scale;
        r
    })
}

impl Engines {
    pub fn new() -> Self {
        let meshes = [shapes::torus(0.6, 0.3, 12, 7).unwrap(), shapes::cube().unwrap()];
        let [torus, cube] = meshes.each_ref().map(|m| (m.positions().len() as u32, m.triangles().len() as u32));
        // Three vertices and five indices that nobody draws come first, a draw of nothing between the two.
        let draw = |first_vertex, vertices, first_index, triangles, instances| Draw {
            first_vertex,
            vertices,
            first_index,
            triangles,
            instances,
        };
        let draws = vec![
            draw(3, torus.0, 5, torus.1, 3),
            draw(3, torus.0, 5, torus.1, 0),
            draw(3 + torus.0, cube.0, 5 + 3 * torus.1, cube.1, 2),
        ];
        Self { meshes, draws, transforms: (0..5).map(transform).collect() }
    }

    fn color(vertex: usize) -> [f32; 3] {
        [0, 1, 2].map(|c| (vertex * (c + 3) % 11) as f32 / 11.0)
    }

    /// The vertex buffer.
    pub fn vertices(&self) -> Vec<[f32; 10]> {
        let unused = [[9.0; 10]; 3];
        let positions = self.meshes.iter().flat_map(Mesh::positions);
        let vertex = |(i, p): (usize, &[f32; 3])| {
            let c = Self::color(i + 3);
            [9.0, 9.0, 9.0, p[0], p[1], p[2], c[0], c[1], c[2], 9.0]
        };
        unused.into_iter().chain(positions.enumerate().map(vertex)).collect()
    }

    pub fn indices(&self) -> Vec<u32> {
        let drawn = self.meshes.iter().flat_map(|m| m.triangles().iter().flatten().copied());
        [0; 5].into_iter().chain(drawn).collect()
    }

    /// The mesh that the draws make together, as a scene.
    fn scene(&self) -> Scene {
        let (mut positions, mut triangles, mut colors) = (Vec::new(), Vec::<[u32; 3]>::new(), Vec::new());
        for (i, &[x, y, z]) in self.transforms.iter().enumerate() {
            let mesh = &self.meshes[usize::from(i >= 3)];
            let (base, first) = (positions.len() as u32, if i < 3 { 3 } else { 3 + self.meshes[0].positions().len() });
            let at = |r: [f32; 4], p: &[f32; 3]| r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + r[3];
            positions.extend(mesh.positions().iter().map(|p| [at(x, p), at(y, p), at(z, p)]));
            colors.extend((0..mesh.positions().len()).map(|v| Self::color(first + v)));
            triangles.extend(mesh.triangles().iter().map(|t| t.map(|v| base + v)));
        }
        let mesh = Mesh::new(positions, triangles).unwrap().with_appearance(Appearance::VertexColors(colors)).unwrap();
        Scene::new(mesh).with_lights(Lights::official())
    }

    pub fn case(&self) -> Case {
        let mut case = random_case(2, Kind::Plain);
        case.scene = self.scene();
        let camera = |angle| Camera::from_angles(4.0, 20.0, angle, Projection::Perspective { fov_y: 0.8 }).unwrap();
        case.cameras = vec![camera(10.0), camera(100.0)];
        case.settings = softras::Settings { width: 40, height: 32, sigma: 1e-3, save: true, ..Default::default() };
        case
    }
}

/// A buffer of a host's, which its kernels also write.
pub fn storage(engine: &Engine, bytes: &[u8]) -> Buffer {
    let (size, usage) = (bytes.len().next_multiple_of(4) as u64, vk::BufferUsageFlags::STORAGE_BUFFER);
    let mut buffer = engine.buffer(size, usage, MemoryLocation::CpuToGpu).unwrap();
    buffer.write(0, bytes);
    buffer
}

/// Gradients by vertices and transforms as they should come back, in f64, with the sums of their terms' sizes.
pub struct Expected {
    pub positions: Vec<[(f64, f64); 3]>,
    pub colors: Vec<[(f64, f64); 3]>,
    pub transforms: Vec<[[(f64, f64); 4]; 3]>,
}

fn add((sum, size): &mut (f64, f64), term: f64) {
    *sum += term;
    *size += term.abs();
}

impl Expected {
    pub fn new(engines: &Engines, placed: &MeshGradients) -> Self {
        let vertices = engines.vertices();
        let mut made = Self {
            positions: vec![Default::default(); vertices.len()],
            colors: vec![Default::default(); vertices.len()],
            transforms: vec![Default::default(); 5],
        };
        let mut at = 0;
        for (i, transform) in engines.transforms.iter().enumerate() {
            let draw = engines.draws[if i < 3 { 0 } else { 2 }];
            for v in draw.first_vertex as usize..(draw.first_vertex + draw.vertices) as usize {
                let g = placed.positions[at].map(f64::from);
                let p = [vertices[v][3], vertices[v][4], vertices[v][5], 1.0].map(f64::from);
                for row in 0..3 {
                    for k in 0..4 {
                        add(&mut made.transforms[i][row][k], g[row] * p[k]);
                    }
                    for k in 0..3 {
                        add(&mut made.positions[v][k], g[row] * f64::from(transform[row][k]));
                    }
                    add(&mut made.colors[v][row], f64::from(placed.colors[at][row]));
                }
                at += 1;
            }
        }
        made
    }
}

/// The first value that is not within rounding of a sum of terms of that size.
pub fn off(values: &[f32], expected: &[(f64, f64)]) -> Option<usize> {
    assert_eq!(values.len(), expected.len());
    let mut pairs = values.iter().zip(expected);
    pairs.position(|(&value, &(sum, size))| !((f64::from(value) - sum).abs() <= 1e-6 * size))
}

#[test]
fn a_value_that_is_off_is_noticed() {
    let expected = [(1.0, 3.0), (0.0, 0.0)];
    assert_eq!(off(&[1.0, 0.0], &expected), None);
    assert_eq!(off(&[1.000_01, 0.0], &expected), Some(0));
    assert_eq!(off(&[1.0, 1e-20], &expected), Some(1));
    assert_eq!(off(&[1.0, f32::NAN], &expected), Some(1));
}
