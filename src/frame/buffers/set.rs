//! Buffers that softras owns itself, which are replaced by larger ones when a plan needs more.

use super::{BufferId, Parts, Role, UNUSED_SIZE};
use crate::error::{Error, Result};
use crate::vulkan::{
    Buffer, BufferDesc, BufferPart, Context, Location, Mapped, MappedMut, SharedBuffer, TexelFormat, vk,
};

/// One buffer of our own.
#[derive(Debug)]
enum Owned {
    Shared(SharedBuffer),
    Device(Buffer),
}

impl Owned {
    fn buffer(&self) -> &Buffer {
        match self {
            Self::Shared(buffer) => buffer.buffer(),
            Self::Device(buffer) => buffer,
        }
    }

    fn whole(&self) -> &BufferPart {
        match self {
            Self::Shared(buffer) => buffer.whole(),
            Self::Device(buffer) => buffer.whole(),
        }
    }
}

/// The content of a set's shared buffers by their ids.
#[derive(Debug)]
pub struct Contents<'a>(Vec<(BufferId, Mapped<'a>)>);

impl Contents<'_> {
    /// The first `count` floats of a buffer.
    ///
    /// # Errors
    /// [`Error::Vulkan`] when it is not that large, or there is no such buffer that the host reaches.
    pub fn floats(&self, id: BufferId, count: usize) -> Result<&[f32]> {
        let (_, bytes) = self.0.iter().find(|(found, _)| *found == id).ok_or_else(|| missing(id))?;
        let range = bytes.get(..4 * count).ok_or_else(|| {
            let result = format!("buffer `{}` has {} bytes, not {count} floats", id.name(), bytes.len());
            Error::Vulkan { call: "buffer access", result }
        })?;
        Ok(bytemuck::cast_slice(range))
    }
}

/// Buffers of our own by their ids.
#[derive(Debug, Default)]
pub struct BufferSet {
    owned: Vec<(BufferId, Owned)>,
}

fn missing(id: BufferId) -> Error {
    Error::Vulkan { call: "buffer access", result: format!("there is no buffer `{}`", id.name()) }
}

fn unreachable_by_host(id: BufferId) -> Error {
    Error::Vulkan { call: "buffer access", result: format!("the host cannot reach the buffer `{}`", id.name()) }
}

impl BufferSet {
    fn find(&self, id: BufferId) -> Result<&Owned> {
        let found = self.owned.iter().find(|(found, _)| *found == id);
        found.map(|(_, owned)| owned).ok_or_else(|| missing(id))
    }

    fn find_shared(&self, id: BufferId) -> Result<&SharedBuffer> {
        match self.find(id)? {
            Owned::Shared(buffer) => Ok(buffer),
            Owned::Device(_) => Err(unreachable_by_host(id)),
        }
    }

    fn find_shared_mut(&mut self, id: BufferId) -> Result<&mut SharedBuffer> {
        match self.owned.iter_mut().find(|(found, _)| *found == id) {
            Some((_, Owned::Shared(buffer))) => Ok(buffer),
            Some((_, Owned::Device(_))) => Err(unreachable_by_host(id)),
            None => Err(missing(id)),
        }
    }

    /// Makes the buffer hold at least `size` bytes. Returns `true` if it is a new buffer, so that descriptors must be
    /// written again.
    ///
    /// # Errors
    /// [`crate::Error::Limit`] or [`crate::Error::OutOfMemory`] when it cannot be allocated; the old buffer is then gone.
    pub fn reserve(&mut self, context: &Context, id: BufferId, size: u64) -> Result<bool> {
        if self.find(id).is_ok_and(|owned| owned.buffer().size() >= size.max(1)) {
            return Ok(false);
        }
        let desc = BufferDesc {
            name: id.name(),
            size,
            usage: vk::BufferUsageFlags::STORAGE_BUFFER | vk::BufferUsageFlags::INDIRECT_BUFFER,
            location: Location::Device,
            texels: Some(id.row().format),
        };
        // The old one is freed first, so that growing does not need memory for both.
        self.owned.retain(|(found, _)| *found != id);
        let owned = match id.row().role {
            Role::Input => Owned::Shared(SharedBuffer::for_upload(context, &desc)?),
            Role::Output => Owned::Shared(SharedBuffer::for_download(context, &desc)?),
            Role::Workspace => Owned::Device(Buffer::new(context, &desc)?),
        };
        self.owned.push((id, owned));
        Ok(true)
    }

