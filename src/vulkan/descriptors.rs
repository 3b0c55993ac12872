//! Descriptor sets: buffers and images bound to a kernel's bindings by name.

use super::buffer_desc::{TexelFormat, limit_error};
use super::buffer_part::BufferPart;
use super::device::Device;
use super::host_memory::{ImageRef, TextureRef};
use super::keep::{Keep, Kept};
use super::kernel::{Binding, BindingKind, Kernel};
use super::pipeline::{self, Pipeline};
use super::result::Named;
use crate::Result;
use ash::vk;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

const CALL: &str = "vkUpdateDescriptorSets";

/// Room for one descriptor set for each kernel of a list. Room once used is free again only with the whole pool.
#[derive(Clone)]
pub struct DescriptorPool(Arc<Pool>);

struct Pool {
    device: Device,
    raw: vk::DescriptorPool,
    /// Only one thread at a time may allocate from the pool.
    lock: Mutex<()>,
}

/// The buffers that a kernel works on. Keeps them, and its pool, alive. Cheap to clone.
#[derive(Clone)]
pub struct DescriptorSet(Arc<Set>);

pub(super) struct Set {
    raw: vk::DescriptorSet,
    kernel: &'static Kernel,
    pool: Arc<Pool>,
    _layout: Arc<pipeline::PipelineInner>,
    #[cfg_attr(not(feature = "renderer"), expect(dead_code, reason = "it only keeps the buffers"))]
    buffers: Vec<Keep>,
}

impl Kept for Set {
    #[cfg(feature = "renderer")]
    fn uses(&self, uses: &mut super::keep::Uses) {
        self.buffers.iter().for_each(|buffer| buffer.uses(uses));
    }
}

impl DescriptorPool {
    /// Makes room for one set for each kernel; name a kernel as often as it is bound.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`], [`crate::Error::OutOfMemory`].
    pub fn new(device: &Device, kernels: &[&'static Kernel]) -> Result<Self> {
        let mut counts = BTreeMap::new();
        for binding in kernels.iter().flat_map(|k| k.bindings) {
            *counts.entry(binding.kind.descriptor_type()).or_insert(0) += 1;
        }
        // A pool without any descriptor is invalid, and a kernel without bindings is not.
        if counts.is_empty() {
            counts.insert(vk::DescriptorType::STORAGE_BUFFER, 1);
        }
        let sizes: Vec<_> =
            counts.into_iter().map(|(ty, descriptor_count)| vk::DescriptorPoolSize { ty, descriptor_count }).collect();
        let sets = kernels.len().max(1) as u32;
        let info = vk::DescriptorPoolCreateInfo::default().max_sets(sets).pool_sizes(&sizes);
        // SAFETY: the info's pointers live until the call returns; no count is zero.
        let raw = unsafe { device.raw().create_descriptor_pool(&info, device.callbacks()) }
            .named("vkCreateDescriptorPool")?;
        device.name_object(raw, "descriptors");
        Ok(Self(Arc::new(Pool { device: device.clone(), raw, lock: Mutex::new(()) })))
    }

    /// Binds buffers to the kernel's bindings by their names: each exactly once, none else.
    ///
    /// The set also serves every other pipeline of the same kernel.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`] naming the binding that is missing, unknown or given twice, and the buffer that is of another
    /// device, has no fitting usage or texels, or is misaligned; [`crate::Error::Limit`].
    pub fn bind(&self, pipeline: &Pipeline, buffers: &[(&str, &BufferPart)]) -> Result<DescriptorSet> {
        let resources: Vec<_> = buffers.iter().map(|&(name, buffer)| (name, Resource::Buffer(buffer))).collect();
        self.bind_resources(pipeline, &resources)
    }

    /// Binds buffers as [`bind`](Self::bind) does, and the image that the kernel stores to.
    ///
    /// # Errors
    /// As [`bind`](Self::bind), and for an image of another format.
    pub fn bind_with_image(
        &self,
        pipeline: &Pipeline,
        buffers: &[(&str, &BufferPart)],
        image: (&str, &ImageRef),
    ) -> Result<DescriptorSet> {
        let buffers = buffers.iter().map(|&(name, buffer)| (name, Resource::Buffer(buffer)));
        let resources: Vec<_> = buffers.chain([(image.0, Resource::Image(image.1))]).collect();
        self.bind_resources(pipeline, &resources)
    }

    /// Binds buffers as [`bind`](Self::bind) does, and the image that the kernel reads.
    pub fn bind_with_texture(
        &self,
        pipeline: &Pipeline,
        buffers: &[(&str, &BufferPart)],
        texture: (&str, &TextureRef),
    ) -> Result<DescriptorSet> {
        let buffers = buffers.iter().map(|&(name, buffer)| (name, Resource::Buffer(buffer)));
        let resources: Vec<_> = buffers.chain([(texture.0, Resource::Texture(texture.1))]).collect();
        self.bind_resources(pipeline, &resources)
    }

    fn bind_resources(&self, pipeline: &Pipeline, resources: &[(&str, Resource<'_>)]) -> Result<DescriptorSet> {
        let kernel = pipeline.kernel();
        let device = &self.0.device;
        if pipeline.inner().device().raw().handle() != device.raw().handle() {
            return Err(kernel.misuse(CALL, "pipeline and descriptor pool are of different devices"));
        }
        let matched = match_names(kernel, resources)?;
        for (binding, resource) in &matched {
            match resource {
                Resource::Buffer(buffer) => check_buffer(device, kernel, binding, buffer)?,
                Resource::Image(image) => check_image(kernel, binding, image)?,
                Resource::Texture(texture) => check_texture(kernel, binding, texture)?,
            }
        }
        let raw = self.0.allocate(pipeline.inner().set_layout())?;
        // Mesa's lavapipe never frees the name of a set, and a renderer makes sets for each new size of its images.
        if !device.is_lavapipe() {
            device.name_object(raw, kernel.name);
        }
        // SAFETY: the set was just allocated with this kernel's layout; what it points to is kept below, or by the host
        // (`BufferRef::new`, `ImageRef::new`, `TextureRef::new`).
        unsafe { write(device, raw, &matched) };
        let keep = |resource: &Resource<'_>| match resource {
            Resource::Buffer(buffer) => buffer.keep.clone(),
            Resource::Image(_) | Resource::Texture(_) => None,
        };
        let keeps = matched.iter().filter_map(|(_, resource)| keep(resource)).collect();
        let (pool, layout) = (self.0.clone(), pipeline.inner().clone());
        Ok(DescriptorSet(Arc::new(Set { raw, kernel, pool, _layout: layout, buffers: keeps })))
    }
}

/// The resource that a binding is given.
#[derive(Clone, Copy)]
enum Resource<'a> {
    Buffer(&'a BufferPart),
    Image(&'a ImageRef),
    Texture(&'a TextureRef),
}

impl DescriptorSet {
    /// The kernel whose bindings it fills.
    pub fn kernel(&self) -> &'static Kernel {
        self.0.kernel
    }

    pub(super) fn inner(&self) -> &Arc<Set> {
        &self.0
    }
}

impl Set {
    pub(super) fn raw(&self) -> vk::DescriptorSet {
        self.raw
    }

    pub(super) fn device(&self) -> &Device {
        &self.pool.device
    }
}

impl std::fmt::Debug for DescriptorPool {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "DescriptorPool({:?})", self.0.raw)
    }
}

impl std::fmt::Debug for DescriptorSet {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "DescriptorSet({})", self.0.kernel.name)
    }
}

