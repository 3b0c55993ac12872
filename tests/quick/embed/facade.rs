//! The facade: from a host's meshes, matrices and buffers to images and gradients. Where the simple API renders the same,
//! the bits are the same.
// Loops use indices as the formulas do, and comparisons count NaN as a failure.
#![allow(clippy::needless_range_loop, clippy::neg_cmp_op_on_partial_ord)]

use super::geometry::{COLOR, Engines, Expected, POSITION, TRANSFORM, VERTEX, off, storage};
use crate::common::gradient::random_upstream;
use crate::common::renderer;
use crate::common::scenes::Case;
use crate::host::engine::{Buffer, Engine};
pub use crate::host::{Memory, bind, run};
use crate::host::{assert_silent, difference, engine, error, rasterizer, upstream_bytes};
use ash::vk;
use gpu_allocator::MemoryLocation;
use softras::embed::{
    Capacity, Draw, GeometryGradients, IndexFormat, Layout, MeshBuffers, MeshLook, Pass, PassBuffer, PassMemory,
    PassMesh, PassStatus, Rasterizer, TexelSource,
};
use softras::scene::{Appearance, Wrap};
use softras::{Camera, Error, Frame, GradientRequest, Lights, Mesh, Projection, Scene, Settings};

/// Two triangles, and the texels of their texture across and down.
pub const QUAD: [u16; 6] = [0, 1, 2, 0, 2, 3];
pub const SIZE: (u32, u32) = (4, 2);

/// A host's two meshes of one vertex and one index buffer, three and two instances of them.
pub struct Scenery {
    pub engines: Engines,
    pub vertices: Buffer,
    pub indices: Buffer,
    pub transforms: Buffer,
    pub gradients: Buffer,
    pub transform_gradients: Buffer,
}

impl Scenery {
    pub fn new(engine: &Engine) -> Self {
        let engines = Engines::new();
        let rows = |t: &[[f32; 4]; 3]| -> [f32; 16] {
            std::array::from_fn(|i| if (1..13).contains(&i) { t[(i - 1) / 4][(i - 1) % 4] } else { 7.0 })
        };
        let transforms: Vec<_> = engines.transforms.iter().map(rows).collect();
        let short: Vec<u16> = engines.indices().iter().map(|&i| i as u16).collect();
        Self {
            vertices: storage(engine, bytemuck::cast_slice(&engines.vertices())),
            indices: storage(engine, bytemuck::cast_slice(&short)),
            transforms: storage(engine, bytemuck::cast_slice(&transforms)),
            gradients: storage(engine, &vec![0xcd; VERTEX as usize * engines.vertices().len()]),
            transform_gradients: storage(engine, &[0xcd; 64 * 5]),
            engines,
        }
    }

    pub fn meshes(&self) -> Vec<PassMesh> {
        let mesh =
            |draws: Vec<Draw>| PassMesh::of_draws(draws, &self.engines.indices()).with_look(MeshLook::VertexColors);
        vec![mesh(self.engines.draws[..2].to_vec()), mesh(self.engines.draws[2..].to_vec())]
    }

    pub fn buffers(&self, on_device: bool) -> Vec<MeshBuffers> {
        let mesh = |first: u64, count: u64| {
            let part = |buffer: &Buffer| buffer.whole().part(64 * first, 64 * count).unwrap();
            let gradients = GeometryGradients {
                positions: Some((self.gradients.whole(), POSITION)),
                colors: Some((self.gradients.whole(), COLOR)),
                transforms: Some((part(&self.transform_gradients), TRANSFORM)),
            };
            MeshBuffers {
                colors: Some((self.vertices.whole(), COLOR)),
                transforms: Some((part(&self.transforms), TRANSFORM)),
                indices: on_device.then(|| (self.indices.whole(), IndexFormat::Uint16)),
                gradients,
                ..MeshBuffers::new(self.vertices.whole(), POSITION)
            }
        };
        vec![mesh(0, 3), mesh(3, 2)]
    }
}

/// The images of a frame whose colour and silhouette were asked for.
pub fn assert_images(memory: &Memory, pass: &Pass, frame: &Frame, what: &str) {
    let texels = memory.floats(pass, PassBuffer::Color);
    let rgb: Vec<f32> = texels.chunks_exact(4).flat_map(|t| [t[0], t[1], t[2]]).collect();
    let alpha: Vec<f32> = texels.chunks_exact(4).map(|t| t[3]).collect();
    assert_eq!(difference(&rgb, &frame.color().unwrap().data), None, "{what}");
    assert_eq!(difference(&alpha, &frame.silhouette().unwrap().data), None, "{what}");
}

