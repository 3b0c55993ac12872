//! The three buffers of a pass: what each is made with, and what lies where.

use super::buffers::PassBuffer;
use crate::embed::place::tables::Tables;
use crate::error::{Error, Result};
use crate::frame::buffers::BufferId;
use crate::frame::frame_plan::BufferRequirement;
use crate::vulkan::{BufferRef, vk};

/// Where a buffer's memory belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MemoryKind {
    /// Mapped memory that the CPU writes: HOST_VISIBLE.
    Upload,
    /// The device's own memory: DEVICE_LOCAL.
    Device,
    /// Mapped memory that the CPU reads: HOST_VISIBLE, and HOST_CACHED if the device has it.
    Readback,
}

/// A buffer that a pass needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemoryRequirement {
    /// Where its memory belongs.
    pub kind: MemoryKind,
    /// Bytes, at least.
    pub size: u64,
    /// The usages that the VkBuffer is made with.
    pub usage: vk::BufferUsageFlags,
    /// The alignment of its offset if it is a part of a larger VkBuffer.
    pub alignment: u64,
}

/// The buffers of a pass, made as [`PassPlan::memory`](crate::embed::PassPlan::memory) says.
#[derive(Clone, Copy, Debug)]
pub struct PassMemory<'a> {
    /// For what the CPU writes.
    pub upload: BufferRef,
    /// For what the kernels work on.
    pub device: BufferRef,
    /// For what the CPU reads.
    pub readback: BufferRef,
    /// Those that the plan leaves to the host ([`PassBuilder::own_buffers`](crate::embed::PassBuilder::own_buffers)).
    pub own: &'a [(PassBuffer, BufferRef)],
}

/// A copy between two of a pass's buffers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Copy {
    pub id: BufferId,
    /// Offset in the upload or readback buffer.
    pub mapped: u64,
    /// Offset in the frame's buffer.
    pub at: u64,
    pub size: u64,
}

/// Where each of several required buffers lies within one VkBuffer.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Arena {
    size: u64,
    /// The usages that the buffers need, and transfer in both directions.
    usage: vk::BufferUsageFlags,
    alignment: u64,
    /// Id, offset and bytes of each.
    parts: Vec<(BufferId, u64, u64)>,
}

impl Arena {
    /// Lays out buffers one after the other, each aligned as it needs and as the host wishes.
    fn new<'a>(buffers: impl Iterator<Item = &'a BufferRequirement>, alignment: u64) -> Self {
        let usage = vk::BufferUsageFlags::TRANSFER_SRC | vk::BufferUsageFlags::TRANSFER_DST;
        let mut arena = Self { size: 0, usage, alignment, parts: Vec::new() };
        for requirement in buffers {
            let own = requirement.alignment.max(alignment);
            arena.alignment = arena.alignment.max(own);
            let offset = arena.size.next_multiple_of(own);
            // Sizes are whole texels, so that a view of the part can cover it.
            let size = requirement.size.next_multiple_of(requirement.id.row().format.bytes());
            arena.parts.push((requirement.id, offset, size));
            arena.usage |= requirement.usage;
            arena.size = offset + size;
        }
        arena
    }

    fn refs(&self, buffer: &BufferRef) -> Result<Vec<(BufferId, BufferRef)>> {
        let part = |&(id, offset, range): &(_, u64, u64)| Ok((id, buffer.part(offset, range)?));
        self.parts.iter().map(part).collect()
    }
}

/// Where everything lies in the three buffers.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Layouts {
    arena: Arena,
    /// The buffers that the host binds itself.
    pub own: Vec<(PassBuffer, MemoryRequirement)>,
    /// Table of draws of each mesh: offset in the upload and in the device buffer, bytes.
    pub draws: Vec<(u64, u64, u64)>,
    /// Inputs of every frame, then those of the setup: the views' shapes first.
    pub frame: Vec<Copy>,
    pub setup: Vec<Copy>,
    pub upload_size: u64,
    pub device_size: u64,
    /// Outputs of the forward frame, the status first, and of the backward pass.
    pub forward: Vec<Copy>,
    pub backward: Vec<Copy>,
    pub readback_size: u64,
}

/// The requests that a pass's memory depends on besides its plans.
pub(crate) struct Wishes<'a> {
    pub alignment: u64,
    pub own: &'a [PassBuffer],
    pub read_back: &'a [PassBuffer],
}

/// Copies begin at multiples of this in the upload and the readback buffer.
const STEP: u64 = 16;

