//! The renderer's own memory of a frame or of its gradients: VkBuffers for the arenas of its plan and, where the host cannot map these,
//! one to write inputs into and one to read outputs from.

use crate::embed::{Arena, Copy, Staging};
use crate::error::{Error, Result};
use crate::frame::buffers::BufferId;
use crate::frame::pack::InputChanges;
use crate::vulkan::{Buffer, BufferDesc, BufferPart, Context, Location, Mapped, MappedMut, vk};

/// The part of a plan that memory is made for.
pub(super) struct Region<'a> {
    pub arenas: &'a [Arena],
    pub inputs: Vec<Copy>,
    pub outputs: &'a [Copy],
    /// Bytes of the upload and of the readback buffer.
    pub staging: [u64; 2],
}

impl Region<'_> {
    /// Bytes on the device.
    pub fn bytes(&self) -> u64 {
        self.arenas.iter().map(|arena| arena.size).sum()
    }
}

/// The memory of a region.
#[derive(Debug, Default)]
pub(super) struct Memory {
    /// A VkBuffer for each arena, and whether the host writes or reads it.
    arenas: Vec<(Buffer, bool)>,
    /// Where each buffer lies: its arena, offset and bytes.
    places: Vec<(BufferId, usize, u64, u64)>,
    /// The upload and the readback buffer; `None` where arenas are mapped.
    staging: Option<[Buffer; 2]>,
    inputs: Vec<Copy>,
    outputs: Vec<Copy>,
}

fn missing(id: BufferId) -> Error {
    Error::Vulkan { call: "buffer access", result: format!("there is no buffer `{id}` that the host reaches") }
}

impl Memory {
    /// Makes room for a region, for which VkBuffers that are too small are replaced. Returns the inputs whose bytes are gone: all but
    /// those that lie where they lay.
    ///
    /// # Errors
    /// [`Error::Limit`] or [`Error::OutOfMemory`] when it cannot be allocated; all of the memory is freed then.
    pub fn reserve(&mut self, context: &Context, region: &Region<'_>) -> Result<InputChanges> {
        let before = std::mem::take(self);
        let mut made = Self::default();
        let mut held: Vec<_> = before.arenas.into_iter().map(Some).collect();
        let mut kept = Vec::new();
        for (i, arena) in region.arenas.iter().enumerate() {
            let old = held.get_mut(i).and_then(Option::take);
            let old = old.filter(|(buffer, shared)| *shared == arena.shared && buffer.size() >= arena.size);
            kept.push(old.is_some());
            let buffer = match old {
                Some((buffer, _)) => buffer,
                None => buffer_of(context, arena)?,
            };
            made.arenas.push((buffer, arena.shared));
            made.places.extend(arena.parts.iter().map(|&(id, offset, size)| (id, i, offset, size)));
        }
        drop(held);
        if made.arenas.iter().any(|(buffer, shared)| *shared && !buffer.is_mapped()) {
            made.staging = Some(staging_of(context, before.staging, region.staging)?);
        }
        (made.inputs, made.outputs) = (region.inputs.clone(), region.outputs.to_vec());
        let mut moved = InputChanges::default();
        for place in &made.places {
            moved.note(place.0, !(kept[place.1] && before.places.contains(place)));
        }
        *self = made;
        Ok(moved)
    }

    /// Bytes on the device.
    pub fn bytes(&self) -> u64 {
        self.arenas.iter().map(|(buffer, _)| buffer.size()).sum()
    }

    /// Bytes on the device once there is [room](Self::reserve) for a region.
    pub fn bytes_with(&self, region: &Region<'_>) -> u64 {
        let held = self.arenas.iter().map(|(buffer, _)| buffer.size()).chain(std::iter::repeat(0));
        region.arenas.iter().zip(held).map(|(arena, held)| arena.size.max(held)).sum()
    }

    /// The buffers, to be bound.
    pub fn parts(&self) -> Result<Vec<(BufferId, BufferPart)>> {
        let part = |&(id, arena, offset, size): &(_, usize, _, _)| {
            let (buffer, _) = &self.arenas[arena];
            Ok((id, buffer.whole().part(offset, size)?))
        };
        self.places.iter().map(part).collect()
    }

    /// The buffers to copy through, if any.
    pub fn staging(&self) -> Option<Staging> {
        let [upload, readback] = self.staging.as_ref()?;
        Some(Staging { upload: upload.whole().clone(), readback: readback.whole().clone() })
    }

    /// The VkBuffer in which the host finds a buffer, as its number among the arenas, and the offset there.
    fn place(&self, id: BufferId) -> Result<(usize, u64)> {
        let place = self.places.iter().find(|(own, ..)| *own == id);
        place.map(|&(_, arena, offset, _)| (arena, offset)).ok_or_else(|| missing(id))
    }