/// dL by positions and by colours of all placed vertices.
pub fn vertex_gradients(memory: &Memory, pass: &Pass) -> [Vec<f32>; 2] {
    let rows = memory.floats(pass, PassBuffer::VertexGradients);
    [0, 4].map(|at| rows.chunks_exact(8).flat_map(|row| row[at..at + 3].to_vec()).collect())
}

#[test]
fn several_meshes_of_a_host_render_as_one_scene() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let scenery = Scenery::new(&engine);
    let case = scenery.engines.case();
    let mut simple = renderer();
    let frame = simple.render(&case.scene, &case.cameras, &case.settings).unwrap();
    let wanted = GradientRequest { colors: true, camera: true, lights: true, ..GradientRequest::default() };
    let upstream = random_upstream(&case, case.settings.outputs);
    let expected = simple.backward(&frame, &upstream, &wanted).unwrap();

    for (on_device, alignment) in [(false, 1), (true, 256)] {
        let plan = rasterizer
            .pass(&scenery.meshes())
            .settings(case.settings.clone())
            .cameras(&case.cameras)
            .lights(Lights::official())
            .gradients(wanted)
            .inside_planes()
            .alignment(alignment)
            .read_back(&[PassBuffer::Color, PassBuffer::VertexGradients])
            .build()
            .unwrap();
        let mut memory = Memory::new(&engine, &plan);
        let pass = bind(&rasterizer, &plan, &mut memory, &scenery.buffers(on_device));
        memory.write_upstream(&pass, &upstream);
        run(&engine, &pass);
        assert_eq!(pass.status(memory.readback.bytes()).unwrap(), PassStatus::Whole);
        assert_eq!(memory.whole_word(&pass), 1);
        assert_images(&memory, &pass, &frame, "facade");
        let [positions, colors] = vertex_gradients(&memory, &pass);
        let mesh = &expected.meshes[0];
        assert_eq!(difference(&positions, mesh.positions.as_flattened()), None);
        assert_eq!(difference(&colors, mesh.colors.as_flattened()), None);
        // The host's vertices get sums over three or two instances. Vertices that no draw reads, and other words, stay.
        let due = Expected::new(&scenery.engines, mesh);
        let words = scenery.gradients.floats(0, 10 * scenery.engines.vertices().len());
        let part = |first: usize| words.chunks_exact(10).flat_map(|v| v[first..first + 3].to_vec()).collect::<Vec<_>>();
        let untouched = f32::from_bits(0xcdcd_cdcd);
        assert!(part(3)[..9].iter().chain(&part(0)).all(|&x| x == untouched));
        assert_eq!(off(&part(3)[9..], &due.positions.as_flattened()[9..]), None);
        assert_eq!(off(&part(6)[9..], &due.colors.as_flattened()[9..]), None);
        let words = scenery.transform_gradients.floats(0, 16 * 5);
        let rows: Vec<f32> = words.chunks_exact(16).flat_map(|t| t[1..13].to_vec()).collect();
        assert!(words.iter().step_by(16).all(|&x| x == untouched));
        assert_eq!(off(&rows, due.transforms.as_flattened().as_flattened()), None);
        assert!(rows.iter().any(|x| x.abs() > 1e-6) && part(6)[9..].iter().any(|x| x.abs() > 1e-6));
        // The uses for a render graph: vertices are only read; only the backward pass writes gradients.
        let uses = pass.uses();
        let writes = [&scenery.vertices, &scenery.gradients].map(|buffer| {
            uses.each_ref().map(|uses| {
                let of_it = uses.iter().filter(|(at, ..)| at.raw() == buffer.raw);
                of_it.map(|(.., access)| access.contains(vk::AccessFlags::SHADER_WRITE)).max()
            })
        });
        assert_eq!(writes, [[None, Some(false), Some(false)], [None, None, Some(true)]]);
        // The readback buffer has the same values as the device's.
        for id in [PassBuffer::Color, PassBuffer::VertexGradients] {
            let (at, size) = plan.readback_part(id).unwrap();
            let read = memory.readback.floats(at, size as usize / 4);
            assert_eq!(difference(&read, &memory.floats(&pass, id)[..read.len()]), None, "{id:?}");
        }
        let aligned = |id| pass.buffer(id).unwrap().offset().is_multiple_of(alignment);
        assert!(PassBuffer::ALL.iter().copied().filter(|&id| pass.buffer(id).is_some()).all(aligned));
    }
    drop((scenery, rasterizer));
    assert_silent(engine);
}

