//! The facade with a host's images: textures out of them, and what is stored into them by the host's own matrices.

use super::facade::*;
use super::geometry::storage;
use super::images::{change_use, stored, whole_image};
use crate::common::renderer;
use crate::host::engine::{Engine, Image};
use crate::host::{assert_silent, engine, rasterizer, submit};
use ash::vk;
use gpu_allocator::MemoryLocation;
use softras::embed::{
    CameraMatrices, ClipSpace, FrameImage, HostCamera, ImageFormat, Layout, MeshBuffers, MeshLook, PassBuffer,
    PassMesh, PassStatus, TexelSource, TextureRef,
};
use softras::glam::{DMat4, DVec3};
use softras::scene::{Appearance, Background, Outputs, Texture, Wrap};
use softras::{Camera, Mesh, Projection, Scene, Settings, shapes};

/// A sampled image with given texels.
fn texture(engine: &Engine, format: vk::Format, size: (u32, u32), texels: &[u8]) -> (Image, TextureRef) {
    let image =
        engine.image_of(format, size, vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST).unwrap();
    let mut source =
        engine.buffer(texels.len() as u64, vk::BufferUsageFlags::TRANSFER_SRC, MemoryLocation::CpuToGpu).unwrap();
    source.write(0, texels);
    submit(engine, |commands| {
        use vk::{AccessFlags as A, ImageLayout as L, PipelineStageFlags as S};
        change_use(
            engine,
            commands,
            &image,
            (L::UNDEFINED, A::empty(), S::TOP_OF_PIPE),
            (L::TRANSFER_DST_OPTIMAL, A::TRANSFER_WRITE, S::TRANSFER),
        );
        let copy = [whole_image(size)];
        unsafe {
            engine.device().cmd_copy_buffer_to_image(
                commands.raw(),
                source.raw,
                image.raw,
                L::TRANSFER_DST_OPTIMAL,
                &copy,
            )
        };
        change_use(
            engine,
            commands,
            &image,
            (L::TRANSFER_DST_OPTIMAL, A::TRANSFER_WRITE, S::TRANSFER),
            (L::SHADER_READ_ONLY_OPTIMAL, A::SHADER_READ, S::COMPUTE_SHADER),
        );
    });
    let texture = unsafe { TextureRef::new(image.view, size.0, size.1) };
    (image, texture)
}

/// A textured quad of a host: x, y, z, u, v with v growing downwards.
const CORNERS: [[f32; 5]; 4] =
    [[-1.0, -1.0, 0.0, 0.0, 1.0], [1.0, -1.0, 0.0, 1.0, 1.0], [1.0, 1.0, 0.0, 1.0, 0.0], [-1.0, 1.0, 0.0, 0.0, 0.0]];

