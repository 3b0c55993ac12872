//! A function of a module as blocks, and which of them can run.

use super::constants::Constants;
use super::ids::{resolved, result};
use super::{Instruction, made, opcode};
use spirv::Op;
use std::collections::{BTreeMap, HashMap, HashSet};

/// A basic block: its label, its instructions, and the branch at its end.
#[derive(Clone)]
pub(super) struct Block {
    pub label: u32,
    pub body: Vec<Instruction>,
}

/// A function: what stands before its first block, and its blocks in order.
#[derive(Clone)]
pub(super) struct Function {
    pub head: Vec<Instruction>,
    pub blocks: Vec<Block>,
}

impl Function {
    /// Takes the instructions up to the end of a function.
    pub(super) fn parse(instructions: &mut impl Iterator<Item = Instruction>) -> Self {
        let mut function = Self { head: Vec::new(), blocks: Vec::new() };
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

    pub(super) fn bodies(&self) -> impl Iterator<Item = &Instruction> {
        self.blocks.iter().flat_map(|block| &block.body)
    }

    /// The function without the blocks that cannot run.
    pub(super) fn cut(mut self, constants: &Constants) -> Self {
        let mut constants = constants.clone();
        constants.follow(self.bodies());
        self.blocks.iter_mut().for_each(|block| block.choose(&constants));
        let reached = self.reached();
        // A merge block and the target of `continue` must exist even if nothing leads to them.
        let mut ends = HashMap::new();
        for block in self.blocks.iter().filter(|block| reached.contains(&block.label)) {
            ends.extend(block.merge().map(|label| (label, made(Op::Unreachable, &[]))));
            ends.extend(block.continues().map(|label| (label, made(Op::Branch, &[block.label]))));
        }
        self.blocks.retain_mut(|block| {
            let end = ends.remove(&block.label);
            if !reached.contains(&block.label) {
                let Some(end) = end else { return false };
                block.body = vec![end];
            }
            true
        });
        self.fix_phis();
        self.join();
        self
    }

    /// Joins each block to the one before if nothing else leads to or names it.
    pub(super) fn join(&mut self) {
        let mut named: HashMap<u32, usize> = HashMap::new();
        for i in self.blocks.iter().flat_map(|block| &block.body[block.body.len().saturating_sub(2)..]) {
            if let Some(Op::Branch | Op::BranchConditional | Op::SelectionMerge | Op::LoopMerge) = opcode(i) {
                i[1..].iter().for_each(|id| *named.entry(*id).or_default() += 1);
            }
        }
        let mut joined: Vec<Block> = Vec::with_capacity(self.blocks.len());
        let mut renamed = HashMap::new();
        for block in std::mem::take(&mut self.blocks) {
            let follows = |last: &&mut Block| last.targets() == [block.label] && last.merge().is_none();
            match joined.last_mut().filter(follows) {
                Some(last) if named[&block.label] == 1 && opcode(&block.body[0]) != Some(Op::Phi) => {
                    renamed.insert(block.label, last.label);
                    last.body.pop();
                    last.body.extend(block.body);
                }
                _ => joined.push(block),
            }
        }
        self.blocks = joined;
        let phis = self.blocks.iter_mut().flat_map(|block| &mut block.body).filter(|i| opcode(i) == Some(Op::Phi));
        phis.for_each(|phi| phi[3..].chunks_exact_mut(2).for_each(|pair| pair[1] = resolved(&renamed, pair[1])));
    }

    /// The labels of the blocks that can be reached from the first.
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

    /// Removes from each phi the values of blocks that no longer lead to its own.
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
        // The condition of a loop has no OpSelectionMerge. It stays, because a loop needs its branch back.
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
    pub(super) fn targets(&self) -> Vec<u32> {
        let Some(end) = self.body.last() else { return Vec::new() };
        match (opcode(end), &end[1..]) {
            (Some(Op::Branch), &[target]) => vec![target],
            (Some(Op::BranchConditional), &[_, yes, no, ..]) => vec![yes, no],
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