#[test]
fn each_view_may_have_a_mesh_and_the_host_buffers_of_its_own() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let engines = Engines::new();
    let case = engines.case();
    let [torus, cube] = &engines.meshes;
    let plain = |mesh: &Mesh, look| {
        Mesh::new(mesh.positions().to_vec(), mesh.triangles().to_vec()).unwrap().with_appearance(look).unwrap()
    };
    let colors: Vec<[f32; 3]> = (0..torus.positions().len()).map(|v| [v as f32 / 100.0, 0.5, 0.25]).collect();
    let red = [0.75, 0.25, 0.5];
    let scene = Scene::batch(vec![
        plain(cube, Appearance::Uniform(red)),
        plain(torus, Appearance::VertexColors(colors.clone())),
    ]);
    let scene = scene.with_lights(Lights::official());
    let mut simple = renderer();
    let frame = simple.render(&scene, &case.cameras, &case.settings).unwrap();
    let batch = Case { scene, ..case.clone() };
    let upstream = random_upstream(&batch, case.settings.outputs);
    let wanted = GradientRequest { colors: true, ..GradientRequest::default() };
    let expected = simple.backward(&frame, &upstream, &wanted).unwrap();

    let indices = |mesh: &Mesh| mesh.triangles().as_flattened().to_vec();
    let plan = rasterizer
        .pass(&[
            PassMesh::new(cube.positions().len() as u32, &indices(cube)).with_look(MeshLook::Color(red)),
            PassMesh::new(torus.positions().len() as u32, &indices(torus)).with_look(MeshLook::VertexColors),
        ])
        .one_mesh_a_view()
        .settings(case.settings.clone())
        .cameras(&case.cameras)
        .lights(Lights::official())
        .gradients(wanted)
        .inside_planes()
        .own_buffers(&[PassBuffer::UpstreamColor, PassBuffer::Color])
        .build()
        .unwrap();
    let own: Vec<(PassBuffer, Buffer)> = plan
        .own_buffers()
        .iter()
        .map(|(id, r)| (*id, engine.buffer(r.size, r.usage, MemoryLocation::GpuToCpu).unwrap()))
        .collect();
    let own_refs: Vec<_> = own.iter().map(|(id, buffer)| (*id, buffer.whole())).collect();
    let packed = Layout { stride: 12, offset: 0 };
    let [cube_vertices, torus_vertices] =
        [cube, torus].map(|mesh| storage(&engine, bytemuck::cast_slice(mesh.positions())));
    let torus_colors = storage(&engine, bytemuck::cast_slice(&colors));
    let buffers = [
        MeshBuffers::new(cube_vertices.whole(), packed),
        MeshBuffers {
            colors: Some((torus_colors.whole(), packed)),
            ..MeshBuffers::new(torus_vertices.whole(), packed)
        },
    ];
    let mut memory = Memory::new(&engine, &plan);
    let refs = PassMemory { own: &own_refs, ..memory.refs() };
    let pass = rasterizer.bind_pass(plan.clone(), refs, &buffers).unwrap();
    pass.write_inputs(memory.upload.bytes_mut()).unwrap();
    let mut own = own;
    for (id, values) in upstream_bytes(&upstream) {
        let (_, buffer) = own.iter_mut().find(|(own, _)| *own == id).unwrap();
        buffer.write(0, bytemuck::cast_slice(&values));
    }
    run(&engine, &pass);
    assert_eq!(pass.status(memory.readback.bytes()).unwrap(), PassStatus::Whole);
    let (_, color) = own.iter().find(|(id, _)| *id == PassBuffer::Color).unwrap();
    let texels = color.floats(0, 4 * frame.silhouette().unwrap().data.len());
    let rgb: Vec<f32> = texels.chunks_exact(4).flat_map(|t| [t[0], t[1], t[2]]).collect();
    assert_eq!(difference(&rgb, &frame.color().unwrap().data), None);
    let [positions, by_color] = vertex_gradients(&memory, &pass);
    let due: Vec<f32> = expected.meshes.iter().flat_map(|mesh| mesh.positions.as_flattened().to_vec()).collect();
    assert_eq!(difference(&positions, &due), None);
    let first = 3 * cube.positions().len();
    assert_eq!(difference(&by_color[first..], expected.meshes[1].colors.as_flattened()), None);
    let missing = rasterizer.bind_pass(plan, memory.refs(), &buffers);
    assert!(error(missing).contains("there is no buffer"));
    drop((pass, memory, own, cube_vertices, torus_vertices, torus_colors, rasterizer));
    assert_silent(engine);
}

