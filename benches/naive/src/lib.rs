//! The baseline of the benchmarks: every pixel over every face, as the official code does it.
#![allow(clippy::panic)]

use softras::internals::vulkan::{
    BufferDesc, CommandBuffer, Context, ContextOptions, DescriptorPool, Pipeline, SharedBuffer, TexelFormat,
};
use softras::scene::{Appearance, Background, Outputs};
use softras::{Camera, Projection, Scene, Settings};
use softras_lab::measure::time::median;
use std::time::Instant;

/// The kernel, as the build script writes it. Of the names that a kernel may refer to, this one needs a few.
#[allow(unused_imports)]
mod kernel {
    use softras::internals::vulkan::{
        Binding, BindingKind, Kernel, KernelData, Member, SpecValue, Specialization, Struct,
    };

    const fn words<const N: usize>(bytes: &[u8]) -> [u32; N] {
        let mut words = [0; N];
        let mut i = 0;
        while i < N {
            words[i] = u32::from_le_bytes([bytes[4 * i], bytes[4 * i + 1], bytes[4 * i + 2], bytes[4 * i + 3]]);
            i += 1;
        }
        words
    }

    include!(concat!(env!("OUT_DIR"), "/kernel.rs"));
}

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Push {
    width: u32,
    height: u32,
    faces: u32,
    composite: u32,
    inverse_sigma: f32,
    inverse_gamma: f32,
    near: f32,
    far: f32,
    radius_squared: f32,
    epsilon: f32,
}

/// Median milliseconds of a forward frame, and its image: RGB and silhouette of every pixel. The scene is one mesh in vertex
/// colours before one perspective camera, the background black.
///
/// # Errors
/// As [`softras::Renderer::render`].
pub fn render(
    scene: &Scene,
    camera: &Camera,
    settings: &Settings,
    repeats: usize,
) -> softras::Result<(f64, Vec<[f32; 4]>)> {
    let context = Context::new(&ContextOptions::default())?;
    let mesh = &scene.meshes[0];
    let Appearance::VertexColors(vertex_colors) = mesh.appearance() else { panic!("vertex colours are expected") };
    let screen = on_screen(mesh.positions(), camera);
    let of_faces = |values: &dyn Fn(usize) -> [f32; 4]| -> Vec<[f32; 4]> {
        mesh.triangles().iter().flatten().map(|&v| values(v as usize)).collect()
    };
    let corners = of_faces(&|v| screen[v]);
    let colors = of_faces(&|v| [vertex_colors[v][0], vertex_colors[v][1], vertex_colors[v][2], 0.0]);
    let pixels = settings.width * settings.height;
    let upload = |name, texels: &[[f32; 4]]| -> softras::Result<SharedBuffer> {
        let bytes: &[u8] = bytemuck::cast_slice(texels);
        let size = bytes.len() as u64;
        let format = Some(TexelFormat::Float4);
        let mut buffer =
            SharedBuffer::for_upload(&context, &BufferDesc { name, size, texels: format, ..BufferDesc::default() })?;
        buffer.write(0, bytes)?;
        Ok(buffer)
    };
    let (corners, colors) = (upload("naive corners", &corners)?, upload("naive colors", &colors)?);
    let desc = BufferDesc { name: "naive image", size: 16 * u64::from(pixels), ..BufferDesc::default() };
    let image = SharedBuffer::for_download(&context, &desc)?;
    let kernel = &kernel::NAIVE;
    let pipeline = Pipeline::new(context.device(), kernel, &[], Some(context.pipeline_cache()))?;
    let parts = [("corners", corners.whole()), ("colors", colors.whole()), ("Image", image.whole())];
    let set = DescriptorPool::new(context.device(), &[kernel])?.bind(&pipeline, &parts)?;
    let push = Push {
        width: settings.width,
        height: settings.height,
        faces: mesh.triangles().len() as u32,
        composite: u32::from(settings.background == Background::Composite),
        inverse_sigma: (1.0 / settings.sigma) as f32,
        inverse_gamma: (1.0 / settings.gamma) as f32,
        near: settings.near as f32,
        far: settings.far as f32,
        radius_squared: (settings.sigma * settings.cutoff()) as f32,
        epsilon: settings.epsilon as f32,
    };
    let mut commands = CommandBuffer::new(&context, "naive")?;
    commands.record(|recorder| {
        corners.record_upload(recorder)?;
        colors.record_upload(recorder)?;
        recorder.barrier();
        recorder.dispatch(&pipeline, &set, bytemuck::bytes_of(&push), [pixels.div_ceil(64), 1, 1])?;
        recorder.barrier();
        image.record_download(recorder)?;
        recorder.barrier_to_host();
        Ok(())
    })?;
    let mut texels = vec![[0.0f32; 4]; pixels as usize];
    let mut times = Vec::new();
    for run in 0..=repeats {
        let start = Instant::now();
        commands.submit_and_wait()?;
        image.read(0, bytemuck::cast_slice_mut(&mut texels))?;
        // The first run compiles the kernel.
        if run > 0 {
            times.push(start.elapsed().as_secs_f64() * 1e3);
        }
    }
    Ok((median(times), texels))
}

/// Screen x, y and view depth of every vertex.
fn on_screen(positions: &[[f32; 3]], camera: &Camera) -> Vec<[f32; 4]> {
    let Projection::Perspective { fov_y } = *camera.projection() else { panic!("a perspective camera is expected") };
    let slope = (fov_y / 2.0).tan();
    let place = |p: &[f32; 3]| {
        let [x, y, z] = [0, 1, 2].map(|i| {
            let row = camera.view()[i];
            (0..3).map(|k| row[k] * f64::from(p[k])).sum::<f64>() + row[3]
        });
        [(x / (z * slope)) as f32, (y / (z * slope)) as f32, z as f32, 0.0]
    };
    positions.iter().map(place).collect()
}

/// The largest error of colour and silhouette.
pub fn error(image: &[[f32; 4]], reference: &softras_reference::ReferenceFrame, outputs: Outputs) -> f64 {
    assert!(outputs.color && outputs.silhouette && reference.silhouette.len() == image.len());
    let pixels = image.iter().zip(reference.color.chunks_exact(3)).zip(&reference.silhouette);
    let off = |(([r, g, b, a], color), alpha): ((&[f32; 4], &[f64]), &f64)| {
        let color = [*r, *g, *b].into_iter().zip(color).map(|(x, y)| (f64::from(x) - y).abs());
        color.fold((f64::from(*a) - alpha).abs(), f64::max)
    };
    pixels.map(off).fold(0.0, f64::max)
}
