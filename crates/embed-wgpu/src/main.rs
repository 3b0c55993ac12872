//! softras inside a wgpu engine: the VkDevice comes out of a wgpu device, softras records into a wgpu command encoder, and
//! wgpu copies its image into a texture that a render pass samples. So would Bevy.
//!
//! `cargo run -p embed-wgpu [PICTURE.png]`
// Handing raw handles across has no other way; each block is a call whose promise is stated beside it.
#![allow(unsafe_code, dead_code, missing_docs)]

use ash::vk;
use softras::embed::{
    BufferRef, CameraMatrices, ClipSpace, HostAdapter, HostCommands, HostDevice, Layout, MemoryKind, MemoryRequirement,
    MeshBuffers, MeshLook, Pass, PassBuffer, PassMemory, PassMesh, PassStatus, Rasterizer, Requirements,
};
use softras::glam::DVec3;
use softras::glam::dcamera::rh::{proj::directx::perspective, view::look_at_mat4};
use softras::scene::Background;
use softras::{Lights, Settings, shapes};
use std::path::Path;
use wgpu::hal::api::Vulkan;
use wgpu::util::DeviceExt;

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

/// One of softras' buffers on wgpu's device. wgpu's own buffers cannot be read as texels.
struct Memory {
    device: ash::Device,
    needs: MemoryRequirement,
    buffer: vk::Buffer,
    memory: vk::DeviceMemory,
    /// Null for memory that the host does not see.
    mapped: *mut u8,
}

impl Memory {
    fn new(
        instance: &ash::Instance,
        physical: vk::PhysicalDevice,
        device: &ash::Device,
        needs: MemoryRequirement,
    ) -> Outcome<Self> {
        type Flags = vk::MemoryPropertyFlags;
        let wanted = match needs.kind {
            MemoryKind::Device => Flags::DEVICE_LOCAL,
            _ => Flags::HOST_VISIBLE | Flags::HOST_COHERENT,
        };
        let info = vk::BufferCreateInfo::default().size(needs.size).usage(needs.usage);
        // SAFETY: the handles are wgpu's, which live; what is made here is destroyed by `Drop`.
        unsafe {
            let buffer = device.create_buffer(&info, None)?;
            let (memory, mapped) = (vk::DeviceMemory::null(), std::ptr::null_mut());
            let mut made = Self { device: device.clone(), needs, buffer, memory, mapped };
            let room = device.get_buffer_memory_requirements(buffer);
            let types = instance.get_physical_device_memory_properties(physical);
            let fits = |(i, t): &(usize, &vk::MemoryType)| {
                room.memory_type_bits >> i & 1 == 1 && t.property_flags.contains(wanted)
            };
            let (index, _) = types.memory_types_as_slice().iter().enumerate().find(fits).ok_or("no such memory")?;
            let info = vk::MemoryAllocateInfo::default().allocation_size(room.size).memory_type_index(index as u32);
            made.memory = device.allocate_memory(&info, None)?;
            device.bind_buffer_memory(buffer, made.memory, 0)?;
            if needs.kind != MemoryKind::Device {
                let flags = vk::MemoryMapFlags::empty();
                made.mapped = device.map_memory(made.memory, 0, vk::WHOLE_SIZE, flags)?.cast();
            }
            Ok(made)
        }
    }

    /// The whole buffer as softras takes it.
    fn whole(&self) -> BufferRef {
        // SAFETY: the buffer has this size and usage, and outlives the pass.
        unsafe { BufferRef::new(self.buffer, self.needs.size, self.needs.usage) }
    }

