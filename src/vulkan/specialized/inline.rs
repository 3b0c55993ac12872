//! Replaces calls by the bodies of the functions that they call.

use super::function::{Block, Function};
use super::ids::{Ids, renamed, result};
use super::{Instruction, made, opcode};
use spirv::Op;
use std::collections::HashMap;

impl Function {
    /// The function with its calls replaced, except those of functions that return in several places.
    pub(super) fn inlined(self, all: &HashMap<u32, Self>, done: &mut HashMap<u32, Self>, ids: &mut Ids) -> Self {
        for id in self.calls().collect::<Vec<_>>() {
            if let (None, Some(called)) = (done.get(&id), all.get(&id)) {
                let called = called.clone().inlined(all, done, ids);
                done.insert(id, called);
            }
        }
        let mut whole = Self { head: self.head, blocks: Vec::new() };
        let (mut variables, mut returned, mut ends) = (Vec::new(), HashMap::new(), HashMap::new());
        for Block { label, body } in self.blocks {
            let mut block = Block { label, body: Vec::new() };
            for instruction in body {
                let called = call_of(&instruction).and_then(|id| done.get(&id)).filter(|called| called.ends_once());
                let Some(called) = called else {
                    block.body.push(instruction);
                    continue;
                };
                let mut map = ids.copies(called.all_results());
                map.extend(called.parameters().zip(instruction[4..].iter().copied()));
                block.body.push(made(Op::Branch, &[map[&called.blocks[0].label]]));
                for part in &called.blocks {
                    let next = Block { label: map[&part.label], body: Vec::new() };
                    whole.blocks.push(std::mem::replace(&mut block, next));
                    for copied in part.body.iter().map(|instruction| renamed(instruction.clone(), &map)) {
                        match opcode(&copied) {
                            Some(Op::Variable) => variables.push(copied),
                            Some(Op::ReturnValue) => _ = returned.insert(instruction[2], copied[1]),
                            Some(Op::Return) => {}
                            _ => block.body.push(copied),
                        }
                    }
                }
            }
            ends.insert(label, block.label);
            whole.blocks.push(block);
        }
        // Phis name the block that a value comes from, which may have become several.
        let from = |phi: &mut Instruction| {
            phi[3..].chunks_exact_mut(2).for_each(|pair| pair[1] = *ends.get(&pair[1]).unwrap_or(&pair[1]))
        };
        let ends_only = |i: &&mut Instruction| opcode(i) == Some(Op::Phi);
        whole.blocks.iter_mut().flat_map(|block| &mut block.body).filter(ends_only).for_each(from);
        for block in &mut whole.blocks {
            block.body = std::mem::take(&mut block.body).into_iter().map(|i| renamed(i, &returned)).collect();
        }
        if let Some(first) = whole.blocks.first_mut() {
            first.body.splice(0..0, variables);
        }
        whole
    }

    fn parameters(&self) -> impl Iterator<Item = u32> {
        self.head.iter().filter(|i| opcode(i) == Some(Op::FunctionParameter)).filter_map(|i| result(i))
    }

    /// Whether it returns in one place, which all its paths lead to.
    fn ends_once(&self) -> bool {
        let ends = |i: &&Instruction| matches!(opcode(i), Some(Op::Return | Op::ReturnValue | Op::Unreachable));
        let last = self.blocks.last().and_then(|block| block.body.last());
        self.bodies().filter(ends).count() == 1 && last.is_some_and(|i| ends(&i))
    }
}

fn call_of(instruction: &Instruction) -> Option<u32> {
    if opcode(instruction) == Some(Op::FunctionCall) { instruction.get(3).copied() } else { None }
}
