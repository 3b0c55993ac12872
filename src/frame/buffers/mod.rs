//! The buffers of a frame and of its gradients: their ids, the one table that describes them, and who owns them.

mod counts;
mod parts;
mod table;

pub use counts::{ForwardCounts, GradientCounts, TableLengths, Totals, bytes};
pub use parts::Parts;
pub use table::{BufferId, Formula};

use crate::vulkan::{kernels, vk};
use std::sync::OnceLock;

/// Who fills a buffer. Where its memory should lie follows from that.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The host fills it before the frame. It lies in device-local memory that is copied into or, if device and host share
    /// their memory, mapped. Kernels of an embedding host may fill it as well.
    Input,
    /// One stage fills it for the next. It lies in device-local memory that is never mapped, and its content is undefined
    /// outside a frame.
    Workspace,
    /// The kernels fill it for the host. It lies in device-local memory that is copied from, or mapped as an input.
    Output,
}

/// Bytes of [`BufferId::Unused`]: one texel of any format.
pub const UNUSED_SIZE: u64 = 16;

/// Binding names that stand for different buffers in different stages, and the buffers that each can stand for.
pub const ALIASES: [(&str, &[BufferId]); 2] = [
    ("items", &[BufferId::ShownItems, BufferId::OutlineItems, BufferId::LongRecords]),
    ("rows", &[BufferId::LightRecords, BufferId::PixelSums, BufferId::ViewSums]),
];

/// The sizes of all buffers of a plan in bytes, indexed by [`BufferId`]; 0 for a buffer that the plan does not have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sizes([u64; BufferId::COUNT]);

impl Sizes {
    /// No buffer at all.
    pub const NONE: Self = Self([0; BufferId::COUNT]);

    /// The sizes of a forward frame's buffers by their formulas.
    pub fn of_frame(counts: &ForwardCounts) -> Self {
        Self(BufferId::ALL.map(|id| match id.row().size {
            Formula::Frame(size) => size(counts),
            Formula::Gradients(_) => 0,
        }))
    }

    /// The sizes of the buffers that a backward pass adds, by their formulas.
    pub fn of_gradients(counts: &GradientCounts) -> Self {
        Self(BufferId::ALL.map(|id| match id.row().size {
            Formula::Frame(_) => 0,
            Formula::Gradients(size) => size(counts),
        }))
    }

    /// Every buffer that the plan has, with its bytes.
    pub fn iter(&self) -> impl Iterator<Item = (BufferId, u64)> {
        BufferId::ALL.into_iter().zip(self.0).filter(|(_, size)| *size > 0)
    }

    /// The bytes of all buffers that are not filled by the host.
    #[cfg(test)]
    pub fn device_filled(&self) -> u64 {
        self.iter()
            .filter(|(id, _)| id.row().role != Role::Input && *id != BufferId::Unused)
            .map(|(_, size)| size)
            .sum()
    }

    /// The first buffer that is larger here than in `room`, with both sizes.
    pub fn larger_than(&self, room: &Self) -> Option<(BufferId, u64, u64)> {
        let pairs = BufferId::ALL.into_iter().zip(self.0.into_iter().zip(room.0));
        pairs.map(|(id, (size, room))| (id, size, room)).find(|(_, size, room)| size > room)
    }
}

impl std::ops::Index<BufferId> for Sizes {
    type Output = u64;

    fn index(&self, id: BufferId) -> &u64 {
        &self.0[id as usize]
    }
}

impl std::ops::IndexMut<BufferId> for Sizes {
    fn index_mut(&mut self, id: BufferId) -> &mut u64 {
        &mut self.0[id as usize]
    }
}

impl BufferId {
    /// How softras uses the buffer: the usages of its row, and those that the kernels' bindings need.
    pub(crate) fn usage(self) -> vk::BufferUsageFlags {
        static USAGES: OnceLock<[vk::BufferUsageFlags; BufferId::COUNT]> = OnceLock::new();
        let usages = USAGES.get_or_init(|| {
            let mut usages = Self::ALL.map(|id| id.row().usage);
            for binding in kernels::ALL.iter().flat_map(|kernel| kernel.bindings) {
                let usage = binding.kind.buffer_usage();
                let alias = ALIASES.iter().find(|(alias, _)| *alias == binding.name);
                let own = Self::of_binding(binding.name);
                for id in alias.map_or(&[][..], |(_, ids)| ids).iter().copied().chain(own) {
                    usages[id as usize] |= usage;
                }
            }
            usages
        });
        usages[self as usize]
    }

