//! The buffers of a frame by name: who fills them, and how the kernels read them.

use crate::embed::{BufferRequirement, Parts};
use crate::error::{Error, Result};
use crate::frame::plan::BufferSizes;
use crate::vulkan::{Buffer, BufferDesc, BufferPart, Context, Location, SharedBuffer, TexelFormat, kernels, vk};
use std::sync::OnceLock;

/// Who fills a buffer, and with that where its memory had best lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The host, before the frame: device-local memory that is copied into or, where the device's memory is the host's own,
    /// mapped. A host's kernels may fill it as well.
    Input,
    /// One stage for the next: device-local memory, never mapped. Its content means nothing outside a frame.
    Workspace,
    /// The kernels, for the host: device-local memory that is copied from, or mapped as above.
    Output,
}

/// A buffer that kernels bind by `name`.
#[derive(Clone, Copy, Debug)]
pub struct Slot {
    /// As in the kernels: `bin_ranges` is the texel buffer and, written, the block `BinRanges`.
    pub name: &'static str,
    /// What an element is to the kernels that read it.
    pub format: TexelFormat,
    /// Who fills it.
    pub role: Role,
}

const fn slot(name: &'static str, format: TexelFormat, role: Role) -> Slot {
    Slot { name, format, role }
}

/// Bound wherever a kernel has a binding that a frame does not use.
pub const UNUSED: Slot = slot("unused", TexelFormat::Float, Role::Workspace);

/// Bytes of [`UNUSED`]: one texel of any format.
pub const UNUSED_SIZE: u64 = 16;

/// Every buffer of a forward frame.
pub const FORWARD: [Slot; 34] = [
    slot("view_shapes", TexelFormat::Uint4, Role::Input),
    slot("view_cameras", TexelFormat::Float4, Role::Input),
    slot("positions", TexelFormat::Float, Role::Input),
    slot("indices", TexelFormat::Uint, Role::Input),
    slot("adjacency", TexelFormat::Uint, Role::Input),
    slot("lights", TexelFormat::Float4, Role::Input),
    slot("colors", TexelFormat::Float, Role::Input),
    slot("uvs", TexelFormat::Float, Role::Input),
    slot("uv_indices", TexelFormat::Uint, Role::Input),
    slot("triangle_textures", TexelFormat::Uint, Role::Input),
    slot("textures", TexelFormat::Uint4, Role::Input),
    slot("texels", TexelFormat::Float4, Role::Input),
    slot("vertices", TexelFormat::Float4, Role::Workspace),
    slot("vertex_shading", TexelFormat::Float4, Role::Workspace),
    slot("geometry", TexelFormat::Float4, Role::Workspace),
    slot("shading", TexelFormat::Float4, Role::Workspace),
    slot("boxes", TexelFormat::Int4, Role::Workspace),
    slot("bin_bits", TexelFormat::Uint, Role::Workspace),
    slot("bin_ranges", TexelFormat::Uint2, Role::Workspace),
    slot("coarse_slots", TexelFormat::Uint, Role::Workspace),
    slot("coarse_words", TexelFormat::Uint, Role::Workspace),
    slot("tile_items", TexelFormat::Uint4, Role::Workspace),
    slot("tile_counts", TexelFormat::Uint, Role::Workspace),
    slot("tile_marks", TexelFormat::Uint, Role::Workspace),
    slot("tile_slots", TexelFormat::Uint, Role::Workspace),
    slot("status", TexelFormat::Uint, Role::Output),
    slot("color", TexelFormat::Float4, Role::Output),
    slot("silhouette", TexelFormat::Float, Role::Output),
    slot("depths", TexelFormat::Float, Role::Output),
    slot("normals", TexelFormat::Float4, Role::Output),
    slot("saved", TexelFormat::Float4, Role::Workspace),
    slot("tile_bounds", TexelFormat::Float2, Role::Workspace),
    slot("cell_ranges", TexelFormat::Uint2, Role::Workspace),
    slot("cells", TexelFormat::Uint2, Role::Workspace),
];

/// Every buffer that a backward pass adds.
pub const BACKWARD: [Slot; 18] = [
    slot("upstream_color", TexelFormat::Float4, Role::Input),
    slot("upstream_silhouette", TexelFormat::Float, Role::Input),
    slot("upstream_depths", TexelFormat::Float, Role::Input),
    slot("upstream_normals", TexelFormat::Float4, Role::Input),
    slot("pixel_gradients", TexelFormat::Float4, Role::Workspace),
    slot("pixel_sums", TexelFormat::Float4, Role::Workspace),
    slot("shown_items", TexelFormat::Uint4, Role::Workspace),
    slot("outline_items", TexelFormat::Uint4, Role::Workspace),
    slot("item_counts", TexelFormat::Uint, Role::Workspace),
    slot("partials", TexelFormat::Float4, Role::Workspace),
    slot("corner_lights", TexelFormat::Float4, Role::Workspace),
    slot("light_records", TexelFormat::Float4, Role::Workspace),
    slot("area_gradients", TexelFormat::Float4, Role::Workspace),
    slot("view_sums", TexelFormat::Float4, Role::Workspace),
    slot("corner_gradients", TexelFormat::Float4, Role::Output),
    slot("vertex_gradients", TexelFormat::Float4, Role::Output),
    slot("texel_sums", TexelFormat::Uint, Role::Output),
    // Three texels for each view, then for each light, then for the pixels.
    slot("totals", TexelFormat::Float4, Role::Output),
];

