//! softras inside a wgpu engine: the VkDevice comes out of a wgpu device, softras records into a wgpu command encoder, and
//! wgpu copies its image into a texture that a render pass samples. So would Bevy.
//!
//! `cargo run -p embed-wgpu [PICTURE.png]`
// Handing raw handles across has no other way; each block is a call whose promise is stated beside it.
#![allow(unsafe_code, dead_code, missing_docs)]

use ash::vk;
use glam::DVec3;
use softras::embed::{
    Arena, BufferId, BufferRef, FrameBindings, FramePlan, HostAdapter, HostCommands, HostDevice, Inputs, Rasterizer,
    Shape, Status, requirements,
};
use softras::scene::{Appearance, Background};
use softras::{Camera, Lights, Projection, Scene, Settings, shapes};
use std::path::Path;
use wgpu::hal::api::Vulkan;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

const SIZE: u32 = 256;

/// Draws softras' image over a gradient of wgpu's own, by softras' silhouette.
const DRAW: &str = "
@group(0) @binding(0) var image: texture_2d<f32>;

@vertex
fn vertex(@builtin(vertex_index) i: u32) -> @builtin(position) vec4<f32> {
    return vec4(f32(i32(i & 1u) * 4 - 1), f32(i32(i >> 1u) * 4 - 1), 0.0, 1.0);
}

@fragment
fn fragment(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
    let texel = textureLoad(image, vec2<i32>(at.xy), 0);
    let sky = mix(vec3(0.05, 0.1, 0.3), vec3(0.8, 0.6, 0.4), at.y / f32(textureDimensions(image).y));
    return vec4(texel.rgb + (1.0 - texel.a) * sky, 1.0);
}";

/// softras' memory on wgpu's device: one buffer that the host maps. wgpu's own buffers cannot be read as texels.
struct Memory {
    device: ash::Device,
    buffer: vk::Buffer,
    memory: vk::DeviceMemory,
    mapped: *mut u8,
    size: usize,
}

impl Memory {
    fn new(
        instance: &ash::Instance,
        physical: vk::PhysicalDevice,
        device: &ash::Device,
        arena: &Arena,
    ) -> Outcome<Self> {
        let info = vk::BufferCreateInfo::default().size(arena.size).usage(arena.usage);
        // SAFETY: the handles are wgpu's, which live; what is made here is destroyed by `Drop`.
        unsafe {
            let buffer = device.create_buffer(&info, None)?;
            let mut made = Self {
                device: device.clone(),
                buffer,
                memory: vk::DeviceMemory::null(),
                mapped: std::ptr::null_mut(),
                size: arena.size as usize,
            };
            let needed = device.get_buffer_memory_requirements(buffer);
            let types = instance.get_physical_device_memory_properties(physical);
            let wanted = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
            let fits = |(i, t): &(usize, &vk::MemoryType)| {
                needed.memory_type_bits >> i & 1 == 1 && t.property_flags.contains(wanted)
            };
            let (index, _) = types.memory_types_as_slice().iter().enumerate().find(fits).ok_or("no mapped memory")?;
            let info = vk::MemoryAllocateInfo::default().allocation_size(needed.size).memory_type_index(index as u32);
            made.memory = device.allocate_memory(&info, None)?;
            device.bind_buffer_memory(buffer, made.memory, 0)?;
            let flags = vk::MemoryMapFlags::empty();
            made.mapped = device.map_memory(made.memory, 0, vk::WHOLE_SIZE, flags)?.cast();
            Ok(made)
        }
    }

    fn bytes_mut(&mut self) -> &mut [u8] {
        // SAFETY: mapped for as long as self lives; the device uses it only between submission and wait.
        unsafe { std::slice::from_raw_parts_mut(self.mapped, self.size) }
    }

    fn write(&mut self, offset: u64, bytes: &[u8]) {
        self.bytes_mut()[offset as usize..][..bytes.len()].copy_from_slice(bytes);
    }
}

impl Drop for Memory {
    fn drop(&mut self) {
        // SAFETY: the device has been waited for, and lives. Freeing unmaps; null is ignored.
        unsafe {
            self.device.destroy_buffer(self.buffer, None);
            self.device.free_memory(self.memory, None);
        }
    }
}

