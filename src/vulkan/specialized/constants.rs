//! The values of a module's constants, and the arithmetic of the operations on them.

use super::ids::Ids;
use super::{Instruction, made, opcode};
use spirv::{Decoration, Op};
use std::collections::HashMap;

/// The constants of a module, as far as they are known.
#[derive(Clone, Default)]
pub(super) struct Constants {
    /// The bits of each scalar; 0 or 1 for a bool.
    scalars: HashMap<u32, u32>,
    /// The members of each vector and array.
    composites: HashMap<u32, Vec<u32>>,
    /// The values of specialization constants by their ids in the module.
    given: HashMap<u32, u32>,
    /// The type of bools.
    bool_type: Option<u32>,
    /// The ids of scalars by type and value, and of undefined values by type.
    known: HashMap<(u32, Option<u32>), u32>,
    /// Instructions that define further ones.
    pub made: Vec<Instruction>,
}

impl Constants {
    /// Gives the values to the specialization constants with their `constant_id`.
    pub(super) fn new(globals: &[Instruction], values: &HashMap<u32, u32>) -> Self {
        let mut constants = Self::default();
        for instruction in globals {
            match (opcode(instruction), &instruction[1..]) {
                (Some(Op::TypeBool), &[id]) => constants.bool_type = Some(id),
                (Some(Op::Decorate), &[id, decoration, number]) if decoration == Decoration::SpecId as u32 => {
                    constants.given.extend(values.get(&number).map(|&value| (id, value)));
                }
                _ => {}
            }
        }
        constants
    }

    /// The value of a scalar where it is known.
    pub(super) fn scalar(&self, id: u32) -> Option<u32> {
        self.scalars.get(&id).copied()
    }

    /// Notes the constant that a global instruction defines. A constant that depends on specialization constants becomes a plain
    /// one where its value is known.
    pub(super) fn freeze(&mut self, instruction: &mut Instruction) {
        let Some(op) = opcode(instruction) else { return };
        let &[kind, id, ref operands @ ..] = instruction.get(1..).unwrap_or_default() else { return };
        let value = match (op, operands) {
            (Op::ConstantTrue, []) => Some(1),
            (Op::ConstantFalse, []) => Some(0),
            (Op::SpecConstantTrue, []) => Some(self.given.get(&id).map_or(1, |value| u32::from(*value != 0))),
            (Op::SpecConstantFalse, []) => Some(self.given.get(&id).map_or(0, |value| u32::from(*value != 0))),
            (Op::Constant, &[value]) => Some(value),
            (Op::SpecConstant, &[value]) => Some(self.given.get(&id).copied().unwrap_or(value)),
            (Op::SpecConstantOp, &[op, ref operands @ ..]) => {
                Op::from_u32(op).and_then(|op| self.value_of(op, operands))
            }
            (Op::ConstantComposite | Op::SpecConstantComposite, members) => {
                self.composites.insert(id, members.to_vec());
                None
            }
            _ => None,
        };
        let Some(value) = value else { return };
        self.scalars.insert(id, value);
        self.known.insert((kind, Some(value)), id);
        *instruction = self.defined(kind, id, value);
    }

    fn defined(&self, kind: u32, id: u32, value: u32) -> Instruction {
        match (self.bool_type == Some(kind), value) {
            (true, 0) => made(Op::ConstantFalse, &[kind, id]),
            (true, _) => made(Op::ConstantTrue, &[kind, id]),
            (false, _) => made(Op::Constant, &[kind, id, value]),
        }
    }

    /// The id of a scalar.
    pub(super) fn id_of(&mut self, kind: u32, value: u32, ids: &mut Ids) -> u32 {
        if let Some(&id) = self.known.get(&(kind, Some(value))) {
            return id;
        }
        let id = ids.fresh();
        self.note(id, value);
        self.known.insert((kind, Some(value)), id);
        self.made.push(self.defined(kind, id, value));
        id
    }