/// An error names a buffer that does not fit.
#[test]
fn misfits_of_a_pass_are_named() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let case: Case = Engines::new().case();
    let vertices = storage(&engine, &[0; 4 * 20]);
    let at = Layout { stride: 20, offset: 0 };
    let plain = MeshBuffers::new(vertices.whole(), at);
    let mesh = PassMesh::new(4, &QUAD);
    let builder = |mesh: &PassMesh| {
        rasterizer.pass(std::slice::from_ref(mesh)).settings(case.settings.clone()).cameras(&case.cameras)
    };
    let build = |mesh: &PassMesh| error(builder(mesh).build());
    assert_eq!(build(&mesh), "no error");
    assert!(build(&PassMesh::new(3, &QUAD)).contains("vertex 3, of 3"));
    assert!(error(rasterizer.pass(std::slice::from_ref(&mesh)).build()).contains("0 views"));
    assert!(error(builder(&mesh).alignment(24).build()).contains("power of two"));
    assert_eq!(error(builder(&mesh).capacity(Capacity { coarse: 0, list: 0, cells: 0 }).build()), "no error");
    let huge = builder(&mesh).image_size(16384, 16384).build();
    assert!(huge.is_ok() || matches!(huge, Err(Error::Limit { .. })), "{}", error(huge));
    assert!(error(builder(&mesh).image_size(16385, 1).build()).contains("16384"));
    assert!(error(builder(&mesh).read_back(&[PassBuffer::Totals]).build()).contains("`totals`"));
    let textured = mesh.clone().with_look(MeshLook::Texture { size: SIZE, wrap: Wrap::Clamp, v_down: false });
    let colored = mesh.clone().with_look(MeshLook::VertexColors);
    let both = rasterizer.pass(&[textured.clone(), colored.clone()]).cameras(&case.cameras).build();
    assert!(error(both).contains("vertex colours beside"));

    let bind = |mesh: &PassMesh, change: &dyn Fn(&mut MeshBuffers)| {
        let plan = builder(mesh).build().unwrap();
        let memory = Memory::new(&engine, &plan);
        let mut buffers = plain;
        change(&mut buffers);
        error(rasterizer.bind_pass(plan, memory.refs(), &[buffers]))
    };
    assert_eq!(bind(&mesh, &|_| {}), "no error");
    assert!(bind(&colored, &|_| {}).contains("MeshBuffers::colors"));
    assert!(bind(&textured, &|_| {}).contains("MeshBuffers::uvs"));
    assert!(bind(&mesh.clone().with_instances(2), &|_| {}).contains("MeshBuffers::transforms"));
    assert!(bind(&mesh, &|b| b.positions.0 = vertices.whole().part(0, 40).unwrap()).contains("positions"));
    assert!(bind(&mesh, &|b| b.positions.1.stride = 22).contains("multiples of four"));
    assert!(bind(&mesh, &|b| b.positions.1.stride = 8).contains("multiples of four"));
    let indices = |bytes, format| Some((vertices.whole().part(0, bytes).unwrap(), format));
    assert_eq!(bind(&mesh, &|b| b.indices = indices(12, IndexFormat::Uint16)), "no error");
    assert!(bind(&mesh, &|b| b.indices = indices(8, IndexFormat::Uint16)).contains("indices"));
    assert!(bind(&mesh, &|b| b.indices = indices(20, IndexFormat::Uint32)).contains("indices"));
    let rows = Layout { stride: 48, offset: 0 };
    let transforms = |bytes| Some((vertices.whole().part(0, bytes).unwrap(), rows));
    assert!(bind(&mesh, &|b| b.transforms = transforms(44)).contains("transforms"));
    let short = |b: &mut MeshBuffers| {
        b.uvs = Some((vertices.whole(), Layout { stride: 20, offset: 12 }));
        b.texels = Some(TexelSource::Bytes { at: vertices.whole().part(0, 16).unwrap(), srgb: false });
    };
    assert!(bind(&textured, &short).contains("texels"));
    let gradients = GeometryGradients { positions: Some((vertices.whole(), at)), ..GeometryGradients::default() };
    assert!(bind(&mesh, &|b| b.gradients = gradients).contains("PassBuilder::gradients"));
    misfit_gradients(&engine, &rasterizer, &case);
    assert!(
        error(rasterizer.bind_pass(
            builder(&mesh).build().unwrap(),
            Memory::new(&engine, &builder(&mesh).build().unwrap()).refs(),
            &[]
        ))
        .contains("0 meshes")
    );

    let plan = builder(&mesh).build().unwrap();
    let memory = Memory::new(&engine, &plan);
    let mut refs = memory.refs();
    refs.device = refs.device.part(0, refs.device.range() - 16).unwrap();
    assert!(error(rasterizer.bind_pass(plan.clone(), refs, &[plain])).contains("the device buffer has"));
    let mut refs = memory.refs();
    refs.upload = memory.readback.whole();
    assert!(error(rasterizer.bind_pass(plan.clone(), refs, &[plain])).contains("the upload buffer"));
    let mut pass = rasterizer.bind_pass(plan, memory.refs(), &[plain]).unwrap();
    assert!(error(pass.write_inputs(&mut [0; 16])).contains("upload buffer of 16 bytes"));
    assert!(error(pass.status(&[0; 8])).contains("readback buffer of 8 bytes"));
    assert!(error(pass.set_cameras(&case.cameras[..1])).contains("1 cameras"));
    assert_eq!(error(pass.set_cameras(&case.cameras)), "no error");
    let flat = Camera::from_matrix(case.cameras[0].matrix(), Projection::Orthographic { half_height: 1.2 }).unwrap();
    assert!(
        error(pass.set_cameras(&vec![flat; case.cameras.len()]))
            .contains("planned without cameras that are orthographic")
    );
    let sharper = Settings { sigma: 1e-5, gamma: 1e-3, ..case.settings.clone() };
    assert_eq!(error(pass.set_settings(sharper)), "no error");
    assert!(error(pass.set_settings(Settings { width: 20, ..case.settings.clone() })).contains("pixels"));
    let frame = engine.commands().unwrap();
    frame.begin().unwrap();
    assert!(error(pass.record_backward(&mut frame.host())).contains("no gradients"));
    engine.end(&frame).unwrap();
    drop((frame, pass, memory, vertices, rasterizer));
    assert_silent(engine);
}