/// What softras needs of wgpu's device, and the functions to make buffers with.
fn host_device(device: &wgpu::Device) -> Outcome<(HostAdapter, HostDevice, ash::Instance, ash::Device)> {
    // SAFETY: the guard is dropped at once, the handles are not destroyed.
    let hal = unsafe { device.as_hal::<Vulkan>() }.ok_or("the device is not Vulkan's")?;
    let shared = hal.shared_instance();
    let instance = shared.raw_instance();
    let get_instance_proc_addr = shared.entry().static_fn().get_instance_proc_addr;
    let physical = hal.raw_physical_device();
    // SAFETY: the handles are wgpu's, whose device outlives the rasterizer.
    let (adapter, host) = unsafe {
        let adapter = HostAdapter::new(get_instance_proc_addr, instance.handle(), physical);
        (adapter, HostDevice::new(adapter, hal.raw_device().handle()))
    };
    Ok((adapter, host, instance.clone(), hal.raw_device().clone()))
}

fn scene() -> softras::Result<(Scene, Camera, Settings)> {
    let mesh = shapes::torus(0.75, 0.32, 48, 24)?.with_appearance(Appearance::Uniform([0.9, 0.35, 0.2]))?;
    let scene = Scene::new(mesh).with_lights(Lights::official());
    let camera =
        Camera::look_at(DVec3::new(1.2, 1.8, 2.6), DVec3::ZERO, DVec3::Y, Projection::Perspective { fov_y: 0.7 })?;
    let settings =
        Settings { width: SIZE, height: SIZE, sigma: 1e-4, background: Background::Composite, ..Settings::default() };
    Ok((scene, camera, settings))
}

/// Runs the example and returns the picture: RGBA, sRGB, row by row.
pub fn run(path: Option<&Path>, validation: bool) -> Outcome<Vec<u8>> {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::VULKAN;
    descriptor.flags = if validation { wgpu::InstanceFlags::VALIDATION } else { wgpu::InstanceFlags::empty() };
    let instance = wgpu::Instance::new(descriptor);
    let adapter = wait(instance.request_adapter(&wgpu::RequestAdapterOptions::default()))?;
    let (device, queue) = wait(adapter.request_device(&wgpu::DeviceDescriptor::default()))?;

    let (host_adapter, host, raw_instance, raw_device) = host_device(&device)?;
    requirements().judge(&host_adapter)?;
    let rasterizer = Rasterizer::new(&host)?;
    let (scene, camera, settings) = scene()?;
    let cameras = [camera];
    let plan = rasterizer.plan(&Shape::of(&scene, &cameras, &settings)?, &settings)?;
    let arena = Arena::of(plan.buffers());
    let mut memory = Memory::new(&raw_instance, host_adapter.physical_device(), &raw_device, &arena)?;
    let inputs = Inputs::new(&scene, &cameras, &settings, &plan);
    for &(name, offset, _) in &arena.parts {
        memory.write(offset, inputs.get(name).unwrap_or_default());
    }
    // SAFETY: the buffer is of this device, has the arena's size and usage, and outlives the bindings.
    let buffer = unsafe { BufferRef::new(memory.buffer, arena.size, arena.usage) };
    let bindings = rasterizer.bind(&plan, &arena.refs(&buffer)?)?;

    let picture = draw(&device, &queue, &rasterizer, (&plan, &bindings), (&memory, &arena))?;
    let at = arena.part(BufferId::Status).ok_or("no status")?.0 as usize;
    let status = Status::from_bytes(memory.bytes_mut()[at..].first_chunk().ok_or("no status")?);
    if status.judge(&plan)?.is_some() {
        return Err("the lists were too small: plan again with the capacity that the status tells".into());
    }
    if let Some(path) = path {
        let mut encoder = png::Encoder::new(std::io::BufWriter::new(std::fs::File::create(path)?), SIZE, SIZE);
        encoder.set_color(png::ColorType::Rgba);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.write_header()?.write_image_data(&picture)?;
    }
    drop((bindings, memory, rasterizer));
    Ok(picture)
}

