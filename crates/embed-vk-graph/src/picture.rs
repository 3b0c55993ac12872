//! softras' image among the engine's own geometry, by depth.

use super::Outcome;
use super::engine::{Engine, Mesh, Soft, shader};
use softras::Lights;
use softras::embed::{CameraMatrices, ClipSpace, FrameImage, ImageBindings, ImageFormat, ImageRef, MeshBuffers};
use softras::glam::DVec3;
use softras::glam::dcamera::rh::{proj::vulkan::perspective_infinite_reverse, view::look_at_mat4};
use softras::scene::Outputs;
use std::path::Path;
use std::sync::Arc;
use vk_graph::Graph;
use vk_graph::cmd::{LoadOp, StoreOp};
use vk_graph::driver::ash::vk;
use vk_graph::driver::buffer::Buffer;
use vk_graph::driver::graphics::{BlendInfo, DepthStencilInfo, GraphicsPipeline, GraphicsPipelineInfo};
use vk_graph::driver::image::{Image, ImageInfo};
use vk_graph::driver::sync::AccessType;

/// Pixels along an edge.
const SIZE: u32 = 384;

fn image(engine: &Engine, format: vk::Format, usage: vk::ImageUsageFlags) -> Outcome<Arc<Image>> {
    Ok(Arc::new(Image::create(&engine.device, ImageInfo::image_2d(SIZE, SIZE, format, usage))?))
}

pub struct Picture {
    soft: Soft,
    /// softras' image and depth, and the bindings that store them.
    color: Arc<Image>,
    depth: Arc<Image>,
    stored: Arc<[ImageBindings; 2]>,
    triangle: GraphicsPipeline,
    composite: GraphicsPipeline,
    pixels: Arc<Buffer>,
    world_to_clip: [f32; 16],
}

impl Picture {
    pub fn new(engine: &mut Engine, mesh: &Mesh) -> Outcome<Self> {
        // The engine's own camera: right-handed, y down in clip space, depth reversed and without a far plane.
        let view = look_at_mat4(DVec3::new(1.7, 0.9, -2.3), DVec3::ZERO, DVec3::Y);
        let projection = perspective_infinite_reverse(0.75, 1.0, 1.0);
        let matrices = CameraMatrices { view: view.to_cols_array_2d(), projection: projection.to_cols_array_2d() };
        let plan = engine.rasterizer.pass(std::slice::from_ref(&mesh.shape)).settings(super::settings(SIZE, 1.0));
        let plan = plan.camera_matrices(&[matrices], ClipSpace::default()).lights(Lights::official());
        let plan = plan.outputs(Outputs { normal: false, ..Outputs::ALL });
        let soft = engine.bind(plan.build()?, &MeshBuffers { gradients: Default::default(), ..mesh.buffers() })?;

        let usage = vk::ImageUsageFlags::STORAGE | vk::ImageUsageFlags::SAMPLED;
        let color = image(engine, vk::Format::R16G16B16A16_SFLOAT, usage)?;
        let depth = image(engine, vk::Format::R32_SFLOAT, usage)?;
        let bind = |what, image: &Image, format| -> Outcome<_> {
            let view = image.view(image.info.into_image_view())?;
            // SAFETY: the view is of the image, which lives as long as the bindings and has the usage STORAGE.
            let target = unsafe { ImageRef::new(view, format, SIZE, SIZE) };
            Ok(soft.pass.bind_image(what, 0, &target)?)
        };
        let foreground = FrameImage::Foreground { premultiplied: true, srgb: false };
        let depth_buffer = FrameImage::DepthBuffer { least_silhouette: 0.01 };
        let stored =
            [bind(foreground, &color, ImageFormat::Rgba16Float)?, bind(depth_buffer, &depth, ImageFormat::R32Float)?];

        let info = || GraphicsPipelineInfo::builder().cull_mode(vk::CullModeFlags::NONE);
        let over = BlendInfo {
            blend_enable: true,
            src_color_blend_factor: vk::BlendFactor::ONE,
            dst_color_blend_factor: vk::BlendFactor::ONE_MINUS_SRC_ALPHA,
            src_alpha_blend_factor: vk::BlendFactor::ONE,
            dst_alpha_blend_factor: vk::BlendFactor::ONE_MINUS_SRC_ALPHA,
            ..BlendInfo::REPLACE
        };
        let pipeline = |info, shaders: [&[u8]; 2]| GraphicsPipeline::create(&engine.device, info, shaders);
        Ok(Self {
            triangle: pipeline(info().build(), [shader!("triangle.vert"), shader!("triangle.frag")])?,
            composite: pipeline(info().blend(over).build(), [shader!("composite.vert"), shader!("composite.frag")])?,
            pixels: engine.upload(vk::BufferUsageFlags::TRANSFER_DST, &vec![0; 4 * (SIZE * SIZE) as usize])?,
            world_to_clip: (projection * view).as_mat4().to_cols_array(),
            stored: Arc::new(stored),
            soft,
            color,
            depth,
        })
    }

