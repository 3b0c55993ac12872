//! Loops with a known number of passes, written out.

use super::constants::Constants;
use super::function::{Block, Function};
use super::ids::{Ids, renamed, result};
use super::{Instruction, made, opcode};
use spirv::Op;
use std::collections::HashMap;

/// The most passes of a loop that is written out: as many as Mesa unrolls.
const MOST_PASSES: usize = 32;

/// A loop `for (int i = first; i < end; i += step)` with constants, as glslang writes it: its header, its test, the blocks of
/// its body, the step, and the block behind it.
struct Loop {
    header: usize,
    step: usize,
    variable: u32,
    values: Vec<u32>,
}

impl Function {
    /// Writes out all loops that are known, inner ones first.
    pub(super) fn unroll(&mut self, constants: &mut Constants, ids: &mut Ids) {
        for header in (0..self.blocks.len()).rev() {
            if let Some(found) = self.loop_at(header, constants) {
                self.write_out(&found, constants, ids);
            }
        }
    }

    fn loop_at(&self, header: usize, constants: &mut Constants) -> Option<Loop> {
        let [merge, _] = &self.blocks[header].body[..] else { return None };
        let &[_, end, next, 0] = &merge[..] else { return None };
        let at = |label: u32| self.blocks.iter().position(|block| block.label == label);
        let (step, end_at, test) = (at(next)?, at(end)?, header + 1);
        let [load, compare, branch] = &self.blocks.get(test)?.body[..] else { return None };
        let [_, increase, store, _] = &self.blocks[step].body[..] else { return None };
        let variable = *load.get(3)?;
        let is = |i: &Instruction, op: Op| opcode(i) == Some(op);
        let shaped = is(merge, Op::LoopMerge)
            && is(load, Op::Load)
            && is(branch, Op::BranchConditional)
            && branch[2..] == [self.blocks.get(test + 1)?.label, end]
            && step + 1 == end_at
            && test + 1 < step
            && self.blocks[step - 1].targets() == [next]
            && self.blocks[header.checked_sub(1)?].targets() == [self.blocks[header].label]
            && self.blocks[end_at].body.iter().all(|i| !is(i, Op::Phi))
            && self.blocks[step].body[0][3] == variable
            && is(store, Op::Store)
            && store[1..] == [variable, increase[2]];
        // Nothing else may change the variable, or leave the loop or its body.
        let inside = &self.blocks[test..=step];
        let changes = |i: &&Instruction| !is(i, Op::Load) && i[1..].contains(&variable);
        let leads = |label: u32| inside.iter().flat_map(Block::targets).filter(move |target| *target == label).count();
        if !shaped
            || inside.iter().flat_map(|b| &b.body).filter(changes).count() != 1
            || leads(end) != 1
            || leads(next) != 1
        {
            return None;
        }
        let before = self.blocks[header.checked_sub(1)?].body.iter().rev();
        let first = before.into_iter().find(|i| is(i, Op::Store) && i[1] == variable)?;
        let mut value = constants.scalar(first[2])?;
        let mut values = vec![value];
        while constants.value_with(load[2], value, compare)? != 0 {
            value = constants.value_with(self.blocks[step].body[0][2], value, increase)?;
            values.push(value);
            if values.len() > MOST_PASSES + 1 {
                return None;
            }
        }
        Some(Loop { header, step, variable, values })
    }

    fn write_out(&mut self, found: &Loop, constants: &mut Constants, ids: &mut Ids) {
        let blocks: Vec<Block> = self.blocks.drain(found.header + 1..=found.step).collect();
        let [test, body @ .., _] = &blocks[..] else { return };
        let (kind, end) = (test.body[0][1], test.body[2][3]);
        let loads = |i: &Instruction| opcode(i) == Some(Op::Load) && i[3] == found.variable;
        let results = || body.iter().flat_map(|block| block.body.iter().filter_map(|i| result(i)).chain([block.label]));
        let mut written: Vec<Block> = Vec::new();
        let (last, values) = found.values.split_last().unwrap_or((&0, &[]));
        let next = |written: &mut Vec<Block>, label: u32| {
            if let Some(Block { body, .. }) = written.last_mut() {
                body.pop();
                body.push(made(Op::Branch, &[label]));
            }
        };
        for &value in values {
            let mut map: HashMap<u32, u32> = ids.copies(results());
            let value = constants.id_of(kind, value, ids);
            for i in body.iter().flat_map(|block| &block.body).filter(|i| loads(i)) {
                map.insert(i[2], value);
            }
            next(&mut written, map[&body[0].label]);
            written.extend(body.iter().map(|block| Block {
                label: map[&block.label],
                body: block.body.iter().filter(|i| !loads(i)).map(|i| renamed(i.clone(), &map)).collect(),
            }));
        }
        next(&mut written, end);
        let first = written.first().map_or(end, |block| block.label);
        let value = constants.id_of(kind, *last, ids);
        self.blocks[found.header].body = vec![made(Op::Store, &[found.variable, value]), made(Op::Branch, &[first])];
        self.blocks.splice(found.header + 1..found.header + 1, written);
    }
}