/// One submission: softras, a copy into a texture, a render pass that samples it, and a copy for the host to see.
fn draw(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    rasterizer: &Rasterizer,
    (plan, bindings): (&FramePlan, &FrameBindings),
    (memory, arena): (&Memory, &Arena),
) -> Outcome<Vec<u8>> {
    // An encoder of its own for softras: wgpu does not know what is recorded into it.
    let mut softras = device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("softras") });
    // SAFETY: the command buffer is recording, outside a pass, of a queue that computes; bindings and memory are kept
    // until the queue has been waited for below.
    unsafe {
        softras.as_hal_mut::<Vulkan, _, Outcome<()>>(|encoder| {
            let mut commands = HostCommands::new(encoder.ok_or("the encoder is not Vulkan's")?.raw_handle());
            Ok(rasterizer.record_forward(&mut commands, plan, bindings)?)
        })?;
    }

    let usage = wgpu::BufferUsages::COPY_SRC;
    let descriptor =
        wgpu::BufferDescriptor { label: Some("softras"), size: arena.size, usage, mapped_at_creation: false };
    // SAFETY: the buffer is of this device, has the usage, is not empty, outlives wgpu's use of it and stays ours to
    // destroy. softras has written the part that is read.
    let color = unsafe {
        let buffer = wgpu::hal::vulkan::Buffer::from_raw_externally_owned(memory.buffer, Box::new(|| {}));
        device.create_buffer_from_hal::<Vulkan>(buffer, &descriptor)
    };
    let size = wgpu::Extent3d { width: SIZE, height: SIZE, depth_or_array_layers: 1 };
    let texture = |format, usage| {
        device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size,
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage,
            view_formats: &[],
        })
    };
    type Usages = wgpu::TextureUsages;
    let image = texture(wgpu::TextureFormat::Rgba32Float, Usages::COPY_DST | Usages::TEXTURE_BINDING);
    let target = texture(wgpu::TextureFormat::Rgba8UnormSrgb, Usages::RENDER_ATTACHMENT | Usages::COPY_SRC);
    let usage = wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ;
    let bytes = u64::from(4 * SIZE * SIZE);
    let picture =
        device.create_buffer(&wgpu::BufferDescriptor { label: None, size: bytes, usage, mapped_at_creation: false });

    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let layout =
        |offset, texel| wgpu::TexelCopyBufferLayout { offset, bytes_per_row: Some(texel * SIZE), rows_per_image: None };
    let (offset, _) = arena.part(BufferId::Color).ok_or("no colour")?;
    let from = wgpu::TexelCopyBufferInfo { buffer: &color, layout: layout(offset, 16) };
    encoder.copy_buffer_to_texture(from, image.as_image_copy(), size);
    draw_pass(device, &mut encoder, &image, &target);
    let to = wgpu::TexelCopyBufferInfo { buffer: &picture, layout: layout(0, 4) };
    encoder.copy_texture_to_buffer(target.as_image_copy(), to, size);
    queue.submit([softras.finish(), encoder.finish()]);

    picture.map_async(wgpu::MapMode::Read, .., |_| {});
    device.poll(wgpu::PollType::Wait { submission_index: None, timeout: None })?;
    let pixels = picture.get_mapped_range(..)?.to_vec();
    Ok(pixels)
}

fn draw_pass(device: &wgpu::Device, encoder: &mut wgpu::CommandEncoder, image: &wgpu::Texture, target: &wgpu::Texture) {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl(DRAW.into()),
    });
    let entry = wgpu::BindGroupLayoutEntry {
        binding: 0,
        visibility: wgpu::ShaderStages::FRAGMENT,
        ty: wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Float { filterable: false },
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        },
        count: None,
    };
    let group_layout =
        device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: None, entries: &[entry] });
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: None,
        bind_group_layouts: &[Some(&group_layout)],
        immediate_size: 0,
    });
    let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: None,
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("vertex"),
            compilation_options: Default::default(),
            buffers: &[],
        },
        primitive: Default::default(),
        depth_stencil: None,
        multisample: Default::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some("fragment"),
            compilation_options: Default::default(),
            targets: &[Some(target.format().into())],
        }),
        multiview_mask: None,
        cache: None,
    });
    let view = image.create_view(&Default::default());
    let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &group_layout,
        entries: &[wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(&view) }],
    });
    let view = target.create_view(&Default::default());
    let attachment = wgpu::RenderPassColorAttachment {
        view: &view,
        depth_slice: None,
        resolve_target: None,
        ops: Default::default(),
    };
    let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        color_attachments: &[Some(attachment)],
        ..Default::default()
    });
    pass.set_pipeline(&pipeline);
    pass.set_bind_group(0, &group, &[]);
    pass.draw(0..3, 0..1);
}

/// wgpu's native futures are ready at once.
fn wait<T>(future: impl Future<Output = T>) -> T {
    let mut future = std::pin::pin!(future);
    let mut context = std::task::Context::from_waker(std::task::Waker::noop());
    loop {
        if let std::task::Poll::Ready(value) = future.as_mut().poll(&mut context) {
            return value;
        }
        std::thread::yield_now();
    }
}

fn main() -> Outcome<()> {
    let path = std::env::args_os().nth(1).map_or_else(|| "embed_wgpu.png".into(), std::path::PathBuf::from);
    let validation = std::env::var_os("SOFTRAS_VALIDATION").is_some_and(|v| v != "0");
    run(Some(&path), validation)?;
    println!("picture in {}", path.display());
    Ok(())
}