/// Bytes that a plan gives to a buffer that the device fills.
pub fn planned_size(sizes: &BufferSizes, name: &str) -> u64 {
    match name {
        "vertices" => sizes.vertices,
        "vertex_shading" => sizes.vertex_shading,
        "geometry" => sizes.geometry,
        "shading" => sizes.shading,
        "boxes" => sizes.boxes,
        "bin_bits" => sizes.bin_bits,
        "bin_ranges" => sizes.bin_ranges,
        "coarse_slots" => sizes.coarse_slots,
        "coarse_words" => sizes.coarse_words,
        "tile_slots" => sizes.tile_slots,
        "tile_items" => sizes.tile_items,
        "tile_counts" => sizes.tile_counts,
        "tile_marks" => sizes.tile_marks,
        "status" => sizes.status,
        "color" => sizes.color,
        "silhouette" => sizes.silhouette,
        "depths" => sizes.depths,
        "normals" => sizes.normals,
        "saved" => sizes.saved,
        "tile_bounds" => sizes.tile_bounds,
        "cell_ranges" => sizes.cell_ranges,
        "cells" => sizes.cells,
        _ => 0,
    }
}

/// How softras uses a buffer, from what the kernels bind.
pub fn usage_of(name: &str) -> vk::BufferUsageFlags {
    type Usages = Vec<(String, vk::BufferUsageFlags)>;
    static USAGES: OnceLock<Usages> = OnceLock::new();
    let usages = USAGES.get_or_init(|| {
        let bindings = kernels::ALL.iter().flat_map(|kernel| kernel.bindings);
        bindings.map(|b| (buffer_of_binding(b.name), b.kind.buffer_usage())).collect()
    });
    use vk::BufferUsageFlags as U;
    let by_us = match name {
        "status" => U::TRANSFER_DST,
        "bin_bits" | "texel_sums" => U::TRANSFER_SRC | U::TRANSFER_DST,
        // Cleared where only the device knows how many triangles there are.
        "corner_gradients" | "light_records" => U::TRANSFER_DST,
        // Written from a host's geometry, and stored into a host's images.
        "positions" | "colors" => U::STORAGE_BUFFER,
        "color" | "silhouette" | "depths" | "normals" => U::UNIFORM_TEXEL_BUFFER,
        "item_counts" | "tile_counts" => U::TRANSFER_DST | U::INDIRECT_BUFFER,
        "unused" => U::STORAGE_BUFFER | U::UNIFORM_TEXEL_BUFFER,
        _ => U::empty(),
    };
    // What several stages do to one buffer each has one name in their kernel (`passes::buffer_of_stage`).
    let shared = match name {
        "shown_items" | "outline_items" => "items",
        "light_records" | "pixel_sums" | "view_sums" => "rows",
        _ => name,
    };
    usages.iter().filter(|(n, _)| n == name || n == shared).fold(by_us, |all, (_, usage)| all | *usage)
}

/// The name of a buffer from that of a binding: `bin_ranges`, or the block `BinRanges`.
pub fn buffer_of_binding(binding: &str) -> String {
    let mut name = String::with_capacity(binding.len() + 2);
    for (i, letter) in binding.chars().enumerate() {
        if letter.is_ascii_uppercase() && i > 0 {
            name.push('_');
        }
        name.push(letter.to_ascii_lowercase());
    }
    name
}

fn missing(name: &str) -> Error {
    Error::Vulkan { call: "buffer access", result: format!("there is no buffer `{name}` that the host reaches") }
}

/// One buffer of our own.
#[derive(Debug)]
enum Owned {
    Shared(SharedBuffer),
    Device(Buffer),
}

/// Buffers of our own, one for each [`Slot`], that grow when a frame needs more.
#[derive(Debug, Default)]
pub struct BufferSet {
    owned: Vec<(Slot, Owned)>,
}

impl BufferSet {
    /// A buffer's reference for descriptors.
    pub fn get(&self, name: &str) -> Option<&BufferPart> {
        self.find(name).map(|owned| match owned {
            Owned::Shared(buffer) => buffer.whole(),
            Owned::Device(buffer) => buffer.whole(),
        })
    }

