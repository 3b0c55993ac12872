//! Buffers that softras owns itself, which are replaced by larger ones when a plan needs more.

use super::{BufferId, Entry, Parts, Role, UNUSED_SIZE};
use crate::error::{Error, Result};
use crate::vulkan::{
    Buffer, BufferDesc, BufferPart, Context, Location, Mapped, MappedMut, SharedBuffer, TexelFormat, vk,
};

/// The id of a buffer in a [`BufferSet`].
pub trait Key: Copy + PartialEq {
    /// Its label in debuggers and in errors.
    fn name(self) -> &'static str;
}

impl Key for BufferId {
    fn name(self) -> &'static str {
        Self::name(self)
    }
}

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
pub struct Contents<'a, K = BufferId>(Vec<(K, Mapped<'a>)>);

impl<K: Key> Contents<'_, K> {
    /// The first `count` floats of a buffer.
    ///
    /// # Errors
    /// [`Error::Vulkan`] when it is not that large, or there is no such buffer that the host reaches.
    pub fn floats(&self, id: impl Into<K>, count: usize) -> Result<&[f32]> {
        let id = id.into();
        let (_, bytes) = self.0.iter().find(|(found, _)| *found == id).ok_or_else(|| missing(id))?;
        let range = bytes.get(..4 * count).ok_or_else(|| {
            let result = format!("buffer `{}` has {} bytes, not {count} floats", id.name(), bytes.len());
            Error::Vulkan { call: "buffer access", result }
        })?;
        Ok(bytemuck::cast_slice(range))
    }
}

/// Buffers of our own by their ids.
#[derive(Debug)]
pub struct BufferSet<K = BufferId> {
    owned: Vec<(Entry<K>, Owned)>,
}

impl<K> Default for BufferSet<K> {
    fn default() -> Self {
        Self { owned: Vec::new() }
    }
}

fn missing<K: Key>(id: K) -> Error {
    Error::Vulkan { call: "buffer access", result: format!("there is no buffer `{}`", id.name()) }
}

fn unreachable_by_host<K: Key>(id: K) -> Error {
    Error::Vulkan { call: "buffer access", result: format!("the host cannot reach the buffer `{}`", id.name()) }
}

impl<K: Key> BufferSet<K> {
    /// A buffer's reference for descriptors.
    pub fn get(&self, id: impl Into<K>) -> Option<&BufferPart> {
        self.find(id.into()).ok().map(Owned::whole)
    }

    fn find(&self, id: K) -> Result<&Owned> {
        let found = self.owned.iter().find(|(entry, _)| entry.id == id);
        found.map(|(_, owned)| owned).ok_or_else(|| missing(id))
    }

    fn find_shared(&self, id: K) -> Result<&SharedBuffer> {
        match self.find(id)? {
            Owned::Shared(buffer) => Ok(buffer),
            Owned::Device(_) => Err(unreachable_by_host(id)),
        }
    }

    fn find_shared_mut(&mut self, id: K) -> Result<&mut SharedBuffer> {
        match self.owned.iter_mut().find(|(entry, _)| entry.id == id) {
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
    pub fn reserve(&mut self, context: &Context, entry: Entry<K>, size: u64) -> Result<bool> {
        if self.find(entry.id).is_ok_and(|owned| owned.buffer().size() >= size.max(1)) {
            return Ok(false);
        }
        let desc = BufferDesc {
            name: entry.id.name(),
            size,
            usage: vk::BufferUsageFlags::STORAGE_BUFFER | vk::BufferUsageFlags::INDIRECT_BUFFER,
            location: Location::Device,
            texels: Some(entry.format),
        };
        // The old one is freed first, so that growing does not need memory for both.
        self.owned.retain(|(e, _)| e.id != entry.id);
        let owned = match entry.role {
            Role::Input => Owned::Shared(SharedBuffer::for_upload(context, &desc)?),
            Role::Output => Owned::Shared(SharedBuffer::for_download(context, &desc)?),
            Role::Workspace => Owned::Device(Buffer::new(context, &desc)?),
        };
        self.owned.push((entry, owned));
        Ok(true)
    }

    /// Every buffer that the host and the device share.
    pub fn shared(&self) -> impl Iterator<Item = (Entry<K>, &SharedBuffer)> {
        self.owned.iter().filter_map(|(entry, owned)| match owned {
            Owned::Shared(buffer) => Some((*entry, buffer)),
            Owned::Device(_) => None,
        })
    }

    /// Writes an input from its start.
    ///
    /// # Errors
    /// If the bytes do not fit, or there is no such buffer, or the host cannot reach it.
    pub fn write(&mut self, id: impl Into<K>, bytes: &[u8]) -> Result<()> {
        self.find_shared_mut(id.into())?.write(0, bytes)
    }

    /// The content of the shared buffers, in mapped memory. While it is held, no work that uses them can be submitted.
    ///
    /// # Errors
    /// [`Error::Vulkan`] while such work is pending.
    pub fn contents(&self) -> Result<Contents<'_, K>> {
        let mut contents = Vec::with_capacity(self.owned.len());
        for (entry, buffer) in self.shared() {
            contents.push((entry.id, buffer.bytes(buffer.buffer().size())?));
        }
        Ok(Contents(contents))
    }

    /// The first `range` bytes of an input in mapped memory, to be written.
    ///
    /// # Errors
    /// If it is smaller, there is no such buffer, the host cannot reach it, or pending work uses it.
    pub fn bytes_mut(&mut self, id: impl Into<K>, range: usize) -> Result<MappedMut<'_>> {
        self.find_shared_mut(id.into())?.bytes_mut(range as u64)
    }

    /// Reads an output from its start.
    ///
    /// # Errors
    /// If it is smaller, there is no such buffer, the host cannot reach it, or pending work uses it.
    pub fn read(&self, id: impl Into<K>, bytes: &mut [u8]) -> Result<()> {
        self.find_shared(id.into())?.read(0, bytes)
    }

    /// The buffers that a plan's kernels bind.
    ///
    /// # Errors
    /// [`Error::Vulkan`] if one of the buffers was not reserved.
    pub fn parts(&self, required: impl IntoIterator<Item = BufferId>) -> Result<Parts>
    where
        BufferId: Into<K>,
    {
        let mut parts = Parts::default();
        for id in required {
            let owned = self.find(id.into())?;
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
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_absent_buffer_is_an_error() {
        let mut set = BufferSet::<BufferId>::default();
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
        assert!(set.get(BufferId::Positions).is_none());
    }
}
