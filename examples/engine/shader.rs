//! The engine's compute kernels and its one way of drawing: triangles in one colour onto an image.

use super::{Core, Engine, Image, Outcome};
use ash::vk;
use std::sync::Arc;

/// WGSL to SPIR-V.
fn compile(source: &str) -> Outcome<Vec<u32>> {
    let module = naga::front::wgsl::parse_str(source).map_err(|e| e.emit_to_string(source))?;
    let mut validator = naga::valid::Validator::new(naga::valid::ValidationFlags::all(), Default::default());
    let info = validator.validate(&module).map_err(|e| e.emit_to_string(source))?;
    let mut options = naga::back::spv::Options::default();
    // Clip space is Vulkan's own here, not WGSL's.
    options.flags.remove(naga::back::spv::WriterFlags::ADJUST_COORDINATE_SPACE);
    Ok(naga::back::spv::write_vec(&module, &info, &options, None)?)
}

fn create_module(core: &Core, source: &str) -> Outcome<vk::ShaderModule> {
    let words = compile(source)?;
    Ok(unsafe { core.device.create_shader_module(&vk::ShaderModuleCreateInfo::default().code(&words), None) }?)
}

/// A compute kernel `main` over storage buffers, bindings 0, 1, ... of group 0.
pub struct Compute {
    pipeline: vk::Pipeline,
    layout: vk::PipelineLayout,
    set_layout: vk::DescriptorSetLayout,
    pool: vk::DescriptorPool,
    core: Arc<Core>,
}

impl Compute {
    /// Compiles a kernel over `buffers` buffers, with room for `sets` descriptor sets.
    pub fn new(engine: &Engine, source: &str, buffers: u32, sets: u32) -> Outcome<Self> {
        let core = engine.core().clone();
        let device = &core.device;
        let binding = |binding| {
            vk::DescriptorSetLayoutBinding::default()
                .binding(binding)
                .descriptor_type(vk::DescriptorType::STORAGE_BUFFER)
                .descriptor_count(1)
                .stage_flags(vk::ShaderStageFlags::COMPUTE)
        };
        let bindings: Vec<_> = (0..buffers).map(binding).collect();
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        let set_layout = unsafe { device.create_descriptor_set_layout(&info, None) }?;
        let layouts = [set_layout];
        let info = vk::PipelineLayoutCreateInfo::default().set_layouts(&layouts);
        let layout = unsafe { device.create_pipeline_layout(&info, None) }?;
        let module = create_module(&core, source)?;
        let stage = vk::PipelineShaderStageCreateInfo::default()
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(module)
            .name(c"main");
        let info = [vk::ComputePipelineCreateInfo::default().stage(stage).layout(layout)];
        let made = unsafe { device.create_compute_pipelines(vk::PipelineCache::null(), &info, None) };
        unsafe { device.destroy_shader_module(module, None) };
        let pipeline = made.map_err(|(_, e)| e)?[0];
        let sizes =
            [vk::DescriptorPoolSize { ty: vk::DescriptorType::STORAGE_BUFFER, descriptor_count: buffers * sets }];
        let info = vk::DescriptorPoolCreateInfo::default().max_sets(sets).pool_sizes(&sizes);
        let pool = unsafe { device.create_descriptor_pool(&info, None) }?;
        Ok(Self { pipeline, layout, set_layout, pool, core })
    }

    /// A set of (buffer, offset, bytes).
    pub fn bind(&self, buffers: &[(vk::Buffer, u64, u64)]) -> Outcome<vk::DescriptorSet> {
        let device = &self.core.device;
        let layouts = [self.set_layout];
        let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(self.pool).set_layouts(&layouts);
        let set = unsafe { device.allocate_descriptor_sets(&info) }?[0];
        let info = |&(buffer, offset, range)| [vk::DescriptorBufferInfo { buffer, offset, range }];
        let infos: Vec<_> = buffers.iter().map(info).collect();
        let writes: Vec<_> = (0..)
            .zip(&infos)
            .map(|(binding, info)| {
                vk::WriteDescriptorSet::default()
                    .dst_set(set)
                    .dst_binding(binding)
                    .descriptor_type(vk::DescriptorType::STORAGE_BUFFER)
                    .buffer_info(info)
            })
            .collect();
        unsafe { device.update_descriptor_sets(&writes, &[]) };
        Ok(set)
    }

    pub fn dispatch(&self, commands: vk::CommandBuffer, set: vk::DescriptorSet, groups: u32) {
        let (device, point) = (&self.core.device, vk::PipelineBindPoint::COMPUTE);
        unsafe {
            device.cmd_bind_pipeline(commands, point, self.pipeline);
            device.cmd_bind_descriptor_sets(commands, point, self.layout, 0, &[set], &[]);
            device.cmd_dispatch(commands, groups, 1, 1);
        }
    }
}

impl Drop for Compute {
    fn drop(&mut self) {
        let device = &self.core.device;
        unsafe {
            device.destroy_pipeline(self.pipeline, None);
            device.destroy_pipeline_layout(self.layout, None);
            device.destroy_descriptor_pool(self.pool, None);
            device.destroy_descriptor_set_layout(self.set_layout, None);
        }
    }
}

/// Draws indexed triangles onto what an image already holds. Vertices begin with x, y, z.
pub struct Overlay {
    pipeline: vk::Pipeline,
    layout: vk::PipelineLayout,
    pass: vk::RenderPass,
    size: (u32, u32),
    core: Arc<Core>,
}

