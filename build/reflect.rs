//! Reads out of a SPIR-V module what the host must agree with: bindings, push constants, specialization constants,
//! the local size and the layout of every record in a storage buffer.
//!
//! Only what glslang emits for a compute kernel is understood; anything else is an error that names it.

use std::collections::{BTreeMap, HashMap, HashSet};

/// What a binding holds, as the name of a variant of `BindingKind` in the library.
pub type Kind = &'static str;

/// One descriptor of set 0.
pub struct Binding {
    pub name: String,
    pub binding: u32,
    pub kind: Kind,
    pub readonly: bool,
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

/// All that a kernel's SPIR-V says about its interface.
pub struct Reflection {
    /// What the module asks of a device, by SPIR-V's names.
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

enum Type {
    Bool,
    Int { bytes: u32, signed: bool },
    Float { bytes: u32 },
    Vector { component: u32, count: u32 },
    Matrix { column: u32, columns: u32 },
    Image { sampled: u32, dim: u32, texel: u32, format: u32 },
    SampledImage { image: u32 },
    Array { element: u32, length: u32 },
    RuntimeArray { element: u32 },
    Struct { members: Vec<u32> },
    Pointer { storage: u32, pointee: u32 },
}

/// Storage classes.
const UNIFORM_CONSTANT: u32 = 0;
const UNIFORM: u32 = 2;
const WORKGROUP: u32 = 4;
const PUSH_CONSTANT: u32 = 9;
const STORAGE_BUFFER: u32 = 12;
/// Decorations.
const SPEC_ID: u32 = 1;
const BUFFER_BLOCK: u32 = 3;
const ARRAY_STRIDE: u32 = 6;
const MATRIX_STRIDE: u32 = 7;
const BUILT_IN: u32 = 11;
const NON_WRITABLE: u32 = 24;
const BINDING: u32 = 33;
const DESCRIPTOR_SET: u32 = 34;
const OFFSET: u32 = 35;
/// The built-in variable gl_WorkGroupSize.
const WORKGROUP_SIZE: u32 = 25;
/// Image dimension 2D.
const DIM_2D: u32 = 1;
/// Image dimension Buffer: a texel buffer.
const DIM_BUFFER: u32 = 5;

#[derive(Default)]
struct Module {
    names: HashMap<u32, String>,
    member_names: HashMap<(u32, u32), String>,
    decorations: HashMap<(u32, u32), u32>,
    member_decorations: HashMap<(u32, u32, u32), u32>,
    types: HashMap<u32, Type>,
    /// Value of each scalar constant, specialization constants with their default.
    constants: HashMap<u32, (u32, u32)>,
    spec_constants: Vec<u32>,
    /// The operands of each constant computed from others.
    computed: HashMap<u32, Vec<u32>>,
    /// Ids that code or an array's length names.
    used: HashSet<u32>,
    in_code: bool,
    composites: HashMap<u32, Vec<u32>>,
    /// (id, pointer type, storage class) of each global variable.
    variables: Vec<(u32, u32, u32)>,
    capabilities: Vec<u32>,
    local_size: [u32; 3],
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
            PUSH_CONSTANT => push_members = module.members(*pointee)?,
            WORKGROUP => shared_bytes += module.bare_size(*pointee)?,
            UNIFORM_CONSTANT | UNIFORM | STORAGE_BUFFER => {
                bindings.push(module.binding(id, *pointee, storage)?);
                if storage != UNIFORM_CONSTANT {
                    module.collect_structs(*pointee, 0, &mut structs)?;
                }
            }
            _ => {}
        }
    }
    bindings.sort_by_key(|b| b.binding);
    if let Some(pair) = bindings.windows(2).find(|pair| pair[0].binding == pair[1].binding) {
        return Err(format!("`{}` and `{}` share binding {}", pair[0].name, pair[1].name, pair[0].binding));
    }
    let (local_size, local_size_ids) = module.local_size();
    Ok(Reflection {
        capabilities: module.capabilities.iter().map(|&c| capability(c)).collect(),
        shared_bytes,
        local_size,
        local_size_ids,
        bindings,
        push_members,
        specialization: module.specialization()?,
        structs,
    })
}

