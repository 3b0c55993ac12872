//! SPIR-V for given values of its specialization constants: they become plain constants, and what they switch off goes.
//!
//! A driver does the same, but Mesa's lavapipe does it late: it first inlines every function and optimises what will never run,
//! which is most of a kernel that knows every mode. A pipeline of a module that was cut down first is made in two thirds of the
//! time (`cargo bench --bench cold`).
//!
//! The pass knows what glslang emits: structured control flow, scalars of 32 bits, no debug lines. An instruction that it does
//! not know is kept as it is.

mod constants;
mod function;

use constants::Constants;
use function::Function;
use spirv::{Decoration, Op};
use std::collections::{HashMap, HashSet};

/// An instruction with its operands; the first word holds the number of words and the opcode.
type Instruction = Vec<u32>;

/// The module with its specialization constants at these values, each with its `constant_id`; those that are not named keep
/// their defaults.
pub(super) fn specialized(words: &[u32], values: &HashMap<u32, u32>) -> Vec<u32> {
    let (header, code) = words.split_at(words.len().min(HEADER_WORDS));
    let mut instructions = instructions(code).into_iter().peekable();
    let mut globals = Vec::new();
    while let Some(instruction) = instructions.next_if(|i| opcode(i) != Some(Op::Function)) {
        globals.push(instruction);
    }
    let mut constants = Constants::new(&globals, values);
    for instruction in &mut globals {
        constants.freeze(instruction);
    }
    let mut functions = Vec::new();
    while instructions.peek().is_some() {
        functions.push(Function::parse(&mut instructions).cut(&constants));
    }
    let called = called_functions(&globals, &functions);
    let (kept, dropped): (Vec<_>, Vec<_>) = functions.into_iter().partition(|f| called.contains(&f.id()));
    let mut removed: HashSet<u32> = dropped.iter().flat_map(Function::all_results).collect();
    removed.extend(kept.iter().flat_map(Function::removed_results));
    globals.retain(|instruction| !is_about(instruction, &removed) && !is_specialization_id(instruction));
    let kept = kept.into_iter().flat_map(Function::into_instructions);
    header.iter().copied().chain(globals.into_iter().chain(kept).flatten()).collect()
}

/// The words before a module's first instruction.
const HEADER_WORDS: usize = 5;

fn instructions(mut code: &[u32]) -> Vec<Instruction> {
    let mut all = Vec::new();
    while let Some(&head) = code.first() {
        let count = ((head >> 16) as usize).clamp(1, code.len());
        let (instruction, rest) = code.split_at(count);
        all.push(instruction.to_vec());
        code = rest;
    }
    all
}

fn opcode(instruction: &[u32]) -> Option<Op> {
    Op::from_u32(instruction.first()? & 0xffff)
}

/// An instruction of an opcode and its operands.
fn made(op: Op, operands: &[u32]) -> Instruction {
    let count = operands.len() as u32 + 1;
    [&[count << 16 | op as u32], operands].concat()
}

/// The functions that the entry point reaches by calls.
fn called_functions(globals: &[Instruction], functions: &[Function]) -> HashSet<u32> {
    let entries = globals.iter().filter(|i| opcode(i) == Some(Op::EntryPoint)).filter_map(|i| i.get(2).copied());
    let mut waiting: Vec<u32> = entries.collect();
    let mut called = HashSet::new();
    while let Some(id) = waiting.pop() {
        if called.insert(id) {
            waiting.extend(functions.iter().filter(|f| f.id() == id).flat_map(Function::calls));
        }
    }
    called
}

/// Whether an instruction names or decorates one of these ids.
fn is_about(instruction: &[u32], ids: &HashSet<u32>) -> bool {
    let about = matches!(opcode(instruction), Some(Op::Name | Op::Decorate | Op::DecorateId));
    about && instruction.get(1).is_some_and(|id| ids.contains(id))
}

fn is_specialization_id(instruction: &[u32]) -> bool {
    opcode(instruction) == Some(Op::Decorate) && instruction.get(2) == Some(&(Decoration::SpecId as u32))
}

#[cfg(test)]
mod tests;