    /// The buffer of a kernel's binding: `bin_ranges`, or the block `BinRanges` if the kernel writes it. `None` for the
    /// [`ALIASES`] and for names that are no buffer of a frame.
    pub(crate) fn of_binding(binding: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|id| is_binding_of(binding, id.name()))
    }
}

/// The kernels whose buffers are those of the table. The self-test, and what reads a host's geometry and writes its images,
/// have buffers and push constants of their own.
#[cfg(test)]
pub fn kernels_of_a_frame() -> impl Iterator<Item = &'static crate::vulkan::Kernel> {
    const OTHERS: [&str; 4] = ["counts", "place", "selftest", "store"];
    kernels::ALL.iter().copied().filter(|kernel| !OTHERS.iter().any(|other| kernel.name.starts_with(other)))
}

/// Whether a binding has a buffer's name: in snake case, or in camel case as the name of a block.
pub fn is_binding_of(binding: &str, name: &str) -> bool {
    if binding == name {
        return true;
    }
    let mut letters = binding.chars().enumerate().flat_map(|(i, letter)| {
        let underscore = (letter.is_ascii_uppercase() && i > 0).then_some('_');
        underscore.into_iter().chain([letter.to_ascii_lowercase()])
    });
    name.chars().all(|letter| letters.next() == Some(letter)) && letters.next().is_none()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vulkan::{BindingKind, TexelFormat};

    fn resolves(binding: &str) -> bool {
        ALIASES.iter().any(|(alias, _)| *alias == binding) != BufferId::of_binding(binding).is_some()
    }

    /// The buffers that a binding can stand for: several of an alias, or the one of its name.
    fn buffers_of(binding: &str) -> Vec<BufferId> {
        let alias = ALIASES.iter().find(|(alias, _)| *alias == binding).map_or(&[][..], |(_, ids)| ids);
        alias.iter().copied().chain(BufferId::of_binding(binding)).collect()
    }

    #[test]
    fn every_binding_of_a_frames_kernels_is_in_the_table() {
        let mut kernels_seen = 0;
        for kernel in kernels_of_a_frame() {
            kernels_seen += 1;
            for binding in kernel.bindings {
                assert!(resolves(binding.name), "{}: `{}`", kernel.name, binding.name);
                for id in buffers_of(binding.name) {
                    let (format, kind) = (id.row().format, binding.kind);
                    let fits = match kind {
                        BindingKind::UniformTexelBufferFloat => {
                            matches!(format, TexelFormat::Float | TexelFormat::Float2 | TexelFormat::Float4)
                        }
                        BindingKind::UniformTexelBufferUint => {
                            matches!(format, TexelFormat::Uint | TexelFormat::Uint2 | TexelFormat::Uint4)
                        }
                        BindingKind::UniformTexelBufferInt => matches!(format, TexelFormat::Int4),
                        kind => kind == BindingKind::StorageBuffer,
                    };
                    assert!(fits, "{}: {id} is {format:?} read as {kind:?}", kernel.name);
                }
            }
        }
        assert!(kernels_seen >= 16, "{kernels_seen}");
        for wrong in ["", "binranges", "Bin_Ranges", "bin_range", "bin_rangess", "BinRange", "item", "Items"] {
            assert!(!resolves(wrong), "`{wrong}`");
        }
    }

    #[test]
    fn every_row_is_bound_by_some_kernel() {
        let bound = |id: BufferId| {
            let alias = |name: &str| ALIASES.iter().any(|(alias, ids)| *alias == name && ids.contains(&id));
            let mut bindings = kernels::ALL.iter().flat_map(|kernel| kernel.bindings);
            bindings.any(|binding| is_binding_of(binding.name, id.name()) || alias(binding.name))
        };
        for id in BufferId::ALL {
            assert!(bound(id) || id == BufferId::Unused, "{id}");
            assert_eq!(BufferId::ALL[id as usize], id);
            assert_eq!(BufferId::of_binding(id.name()), Some(id), "names are unique");
        }
    }

    #[test]
    fn sizes_are_found_by_their_id() {
        let mut sizes = Sizes::NONE;
        sizes[BufferId::Color] = 64;
        sizes[BufferId::Totals] = 48;
        assert_eq!(sizes.iter().collect::<Vec<_>>(), [(BufferId::Color, 64), (BufferId::Totals, 48)]);
        let mut room = sizes;
        assert_eq!(sizes.larger_than(&room), None);
        room[BufferId::Totals] = 47;
        assert_eq!(sizes.larger_than(&room), Some((BufferId::Totals, 48, 47)));
    }
}