/// A capability's name, as far as a compute kernel is likely to have it.
fn capability(number: u32) -> String {
    let name = match number {
        0 => "Matrix",
        1 => "Shader",
        9 => "Float16",
        10 => "Float64",
        11 => "Int64",
        12 => "Int64Atomics",
        22 => "Int16",
        39 => "Int8",
        46 => "SampledBuffer",
        47 => "ImageBuffer",
        50 => "ImageQuery",
        61 => "GroupNonUniform",
        62 => "GroupNonUniformVote",
        63 => "GroupNonUniformArithmetic",
        64 => "GroupNonUniformBallot",
        65 => "GroupNonUniformShuffle",
        66 => "GroupNonUniformShuffleRelative",
        67 => "GroupNonUniformClustered",
        68 => "GroupNonUniformQuad",
        _ => return format!("Capability{number}"),
    };
    name.to_string()
}

/// A literal string of an instruction: UTF-8, ended by a zero byte.
fn text(words: &[u32]) -> String {
    let bytes: Vec<u8> = words.iter().flat_map(|w| w.to_le_bytes()).take_while(|&b| b != 0).collect();
    String::from_utf8_lossy(&bytes).into_owned()
}

impl Module {
    fn parse(words: &[u32]) -> Result<Self, String> {
        if words.len() < 5 || words[0] != 0x0723_0203 {
            return Err("not a SPIR-V module".to_string());
        }
        let mut module = Self { local_size: [1; 3], ..Self::default() };
        let mut rest = &words[5..];
        while let Some(&head) = rest.first() {
            let count = (head >> 16) as usize;
            if count == 0 || count > rest.len() {
                return Err("a SPIR-V instruction runs past the end of the module".to_string());
            }
            module.instruction(head & 0xffff, &rest[1..count]);
            rest = &rest[count..];
        }
        Ok(module)
    }

    fn instruction(&mut self, opcode: u32, o: &[u32]) {
        // From the first OpFunction on all is code. A literal among the operands may look like an id: harmless.
        self.in_code |= opcode == 54;
        if self.in_code {
            self.used.extend(o);
        }
        match (opcode, o) {
            (17, [capability]) => self.capabilities.push(*capability),
            (5, [id, name @ ..]) => _ = self.names.insert(*id, text(name)),
            (6, [id, member, name @ ..]) => _ = self.member_names.insert((*id, *member), text(name)),
            // OpExecutionMode LocalSize
            (16, [_, 17, x, y, z]) => self.local_size = [*x, *y, *z],
            (20, [id]) => _ = self.types.insert(*id, Type::Bool),
            (21, [id, bits, sign]) => _ = self.types.insert(*id, Type::Int { bytes: bits / 8, signed: *sign == 1 }),
            (22, [id, bits, ..]) => _ = self.types.insert(*id, Type::Float { bytes: bits / 8 }),
            (23, [id, component, count]) => {
                _ = self.types.insert(*id, Type::Vector { component: *component, count: *count })
            }
            (24, [id, column, columns]) => {
                _ = self.types.insert(*id, Type::Matrix { column: *column, columns: *columns })
            }
            (25, [id, texel, dim, _, _, _, sampled, format, ..]) => {
                _ = self.types.insert(*id, Type::Image { sampled: *sampled, dim: *dim, texel: *texel, format: *format })
            }
            (27, [id, image]) => _ = self.types.insert(*id, Type::SampledImage { image: *image }),
            (28, [id, element, length]) => {
                self.used.insert(*length);
                _ = self.types.insert(*id, Type::Array { element: *element, length: *length })
            }
            (29, [id, element]) => _ = self.types.insert(*id, Type::RuntimeArray { element: *element }),
            (30, [id, members @ ..]) => _ = self.types.insert(*id, Type::Struct { members: members.to_vec() }),
            (32, [id, storage, pointee]) => {
                _ = self.types.insert(*id, Type::Pointer { storage: *storage, pointee: *pointee })
            }
            // OpConstant and the specialization constants true, false, value.
            (43, [ty, id, value, ..]) => _ = self.constants.insert(*id, (*ty, *value)),
            (48..=50, [ty, id, value @ ..]) => {
                let value = value.first().copied().unwrap_or(u32::from(opcode == 48));
                self.constants.insert(*id, (*ty, value));
                self.spec_constants.push(*id);
            }
            // OpSpecConstantOp
            (52, [_, id, _, operands @ ..]) => _ = self.computed.insert(*id, operands.to_vec()),
            (44 | 51, [_, id, parts @ ..]) => {
                self.used.extend(parts);
                _ = self.composites.insert(*id, parts.to_vec())
            }
            (59, [ty, id, storage, ..]) => self.variables.push((*id, *ty, *storage)),
            (71, [id, decoration, value @ ..]) => {
                _ = self.decorations.insert((*id, *decoration), value.first().copied().unwrap_or(0))
            }
            (72, [id, member, decoration, value @ ..]) => {
                _ = self.member_decorations.insert((*id, *member, *decoration), value.first().copied().unwrap_or(0))
            }
            _ => {}
        }
    }