    /// Whether it has an input.
    pub fn has_input(&self, id: BufferId) -> bool {
        self.inputs.iter().any(|copy| copy.id == id)
    }

    /// Writes an input from its start.
    ///
    /// # Errors
    /// If the bytes do not fit, there is no such input, or pending work uses it.
    pub fn write(&mut self, id: BufferId, bytes: &[u8]) -> Result<()> {
        self.bytes_mut(id, bytes.len())?.copy_from_slice(bytes);
        Ok(())
    }

    /// The first bytes of an input where the host writes them.
    ///
    /// # Errors
    /// As [`write`](Self::write).
    pub fn bytes_mut(&mut self, id: BufferId, count: usize) -> Result<MappedMut<'_>> {
        let copy = *self.inputs.iter().find(|copy| copy.id == id).ok_or_else(|| missing(id))?;
        let (arena, offset) = self.place(id)?;
        match &mut self.staging {
            Some([upload, _]) => upload.bytes_mut(copy.mapped, count as u64),
            None => self.arenas[arena].0.bytes_mut(offset, count as u64),
        }
    }

    /// The outputs where the host reads them. While they are held, no work that uses them can be submitted.
    ///
    /// # Errors
    /// [`Error::Vulkan`] while such work is pending.
    pub fn contents(&self) -> Result<Contents<'_>> {
        let content = |copy: &Copy| {
            let (arena, offset) = self.place(copy.id)?;
            let bytes = match &self.staging {
                Some([_, readback]) => readback.bytes(copy.mapped, copy.size),
                None => self.arenas[arena].0.bytes(offset, copy.size),
            };
            Ok((copy.id, bytes?))
        };
        self.outputs.iter().map(content).collect::<Result<_>>().map(Contents)
    }
}

fn buffer_of(context: &Context, arena: &Arena) -> Result<Buffer> {
    // An arena of one buffer is that buffer to whoever reads an error or a list of objects.
    let name = match arena.parts[..] {
        [(id, ..)] => id.name(),
        _ if arena.shared => "inputs and outputs",
        _ => "workspace",
    };
    let location = if arena.shared { Location::DeviceMapped } else { Location::Device };
    // The buffers of the next plan may lie in it.
    let usage = BufferDesc::USAGES;
    Buffer::new(context, &BufferDesc { name, size: arena.size, usage, location, texels: None })
}

/// The upload and the readback buffer: the old ones, if they are large enough.
fn staging_of(context: &Context, old: Option<[Buffer; 2]>, sizes: [u64; 2]) -> Result<[Buffer; 2]> {
    if let Some(old) = old
        && old.iter().zip(sizes).all(|(buffer, size)| buffer.size() >= size)
    {
        return Ok(old);
    }
    let usage = vk::BufferUsageFlags::empty();
    let buffer = |name, size, location| Buffer::new(context, &BufferDesc { name, size, usage, location, texels: None });
    Ok([buffer("upload", sizes[0], Location::Upload)?, buffer("readback", sizes[1], Location::Readback)?])
}

/// The outputs of a frame or of its gradients by their ids.
#[derive(Debug)]
pub(super) struct Contents<'a>(Vec<(BufferId, Mapped<'a>)>);

impl Contents<'_> {
    /// The first `count` floats of a buffer.
    ///
    /// # Errors
    /// [`Error::Vulkan`] when it is not that large, or no such output.
    pub fn floats(&self, id: BufferId, count: usize) -> Result<&[f32]> {
        Ok(bytemuck::cast_slice(self.bytes(id, 4 * count)?))
    }

    /// The first bytes of a buffer.
    ///
    /// # Errors
    /// As [`floats`](Self::floats).
    pub fn bytes(&self, id: BufferId, count: usize) -> Result<&[u8]> {
        let (_, bytes) = self.0.iter().find(|(found, _)| *found == id).ok_or_else(|| missing(id))?;
        bytes.get(..count).ok_or_else(|| {
            let result = format!("buffer `{id}` has {} bytes, not {count}", bytes.len());
            Error::Vulkan { call: "buffer access", result }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_absent_buffer_is_an_error() {
        let mut memory = Memory::default();
        let contents = memory.contents().map(|contents| contents.floats(BufferId::Color, 0).map(drop));
        let errors = [
            contents.and_then(|contents| contents).err(),
            memory.write(BufferId::Positions, &[0; 4]).err(),
            memory.bytes_mut(BufferId::UpstreamColor, 0).err(),
        ];
        for (error, name) in errors.into_iter().zip(["color", "positions", "upstream_color"]) {
            assert!(error.is_some_and(|e| e.to_string().contains(&format!("no buffer `{name}`"))), "{name}");
        }
        assert!(memory.parts().is_ok_and(|parts| parts.is_empty()) && memory.bytes() == 0);
    }
}
