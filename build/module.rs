//! A SPIR-V module as tables: types, names, decorations, constants and variables by their ids.

use spirv::{BuiltIn, Decoration, Dim, ExecutionMode, ImageFormat, Op, StorageClass};
use std::collections::{HashMap, HashSet};

/// A type, with the ids of the types that it is made of.
pub enum Type {
    Bool,
    Int { bytes: u32, signed: bool },
    Float { bytes: u32 },
    Vector { component: u32, count: u32 },
    Image { sampled: u32, dim: Option<Dim>, texel: u32, format: Option<ImageFormat> },
    SampledImage { image: u32 },
    Array { element: u32, length: u32 },
    RuntimeArray { element: u32 },
    Struct { members: Vec<u32> },
    Pointer { pointee: u32 },
}

/// The declarations of a module, by ids.
#[derive(Default)]
pub struct Module {
    pub names: HashMap<u32, String>,
    pub member_names: HashMap<(u32, u32), String>,
    pub decorations: HashMap<(u32, Decoration), u32>,
    pub member_decorations: HashMap<(u32, u32, Decoration), u32>,
    pub types: HashMap<u32, Type>,
    /// Type and value of each scalar constant; specialization constants have their default.
    pub constants: HashMap<u32, (u32, u32)>,
    pub spec_constants: Vec<u32>,
    /// The operands of each constant that is computed from others.
    pub computed: HashMap<u32, Vec<u32>>,
    /// Ids that code or an array's length names.
    pub used: HashSet<u32>,
    in_code: bool,
    pub composites: HashMap<u32, Vec<u32>>,
    /// Id, pointer type and storage class of each global variable.
    pub variables: Vec<(u32, u32, Option<StorageClass>)>,
    pub capabilities: Vec<u32>,
    pub local_size: [u32; 3],
}

/// A literal string of an instruction: UTF-8, ended by a zero byte.
fn text(words: &[u32]) -> String {
    let bytes: Vec<u8> = words.iter().flat_map(|w| w.to_le_bytes()).take_while(|&b| b != 0).collect();
    String::from_utf8_lossy(&bytes).into_owned()
}

impl Module {
    /// Reads a module given as words.
    pub fn parse(words: &[u32]) -> Result<Self, String> {
        if words.len() < 5 || words[0] != spirv::MAGIC_NUMBER {
            return Err("not a SPIR-V module".to_string());
        }
        let mut module = Self { local_size: [1; 3], ..Self::default() };
        let mut rest = &words[5..];
        while let Some(&head) = rest.first() {
            let count = (head >> 16) as usize;
            if count == 0 || count > rest.len() {
                return Err("a SPIR-V instruction runs past the end of the module".to_string());
            }
            if let Some(op) = Op::from_u32(head & 0xffff) {
                let operands = &rest[1..count];
                // From the first OpFunction on all is code. A literal among the operands may look like an id, which only makes
                // one more constant count as used.
                module.in_code |= op == Op::Function;
                if module.in_code {
                    module.used.extend(operands);
                }
                module.annotation(op, operands);
                module.declaration(op, operands);
                module.constant(op, operands);
            }
            rest = &rest[count..];
        }
        Ok(module)
    }

    /// Names, decorations, capabilities and the local size.
    fn annotation(&mut self, op: Op, operands: &[u32]) {
        match (op, operands) {
            (Op::Capability, [capability]) => self.capabilities.push(*capability),
            (Op::Name, [id, name @ ..]) => _ = self.names.insert(*id, text(name)),
            (Op::MemberName, [id, member, name @ ..]) => _ = self.member_names.insert((*id, *member), text(name)),
            (Op::ExecutionMode, [_, mode, x, y, z]) if *mode == ExecutionMode::LocalSize as u32 => {
                self.local_size = [*x, *y, *z];
            }
            (Op::Decorate, [id, decoration, value @ ..]) => {
                if let Some(decoration) = Decoration::from_u32(*decoration) {
                    self.decorations.insert((*id, decoration), value.first().copied().unwrap_or(0));
                }
            }
            (Op::MemberDecorate, [id, member, decoration, value @ ..]) => {
                if let Some(decoration) = Decoration::from_u32(*decoration) {
                    let value = value.first().copied().unwrap_or(0);
                    self.member_decorations.insert((*id, *member, decoration), value);
                }
            }
            _ => {}
        }
    }

