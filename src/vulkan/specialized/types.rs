//! The types of a module, and the parts of a variable.

use super::constants::Constants;
use super::{Instruction, opcode};
use spirv::Op;
use std::collections::HashMap;

/// The parts of each type.
#[derive(Default)]
pub(super) struct Types {
    /// The members of structs, elements of arrays and columns of matrices.
    parts: HashMap<u32, Vec<u32>>,
    /// The components of vectors.
    components: HashMap<u32, u32>,
    /// The types that pointers to a function's variables point to.
    pointees: HashMap<u32, u32>,
}

/// A part of a variable that a pointer points to.
#[derive(Clone, Copy)]
pub(super) struct Place {
    /// The variable.
    pub variable: u32,
    /// The first of its slots.
    pub slot: usize,
    /// The part's type.
    pub kind: u32,
    /// Which component of the slot it is, if it is one.
    pub component: Option<u32>,
}

impl Types {
    pub(super) fn new(globals: &[Instruction], constants: &Constants) -> Self {
        let mut types = Self::default();
        for i in globals {
            match (opcode(i), &i[1..]) {
                (Some(Op::TypeStruct), [id, members @ ..]) => _ = types.parts.insert(*id, members.to_vec()),
                (Some(Op::TypeArray), &[id, element, count]) => {
                    if let Some(count) = constants.scalar(count) {
                        types.parts.insert(id, vec![element; count as usize]);
                    }
                }
                (Some(Op::TypeMatrix), &[id, column, count]) => {
                    types.parts.insert(id, vec![column; count as usize]);
                }
                (Some(Op::TypeVector), &[id, component, _]) => _ = types.components.insert(id, component),
                (Some(Op::TypePointer), &[id, class, kind]) if class == spirv::StorageClass::Function as u32 => {
                    types.pointees.insert(id, kind);
                }
                _ => {}
            }
        }
        types
    }

    pub(super) fn pointee(&self, pointer: u32) -> Option<u32> {
        self.pointees.get(&pointer).copied()
    }

    /// The types of a composite's parts; none for a scalar and a vector.
    pub(super) fn parts(&self, kind: u32) -> Option<&[u32]> {
        self.parts.get(&kind).map(Vec::as_slice)
    }

    /// The number of slots of a type.
    pub(super) fn count(&self, kind: u32) -> usize {
        self.parts(kind).map_or(1, |parts| parts.iter().map(|part| self.count(*part)).sum())
    }

    /// Adds the types of a type's slots.
    pub(super) fn add_parts(&self, kind: u32, slots: &mut Vec<u32>) {
        match self.parts(kind) {
            Some(parts) => parts.iter().for_each(|part| self.add_parts(*part, slots)),
            None => slots.push(kind),
        }
    }

    /// Adds the indices that lead to each slot of a type.
    pub(super) fn add_paths(&self, kind: u32, path: &mut Vec<u32>, paths: &mut Vec<Vec<u32>>) {
        let Some(parts) = self.parts(kind) else { return paths.push(path.clone()) };
        for (i, part) in (0..).zip(parts) {
            path.push(i);
            self.add_paths(*part, path, paths);
            path.pop();
        }
    }

    /// The part of a part that these indices lead to; `None` where one is not known.
    pub(super) fn place(&self, base: Place, indices: impl Iterator<Item = Option<u32>>) -> Option<Place> {
        let mut place = base;
        for index in indices {
            let index = index?;
            match self.parts(place.kind) {
                Some(parts) => {
                    let before = parts.get(..index as usize)?;
                    place.slot += before.iter().map(|part| self.count(*part)).sum::<usize>();
                    place.kind = *parts.get(index as usize)?;
                }
                None => {
                    place.kind = *self.components.get(&place.kind)?;
                    place.component = Some(index);
                }
            }
        }
        Some(place)
    }
}
