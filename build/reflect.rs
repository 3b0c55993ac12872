//! Reads out of a SPIR-V module what the host must agree with: bindings, push constants, specialization constants,
//! the local size and the layout of every record in a storage buffer.
//!
//! It understands what glslang emits for a compute kernel; anything else is an error that names it. Not rspirv-reflect: that
//! crate finds bindings and the size of push constants alone, and would add six crates to the thirteen of this build.

use super::module::{Module, Type};
use spirv::{Capability, Decoration, Dim, ImageFormat, StorageClass};
use std::collections::BTreeMap;

/// The kind of a binding, as the name of a variant of `BindingKind` in the library.
pub type Kind = &'static str;

/// One descriptor of set 0.
pub struct Binding {
    pub name: String,
    pub binding: u32,
    pub kind: Kind,
}

/// One member of a record.
#[derive(Clone, PartialEq)]
pub struct Member {
    pub name: String,
    pub offset: u32,
    /// Bytes the member covers; 0 for a runtime array.
    pub size: u32,
    /// Bytes from one array element to the next; 0 if the member is no array.
    pub stride: u32,
}

/// A record in a storage or uniform buffer.
#[derive(Clone, PartialEq)]
pub struct Struct {
    pub name: String,
    pub size: u32,
    /// Bytes from one to the next in an array of them; 0 if there is no such array.
    pub stride: u32,
    pub members: Vec<Member>,
}

/// A specialization constant; `default` is a variant of the library's `SpecValue` as Rust source.
pub struct Specialization {
    pub name: String,
    pub id: u32,
    pub default: String,
}

/// The interface of a kernel.
pub struct Reflection {
    /// The capabilities that the module requires of a device, by SPIR-V's names.
    pub capabilities: Vec<String>,
    /// Bytes of `shared` variables, specialization constants at their defaults.
    pub shared_bytes: u32,
    pub local_size: [u32; 3],
    pub local_size_ids: [Option<u32>; 3],
    pub bindings: Vec<Binding>,
    pub push_members: Vec<Member>,
    pub specialization: Vec<Specialization>,
    pub structs: Vec<Struct>,
}

/// Reflects one module given as words.
pub fn reflect(words: &[u32]) -> Result<Reflection, String> {
    let module = Module::parse(words)?;
    let mut bindings = Vec::new();
    let mut push_members = Vec::new();
    let mut structs = Vec::new();
    let mut shared_bytes = 0;
    for &(id, pointer, storage) in &module.variables {
        let Some(Type::Pointer { pointee, .. }) = module.types.get(&pointer) else {
            return Err(format!("variable %{id} is of no pointer type"));
        };
        match storage {
            Some(StorageClass::PushConstant) => push_members = module.members(*pointee)?,
            Some(StorageClass::Workgroup) => shared_bytes += module.bare_size(*pointee)?,
            Some(StorageClass::UniformConstant) => bindings.push(module.binding(id, *pointee, false)?),
            Some(class @ (StorageClass::Uniform | StorageClass::StorageBuffer)) => {
                bindings.push(module.binding(id, *pointee, class == StorageClass::StorageBuffer)?);
                module.collect_structs(*pointee, 0, &mut structs)?;
            }
            _ => {}
        }
    }
    bindings.sort_by_key(|b| b.binding);
    if let Some(pair) = bindings.windows(2).find(|pair| pair[0].binding == pair[1].binding) {
        return Err(format!("`{}` and `{}` share binding {}", pair[0].name, pair[1].name, pair[0].binding));
    }
    let (local_size, local_size_ids) = module.local_size();
    let capability = |&number: &u32| match Capability::from_u32(number) {
        Some(capability) => Ok(format!("{capability:?}")),
        None => Err(format!("the module asks for the unknown capability {number}")),
    };
    let capabilities = module.capabilities.iter().map(capability).collect::<Result<_, _>>()?;
    Ok(Reflection {
        capabilities,
        shared_bytes,
        local_size,
        local_size_ids,
        bindings,
        push_members,
        specialization: module.specialization()?,
        structs,
    })
}

impl Module {
    /// A variable of set 0 with its kind. An instance name stands for the block where there is one.
    fn binding(&self, id: u32, pointee: u32, storage_buffer: bool) -> Result<Binding, String> {
        let name = if self.name(id).is_empty() { self.name(pointee) } else { self.name(id) }.to_string();
        let binding =
            self.decoration(id, Decoration::Binding).ok_or(format!("`{name}` has no layout(binding = ...)"))?;
        if self.decoration(id, Decoration::DescriptorSet).unwrap_or(0) != 0 {
            return Err(format!("`{name}` is not in set 0"));
        }
        let image = match self.ty(pointee)? {
            Type::SampledImage { image } => *image,
            _ => pointee,
        };
        let kind = match self.ty(image)? {
            Type::Struct { .. } if storage_buffer => "StorageBuffer",
            Type::Struct { .. } if self.decoration(pointee, Decoration::BufferBlock).is_some() => "StorageBuffer",
            Type::Struct { .. } => return Err(format!("`{name}`: no kernel has a uniform block")),
            Type::Image { dim: Some(Dim::DimBuffer), sampled: 1, texel, .. } => match self.ty(*texel)? {
                Type::Int { signed: true, .. } => "UniformTexelBufferInt",
                Type::Int { .. } => "UniformTexelBufferUint",
                _ => "UniformTexelBufferFloat",
            },
            Type::Image { dim: Some(Dim::Dim2D), sampled: 1, .. } if image == pointee => "SampledImage",
            Type::Image { dim: Some(Dim::Dim2D), sampled: 2, format, .. } => match format {
                Some(ImageFormat::Rgba32f) => "StorageImage(ImageFormat::Rgba32Float)",
                Some(ImageFormat::Rgba16f) => "StorageImage(ImageFormat::Rgba16Float)",
                Some(ImageFormat::R32f) => "StorageImage(ImageFormat::R32Float)",
                Some(ImageFormat::Rgba8) => "StorageImage(ImageFormat::Rgba8Unorm)",
                _ => return Err(format!("`{name}`: images of four formats can be bound, and this is another")),
            },
            _ => {
                return Err(format!("`{name}`: only buffers, uniform texel buffers, textures and images can be bound"));
            }
        };
        Ok(Binding { name, binding, kind })
    }

