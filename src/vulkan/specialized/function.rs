//! A function of a module as blocks, and which of them can run.

use super::constants::Constants;
use super::{Instruction, made, opcode};
use spirv::Op;
use std::collections::{BTreeMap, HashMap, HashSet};

/// A basic block: its label, its instructions, and the branch at its end.
struct Block {
    label: u32,
    body: Vec<Instruction>,
}

/// A function: what stands before its first block, and its blocks in order.
pub(super) struct Function {
    head: Vec<Instruction>,
    blocks: Vec<Block>,
    /// Results of instructions that were removed.
    removed: Vec<u32>,
}

impl Function {
    /// Takes the instructions up to the end of a function.
    pub(super) fn parse(instructions: &mut impl Iterator<Item = Instruction>) -> Self {
        let mut function = Self { head: Vec::new(), blocks: Vec::new(), removed: Vec::new() };
        for instruction in instructions {
            match (opcode(&instruction), function.blocks.last_mut()) {
                (Some(Op::FunctionEnd), _) => break,
                (Some(Op::Label), _) => function.blocks.push(Block { label: instruction[1], body: Vec::new() }),
                (_, Some(block)) => block.body.push(instruction),
                (_, None) => function.head.push(instruction),
            }
        }
        function
    }

    /// Its id.
    pub(super) fn id(&self) -> u32 {
        self.head.first().and_then(|i| i.get(2)).copied().unwrap_or(0)
    }

    /// The functions that it calls.
    pub(super) fn calls(&self) -> impl Iterator<Item = u32> {
        let calls = self.bodies().filter(|i| opcode(i) == Some(Op::FunctionCall));
        calls.filter_map(|i| i.get(3).copied())
    }

    /// The ids that its instructions define.
    pub(super) fn all_results(&self) -> impl Iterator<Item = u32> {
        let labels = self.blocks.iter().map(|block| block.label);
        self.head.iter().chain(self.bodies()).filter_map(|i| result(i)).chain(labels)
    }

    /// The ids that are no longer defined since [`Function::cut`].
    pub(super) fn removed_results(&self) -> impl Iterator<Item = u32> {
        self.removed.iter().copied()
    }

    fn bodies(&self) -> impl Iterator<Item = &Instruction> {
        self.blocks.iter().flat_map(|block| &block.body)
    }

    /// The function without the blocks that no choice leads to.
    pub(super) fn cut(mut self, constants: &Constants) -> Self {
        let mut constants = constants.clone();
        constants.follow(self.bodies());
        self.blocks.iter_mut().for_each(|block| block.choose(&constants));
        let reached = self.reached();
        // A merge block and the target of `continue` must be there even where nothing leads to them.
        let mut ends = HashMap::new();
        for block in self.blocks.iter().filter(|block| reached.contains(&block.label)) {
            ends.extend(block.merge().map(|label| (label, made(Op::Unreachable, &[]))));
            ends.extend(block.continues().map(|label| (label, made(Op::Branch, &[block.label]))));
        }
        let before: Vec<u32> = self.all_results().collect();
        self.blocks.retain_mut(|block| {
            let end = ends.remove(&block.label);
            if !reached.contains(&block.label) {
                let Some(end) = end else { return false };
                block.body = vec![end];
            }
            true
        });
        self.fix_phis();
        let after: HashSet<u32> = self.all_results().collect();
        self.removed = before.into_iter().filter(|id| !after.contains(id)).collect();
        self
    }

    /// The labels of the blocks that branches lead to from the first.
    fn reached(&self) -> HashSet<u32> {
        let targets: HashMap<u32, Vec<u32>> = self.blocks.iter().map(|block| (block.label, block.targets())).collect();
        let mut waiting: Vec<u32> = self.blocks.first().map(|block| block.label).into_iter().collect();
        let mut reached = HashSet::new();
        while let Some(label) = waiting.pop() {
            if reached.insert(label) {
                waiting.extend(targets.get(&label).into_iter().flatten());
            }
        }
        reached
    }

    /// Leaves to each phi the values of the blocks that still lead to its own.
    fn fix_phis(&mut self) {
        let mut leading: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for block in &self.blocks {
            block.targets().into_iter().for_each(|target| leading.entry(target).or_default().push(block.label));
        }
        for block in &mut self.blocks {
            let from = leading.remove(&block.label).unwrap_or_default();
            for phi in block.body.iter_mut().filter(|i| opcode(i) == Some(Op::Phi)) {
                let (result, pairs) = phi[1..].split_at(2);
                let kept = pairs.chunks_exact(2).filter(|pair| from.contains(&pair[1])).flatten().copied();
                *phi = made(Op::Phi, &result.iter().copied().chain(kept).collect::<Vec<_>>());
            }
        }
    }

    /// Its instructions in order.
    pub(super) fn into_instructions(self) -> impl Iterator<Item = Instruction> {
        let of_block = |block: Block| std::iter::once(made(Op::Label, &[block.label])).chain(block.body);
        let end = std::iter::once(made(Op::FunctionEnd, &[]));
        self.head.into_iter().chain(self.blocks.into_iter().flat_map(of_block)).chain(end)
    }
}

impl Block {
    /// Turns a choice by a known condition into a branch.
    fn choose(&mut self, constants: &Constants) {
        let [.., merge, branch] = &self.body[..] else { return };
        // A loop's own condition stands without a selection, and stays: a loop needs its way back.
        if opcode(merge) != Some(Op::SelectionMerge) || opcode(branch) != Some(Op::BranchConditional) {
            return;
        }
        let Some(&[condition, yes, no, ..]) = branch.get(1..) else { return };
        let Some(value) = constants.scalar(condition) else { return };
        let chosen = made(Op::Branch, &[if value != 0 { yes } else { no }]);
        self.body.truncate(self.body.len() - 2);
        self.body.push(chosen);
    }

    /// The labels that its end may branch to.
    fn targets(&self) -> Vec<u32> {
        let Some(end) = self.body.last() else { return Vec::new() };
        match (opcode(end), &end[1..]) {
            (Some(Op::Branch), &[target]) => vec![target],
            (Some(Op::BranchConditional), &[_, yes, no, ..]) => vec![yes, no],
            (Some(Op::Switch), [_, default, cases @ ..]) => {
                std::iter::once(*default).chain(cases.chunks_exact(2).map(|case| case[1])).collect()
            }
            _ => Vec::new(),
        }
    }

    /// The merge block that it declares.
    fn merge(&self) -> Option<u32> {
        let merges = |i: &&Instruction| matches!(opcode(i), Some(Op::SelectionMerge | Op::LoopMerge));
        self.body.iter().find(merges).and_then(|i| i.get(1).copied())
    }

    /// The target of `continue` that it declares, as the head of a loop.
    fn continues(&self) -> Option<u32> {
        let of_loop = self.body.iter().find(|i| opcode(i) == Some(Op::LoopMerge));
        of_loop.and_then(|i| i.get(2).copied())
    }
}

/// The id that an instruction of a function defines.
fn result(instruction: &[u32]) -> Option<u32> {
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
