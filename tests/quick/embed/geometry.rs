//! A host's own geometry: interleaved vertices, short and long indices, instances with transforms. Images and gradients
//! are the simple API's, bit by bit.
// Indices are what the formulas have, and what is no number counts as off.
#![allow(clippy::needless_range_loop, clippy::neg_cmp_op_on_partial_ord)]

use crate::common::gradient::{random_upstream, same_gradient_bits};
use crate::common::renderer;
use crate::common::scenes::{Case, Kind, random_case};
use crate::host::engine::{Buffer, Engine};
use crate::host::{Backward, Host, assert_silent, difference, engine, error, images, rasterizer, submit};
use ash::vk;
use gpu_allocator::MemoryLocation;
use softras::MeshGradients;
use softras::embed::{
    BufferId, BufferRef, Draw, Geometry, GeometryBuffers, GeometryGradients, IndexFormat, Layout, Rasterizer,
};
use softras::scene::Appearance;
use softras::{Camera, GradientRequest, Lights, Mesh, Projection, Scene, shapes};

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

    /// What the draws draw, as one mesh.
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
fn buffer_of(engine: &Engine, bytes: &[u8], usage: vk::BufferUsageFlags) -> Buffer {
    let size = bytes.len().next_multiple_of(4) as u64;
    let mut buffer = engine.buffer(size, usage, MemoryLocation::CpuToGpu).unwrap();
    buffer.write(0, bytes);
    buffer
}

pub fn storage(engine: &Engine, bytes: &[u8]) -> Buffer {
    buffer_of(engine, bytes, vk::BufferUsageFlags::STORAGE_BUFFER)
}

/// Gradients by vertices and transforms as they should come back, in f64, with the sums of their terms' sizes.
struct Expected {
    positions: Vec<[(f64, f64); 3]>,
    colors: Vec<[(f64, f64); 3]>,
    transforms: Vec<[[(f64, f64); 4]; 3]>,
}

fn add((sum, size): &mut (f64, f64), term: f64) {
    *sum += term;
    *size += term.abs();
}