    /// One graph: softras' frame into images, the engine's triangle, softras' image over it where it is nearer.
    pub fn draw(&self, engine: &mut Engine, mesh: &Mesh, path: &Path) -> Outcome<()> {
        use AccessType::{
            ComputeShaderReadOther, ComputeShaderReadWrite, ComputeShaderWrite,
            FragmentShaderReadSampledImageOrUniformTexelBuffer as FragmentShaderSample,
        };
        let mut graph = Graph::default();
        let (frame, vertices) = (graph.bind_resource(&self.soft.device), graph.bind_resource(&mesh.vertices));
        let (color, depth) = (graph.bind_resource(&self.color), graph.bind_resource(&self.depth));
        let stored = self.stored.clone();
        graph
            .begin_cmd()
            .debug_name("softras picture")
            .resource_access(frame, ComputeShaderReadWrite)
            .resource_access(vertices, ComputeShaderReadOther)
            .resource_access(color, ComputeShaderWrite)
            .resource_access(depth, ComputeShaderWrite)
            .record_cmd(engine.record(&self.soft.pass, move |pass, commands| {
                pass.record_forward(commands)?;
                stored.iter().try_for_each(|image| pass.record_store(commands, image))
            }));

        let usage = vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::TRANSFER_SRC;
        let target = graph.bind_resource(image(engine, vk::Format::R8G8B8A8_SRGB, usage)?);
        let usage = vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT;
        let z = graph.bind_resource(image(engine, vk::Format::D32_SFLOAT, usage)?);
        let world_to_clip = self.world_to_clip;
        graph
            .begin_cmd()
            .debug_name("triangle")
            .bind_pipeline(&self.triangle)
            .depth_stencil(DepthStencilInfo::DEPTH_WRITE_GREATER)
            .color_attachment_image(0, target, LoadOp::clear_rgba(0.02, 0.04, 0.1, 1.0), StoreOp::Store)
            .depth_stencil_attachment_image(z, LoadOp::CLEAR_ZERO_STENCIL_ZERO, StoreOp::Store)
            .record_cmd(move |cmd| {
                cmd.push_constants(0, bytemuck::cast_slice(&world_to_clip)).draw(3, 1, 0, 0);
            });
        graph
            .begin_cmd()
            .debug_name("composite")
            .bind_pipeline(&self.composite)
            .depth_stencil(DepthStencilInfo::DEPTH_WRITE_GREATER)
            .shader_resource_access(0, color, FragmentShaderSample)
            .shader_resource_access(1, depth, FragmentShaderSample)
            .color_attachment_image(0, target, LoadOp::Load, StoreOp::Store)
            .depth_stencil_attachment_image(z, LoadOp::Load, StoreOp::Store)
            .record_cmd(|cmd| {
                cmd.draw(3, 1, 0, 0);
            });
        let pixels = graph.bind_resource(&self.pixels);
        graph.copy_image_to_buffer(target, pixels);
        graph.begin_cmd().resource_access(pixels, AccessType::HostRead).record_cmd(|_| ());
        engine.submit(graph, true)?;
        self.save(path)
    }

    fn save(&self, path: &Path) -> Outcome<()> {
        let mut encoder = png::Encoder::new(std::io::BufWriter::new(std::fs::File::create(path)?), SIZE, SIZE);
        encoder.set_color(png::ColorType::Rgba);
        encoder.set_depth(png::BitDepth::Eight);
        Ok(encoder.write_header()?.write_image_data(self.pixels.mapped_slice())?)
    }
}