impl Pool {
    fn allocate(&self, layout: vk::DescriptorSetLayout) -> Result<vk::DescriptorSet> {
        let layouts = [layout];
        let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(self.raw).set_layouts(&layouts);
        let _guard = self.lock.lock().unwrap_or_else(PoisonError::into_inner);
        // SAFETY: pool and layout live, and the lock keeps other threads out of the pool.
        let sets = unsafe { self.device.raw().allocate_descriptor_sets(&info) }.named("vkAllocateDescriptorSets")?;
        sets.first().copied().ok_or(vk::Result::ERROR_OUT_OF_POOL_MEMORY).named("vkAllocateDescriptorSets")
    }
}

impl Drop for Pool {
    fn drop(&mut self) {
        // SAFETY: every set holds the pool, and what recorded a set held the set; so the device is done with all.
        unsafe { self.device.raw().destroy_descriptor_pool(self.raw, self.device.callbacks()) };
    }
}

/// Each binding with its resource, or an error that names what is missing, unknown or given twice.
fn match_names<'a>(
    kernel: &'static Kernel,
    resources: &[(&str, Resource<'a>)],
) -> Result<Vec<(&'static Binding, Resource<'a>)>> {
    if let Some((name, _)) = resources.iter().find(|(name, _)| kernel.binding(name).is_none()) {
        let known: Vec<_> = kernel.bindings.iter().map(|b| b.name).collect();
        return Err(kernel.misuse(CALL, &format!("there is no binding `{name}`, only {}", known.join(", "))));
    }
    let find = |binding: &'static Binding| {
        let mut given = resources.iter().filter(|(name, _)| *name == binding.name);
        match (given.next(), given.next()) {
            (Some((_, resource)), None) => Ok((binding, *resource)),
            (None, _) => Err(kernel.misuse(CALL, &format!("binding `{}` has no buffer", binding.name))),
            _ => Err(kernel.misuse(CALL, &format!("binding `{}` is given twice", binding.name))),
        }
    };
    kernel.bindings.iter().map(find).collect()
}