    /// The id of a value that was never set.
    pub(super) fn undefined(&mut self, kind: u32, ids: &mut Ids) -> u32 {
        *self.known.entry((kind, None)).or_insert_with(|| {
            let id = ids.fresh();
            self.made.push(made(Op::Undef, &[kind, id]));
            id
        })
    }

    /// Notes the value of a scalar.
    pub(super) fn note(&mut self, id: u32, value: u32) {
        self.scalars.insert(id, value);
    }

    /// Notes the results of a function's instructions that depend on constants alone.
    pub(super) fn follow<'a>(&mut self, instructions: impl Iterator<Item = &'a Instruction>) {
        for instruction in instructions {
            let (Some(op), Some(&[_, id, ref operands @ ..])) = (opcode(instruction), instruction.get(1..)) else {
                continue;
            };
            if let Some(value) = self.value_of(op, operands) {
                self.scalars.insert(id, value);
            }
        }
    }

    /// The result of an instruction, assuming that an id of unknown value has this value.
    pub(super) fn value_with(&mut self, id: u32, value: u32, instruction: &Instruction) -> Option<u32> {
        self.note(id, value);
        let result = self.value_of(opcode(instruction)?, &instruction[3..]);
        self.scalars.remove(&id);
        result
    }

    /// The result of an operation on scalars of 32 bits and bools; `None` for other operations and where it is not known.
    pub(super) fn value_of(&self, op: Op, operands: &[u32]) -> Option<u32> {
        let known: Vec<Option<u32>> = operands.iter().map(|id| self.scalar(*id)).collect();
        match (op, operands, &known[..]) {
            (Op::CompositeExtract, &[composite, member], _) => {
                self.scalar(*self.composites.get(&composite)?.get(member as usize)?)
            }
            (Op::Select, _, &[Some(chosen), first, second]) => {
                if chosen != 0 {
                    first
                } else {
                    second
                }
            }
            (Op::LogicalAnd, _, [Some(0), _] | [_, Some(0)]) => Some(0),
            (Op::LogicalOr, _, [Some(1), _] | [_, Some(1)]) => Some(1),
            (Op::LogicalNot, _, &[Some(a)]) => Some(1 - a.min(1)),
            (Op::Not, _, &[Some(a)]) => Some(!a),
            (Op::Bitcast, _, &[Some(a)]) => Some(a),
            (_, _, &[Some(a), Some(b)]) => value_of_two(op, a, b),
            _ => None,
        }
    }
}

/// The result of an operation on two scalars.
fn value_of_two(op: Op, a: u32, b: u32) -> Option<u32> {
    let (signed_a, signed_b) = (a as i32, b as i32);
    Some(match op {
        Op::LogicalAnd | Op::BitwiseAnd => a & b,
        Op::LogicalOr | Op::BitwiseOr => a | b,
        Op::BitwiseXor => a ^ b,
        Op::LogicalEqual | Op::IEqual => u32::from(a == b),
        Op::LogicalNotEqual | Op::INotEqual => u32::from(a != b),
        Op::ULessThan => u32::from(a < b),
        Op::ULessThanEqual => u32::from(a <= b),
        Op::UGreaterThan => u32::from(a > b),
        Op::UGreaterThanEqual => u32::from(a >= b),
        Op::SLessThan => u32::from(signed_a < signed_b),
        Op::SLessThanEqual => u32::from(signed_a <= signed_b),
        Op::SGreaterThan => u32::from(signed_a > signed_b),
        Op::SGreaterThanEqual => u32::from(signed_a >= signed_b),
        Op::IAdd => a.wrapping_add(b),
        Op::ISub => a.wrapping_sub(b),
        Op::IMul => a.wrapping_mul(b),
        Op::UDiv => a.checked_div(b)?,
        Op::SDiv => signed_a.checked_div(signed_b)? as u32,
        Op::ShiftLeftLogical => a.checked_shl(b)?,
        Op::ShiftRightLogical => a.checked_shr(b)?,
        _ => return None,
    })
}