    /// Bytes of a type in the layout that the decorations give; 0 for a runtime array.
    fn size(&self, id: u32) -> Result<u32, String> {
        Ok(match self.ty(id)? {
            Type::Bool => 4,
            Type::Int { bytes, .. } | Type::Float { bytes } => *bytes,
            Type::Vector { component, count } => self.size(*component)? * count,
            Type::Array { element, length } => {
                let count = self.constants.get(length).ok_or("an array's length is no constant")?.1;
                let stride = self.decoration(id, Decoration::ArrayStride);
                count * stride.map_or_else(|| self.size(*element), Ok)?
            }
            Type::RuntimeArray { .. } => 0,
            Type::Struct { .. } => self.members(id)?.iter().map(|m| m.offset + m.size).max().unwrap_or(0),
            Type::Pointer { .. } => return Err("a pointer inside a record".to_string()),
            Type::Image { .. } | Type::SampledImage { .. } => return Err("an image inside a record".to_string()),
        })
    }

    /// Bytes of a type without a layout: `shared` variables have none.
    fn bare_size(&self, id: u32) -> Result<u32, String> {
        Ok(match self.ty(id)? {
            Type::Array { element, length } => {
                self.bare_size(*element)? * self.constants.get(length).map_or(1, |constant| constant.1)
            }
            Type::Struct { members } => members.iter().map(|&m| self.bare_size(m)).sum::<Result<_, _>>()?,
            _ => self.size(id)?,
        })
    }

    fn members(&self, id: u32) -> Result<Vec<Member>, String> {
        let Type::Struct { members } = self.ty(id)? else {
            return Err(format!("`{}` is no struct", self.name(id)));
        };
        (0..).zip(members).map(|(index, &ty)| self.member(id, index, ty)).collect()
    }

    fn member(&self, id: u32, index: u32, ty: u32) -> Result<Member, String> {
        let name = self.member_names.get(&(id, index)).cloned().unwrap_or_default();
        let decoration = |d| self.member_decorations.get(&(id, index, d)).copied();
        let offset = decoration(Decoration::Offset).ok_or(format!("`{}.{name}` has no offset", self.name(id)))?;
        let stride = match self.ty(ty)? {
            Type::Array { .. } | Type::RuntimeArray { .. } => self.decoration(ty, Decoration::ArrayStride).unwrap_or(0),
            _ => 0,
        };
        Ok(Member { name, offset, size: self.size(ty)?, stride })
    }

    /// This struct and every one inside it, in the order met.
    fn collect_structs(&self, id: u32, stride: u32, found: &mut Vec<Struct>) -> Result<(), String> {
        match self.ty(id)? {
            Type::Array { element, .. } | Type::RuntimeArray { element } => {
                self.collect_structs(*element, self.decoration(id, Decoration::ArrayStride).unwrap_or(0), found)
            }
            Type::Struct { members } => {
                let name = self.name(id).to_string();
                let record = Struct { name, size: self.size(id)?, stride, members: self.members(id)? };
                if !found.contains(&record) {
                    found.push(record);
                }
                members.iter().try_for_each(|&member| self.collect_structs(member, 0, found))
            }
            _ => Ok(()),
        }
    }

    fn local_size(&self) -> ([u32; 3], [Option<u32>; 3]) {
        let mut size = self.local_size;
        let mut ids = [None; 3];
        for (axis, part) in self.workgroup_size().into_iter().flatten().enumerate().take(3) {
            size[axis] = self.constants.get(part).map_or(size[axis], |constant| constant.1);
            ids[axis] = self.decoration(*part, Decoration::SpecId);
        }
        (size, ids)
    }

    /// The constants that a pipeline can be specialized by. Those that only an include declares and no code uses are left out,
    /// so that a pipeline is the same for all their values.
    fn specialization(&self) -> Result<Vec<Specialization>, String> {
        let live = self.live();
        // glslang may emit local_size_x_id's constant twice: keyed by id, the named one wins.
        let mut found: BTreeMap<u32, Specialization> = BTreeMap::new();
        for constant in self.spec_constants.iter().filter(|constant| live.contains(constant)) {
            let Some(id) = self.decoration(*constant, Decoration::SpecId) else { continue };
            let axis = self.workgroup_size().and_then(|parts| parts.iter().position(|part| part == constant));
            let name = match axis {
                _ if !self.name(*constant).is_empty() => self.name(*constant).to_string(),
                Some(axis) => format!("local_size_{}", ["x", "y", "z"][axis.min(2)]),
                None => String::new(),
            };
            if found.get(&id).is_some_and(|other| !other.name.is_empty()) {
                continue;
            }
            let (ty, value) = self.constants[constant];
            let default = match self.ty(ty)? {
                Type::Bool => format!("Bool({})", value != 0),
                Type::Int { signed: true, .. } => format!("Int({})", value.cast_signed()),
                Type::Int { .. } => format!("Uint({value})"),
                Type::Float { .. } => format!("Float({:?}f32)", f32::from_bits(value)),
                _ => return Err(format!("specialization constant `{name}` is no scalar")),
            };
            found.insert(id, Specialization { name, id, default });
        }
        Ok(found.into_values().collect())
    }
}