impl Expected {
    fn new(engines: &Engines, placed: &MeshGradients) -> Self {
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
fn off(values: &[f32], expected: &[(f64, f64)]) -> Option<usize> {
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

/// The frame's arrays, as if nobody had filled them.
fn forget(host: &mut Host, ids: &[BufferId]) {
    for &id in ids {
        let (offset, range) = host.arena.part(id).unwrap();
        host.buffer.bytes_mut()[offset as usize..][..range as usize].fill(0);
    }
}

#[test]
fn a_hosts_instances_are_rendered_and_differentiated_where_they_lie() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let engines = Engines::new();
    let case = engines.case();
    let mut simple = renderer();
    let frame = simple.render(&case.scene, &case.cameras, &case.settings).unwrap();
    let wanted = GradientRequest { colors: true, ..GradientRequest::default() };
    let upstream = random_upstream(&case, case.settings.outputs);
    let expected = simple.backward(&frame, &upstream, &wanted).unwrap();

    let vertices = storage(&engine, bytemuck::cast_slice(&engines.vertices()));
    let long = engines.indices();
    let short: Vec<u16> = long.iter().map(|&i| i as u16).collect();
    let transforms: Vec<[f32; 16]> = engines
        .transforms
        .iter()
        .map(|t| std::array::from_fn(|i| if (1..13).contains(&i) { t[(i - 1) / 4][(i - 1) % 4] } else { 7.0 }))
        .collect();
    let transforms = storage(&engine, bytemuck::cast_slice(&transforms));
    let geometry = Geometry::new(engines.draws.clone()).unwrap();
    let table = geometry.table();
    let draws = buffer_of(&engine, bytemuck::cast_slice(&table), vk::BufferUsageFlags::UNIFORM_TEXEL_BUFFER);
    let formats = [
        (IndexFormat::Uint16, storage(&engine, bytemuck::cast_slice(&short))),
        (IndexFormat::Uint32, storage(&engine, bytemuck::cast_slice(&long))),
    ];
    for (format, indices) in &formats {
        let mut host = Host::new(&engine, &rasterizer, &case);
        let adjacency = host.floats(BufferId::Adjacency).iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert_eq!(geometry.adjacency(0, |i| long[i]), adjacency[..], "the device's indices have another adjacency");
        forget(&mut host, &[BufferId::Positions, BufferId::Colors, BufferId::Indices]);
        let buffers = GeometryBuffers {
            draws: draws.whole(),
            positions: (vertices.whole(), POSITION),
            colors: Some((vertices.whole(), COLOR)),
            indices: Some((indices.whole(), *format)),
            transforms: Some((transforms.whole(), TRANSFORM)),
        };
        let bound = rasterizer.bind_geometry(&geometry, &buffers, &host.bindings).unwrap();
        let backward = Backward::new(&engine, &rasterizer, &host, &upstream, wanted);
        let back = [
            storage(&engine, &vec![0xcd; VERTEX as usize * engines.vertices().len()]),
            storage(&engine, &vec![0xcd; 64 * 5]),
        ];
        let targets = GeometryGradients {
            positions: Some((back[0].whole(), POSITION)),
            colors: Some((back[0].whole(), COLOR)),
            transforms: Some((back[1].whole(), TRANSFORM)),
        };
        let gradients = rasterizer.bind_geometry_gradients(&bound, &targets, &backward.bindings).unwrap();
        submit(&engine, |commands| {
            rasterizer.record_indices(commands, &bound).unwrap();
            rasterizer.record_vertices(commands, &bound).unwrap();
            rasterizer.record_forward(commands, &host.plan, &host.bindings).unwrap();
            backward.record(&rasterizer, commands);
            rasterizer.record_geometry_gradients(commands, &gradients).unwrap();
        });
        assert_eq!(host.status().validate(&host.plan).unwrap(), None);
        let made = images(&case, &host);
        assert_eq!(difference(&made[0].1, &frame.color().unwrap().data), None, "{format:?}");
        assert_eq!(difference(&made[1].1, &frame.silhouette().unwrap().data), None, "{format:?}");
        let placed = &expected.meshes[0];
        let decoded = backward.decode(&host, &case, &case.scene);
        assert_eq!(same_gradient_bits(&expected, &decoded), Ok(()), "{format:?}");

        let due = Expected::new(&engines, placed);
        let words = back[0].floats(0, 10 * engines.vertices().len());
        let part = |first: usize| words.chunks_exact(10).flat_map(|v| v[first..first + 3].to_vec()).collect::<Vec<_>>();
        // The three vertices that no draw reads, and what is no gradient, are left alone.
        let untouched = f32::from_bits(0xcdcd_cdcd);
        assert!(part(3)[..9].iter().chain(&part(0)).all(|&x| x == untouched));
        assert_eq!(off(&part(3)[9..], &due.positions.as_flattened()[9..]), None, "{format:?}");
        assert_eq!(off(&part(6)[9..], &due.colors.as_flattened()[9..]), None, "{format:?}");
        let words = back[1].floats(0, 16 * 5);
        let rows: Vec<f32> = words.chunks_exact(16).flat_map(|t| t[1..13].to_vec()).collect();
        assert!(words.iter().step_by(16).all(|&x| x == untouched));
        assert_eq!(off(&rows, due.transforms.as_flattened().as_flattened()), None, "{format:?}");
        assert!(rows.iter().any(|x| x.abs() > 1e-6) && part(6)[9..].iter().any(|x| x.abs() > 1e-6));
    }
    misfits(&engine, &rasterizer, &engines, &case, [&vertices, &formats[0].1, &transforms, &draws]);
    drop((vertices, formats, transforms, draws, rasterizer));
    assert_silent(engine);
}

/// What does not fit is named.
fn misfits(engine: &Engine, rasterizer: &Rasterizer, engines: &Engines, case: &Case, buffers: [&Buffer; 4]) {
    let host = Host::new(engine, rasterizer, case);
    let [vertices, indices, transforms, draws] = buffers.map(Buffer::whole);
    let good = GeometryBuffers {
        draws,
        positions: (vertices, POSITION),
        colors: None,
        indices: Some((indices, IndexFormat::Uint16)),
        transforms: Some((transforms, TRANSFORM)),
    };
    let geometry = Geometry::new(engines.draws.clone()).unwrap();
    let bind = |change: &dyn Fn(&mut GeometryBuffers, &mut Geometry)| {
        let (mut buffers, mut geometry) = (good, geometry.clone());
        change(&mut buffers, &mut geometry);
        error(rasterizer.bind_geometry(&geometry, &buffers, &host.bindings))
    };
    assert_eq!(bind(&|_, _| {}), "no error");
    let short = |at: BufferRef| at.part(0, at.range() - 4).unwrap();
    assert!(bind(&|b, _| b.positions.0 = short(vertices).part(0, 40 * 90).unwrap()).contains("positions"));
    assert!(bind(&|b, _| b.positions.1.stride = 42).contains("multiples of four"));
    assert!(bind(&|b, _| b.positions.1.stride = 8).contains("multiples of four"));
    assert!(bind(&|b, _| b.indices = Some((short(indices), IndexFormat::Uint16))).contains("indices"));
    assert!(bind(&|b, _| b.indices = Some((indices, IndexFormat::Uint32))).contains("indices"));
    assert!(bind(&|b, _| b.transforms = Some((transforms.part(0, 256).unwrap(), TRANSFORM))).contains("transforms"));
    assert!(bind(&|b, _| b.draws = short(draws)).contains("draws"));
    assert!(bind(&|b, _| b.draws = vertices).contains("UNIFORM_TEXEL_BUFFER"));
    assert!(bind(&|_, g| g.first_vertex = 1).contains("`positions`"));
    assert!(bind(&|_, g| g.first_triangle = 1).contains("`indices`"));
    // A table need not end the buffer, and of no draws there is none.
    let of_draws = |count: usize, bytes| {
        bind(&|b, g| {
            *g = Geometry::new(g.draws()[..count].to_vec()).unwrap();
            b.draws = draws.part(0, bytes).unwrap();
        })
    };
    assert_eq!((of_draws(1, 36), of_draws(0, 0)), ("no error".into(), "no error".into()));
    assert!(of_draws(2, 36).contains("draws"));
    let null = unsafe { BufferRef::new(vk::Buffer::null(), vertices.range(), vertices.usage()) };
    assert!(bind(&|b, _| b.positions.0 = null).contains("is null"));

    // Gradients that the pass does not compute, or of other geometry than the frame's.
    let bound = rasterizer.bind_geometry(&geometry, &good, &host.bindings).unwrap();
    let upstream = random_upstream(case, case.settings.outputs);
    let none = GeometryGradients::default();
    let bind = |wanted, gradients, case| {
        let host = Host::new(engine, rasterizer, case);
        let backward = Backward::new(engine, rasterizer, &host, &upstream, wanted);
        error(rasterizer.bind_geometry_gradients(&bound, &gradients, &backward.bindings))
    };
    let positions = GeometryGradients { positions: Some((vertices, POSITION)), ..none };
    let transforms = GeometryGradients { transforms: Some((transforms, TRANSFORM)), ..none };
    let colors = GeometryGradients { colors: Some((vertices, COLOR)), ..none };
    let by_color = GradientRequest { colors: true, ..GradientRequest::NOTHING };
    assert_eq!(bind(GradientRequest::default(), positions, case), "no error");
    assert_eq!(bind(GradientRequest { camera: true, ..GradientRequest::NOTHING }, none, case), "no error");
    assert!(bind(GradientRequest::default(), colors, case).contains("GradientRequest::colors"));
    assert!(bind(by_color, positions, case).contains("GradientRequest::positions"));
    assert!(bind(by_color, transforms, case).contains("GradientRequest::positions"));
    let smaller = Case { scene: Scene::new(shapes::cube().unwrap()), ..case.clone() };
    assert!(bind(GradientRequest::default(), positions, &smaller).contains("`vertex_gradients`"));
}