    fn find(&self, name: &str) -> Option<&Owned> {
        self.owned.iter().find(|(slot, _)| slot.name == name).map(|(_, owned)| owned)
    }

    /// Makes room for `size` bytes; true when the buffer is a new one, so that descriptors must be written again.
    ///
    /// # Errors
    /// [`crate::Error::Limit`] or [`crate::Error::OutOfMemory`] when it cannot be had; the set is then unchanged.
    pub fn reserve(&mut self, context: &Context, slot: Slot, size: u64) -> Result<bool> {
        let held = match self.find(slot.name) {
            Some(Owned::Shared(buffer)) => buffer.buffer().size(),
            Some(Owned::Device(buffer)) => buffer.size(),
            None => 0,
        };
        if held >= size.max(1) {
            return Ok(false);
        }
        let desc = BufferDesc {
            name: slot.name,
            size,
            usage: vk::BufferUsageFlags::STORAGE_BUFFER | vk::BufferUsageFlags::INDIRECT_BUFFER,
            location: Location::Device,
            texels: Some(slot.format),
        };
        // The old one goes first, so that growing does not need room for both.
        self.owned.retain(|(s, _)| s.name != slot.name);
        let owned = match slot.role {
            Role::Input => Owned::Shared(SharedBuffer::for_upload(context, &desc)?),
            Role::Output => Owned::Shared(SharedBuffer::for_download(context, &desc)?),
            Role::Workspace => Owned::Device(Buffer::new(context, &desc)?),
        };
        self.owned.push((slot, owned));
        Ok(true)
    }

    /// Every buffer that the host and the device share.
    pub fn shared(&self) -> impl Iterator<Item = (Slot, &SharedBuffer)> {
        self.owned.iter().filter_map(|(slot, owned)| match owned {
            Owned::Shared(buffer) => Some((*slot, buffer)),
            Owned::Device(_) => None,
        })
    }

    /// Writes an input.
    ///
    /// # Errors
    /// When it does not fit, or is no shared buffer.
    pub fn write(&mut self, name: &str, bytes: &[u8]) -> Result<()> {
        for (slot, owned) in &mut self.owned {
            if let (true, Owned::Shared(buffer)) = (slot.name == name, owned) {
                return buffer.write(0, bytes);
            }
        }
        Ok(())
    }

    /// The first `count` floats of an output, where they are.
    ///
    /// # Errors
    /// When it is not that large, or is no shared buffer.
    pub fn floats(&self, name: &str, count: usize) -> Result<&[f32]> {
        match self.find(name) {
            Some(Owned::Shared(buffer)) => Ok(bytemuck::cast_slice(buffer.bytes(4 * count as u64)?)),
            _ => Err(missing(name)),
        }
    }

    /// The first `count` floats of an input, to be filled where they are.
    ///
    /// # Errors
    /// As [`floats`](Self::floats).
    pub fn floats_mut(&mut self, name: &str, count: usize) -> Result<&mut [f32]> {
        for (slot, owned) in &mut self.owned {
            if let (true, Owned::Shared(buffer)) = (slot.name == name, owned) {
                return Ok(bytemuck::cast_slice_mut(buffer.bytes_mut(4 * count as u64)?));
            }
        }
        Err(missing(name))
    }

    /// Reads an output from its start.
    ///
    /// # Errors
    /// When it is not that large.
    pub fn read(&self, name: &str, bytes: &mut [u8]) -> Result<()> {
        match self.find(name) {
            Some(Owned::Shared(buffer)) => buffer.read(0, bytes),
            _ => Ok(()),
        }
    }

    /// What a plan's kernels bind, for buffers that were all reserved.
    pub(crate) fn parts(&self, required: &[BufferRequirement]) -> Result<Parts> {
        let mut parts = Parts::default();
        for requirement in required {
            match self.find(requirement.name) {
                Some(Owned::Device(buffer)) if requirement.name == UNUSED.name => {
                    for format in TexelFormat::ALL {
                        parts.unused.push((format, buffer.texel_part(0, UNUSED_SIZE, format)?));
                    }
                }
                Some(Owned::Device(buffer)) => parts.named.push((requirement.name, buffer.whole().clone())),
                Some(Owned::Shared(buffer)) => parts.named.push((requirement.name, buffer.whole().clone())),
                None => {}
            }
        }
        Ok(parts)
    }

    /// The buffer that is bound where a frame has none.
    pub(crate) fn unused(&self) -> Option<&Buffer> {
        match self.find(UNUSED.name) {
            Some(Owned::Device(buffer)) => Some(buffer),
            _ => None,
        }
    }

    /// Bytes of device memory held.
    pub fn bytes(&self) -> u64 {
        let size = |owned: &Owned| match owned {
            Owned::Shared(buffer) => buffer.buffer().size(),
            Owned::Device(buffer) => buffer.size(),
        };
        self.owned.iter().map(|(_, owned)| size(owned)).sum()
    }
}