#[test]
fn textures_come_straight_from_a_hosts_images_and_buffers() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let bytes: Vec<[u8; 4]> = (0..8u8).map(|i| [20 * i, 255 - 30 * i, 7 * i * (i % 3), 255]).collect();
    let linear = |c: u8| f32::from(c) / 255.0;
    let floats: Vec<[f32; 4]> = bytes.iter().map(|t| [linear(t[0]), linear(t[1]), linear(t[2]), 1.0]).collect();
    let rgb: Vec<[f32; 3]> = floats.iter().map(|t| [t[0], t[1], t[2]]).collect();

    // The expected frame, rendered as a scene: the textured quad, and a cube of one colour behind it.
    let quad_uvs: Vec<[f32; 2]> = CORNERS.iter().map(|c| [c[3], 1.0 - c[4]]).collect();
    let cube = shapes::cube().unwrap();
    let mut positions: Vec<[f32; 3]> = CORNERS.iter().map(|c| [c[0], c[1], c[2]]).collect();
    let behind = |p: &[f32; 3]| [p[0] + 0.5, p[1] + 0.25, p[2] - 1.5];
    positions.extend(cube.positions().iter().map(behind));
    let mut triangles = vec![[0, 1, 2], [0, 2, 3]];
    triangles.extend(cube.triangles().iter().map(|t| t.map(|v| v + 4)));
    let mut uvs = quad_uvs;
    uvs.extend(vec![[0.0; 2]; cube.positions().len()]);
    let appearance = Appearance::Textured {
        uvs,
        uv_triangles: triangles.clone(),
        textures: vec![
            Texture::new(SIZE.0, SIZE.1, rgb, Wrap::Clamp).unwrap(),
            Texture::new(1, 1, vec![[0.25, 0.5, 0.125]], Wrap::Clamp).unwrap(),
        ],
        texture_of_triangle: (0..triangles.len()).map(|t| u32::from(t >= 2)).collect(),
    };
    let mesh = Mesh::new(positions, triangles).unwrap().with_appearance(appearance).unwrap();
    let camera =
        Camera::look_at(DVec3::new(0.4, 0.3, 4.0), DVec3::ZERO, DVec3::Y, Projection::Perspective { fov_y: 0.8 })
            .unwrap();
    let settings = Settings { width: 40, height: 32, sigma: 1e-4, ..Settings::default() };
    let frame = renderer().render(&Scene::new(mesh), &[camera], &settings).unwrap();

    let stride = 20;
    let vertices = storage(&engine, bytemuck::cast_slice(&CORNERS));
    let moved: Vec<[f32; 3]> = cube.positions().iter().map(behind).collect();
    let cube_vertices = storage(&engine, bytemuck::cast_slice(&moved));
    let cube_indices: Vec<u32> = cube.triangles().iter().flatten().copied().collect();
    let look = MeshLook::Texture { size: SIZE, wrap: Wrap::Clamp, v_down: true };
    let meshes = [
        PassMesh::new(4, &QUAD).with_look(look),
        PassMesh::new(cube.positions().len() as u32, &cube_indices).with_look(MeshLook::Color([0.25, 0.5, 0.125])),
    ];
    let plan = rasterizer.pass(&meshes).settings(settings).cameras(&[camera]).inside_planes().build().unwrap();
    let usage = vk::BufferUsageFlags::STORAGE_BUFFER | vk::BufferUsageFlags::TRANSFER_SRC;
    let mut words = engine.buffer(32, usage, MemoryLocation::CpuToGpu).unwrap();
    words.write(0, bytemuck::cast_slice(&bytes));
    let mut wide = engine.buffer(128, usage, MemoryLocation::CpuToGpu).unwrap();
    wide.write(0, bytemuck::cast_slice(&floats));
    let float_image = texture(&engine, vk::Format::R32G32B32A32_SFLOAT, SIZE, bytemuck::cast_slice(&floats));
    let byte_image = texture(&engine, vk::Format::R8G8B8A8_UNORM, SIZE, bytemuck::cast_slice(&bytes));
    let sources = [
        ("floats", TexelSource::Floats(wide.whole()), 0.0),
        ("float image", TexelSource::Image(float_image.1), 0.0),
        ("bytes", TexelSource::Bytes { at: words.whole(), srgb: false }, 1e-6),
        ("byte image", TexelSource::Image(byte_image.1), 1e-6),
    ];
    for (what, source, bound) in sources {
        let quad = MeshBuffers {
            uvs: Some((vertices.whole(), Layout { stride, offset: 12 })),
            texels: Some(source),
            ..MeshBuffers::new(vertices.whole(), Layout { stride, offset: 0 })
        };
        let solid = MeshBuffers::new(cube_vertices.whole(), Layout { stride: 12, offset: 0 });
        let mut memory = Memory::new(&engine, &plan);
        let pass = bind(&rasterizer, &plan, &mut memory, &[quad, solid]);
        run(&engine, &pass);
        assert_eq!(pass.status(memory.readback.bytes()).unwrap(), PassStatus::Whole);
        let color = memory.floats(&pass, PassBuffer::Color);
        let expected = &frame.color().unwrap().data;
        for (pixel, own) in color.chunks_exact(4).enumerate() {
            for k in 0..3 {
                let due = expected[3 * pixel + k];
                assert!((own[k] - due).abs() <= bound, "{what}, pixel {pixel}: {own:?} for {due}");
            }
        }
        assert_eq!(pass.texels(0).unwrap().range(), 128);
        assert_eq!(pass.texels(1), None);
    }
    // sRGB texels are decoded.
    let quad = MeshBuffers {
        uvs: Some((vertices.whole(), Layout { stride, offset: 12 })),
        texels: Some(TexelSource::Bytes { at: words.whole(), srgb: true }),
        ..MeshBuffers::new(vertices.whole(), Layout { stride, offset: 0 })
    };
    let solid = MeshBuffers::new(cube_vertices.whole(), Layout { stride: 12, offset: 0 });
    let mut memory = Memory::new(&engine, &plan);
    let pass = bind(&rasterizer, &plan, &mut memory, &[quad, solid]);
    run(&engine, &pass);
    let at = pass.texels(0).unwrap();
    let texels = memory.device.floats(at.offset(), 32);
    for (own, due) in texels.chunks_exact(4).zip(&bytes) {
        for k in 0..3 {
            let c = f64::from(due[k]) / 255.0;
            let due = if c > 0.04045 { ((c + 0.055) / 1.055).powf(2.4) } else { c / 12.92 };
            assert!((f64::from(own[k]) - due).abs() < 1e-5);
        }
        assert_eq!(own[3], 0.0);
    }
    drop((pass, memory, float_image, byte_image, words, wide, vertices, cube_vertices, rasterizer));
    assert_silent(engine);
}