    fn bytes(&mut self) -> &mut [u8] {
        if self.mapped.is_null() {
            return &mut [];
        }
        // SAFETY: mapped for as long as self lives; the device uses it only between submission and wait.
        unsafe { std::slice::from_raw_parts_mut(self.mapped, self.needs.size as usize) }
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

/// softras on wgpu's device, and the functions to make buffers with.
fn rasterizer(device: &wgpu::Device) -> Outcome<(Rasterizer, impl Fn(MemoryRequirement) -> Outcome<Memory> + use<>)> {
    // SAFETY: the guard is dropped at once, the handles are not destroyed.
    let hal = unsafe { device.as_hal::<Vulkan>() }.ok_or("the device is not Vulkan's")?;
    let (shared, physical, raw) = (hal.shared_instance(), hal.raw_physical_device(), hal.raw_device().clone());
    let instance = shared.raw_instance().clone();
    let get_instance_proc_addr = shared.entry().static_fn().get_instance_proc_addr;
    // SAFETY: the handles are wgpu's, whose device outlives the rasterizer.
    let host = unsafe {
        let adapter = HostAdapter::new(get_instance_proc_addr, instance.handle(), physical);
        Requirements::new().validate(&adapter)?;
        HostDevice::new(adapter, raw.handle())
    };
    Ok((Rasterizer::new(&host)?, move |needs| Memory::new(&instance, physical, &raw, needs)))
}

/// Runs the example and returns the picture: RGBA, sRGB, row by row.
pub fn run(path: Option<&Path>, validation: bool) -> Outcome<Vec<u8>> {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::VULKAN;
    descriptor.flags = if validation { wgpu::InstanceFlags::VALIDATION } else { wgpu::InstanceFlags::empty() };
    let instance = wgpu::Instance::new(descriptor);
    let adapter = wait(instance.request_adapter(&wgpu::RequestAdapterOptions::default()))?;
    let (device, queue) = wait(adapter.request_device(&wgpu::DeviceDescriptor::default()))?;

    let (rasterizer, make) = rasterizer(&device)?;
    let torus = shapes::torus(0.75, 0.32, 48, 24)?;
    let mesh = PassMesh::new(torus.positions().len() as u32, torus.triangles().as_flattened());
    let view = look_at_mat4(DVec3::new(1.2, 1.8, 2.6), DVec3::ZERO, DVec3::Y);
    let projection = perspective(0.7, 1.0, 1.0, 100.0).to_cols_array_2d();
    let matrices = CameraMatrices { view: view.to_cols_array_2d(), projection };
    let plan = rasterizer
        .pass(&[mesh.with_look(MeshLook::Color([0.9, 0.35, 0.2]))])
        .settings(Settings { sigma: 1e-4, background: Background::Composite, ..Settings::default() })
        .image_size(SIZE, SIZE)
        .camera_matrices(&[matrices], ClipSpace { y_up: true, ..ClipSpace::default() })
        .lights(Lights::official())
        .alignment(device.limits().min_storage_buffer_offset_alignment.into())
        .build()?;
    let [upload, work, readback] = plan.memory().map(make);
    let (mut upload, work, mut readback) = (upload?, work?, readback?);
    // A vertex buffer of wgpu's, which softras reads in place.
    let vertices = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: None,
        contents: bytemuck::cast_slice(torus.positions()),
        usage: wgpu::BufferUsages::VERTEX | wgpu::BufferUsages::STORAGE,
    });
    // SAFETY: the buffer has this size and usage, and outlives the pass.
    let positions = unsafe {
        let raw = vertices.as_hal::<Vulkan>().ok_or("the buffer is not Vulkan's")?.raw_handle();
        BufferRef::new(raw, vertices.size(), vk::BufferUsageFlags::STORAGE_BUFFER)
    };
    let memory = PassMemory { upload: upload.whole(), device: work.whole(), readback: readback.whole(), own: &[] };
    let mesh = MeshBuffers::new(positions, Layout { stride: 12, offset: 0 });
    let pass = rasterizer.bind_pass(plan, memory, &[mesh])?;
    pass.write_inputs(upload.bytes())?;

    let picture = draw(&device, &queue, &pass, &work)?;
    if let PassStatus::Grow(capacity) = pass.status(readback.bytes())? {
        println!("a plan with {capacity:?} would be faster");
    }
    if let Some(path) = path {
        let mut encoder = png::Encoder::new(std::io::BufWriter::new(std::fs::File::create(path)?), SIZE, SIZE);
        encoder.set_color(png::ColorType::Rgba);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.write_header()?.write_image_data(&picture)?;
    }
    Ok(picture)
}

/// One submission: softras, a copy into a texture, a render pass that samples it, and a copy for the host to see.
fn draw(device: &wgpu::Device, queue: &wgpu::Queue, pass: &Pass, work: &Memory) -> Outcome<Vec<u8>> {
    // An encoder of its own for softras: wgpu does not know what is recorded into it.
    let mut softras = device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("softras") });
    // SAFETY: the command buffer is recording, outside a pass, of a queue that computes; the pass and its memory are kept
    // until the queue has been waited for below.
    unsafe {
        softras.as_hal_mut::<Vulkan, _, Outcome<()>>(|encoder| {
            let raw = encoder.ok_or("the encoder is not Vulkan's")?.raw_handle();
            let mut commands = HostCommands::new(raw);
            pass.record_setup(&mut commands)?;
            pass.record_forward(&mut commands)?;
            // The host reads the status behind the wait.
            let (from, to) = (vk::PipelineStageFlags::TRANSFER, vk::PipelineStageFlags::HOST);
            let status = vk::MemoryBarrier::default()
                .src_access_mask(vk::AccessFlags::TRANSFER_WRITE)
                .dst_access_mask(vk::AccessFlags::HOST_READ);
            work.device.cmd_pipeline_barrier(raw, from, to, vk::DependencyFlags::empty(), &[status], &[], &[]);
            Ok(())
        })?;
    }

    let descriptor = wgpu::BufferDescriptor {
        label: Some("softras"),
        size: work.needs.size,
        usage: wgpu::BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    };
    // SAFETY: the buffer is of this device, has the usage, is not empty, outlives wgpu's use of it and stays ours to
    // destroy. softras has written the part that is read.
    let frame = unsafe {
        let buffer = wgpu::hal::vulkan::Buffer::from_raw_externally_owned(work.buffer, Box::new(|| {}));
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
    let color = pass.buffer(PassBuffer::Color).ok_or("no colour")?;
    let from = wgpu::TexelCopyBufferInfo { buffer: &frame, layout: layout(color.offset(), 16) };
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