/// Checks that the device can bind this part of a buffer in this way.
fn check_buffer(device: &Device, kernel: &Kernel, binding: &Binding, buffer: &BufferPart) -> Result<()> {
    let limits = device.limits();
    let fail = |what: &str| Err(kernel.misuse(CALL, &format!("binding `{}`: {what}", binding.name)));
    if buffer.raw() == vk::Buffer::null() {
        return fail("the buffer is null");
    }
    if !buffer.is_of(device) {
        return fail("the buffer is of another device");
    }
    let (alignment, limit, limit_name) = match binding.kind {
        BindingKind::StorageBuffer => {
            (limits.storage_offset_alignment, limits.max_storage_buffer_range, "maxStorageBufferRange")
        }
        BindingKind::StorageImage(_) | BindingKind::SampledImage => {
            return fail("it is an image, and was given a buffer");
        }
        BindingKind::UniformTexelBufferFloat
        | BindingKind::UniformTexelBufferInt
        | BindingKind::UniformTexelBufferUint => {
            return match buffer.view() {
                None => fail("it is read as texels, and the buffer has no texel view"),
                Some((_, format)) if texels_of(format) == binding.kind => Ok(()),
                Some((_, format)) => fail(&format!("it is {:?}, and the buffer's texels are {format:?}", binding.kind)),
            };
        }
    };
    if !buffer.usage().contains(binding.kind.buffer_usage()) {
        return fail(&format!("the buffer was made without the usage {:?}", binding.kind.buffer_usage()));
    }
    if !buffer.offset().is_multiple_of(alignment.max(1)) {
        return fail(&format!("offset {} is no multiple of the device's {alignment}", buffer.offset()));
    }
    if buffer.range() == 0 {
        return fail("it is empty, and Vulkan binds no empty range");
    }
    limit_error(binding.name, buffer.range(), "bytes", limit_name, limit)
}

/// The binding that reads texels of a format: the kernel's type must be the format's.
fn texels_of(format: TexelFormat) -> BindingKind {
    match format {
        TexelFormat::Float | TexelFormat::Float2 | TexelFormat::Float4 => BindingKind::UniformTexelBufferFloat,
        TexelFormat::Uint | TexelFormat::Uint2 | TexelFormat::Uint4 => BindingKind::UniformTexelBufferUint,
        TexelFormat::Int | TexelFormat::Int4 => BindingKind::UniformTexelBufferInt,
    }
}

/// Checks that the image is what the kernel stores to.
fn check_image(kernel: &Kernel, binding: &Binding, image: &ImageRef) -> Result<()> {
    let fail = |what: String| Err(kernel.misuse(CALL, &format!("binding `{}`: {what}", binding.name)));
    match binding.kind {
        _ if image.raw() == vk::ImageView::null() => fail("the image view is null".into()),
        BindingKind::StorageImage(format) if format == image.format() => Ok(()),
        BindingKind::StorageImage(format) => fail(format!("the image is {:?}, not {format:?}", image.format())),
        _ => fail("it is a buffer, and was given an image".into()),
    }
}

/// Checks that the binding is one of an image that the kernel reads.
fn check_texture(kernel: &Kernel, binding: &Binding, texture: &TextureRef) -> Result<()> {
    let fail = |what: &str| Err(kernel.misuse(CALL, &format!("binding `{}`: {what}", binding.name)));
    match binding.kind {
        _ if texture.raw() == vk::ImageView::null() => fail("the image view is null"),
        BindingKind::SampledImage => Ok(()),
        _ => fail("it is no image to be read, and was given one"),
    }
}

/// The Vulkan structures that one descriptor points to.
#[derive(Clone, Copy, Default)]
struct Info {
    buffer: [vk::DescriptorBufferInfo; 1],
    view: [vk::BufferView; 1],
    image: [vk::DescriptorImageInfo; 1],
}

impl Info {
    fn of(resource: &Resource<'_>) -> Self {
        match resource {
            Resource::Buffer(b) => Self {
                buffer: [vk::DescriptorBufferInfo { buffer: b.raw(), offset: b.offset(), range: b.range() }],
                view: [b.view().map_or(vk::BufferView::null(), |(view, _)| view)],
                ..Self::default()
            },
            Resource::Image(image) => {
                let (image_view, image_layout) = (image.raw(), vk::ImageLayout::GENERAL);
                let image = [vk::DescriptorImageInfo { image_view, image_layout, ..Default::default() }];
                Self { image, ..Self::default() }
            }
            Resource::Texture(texture) => {
                let (image_view, image_layout) = (texture.raw(), texture.layout());
                let image = [vk::DescriptorImageInfo { image_view, image_layout, ..Default::default() }];
                Self { image, ..Self::default() }
            }
        }
    }
}

/// # Safety
/// The set is of the layout with these bindings and not in use; buffers and images live as long as it is used.
unsafe fn write(device: &Device, set: vk::DescriptorSet, matched: &[(&Binding, Resource<'_>)]) {
    let infos: Vec<_> = matched.iter().map(|(_, resource)| Info::of(resource)).collect();
    let writes: Vec<_> = matched
        .iter()
        .zip(&infos)
        .map(|((binding, _), info)| {
            let write = vk::WriteDescriptorSet::default()
                .dst_set(set)
                .dst_binding(binding.binding)
                .descriptor_type(binding.kind.descriptor_type());
            match binding.kind {
                BindingKind::StorageBuffer => write.buffer_info(&info.buffer),
                BindingKind::StorageImage(_) | BindingKind::SampledImage => write.image_info(&info.image),
                _ => write.texel_buffer_view(&info.view),
            }
        })
        .collect();
    // SAFETY: the caller's promise; `infos` live until the call returns.
    unsafe { device.raw().update_descriptor_sets(&writes, &[]) };
}
