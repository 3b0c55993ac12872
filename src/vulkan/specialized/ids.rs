//! The ids in an instruction, and new ones.

use super::{Instruction, opcode};
use spirv::Op;
use std::collections::{BTreeMap, HashMap};

/// New ids of a module.
pub(super) struct Ids {
    /// One more than the largest.
    pub bound: u32,
    /// For each new id that copies another, that other: both have the same decorations.
    origins: BTreeMap<u32, u32>,
}

impl Ids {
    pub(super) fn new(bound: u32) -> Self {
        Self { bound, origins: BTreeMap::new() }
    }

    pub(super) fn fresh(&mut self) -> u32 {
        self.bound += 1;
        self.bound - 1
    }

    /// A new id for each of these, which replaces it in a copy of the instructions that define it.
    pub(super) fn copies(&mut self, ids: impl Iterator<Item = u32>) -> HashMap<u32, u32> {
        ids.map(|id| {
            let copy = self.fresh();
            self.origins.insert(copy, self.origins.get(&id).copied().unwrap_or(id));
            (id, copy)
        })
        .collect()
    }

    /// The copies of each original id.
    pub(super) fn copied(&self) -> HashMap<u32, Vec<u32>> {
        let mut copied: HashMap<u32, Vec<u32>> = HashMap::new();
        self.origins.iter().for_each(|(&copy, &origin)| copied.entry(origin).or_default().push(copy));
        copied
    }
}

/// The id that an instruction of a function defines.
pub(super) fn result(instruction: &[u32]) -> Option<u32> {
    let without = matches!(
        opcode(instruction)?,
        Op::Store
            | Op::Branch
            | Op::BranchConditional
            | Op::Switch
            | Op::Return
            | Op::ReturnValue
            | Op::Unreachable
            | Op::SelectionMerge
            | Op::LoopMerge
            | Op::ControlBarrier
            | Op::MemoryBarrier
            | Op::AtomicStore
            | Op::ImageWrite
            | Op::CopyMemory
            | Op::Nop
    );
    if without { None } else { instruction.get(2).copied() }
}

/// The words of a function's instruction that are ids, types and the result among them, and not literal numbers.
pub(super) fn ids(instruction: &mut [u32]) -> impl Iterator<Item = &mut u32> {
    let (end, literal) = match opcode(instruction) {
        Some(Op::SelectionMerge) => (2, 0),
        Some(Op::LoopMerge | Op::Store | Op::Variable) => (3, 0),
        Some(Op::Load | Op::CompositeExtract | Op::ArrayLength) => (4, 0),
        Some(Op::CompositeInsert | Op::VectorShuffle) => (5, 0),
        Some(Op::ExtInst | Op::ImageWrite) => (usize::MAX, 4),
        Some(Op::ImageFetch | Op::ImageRead) => (usize::MAX, 5),
        _ => (usize::MAX, 0),
    };
    instruction.iter_mut().enumerate().filter(move |(i, _)| *i > 0 && *i < end && *i != literal).map(|(_, id)| id)
}

/// Replaces every id that the map contains.
pub(super) fn renamed(mut instruction: Instruction, map: &HashMap<u32, u32>) -> Instruction {
    ids(&mut instruction).for_each(|id| *id = resolved(map, *id));
    instruction
}

/// Follows the map from an id to the last one that replaces it.
pub(super) fn resolved(map: &HashMap<u32, u32>, mut id: u32) -> u32 {
    while let Some(&other) = map.get(&id) {
        id = other;
    }
    id
}