/// A right-handed Vulkan projection with reversed infinite depth, as many engines have it.
fn reversed_infinite(fov_y: f64, aspect: f64, near: f64) -> [[f64; 4]; 4] {
    let f = 1.0 / (fov_y / 2.0).tan();
    [[f / aspect, 0.0, 0.0, 0.0], [0.0, -f, 0.0, 0.0], [0.0, 0.0, 0.0, -1.0], [0.0, 0.0, near, 0.0]]
}

#[test]
fn matrices_render_and_store_as_the_hosts_rasterizer_would() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let (eye, fov_y, near) = (DVec3::new(0.0, 0.0, 4.0), 0.8, 1.0);
    // Looking along -z from eye: a translation.
    let view = DMat4::from_translation(-eye).to_cols_array_2d();
    let projection = reversed_infinite(fov_y, 48.0 / 32.0, near);
    let outputs = Outputs { normal: false, ..Outputs::ALL };
    let settings = Settings {
        width: 48,
        height: 32,
        sigma: 1e-4,
        outputs,
        background: Background::Composite,
        background_color: [0.5, 0.25, 1.0],
        ..Settings::default()
    };
    let camera = Camera::look_at(eye, DVec3::ZERO, DVec3::Y, Projection::Perspective { fov_y }).unwrap();
    let cube = shapes::cube().unwrap();
    let cube = Mesh::new(cube.positions().to_vec(), cube.triangles().to_vec()).unwrap();
    let frame = renderer().render(&Scene::new(cube.clone()), &[camera], &settings).unwrap();

    let vertices = storage(&engine, bytemuck::cast_slice(cube.positions()));
    let indices: Vec<u32> = cube.triangles().iter().flatten().copied().collect();
    let mesh = PassMesh::new(cube.positions().len() as u32, &indices);
    let builder = rasterizer.pass(&[mesh]).settings(settings.clone());
    let matrices = CameraMatrices { view, projection };
    let plan = builder.camera_matrices(&[matrices], ClipSpace::default()).build().unwrap();
    let mut memory = Memory::new(&engine, &plan);
    let buffers = [MeshBuffers::new(vertices.whole(), Layout { stride: 12, offset: 0 })];
    let pass = bind(&rasterizer, &plan, &mut memory, &buffers);
    run(&engine, &pass);
    assert_eq!(pass.status(memory.readback.bytes()).unwrap(), PassStatus::Whole);
    let (color, depths) = (memory.floats(&pass, PassBuffer::Color), memory.floats(&pass, PassBuffer::Depths));
    let simple = frame.color().unwrap();
    let mut worst = 0.0f32;
    for (own, due) in color.chunks_exact(4).zip(simple.data.chunks_exact(3)) {
        worst = (0..3).fold(worst, |worst, k| worst.max((own[k] - due[k]).abs()));
    }
    assert!(worst < 1e-4, "{worst}");

    // The depth buffer: what the host's rasterizer would have written at the mean depth, and 0 far away.
    let host = HostCamera::new(&matrices, ClipSpace::default(), (48, 32)).unwrap();
    let image = FrameImage::DepthBuffer { least_silhouette: 0.5 };
    let values = stored(&engine, &pass, image, 0, ImageFormat::R32Float);
    let values: &[f32] = bytemuck::cast_slice(&values);
    let mut covered = 0;
    for (pixel, &value) in values.iter().enumerate() {
        let alpha = color[4 * pixel + 3];
        if alpha < 0.5 {
            assert_eq!(value, 0.0);
            continue;
        }
        covered += 1;
        let z = f64::from(depths[pixel]) / f64::from(alpha);
        assert!((host.buffer_depth(z) - f64::from(value)).abs() < 1e-6, "pixel {pixel}: {value} at {z}");
        assert!((near / z - f64::from(value)).abs() < 1e-6);
    }
    assert!(covered > 100);

    // Colour for blending: over any background of the host's, both ways of alpha give the same, and over softras' own
    // background its own image.
    let four = |premultiplied| {
        let image = FrameImage::Foreground { premultiplied, srgb: false };
        let bytes = stored(&engine, &pass, image, 0, ImageFormat::Rgba32Float);
        bytemuck::cast_slice::<u8, f32>(&bytes).to_vec()
    };
    let (straight, premultiplied) = (four(false), four(true));
    for pixel in 0..color.len() / 4 {
        let (s, p, own) = (&straight[4 * pixel..], &premultiplied[4 * pixel..], &color[4 * pixel..]);
        for k in 0..3 {
            let over = p[k] + (1.0 - p[3]) * settings.background_color[k] as f32;
            assert!((over - own[k]).abs() < 1e-5, "pixel {pixel}");
            assert!((s[k] * s[3] - p[k]).abs() < 1e-5, "pixel {pixel}");
        }
        assert_eq!((s[3], p[3]), (own[3], own[3]));
    }
    drop((pass, memory, vertices, rasterizer));
    assert_silent(engine);
}