    /// Every buffer that the host and the device share.
    pub fn shared(&self) -> impl Iterator<Item = (BufferId, &SharedBuffer)> {
        self.owned.iter().filter_map(|(id, owned)| match owned {
            Owned::Shared(buffer) => Some((*id, buffer)),
            Owned::Device(_) => None,
        })
    }

    /// Writes an input from its start.
    ///
    /// # Errors
    /// If the bytes do not fit, or there is no such buffer, or the host cannot reach it.
    pub fn write(&mut self, id: BufferId, bytes: &[u8]) -> Result<()> {
        self.find_shared_mut(id)?.write(0, bytes)
    }

    /// The content of the shared buffers, in mapped memory. While it is held, no work that uses them can be submitted.
    ///
    /// # Errors
    /// [`Error::Vulkan`] while such work is pending.
    pub fn contents(&self) -> Result<Contents<'_>> {
        let mut contents = Vec::with_capacity(self.owned.len());
        for (id, buffer) in self.shared() {
            contents.push((id, buffer.bytes(buffer.buffer().size())?));
        }
        Ok(Contents(contents))
    }

    /// The first `range` bytes of an input in mapped memory, to be written.
    ///
    /// # Errors
    /// If it is smaller, there is no such buffer, the host cannot reach it, or pending work uses it.
    pub fn bytes_mut(&mut self, id: BufferId, range: usize) -> Result<MappedMut<'_>> {
        self.find_shared_mut(id)?.bytes_mut(range as u64)
    }

    /// Reads an output from its start.
    ///
    /// # Errors
    /// If it is smaller, there is no such buffer, the host cannot reach it, or pending work uses it.
    pub fn read(&self, id: BufferId, bytes: &mut [u8]) -> Result<()> {
        self.find_shared(id)?.read(0, bytes)
    }

    /// The buffers that a plan's kernels bind.
    ///
    /// # Errors
    /// [`Error::Vulkan`] if one of the buffers was not reserved.
    pub fn parts(&self, required: impl IntoIterator<Item = BufferId>) -> Result<Parts> {
        let mut parts = Parts::default();
        for id in required {
            let owned = self.find(id)?;
            if id == BufferId::Unused {
                for format in TexelFormat::ALL {
                    parts.unused.push((format, owned.buffer().texel_part(0, UNUSED_SIZE, format)?));
                }
            } else {
                parts.bound.push((id, owned.whole().clone()));
            }
        }
        Ok(parts)
    }

    /// Bytes of all buffers.
    pub fn bytes(&self) -> u64 {
        self.owned.iter().map(|(_, owned)| owned.buffer().size()).sum()
    }

    /// Bytes by which [`bytes`](Self::bytes) grows once the buffer was [reserved](Self::reserve).
    pub fn growth(&self, id: BufferId, size: u64) -> u64 {
        size.saturating_sub(self.find(id).map_or(0, |owned| owned.buffer().size()))
    }

    /// Frees every buffer that is not to be kept.
    pub fn retain(&mut self, keep: impl Fn(BufferId) -> bool) {
        self.owned.retain(|(id, _)| keep(*id));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_absent_buffer_is_an_error() {
        let mut set = BufferSet::default();
        let mut bytes = [0; 4];
        let errors = [
            set.write(BufferId::Positions, &bytes).err(),
            set.read(BufferId::Status, &mut bytes).err(),
            set.contents().and_then(|contents| contents.floats(BufferId::Color, 0).map(drop)).err(),
            set.bytes_mut(BufferId::UpstreamColor, 0).err(),
            set.parts([BufferId::Boxes]).err(),
        ];
        let names = ["positions", "status", "color", "upstream_color", "boxes"];
        for (error, name) in errors.into_iter().zip(names) {
            assert!(error.is_some_and(|e| e.to_string().contains(&format!("no buffer `{name}`"))), "{name}");
        }
    }
}
