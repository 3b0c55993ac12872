//! The three buffers of a pass: what each is made with, and what lies where.

use super::buffers::PassBuffer;
use crate::embed::place::tables::Tables;
use crate::error::{Error, Result};
use crate::frame::buffers::{BufferId, Role};
use crate::frame::frame_plan::BufferRequirement;
use crate::vulkan::{BufferPart, BufferRef, Device, vk};

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
    /// Whether the host writes or reads them.
    pub shared: bool,
    pub size: u64,
    /// The usages that the buffers need, and transfer in both directions.
    usage: vk::BufferUsageFlags,
    alignment: u64,
    /// Id, offset and bytes of each.
    pub parts: Vec<(BufferId, u64, u64)>,
}

impl Arena {
    /// Lays out those of the buffers that the host does not bind itself, one after the other.
    fn all(buffers: &[BufferRequirement], wishes: &Wishes<'_>) -> Vec<Self> {
        let mut arenas: Vec<Self> = Vec::new();
        let most = wishes.apart.unwrap_or(u64::MAX);
        for requirement in buffers.iter().filter(|requirement| !wishes.is_own(requirement.id)) {
            let shared = wishes.apart.is_some() && requirement.id.row().role != Role::Workspace;
            let has_room = |arena: &&mut Self| arena.shared == shared && arena.place(requirement).1 <= most;
            if let Some(arena) = arenas.iter_mut().find(has_room) {
                arena.push(requirement);
                continue;
            }
            let usage = vk::BufferUsageFlags::TRANSFER_SRC | vk::BufferUsageFlags::TRANSFER_DST;
            let mut arena = Self { shared, size: 0, usage, alignment: wishes.alignment, parts: Vec::new() };
            arena.push(requirement);
            arenas.push(arena);
        }
        arenas
    }

    /// Where the next buffer begins and ends.
    fn place(&self, requirement: &BufferRequirement) -> (u64, u64) {
        let offset = self.size.next_multiple_of(requirement.alignment.max(self.alignment));
        // Sizes are whole texels, so that a view of the part can cover it.
        (offset, offset + requirement.size.next_multiple_of(requirement.id.row().format.bytes()))
    }

    fn push(&mut self, requirement: &BufferRequirement) {
        let (offset, end) = self.place(requirement);
        self.parts.push((requirement.id, offset, end - offset));
        self.alignment = self.alignment.max(requirement.alignment);
        self.usage |= requirement.usage;
        self.size = end;
    }

    /// Its buffers in a VkBuffer, in which it begins at an offset.
    pub fn bind(&self, buffer: &BufferPart, at: u64) -> Result<Vec<(BufferId, BufferPart)>> {
        let part = |&(id, offset, range): &(_, u64, u64)| Ok((id, buffer.part(at + offset, range)?));
        self.parts.iter().map(part).collect()
    }
}

/// Where the buffers lie that gradients need beyond those of the frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct GradientLayout {
    pub arenas: Vec<Arena>,
    /// Where an arena that holds all of them begins in the device buffer.
    pub at: u64,
    /// The copies of the upstream gradients, which a host's own kernels write.
    pub upstream: Vec<Copy>,
    pub upload_size: u64,
    /// The copies of their outputs into the readback buffer.
    pub outputs: Vec<Copy>,
    pub readback_end: u64,
}

impl GradientLayout {
    /// Outputs are read back behind the first `readback_end` bytes.
    pub fn new(buffers: &[BufferRequirement], wishes: &Wishes<'_>, readback_end: u64) -> Self {
        let mut layout = Self { arenas: Arena::all(buffers, wishes), readback_end, ..Self::default() };
        let read = buffers.iter().filter(|requirement| wishes.read_back.contains(&requirement.id));
        layout.outputs = read.map(|requirement| copy_of(requirement, &mut layout.readback_end)).collect();
        let written = buffers.iter().filter(|r| wishes.apart.is_some() && r.id.row().role == Role::Input);
        layout.upstream = written.map(|requirement| copy_of(requirement, &mut layout.upload_size)).collect();
        layout
    }
}

/// Where everything lies in the three buffers.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Layouts {
    /// The buffers of the frame.
    pub arenas: Vec<Arena>,
    pub gradients: GradientLayout,
    /// The buffers that the host binds itself.
    pub own: Vec<(PassBuffer, MemoryRequirement)>,
    /// Table of draws of each mesh: offset in the upload and in the device buffer, bytes.
    pub draws: Vec<(u64, u64, u64)>,
    /// Inputs of every frame, then those of the setup: the views' shapes first.
    pub frame: Vec<Copy>,
    pub setup: Vec<Copy>,
    pub upload_size: u64,
    pub device_size: u64,
    /// Outputs of the forward frame, the status first.
    pub forward: Vec<Copy>,
    pub readback_size: u64,
}

/// The requests that a pass's memory depends on besides its plans.
pub(crate) struct Wishes<'a> {
    pub alignment: u64,
    /// Buffers that the host writes or reads lie apart from the workspace, and no VkBuffer that holds several is larger than
    /// this; `None`: one holds all.
    pub apart: Option<u64>,
    pub own: &'a [PassBuffer],
    pub read_back: &'a [BufferId],
}

impl Wishes<'_> {
    fn is_own(&self, id: BufferId) -> bool {
        self.own.iter().any(|own| own.id() == id)
    }
}

/// Copies begin at multiples of this in the upload and the readback buffer.
const STEP: u64 = 16;

/// The copy of a whole buffer, behind what is copied already.
fn copy_of(requirement: &BufferRequirement, end: &mut u64) -> Copy {
    let mapped = *end;
    *end += requirement.size.next_multiple_of(STEP);
    Copy { id: requirement.id, mapped, at: 0, size: requirement.size / 4 * 4 }
}