impl Overlay {
    pub fn new(engine: &Engine, source: &str, stride: u32, size: (u32, u32)) -> Outcome<Self> {
        let core = engine.core().clone();
        let pass = create_pass(&core)?;
        let device = &core.device;
        let layout = unsafe { device.create_pipeline_layout(&vk::PipelineLayoutCreateInfo::default(), None) }?;
        let module = create_module(&core, source)?;
        let stage = |stage, name| vk::PipelineShaderStageCreateInfo::default().stage(stage).module(module).name(name);
        let stages =
            [stage(vk::ShaderStageFlags::VERTEX, c"vertex"), stage(vk::ShaderStageFlags::FRAGMENT, c"fragment")];
        let bindings = [vk::VertexInputBindingDescription::default().stride(stride)];
        let attributes = [vk::VertexInputAttributeDescription::default().format(vk::Format::R32G32B32_SFLOAT)];
        let input = vk::PipelineVertexInputStateCreateInfo::default()
            .vertex_binding_descriptions(&bindings)
            .vertex_attribute_descriptions(&attributes);
        let assembly =
            vk::PipelineInputAssemblyStateCreateInfo::default().topology(vk::PrimitiveTopology::TRIANGLE_LIST);
        let viewports =
            [vk::Viewport { width: size.0 as f32, height: size.1 as f32, max_depth: 1.0, ..Default::default() }];
        let scissors = [area(size)];
        let viewport = vk::PipelineViewportStateCreateInfo::default().viewports(&viewports).scissors(&scissors);
        let raster = vk::PipelineRasterizationStateCreateInfo::default().line_width(1.0);
        let samples =
            vk::PipelineMultisampleStateCreateInfo::default().rasterization_samples(vk::SampleCountFlags::TYPE_1);
        let attachments =
            [vk::PipelineColorBlendAttachmentState::default().color_write_mask(vk::ColorComponentFlags::RGBA)];
        let blend = vk::PipelineColorBlendStateCreateInfo::default().attachments(&attachments);
        let info = [vk::GraphicsPipelineCreateInfo::default()
            .stages(&stages)
            .vertex_input_state(&input)
            .input_assembly_state(&assembly)
            .viewport_state(&viewport)
            .rasterization_state(&raster)
            .multisample_state(&samples)
            .color_blend_state(&blend)
            .layout(layout)
            .render_pass(pass)];
        let made = unsafe { device.create_graphics_pipelines(vk::PipelineCache::null(), &info, None) };
        unsafe { device.destroy_shader_module(module, None) };
        let pipeline = made.map_err(|(_, e)| e)?[0];
        Ok(Self { pipeline, layout, pass, size, core })
    }

    pub fn framebuffer(&self, image: &Image) -> Outcome<vk::Framebuffer> {
        let views = [image.view];
        let info = vk::FramebufferCreateInfo::default()
            .render_pass(self.pass)
            .attachments(&views)
            .width(self.size.0)
            .height(self.size.1)
            .layers(1);
        Ok(unsafe { self.core.device.create_framebuffer(&info, None) }?)
    }

    /// The image is in COLOR_ATTACHMENT_OPTIMAL before and after.
    pub fn draw(
        &self,
        commands: vk::CommandBuffer,
        framebuffer: vk::Framebuffer,
        vertices: (vk::Buffer, u64),
        indices: (vk::Buffer, u64, u32),
    ) {
        let device = &self.core.device;
        let info = vk::RenderPassBeginInfo::default()
            .render_pass(self.pass)
            .framebuffer(framebuffer)
            .render_area(area(self.size));
        unsafe {
            device.cmd_begin_render_pass(commands, &info, vk::SubpassContents::INLINE);
            device.cmd_bind_pipeline(commands, vk::PipelineBindPoint::GRAPHICS, self.pipeline);
            device.cmd_bind_vertex_buffers(commands, 0, &[vertices.0], &[vertices.1]);
            device.cmd_bind_index_buffer(commands, indices.0, indices.1, vk::IndexType::UINT32);
            device.cmd_draw_indexed(commands, indices.2, 1, 0, 0, 0);
            device.cmd_end_render_pass(commands);
        }
    }

    pub fn destroy_framebuffer(&self, framebuffer: vk::Framebuffer) {
        unsafe { self.core.device.destroy_framebuffer(framebuffer, None) };
    }
}

impl Drop for Overlay {
    fn drop(&mut self) {
        unsafe {
            self.core.device.destroy_pipeline(self.pipeline, None);
            self.core.device.destroy_pipeline_layout(self.layout, None);
            self.core.device.destroy_render_pass(self.pass, None);
        }
    }
}

fn area((width, height): (u32, u32)) -> vk::Rect2D {
    vk::Rect2D { offset: vk::Offset2D::default(), extent: vk::Extent2D { width, height } }
}

fn create_pass(core: &Core) -> Outcome<vk::RenderPass> {
    let layout = vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL;
    let attachments = [vk::AttachmentDescription::default()
        .format(vk::Format::R32G32B32A32_SFLOAT)
        .samples(vk::SampleCountFlags::TYPE_1)
        .load_op(vk::AttachmentLoadOp::LOAD)
        .store_op(vk::AttachmentStoreOp::STORE)
        .initial_layout(layout)
        .final_layout(layout)];
    let colors = [vk::AttachmentReference { attachment: 0, layout }];
    let subpasses = [vk::SubpassDescription::default()
        .pipeline_bind_point(vk::PipelineBindPoint::GRAPHICS)
        .color_attachments(&colors)];
    let info = vk::RenderPassCreateInfo::default().attachments(&attachments).subpasses(&subpasses);
    Ok(unsafe { core.device.create_render_pass(&info, None) }?)
}