/// Gradients that the pass does not compute.
fn misfit_gradients(engine: &Engine, rasterizer: &Rasterizer, case: &Case) {
    let vertices = storage(engine, &[0; 4 * 20]);
    let packed = Layout { stride: 12, offset: 0 };
    let target = storage(engine, &[0; 64]);
    let bind = |wanted, gradients| {
        let plan = rasterizer.pass(&[PassMesh::new(4, &QUAD)]).settings(case.settings.clone()).cameras(&case.cameras);
        let plan = plan.gradients(wanted).build().unwrap();
        let memory = Memory::new(engine, &plan);
        let buffers = MeshBuffers { gradients, ..MeshBuffers::new(vertices.whole(), packed) };
        error(rasterizer.bind_pass(plan, memory.refs(), &[buffers]))
    };
    let none = GeometryGradients::default();
    let at = Some((target.whole(), packed));
    let by_color = GradientRequest { colors: true, ..GradientRequest::NOTHING };
    let positions = GeometryGradients { positions: at, ..none };
    assert_eq!(bind(GradientRequest::default(), positions), "no error");
    assert_eq!(bind(GradientRequest { camera: true, ..GradientRequest::NOTHING }, none), "no error");
    assert!(bind(by_color, positions).contains("GradientRequest::positions"));
    assert!(
        bind(GradientRequest::default(), GeometryGradients { colors: at, ..none }).contains("GradientRequest::colors")
    );
    let transforms = GeometryGradients { transforms: at, ..none };
    assert!(bind(by_color, transforms).contains("GradientRequest::positions"));
    assert!(bind(GradientRequest::default(), transforms).contains("MeshBuffers::transforms"));
}