    fn name(&self, id: u32) -> &str {
        self.names.get(&id).map_or("", String::as_str)
    }

    fn decoration(&self, id: u32, decoration: u32) -> Option<u32> {
        self.decorations.get(&(id, decoration)).copied()
    }

    fn ty(&self, id: u32) -> Result<&Type, String> {
        self.types.get(&id).ok_or_else(|| format!("type %{id} ({}) is of an unknown kind", self.name(id)))
    }

    /// A variable of set 0 with its kind. An instance name stands for the block where there is one.
    fn binding(&self, id: u32, pointee: u32, storage: u32) -> Result<Binding, String> {
        let name = if self.name(id).is_empty() { self.name(pointee) } else { self.name(id) }.to_string();
        let binding = self.decoration(id, BINDING).ok_or(format!("`{name}` has no layout(binding = ...)"))?;
        if self.decoration(id, DESCRIPTOR_SET).unwrap_or(0) != 0 {
            return Err(format!("`{name}` is not in set 0"));
        }
        let image = match self.ty(pointee)? {
            Type::SampledImage { image } => *image,
            _ => pointee,
        };
        let kind = match self.ty(image)? {
            Type::Struct { .. } if storage == STORAGE_BUFFER => "StorageBuffer",
            Type::Struct { .. } if self.decoration(pointee, BUFFER_BLOCK).is_some() => "StorageBuffer",
            Type::Struct { .. } => "UniformBuffer",
            Type::Image { dim: DIM_BUFFER, sampled: 1, texel, .. } => match self.ty(*texel)? {
                Type::Int { signed: true, .. } => "UniformTexelBufferInt",
                Type::Int { .. } => "UniformTexelBufferUint",
                _ => "UniformTexelBufferFloat",
            },
            Type::Image { dim: DIM_BUFFER, .. } => "StorageTexelBuffer",
            Type::Image { dim: DIM_2D, sampled: 1, .. } if image == pointee => "SampledImage",
            Type::Image { dim: DIM_2D, sampled: 2, format: 1, .. } => "StorageImage(ImageFormat::Rgba32Float)",
            Type::Image { dim: DIM_2D, sampled: 2, format: 2, .. } => "StorageImage(ImageFormat::Rgba16Float)",
            Type::Image { dim: DIM_2D, sampled: 2, format: 3, .. } => "StorageImage(ImageFormat::R32Float)",
            Type::Image { dim: DIM_2D, sampled: 2, format: 4, .. } => "StorageImage(ImageFormat::Rgba8Unorm)",
            _ => {
                return Err(format!(
                    "`{name}`: only buffers, texel buffers, textures without sampler and images of four formats can be bound"
                ));
            }
        };
        // A `readonly` block carries the decoration on the variable or on each member.
        let readonly = self.decoration(id, NON_WRITABLE).is_some()
            || self.member_decorations.contains_key(&(pointee, 0, NON_WRITABLE))
            || kind.starts_with("Uniform")
            || kind == "SampledImage";
        Ok(Binding { name, binding, kind, readonly })
    }