impl Layouts {
    pub fn new(
        frame: &[BufferRequirement],
        gradients: &[BufferRequirement],
        (tables, setup): (&Tables, &[(BufferId, u64, u64)]),
        wishes: &Wishes<'_>,
    ) -> Result<Self> {
        let all = || frame.iter().chain(gradients);
        let find = |id: BufferId| all().find(|requirement| requirement.id == id);
        if let Some(buffer) = wishes.own.iter().chain(wishes.read_back).find(|buffer| find(buffer.id()).is_none()) {
            return Err(Error::Host {
                what: format!("the pass has no buffer `{buffer}`"),
                fix: "ask for the output or the gradient that it belongs to".into(),
            });
        }
        let own_of = |requirement: &BufferRequirement| wishes.own.iter().find(|own| own.id() == requirement.id);
        let arena = Arena::new(all().filter(|r| own_of(r).is_none()), wishes.alignment);
        let transfer = vk::BufferUsageFlags::TRANSFER_SRC | vk::BufferUsageFlags::TRANSFER_DST;
        let requirement_of = |&BufferRequirement { size, alignment, usage, .. }: &BufferRequirement| {
            MemoryRequirement { kind: MemoryKind::Device, size, usage: usage | transfer, alignment }
        };
        let own = all().filter_map(|r| Some((*own_of(r)?, requirement_of(r)))).collect();
        let (mut upload, mut device) = (0, arena.size);
        let alignment = arena.alignment;
        let mut made = Self {
            arena,
            own,
            draws: Vec::new(),
            frame: Vec::new(),
            setup: Vec::new(),
            upload_size: 0,
            device_size: 0,
            forward: Vec::new(),
            backward: Vec::new(),
            readback_size: 0,
        };
        let mut copy = |id, at, size| {
            let mapped = upload;
            upload += u64::next_multiple_of(size, STEP);
            Copy { id, mapped, at, size }
        };
        for id in [BufferId::ViewCameras, BufferId::Lights] {
            made.frame.extend(find(id).map(|requirement| copy(id, 0, requirement.size)));
        }
        made.setup.extend(find(BufferId::ViewShapes).map(|r| copy(BufferId::ViewShapes, 0, r.size)));
        made.setup.extend(setup.iter().map(|&(id, at, size)| copy(id, at, size)));
        for placed in &tables.placed {
            let size = 32 * placed.geometry.draws().len() as u64;
            device = u64::next_multiple_of(device, alignment);
            made.draws.push((upload, device, size));
            upload += size.next_multiple_of(STEP);
            device += size;
        }
        (made.upload_size, made.device_size) = (upload, device);
        made.read_back(frame, gradients, wishes.read_back);
        Ok(made)
    }

    fn read_back(&mut self, frame: &[BufferRequirement], gradients: &[BufferRequirement], wanted: &[PassBuffer]) {
        let mut end = 0;
        let is_wanted = |r: &&BufferRequirement| wanted.iter().any(|wanted| wanted.id() == r.id);
        let mut copy = |requirement: &BufferRequirement| {
            let mapped = end;
            end += requirement.size.next_multiple_of(STEP);
            Copy { id: requirement.id, mapped, at: 0, size: requirement.size / 4 * 4 }
        };
        let status = frame.iter().filter(|r| r.id == BufferId::Status);
        let others = frame.iter().filter(is_wanted).filter(|r| r.id != BufferId::Status);
        self.forward = status.chain(others).map(&mut copy).collect();
        self.backward = gradients.iter().filter(is_wanted).map(&mut copy).collect();
        self.readback_size = end;
    }

    /// The three buffers.
    pub fn memory(&self, usages: [vk::BufferUsageFlags; 3]) -> [MemoryRequirement; 3] {
        use vk::BufferUsageFlags as U;
        let requirement = |kind, size: u64, usage, extra: U, alignment| MemoryRequirement {
            kind,
            size: size.max(STEP),
            usage: usage | extra,
            alignment,
        };
        // The tables of draws are read as texels.
        let device = self.arena.usage | U::UNIFORM_TEXEL_BUFFER;
        [
            requirement(MemoryKind::Upload, self.upload_size, U::TRANSFER_SRC, usages[0], STEP),
            requirement(MemoryKind::Device, self.device_size, device, usages[1], self.arena.alignment),
            requirement(MemoryKind::Readback, self.readback_size, U::TRANSFER_DST, usages[2], STEP),
        ]
    }

    /// Checks the buffers that a host made for it.
    pub fn validate(&self, memory: &PassMemory<'_>) -> Result<()> {
        let needed = self.memory([vk::BufferUsageFlags::empty(); 3]);
        for (needed, given) in needed.iter().zip([&memory.upload, &memory.device, &memory.readback]) {
            let fail = |what: String| {
                let what = format!("the {:?} buffer {what}", needed.kind).to_lowercase();
                Err(Error::Host { what, fix: "make it as PassPlan::memory says".into() })
            };
            if given.raw() == vk::Buffer::null() {
                return fail("is null".into());
            }
            if given.range() < needed.size {
                return fail(format!("has {} bytes, the pass needs {}", given.range(), needed.size));
            }
            if !given.usage().contains(needed.usage) {
                return fail(format!("was made for {:?}, the pass needs {:?}", given.usage(), needed.usage));
            }
            if !given.offset().is_multiple_of(needed.alignment) {
                return fail(format!("lies at {}, no multiple of {}", given.offset(), needed.alignment));
            }
        }
        Ok(())
    }

    /// Every buffer of the frame and of its gradients.
    pub fn refs(&self, memory: &PassMemory<'_>) -> Result<Vec<(BufferId, BufferRef)>> {
        self.validate(memory)?;
        let mut refs = self.arena.refs(&memory.device)?;
        refs.extend(memory.own.iter().map(|(buffer, at)| (buffer.id(), *at)));
        Ok(refs)
    }
}
