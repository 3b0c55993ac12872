//! The kernels: SPIR-V, and the interface that `build.rs` reads out of it.

use super::host_memory::ImageFormat;
use super::result::misuse_of;
use crate::Error;

/// A compute kernel: its SPIR-V and all that the SPIR-V says about its interface.
///
/// Drivers do not validate SPIR-V, so only [`kernels`] are accepted.
#[derive(Debug)]
pub struct Kernel {
    /// The file's name without `.comp`.
    pub name: &'static str,
    /// SPIR-V 1.3.
    pub spirv: &'static [u32],
    /// Invocations a workgroup along x, y, z, before specialization.
    pub local_size: [u32; 3],
    /// The specialization constants that set the local size, where there are such.
    pub local_size_ids: [Option<u32>; 3],
    /// The capabilities that it requires of a device, by SPIR-V's names (`GroupNonUniformShuffle`). Every device of Vulkan 1.1 has
    /// `Shader`, `SampledBuffer` and `GroupNonUniform`.
    pub capabilities: &'static [&'static str],
    /// Bytes of its `shared` variables, specialization constants at their defaults.
    pub shared_bytes: u32,
    /// The descriptors of set 0, in the order of their binding numbers.
    pub bindings: &'static [Binding],
    /// Size of the push constants in bytes, a multiple of four.
    pub push_constant_bytes: u32,
    /// The push constants, which tests compare with their mirrors in Rust.
    #[cfg(test)]
    pub push_members: &'static [Member],
    /// The specialization constants, in the order of their ids.
    pub specialization: &'static [Specialization],
    /// Every record in a storage or uniform buffer, blocks included, in the order of the SPIR-V; for tests as well.
    #[cfg(test)]
    pub structs: &'static [Struct],
}

impl Kernel {
    /// The error for a use that its interface does not allow; `call` is the Vulkan call that would be invalid.
    pub(super) fn misuse(&self, call: &'static str, what: &str) -> Error {
        misuse_of(call, &format!("kernel `{}`: {what}", self.name))
    }

    /// The binding of this name.
    pub fn binding(&self, name: &str) -> Option<&'static Binding> {
        self.bindings.iter().find(|b| b.name == name)
    }
}

/// One descriptor of set 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Binding {
    /// The variable's name, or the block's where it has no instance name.
    pub name: &'static str,
    /// layout(binding = ...).
    pub binding: u32,
    /// The kind of resource that is bound.
    pub kind: BindingKind,
}

/// The kind of resource that a binding holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BindingKind {
    /// `buffer` block.
    StorageBuffer,
    /// `samplerBuffer` or `textureBuffer`.
    UniformTexelBufferFloat,
    /// `isamplerBuffer`.
    UniformTexelBufferInt,
    /// `usamplerBuffer`.
    UniformTexelBufferUint,
    /// `texture2D`, read without a sampler.
    SampledImage,
    /// `image2D` of this format.
    StorageImage(ImageFormat),
}

/// One member of a record or of the push constants.
#[cfg(test)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Member {
    /// Its name in GLSL.
    pub name: &'static str,
    /// Bytes from the start of the record.
    pub offset: u32,
    /// Bytes it covers; 0 for an array without a length.
    pub size: u32,
    /// Bytes from one array element to the next; 0 if it is no array.
    pub stride: u32,
}

/// A record as it lies in a buffer.
#[cfg(test)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Struct {
    /// Its name in GLSL.
    pub name: &'static str,
    /// Bytes up to the end of the last member.
    pub size: u32,
    /// Bytes from one to the next in an array of them; 0 if there is no such array.
    pub stride: u32,
    /// Its members.
    pub members: &'static [Member],
}

/// A specialization constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Specialization {
    /// Its name in GLSL; `local_size_x`, `_y`, `_z` for those that only set the local size.
    pub name: &'static str,
    /// layout(constant_id = ...).
    pub id: u32,
    /// Its value if none is given, and with it its type.
    pub default: SpecValue,
}

/// The value of a specialization constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SpecValue {
    /// `bool`.
    Bool(bool),
    /// `int`.
    Int(i32),
    /// `uint`.
    Uint(u32),
    /// `float`.
    Float(f32),
}

impl SpecValue {
    /// The word of SPIR-V that holds it; 0 or 1 for a bool.
    pub(super) fn word(self) -> u32 {
        match self {
            Self::Bool(value) => value.into(),
            Self::Int(value) => value.cast_unsigned(),
            Self::Uint(value) => value,
            Self::Float(value) => value.to_bits(),
        }
    }

    /// Whether both are of one GLSL type.
    pub(super) fn same_type(self, other: Self) -> bool {
        std::mem::discriminant(&self) == std::mem::discriminant(&other)
    }
}

impl From<bool> for SpecValue {
    fn from(value: bool) -> Self {
        Self::Bool(value)
    }
}

impl From<i32> for SpecValue {
    fn from(value: i32) -> Self {
        Self::Int(value)
    }
}

impl From<u32> for SpecValue {
    fn from(value: u32) -> Self {
        Self::Uint(value)
    }
}

impl From<f32> for SpecValue {
    fn from(value: f32) -> Self {
        Self::Float(value)
    }
}

/// One static for each file of `glsl/*.comp`, in capitals: `glsl/forward.comp` is `FORWARD`.
pub mod kernels {
    use super::{Binding, BindingKind, ImageFormat, Kernel, SpecValue, Specialization};
    #[cfg(test)]
    use super::{Member, Struct};

    /// Turns a SPIR-V file into words at compile time, because included bytes have no alignment.
    const fn words<const N: usize>(bytes: &[u8]) -> [u32; N] {
        assert!(bytes.len() == 4 * N);
        let mut words = [0; N];
        let mut i = 0;
        while i < N {
            words[i] = u32::from_le_bytes([bytes[4 * i], bytes[4 * i + 1], bytes[4 * i + 2], bytes[4 * i + 3]]);
            i += 1;
        }
        words
    }

    include!(concat!(env!("OUT_DIR"), "/kernels.rs"));
}

/// The constants of `glsl/common/constants.glsl`, of which some are the kernels' alone.
#[allow(dead_code, clippy::approx_constant, clippy::excessive_precision, clippy::unreadable_literal)]
pub mod constants {
    include!(concat!(env!("OUT_DIR"), "/constants.rs"));
}