    /// Bytes of a type laid out as `matrix_stride` and the decorations say; 0 for a runtime array.
    fn size(&self, id: u32, matrix_stride: Option<u32>) -> Result<u32, String> {
        Ok(match self.ty(id)? {
            Type::Bool => 4,
            Type::Int { bytes, .. } | Type::Float { bytes } => *bytes,
            Type::Vector { component, count } => self.size(*component, None)? * count,
            Type::Matrix { columns, .. } => matrix_stride.ok_or(format!("matrix type %{id} has no stride"))? * columns,
            Type::Array { element, length } => {
                let count = self.constants.get(length).ok_or("an array's length is no constant")?.1;
                let stride = self.decoration(id, ARRAY_STRIDE);
                count * stride.map_or_else(|| self.size(*element, matrix_stride), Ok)?
            }
            Type::RuntimeArray { .. } => 0,
            Type::Struct { .. } => self.members(id)?.iter().map(|m| m.offset + m.size).max().unwrap_or(0),
            Type::Pointer { storage, .. } => return Err(format!("a pointer (class {storage}) inside a record")),
            Type::Image { .. } | Type::SampledImage { .. } => return Err("an image inside a record".to_string()),
        })
    }

    /// Bytes of a type without a layout, as `shared` variables have none.
    fn bare_size(&self, id: u32) -> Result<u32, String> {
        Ok(match self.ty(id)? {
            Type::Array { element, length } => {
                self.bare_size(*element)? * self.constants.get(length).map_or(1, |constant| constant.1)
            }
            Type::Struct { members } => members.iter().map(|&m| self.bare_size(m)).sum::<Result<_, _>>()?,
            Type::Matrix { column, columns } => self.size(*column, None)? * columns,
            _ => self.size(id, None)?,
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
        let offset = decoration(OFFSET).ok_or(format!("`{}.{name}` has no offset", self.name(id)))?;
        let stride = match self.ty(ty)? {
            Type::Array { .. } | Type::RuntimeArray { .. } => self.decoration(ty, ARRAY_STRIDE).unwrap_or(0),
            _ => 0,
        };
        Ok(Member { name, offset, size: self.size(ty, decoration(MATRIX_STRIDE))?, stride })
    }

    /// This struct and every one inside it, in the order met.
    fn collect_structs(&self, id: u32, stride: u32, found: &mut Vec<Struct>) -> Result<(), String> {
        match self.ty(id)? {
            Type::Array { element, .. } | Type::RuntimeArray { element } => {
                self.collect_structs(*element, self.decoration(id, ARRAY_STRIDE).unwrap_or(0), found)
            }
            Type::Struct { members } => {
                let name = self.name(id).to_string();
                let record = Struct { name, size: self.size(id, None)?, stride, members: self.members(id)? };
                if !found.contains(&record) {
                    found.push(record);
                }
                members.iter().try_for_each(|&member| self.collect_structs(member, 0, found))
            }
            _ => Ok(()),
        }
    }

    /// gl_WorkGroupSize's parts, if the module decorates a constant as such.
    fn workgroup_size(&self) -> Option<&Vec<u32>> {
        let is_size =
            |(key, value): (&(u32, u32), &u32)| (key.1 == BUILT_IN && *value == WORKGROUP_SIZE).then_some(key.0);
        self.composites.get(&self.decorations.iter().find_map(is_size)?)
    }

    fn local_size(&self) -> ([u32; 3], [Option<u32>; 3]) {
        let mut size = self.local_size;
        let mut ids = [None; 3];
        for (axis, part) in self.workgroup_size().into_iter().flatten().enumerate().take(3) {
            size[axis] = self.constants.get(part).map_or(size[axis], |constant| constant.1);
            ids[axis] = self.decoration(*part, SPEC_ID);
        }
        (size, ids)
    }

    /// The constants that code depends on: what it names, and what that was computed from.
    fn live(&self) -> HashSet<u32> {
        let mut open: Vec<u32> = self.used.iter().copied().collect();
        let mut live = self.used.clone();
        while let Some(id) = open.pop() {
            open.extend(self.computed.get(&id).into_iter().flatten().filter(|&&operand| live.insert(operand)));
        }
        live
    }

    /// What a pipeline can be specialised by. Constants that only the includes know are left out: a pipeline is then the
    /// same for all their values.
    fn specialization(&self) -> Result<Vec<Specialization>, String> {
        let live = self.live();
        // glslang may emit local_size_x_id's constant twice: keyed by id, the named one wins.
        let mut found: BTreeMap<u32, Specialization> = BTreeMap::new();
        for constant in self.spec_constants.iter().filter(|constant| live.contains(constant)) {
            let Some(id) = self.decoration(*constant, SPEC_ID) else { continue };
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