impl Layouts {
    pub fn new(
        frame: &[BufferRequirement],
        gradients: &[BufferRequirement],
        (tables, setup): (&Tables, &[(BufferId, u64, u64)]),
        wishes: &Wishes<'_>,
    ) -> Result<Self> {
        let all = || frame.iter().chain(gradients);
        let find = |id: BufferId| all().find(|requirement| requirement.id == id);
        let own = wishes.own.iter().map(|buffer| buffer.id());
        if let Some(id) = own.chain(wishes.read_back.iter().copied()).find(|id| find(*id).is_none()) {
            return Err(Error::Host {
                what: format!("the pass has no buffer `{id}`"),
                fix: "ask for the output or the gradient that it belongs to".into(),
            });
        }
        let own_of = |requirement: &BufferRequirement| wishes.own.iter().find(|own| own.id() == requirement.id);
        let transfer = vk::BufferUsageFlags::TRANSFER_SRC | vk::BufferUsageFlags::TRANSFER_DST;
        let requirement_of = |&BufferRequirement { size, alignment, usage, .. }: &BufferRequirement| {
            MemoryRequirement { kind: MemoryKind::Device, size, usage: usage | transfer, alignment }
        };
        let own = all().filter_map(|r| Some((*own_of(r)?, requirement_of(r)))).collect();
        let mut readback = 0;
        let status = frame.iter().filter(|r| r.id == BufferId::Status);
        let others = frame.iter().filter(|r| r.id != BufferId::Status && wishes.read_back.contains(&r.id));
        let forward = status.chain(others).map(|r| copy_of(r, &mut readback)).collect();
        let mut made = Self {
            arenas: Arena::all(frame, wishes),
            gradients: GradientLayout::new(gradients, wishes, readback),
            own,
            draws: Vec::new(),
            frame: Vec::new(),
            setup: Vec::new(),
            upload_size: 0,
            device_size: 0,
            forward,
            readback_size: 0,
        };
        made.place_inputs(&find, (tables, setup));
        made.readback_size = made.gradients.readback_end;
        Ok(made)
    }

    /// Lays out the copies of the inputs, and in the device buffer the gradients' arena and the tables of draws.
    fn place_inputs<'a>(
        &mut self,
        find: &dyn Fn(BufferId) -> Option<&'a BufferRequirement>,
        (tables, setup): (&Tables, &[(BufferId, u64, u64)]),
    ) {
        let alignment = self.alignment();
        let mut upload = 0;
        let mut copy = |id, at, size| {
            let mapped = upload;
            upload += u64::next_multiple_of(size, STEP);
            Copy { id, mapped, at, size }
        };
        for id in [BufferId::ViewCameras, BufferId::Lights] {
            self.frame.extend(find(id).map(|requirement| copy(id, 0, requirement.size)));
        }
        self.setup.extend(find(BufferId::ViewShapes).map(|r| copy(BufferId::ViewShapes, 0, r.size)));
        self.setup.extend(setup.iter().map(|&(id, at, size)| copy(id, at, size)));
        let size = |arenas: &[Arena]| arenas.iter().map(|arena| arena.size).sum::<u64>();
        self.gradients.at = size(&self.arenas).next_multiple_of(alignment);
        let mut device = self.gradients.at + size(&self.gradients.arenas);
        for placed in &tables.placed {
            let size = 32 * placed.geometry.draws().len() as u64;
            device = device.next_multiple_of(alignment);
            self.draws.push((upload, device, size));
            upload += size.next_multiple_of(STEP);
            device += size;
        }
        (self.upload_size, self.device_size) = (upload, device);
    }

    /// The inputs that are copied before a frame, whenever they changed.
    #[cfg(feature = "renderer")]
    pub fn inputs(&self) -> impl Iterator<Item = &Copy> {
        self.frame.iter().chain(&self.setup)
    }

    fn alignment(&self) -> u64 {
        let arenas = self.arenas.iter().chain(&self.gradients.arenas);
        arenas.map(|arena| arena.alignment).max().unwrap_or(STEP)
    }

    /// The size, usage and alignment of the upload, the device and the readback buffer. `usages` are what the host adds, in this order.
    pub fn memory(&self, usages: [vk::BufferUsageFlags; 3]) -> [MemoryRequirement; 3] {
        use vk::BufferUsageFlags as U;
        let requirement = |kind, size: u64, usage, extra: U, alignment| MemoryRequirement {
            kind,
            size: size.max(STEP),
            usage: usage | extra,
            alignment,
        };
        // The tables of draws are read as texels.
        let arenas = self.arenas.iter().chain(&self.gradients.arenas);
        let device = arenas.fold(U::UNIFORM_TEXEL_BUFFER, |usage, arena| usage | arena.usage);
        [
            requirement(MemoryKind::Upload, self.upload_size, U::TRANSFER_SRC, usages[0], STEP),
            requirement(MemoryKind::Device, self.device_size, device, usages[1], self.alignment()),
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
    pub fn bind(&self, device: &Device, memory: &PassMemory<'_>) -> Result<Vec<(BufferId, BufferPart)>> {
        self.validate(memory)?;
        let part = |at| BufferPart::of_host(device, at);
        let whole = part(&memory.device);
        let mut parts = Vec::new();
        for (arenas, at) in [(&self.arenas, 0), (&self.gradients.arenas, self.gradients.at)] {
            for arena in arenas {
                parts.extend(arena.bind(&whole, at)?);
            }
        }
        parts.extend(memory.own.iter().map(|(buffer, at)| (buffer.id(), part(at))));
        Ok(parts)
    }
}