    /// Types and global variables.
    fn declaration(&mut self, op: Op, operands: &[u32]) {
        let (id, ty) = match (op, operands) {
            (Op::TypeBool, [id]) => (id, Type::Bool),
            (Op::TypeInt, [id, bits, sign]) => (id, Type::Int { bytes: bits / 8, signed: *sign == 1 }),
            (Op::TypeFloat, [id, bits, ..]) => (id, Type::Float { bytes: bits / 8 }),
            (Op::TypeVector, [id, component, count]) => (id, Type::Vector { component: *component, count: *count }),
            (Op::TypeImage, [id, texel, dim, _, _, _, sampled, format, ..]) => {
                let (dim, format) = (Dim::from_u32(*dim), ImageFormat::from_u32(*format));
                (id, Type::Image { sampled: *sampled, dim, texel: *texel, format })
            }
            (Op::TypeSampledImage, [id, image]) => (id, Type::SampledImage { image: *image }),
            (Op::TypeArray, [id, element, length]) => {
                self.used.insert(*length);
                (id, Type::Array { element: *element, length: *length })
            }
            (Op::TypeRuntimeArray, [id, element]) => (id, Type::RuntimeArray { element: *element }),
            (Op::TypeStruct, [id, members @ ..]) => (id, Type::Struct { members: members.to_vec() }),
            (Op::TypePointer, [id, _, pointee]) => (id, Type::Pointer { pointee: *pointee }),
            (Op::Variable, [ty, id, storage, ..]) => {
                return self.variables.push((*id, *ty, StorageClass::from_u32(*storage)));
            }
            _ => return,
        };
        self.types.insert(*id, ty);
    }

    /// Constants, specialization constants among them.
    fn constant(&mut self, op: Op, operands: &[u32]) {
        match (op, operands) {
            (Op::Constant, [ty, id, value, ..]) => _ = self.constants.insert(*id, (*ty, *value)),
            (Op::SpecConstantTrue | Op::SpecConstantFalse | Op::SpecConstant, [ty, id, value @ ..]) => {
                let value = value.first().copied().unwrap_or(u32::from(op == Op::SpecConstantTrue));
                self.constants.insert(*id, (*ty, value));
                self.spec_constants.push(*id);
            }
            (Op::SpecConstantOp, [_, id, _, operands @ ..]) => _ = self.computed.insert(*id, operands.to_vec()),
            (Op::ConstantComposite | Op::SpecConstantComposite, [_, id, parts @ ..]) => {
                self.used.extend(parts);
                self.composites.insert(*id, parts.to_vec());
            }
            _ => {}
        }
    }

    pub fn name(&self, id: u32) -> &str {
        self.names.get(&id).map_or("", String::as_str)
    }

    pub fn decoration(&self, id: u32, decoration: Decoration) -> Option<u32> {
        self.decorations.get(&(id, decoration)).copied()
    }

    pub fn ty(&self, id: u32) -> Result<&Type, String> {
        self.types.get(&id).ok_or_else(|| format!("type %{id} ({}) is of an unknown kind", self.name(id)))
    }

    /// The parts of gl_WorkGroupSize, if the module decorates a constant as such.
    pub fn workgroup_size(&self) -> Option<&Vec<u32>> {
        let is_size = |(key, value): (&(u32, Decoration), &u32)| {
            (key.1 == Decoration::BuiltIn && *value == BuiltIn::WorkgroupSize as u32).then_some(key.0)
        };
        self.composites.get(&self.decorations.iter().find_map(is_size)?)
    }

    /// The constants that code depends on: what it names, and what that was computed from.
    pub fn live(&self) -> HashSet<u32> {
        let mut open: Vec<u32> = self.used.iter().copied().collect();
        let mut live = self.used.clone();
        while let Some(id) = open.pop() {
            open.extend(self.computed.get(&id).into_iter().flatten().filter(|&&operand| live.insert(operand)));
        }
        live
    }
}
