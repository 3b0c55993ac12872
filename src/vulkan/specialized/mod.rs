//! SPIR-V for given values of its specialization constants: they become plain constants, and what they switch off goes.
//!
//! A driver does the same, but Mesa's lavapipe does it late and slowly: it optimises what will never run, and goes through all
//! functions, loops and variables once more for each loop that it writes out. For it calls are inlined, loops written out and
//! variables made values as well ([`Depth`]).
//!
//! The pass knows what glslang emits: structured control flow, scalars of 32 bits, no debug lines, no `switch`. A call,
//! a loop or a variable of another form is kept as it is.

mod constants;
mod function;
mod ids;
mod inline;
mod promote;
mod types;
mod unroll;

use constants::Constants;
use function::Function;
use ids::Ids;
use spirv::{Decoration, Op};
use std::collections::{HashMap, HashSet};
use types::Types;

/// An instruction with its operands; the first word holds the number of words and the opcode.
type Instruction = Vec<u32>;

/// How much of a driver's work is done for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Depth {
    /// Code that the constants switch off goes. The driver may not fuse products and sums: a GPU's compiler chooses which ones by
    /// what stands around them, so that two kernels would compute the same pair with different bits.
    Cut,
    /// Code that the constants switch off goes, calls are inlined, loops are written out and variables become values. For lavapipe,
    /// which fuses nothing.
    Flat,
}

/// The module with its specialization constants at these values, each with its `constant_id`; those that are not named keep
/// their defaults.
pub(super) fn specialized(words: &[u32], values: &HashMap<u32, u32>, depth: Depth) -> Vec<u32> {
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
    let types = Types::new(&globals, &constants);
    let mut ids = Ids::new(words.get(BOUND).copied().unwrap_or(0));
    let mut functions = HashMap::new();
    let mut all = HashSet::new();
    while instructions.peek().is_some() {
        let function = Function::parse(&mut instructions);
        all.extend(function.all_results());
        functions.insert(function.id(), function.cut(&constants));
    }
    let entries = globals.iter().filter(|i| opcode(i) == Some(Op::EntryPoint)).filter_map(|i| i.get(2).copied());
    let mut waiting: Vec<u32> = entries.collect();
    let (mut inlined, mut kept) = (HashMap::new(), Vec::new());
    while let Some(id) = waiting.pop() {
        let Some(function) = functions.get(&id).filter(|_| kept.iter().all(|f: &Function| f.id() != id)) else {
            continue;
        };
        let mut function = function.clone();
        if depth == Depth::Flat {
            function = function.inlined(&functions, &mut inlined, &mut ids);
            for _ in 0..ROUNDS {
                function.unroll(&mut constants, &mut ids);
                function.join();
                function = function.promote(&types, &mut constants, &mut ids).cut(&constants);
            }
        }
        waiting.extend(function.calls());
        kept.push(function);
    }
    let left: HashSet<u32> = kept.iter().flat_map(Function::all_results).collect();
    all.retain(|id| !left.contains(id));
    let copied = ids.copied();
    let mut described = Vec::with_capacity(globals.len());
    for i in globals.into_iter().filter(|i| !is_specialization_id(i)) {
        if is_decoration(&i) {
            let copies = copied.get(&i[1]).into_iter().flatten().filter(|copy| left.contains(copy));
            described.extend(copies.map(|&copy| [&[i[0], copy], &i[2..]].concat()));
        }
        if !is_about(&i, &all) {
            described.push(i);
        }
    }
    if depth == Depth::Cut {
        forbid_contraction(&mut described, &kept);
    }
    described.append(&mut constants.made);
    let kept = kept.into_iter().flat_map(Function::into_instructions);
    let mut header = header.to_vec();
    header[BOUND] = ids.bound;
    header.into_iter().chain(described.into_iter().chain(kept).flatten()).collect()
}

/// The words before a module's first instruction, and which of them is one more than the largest id.
const HEADER_WORDS: usize = 5;
const BOUND: usize = 3;
/// How often variables are promoted: indices into an array may become known when other variables were promoted before.
const ROUNDS: usize = 2;

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

/// Whether an instruction names or decorates one of these ids.
fn is_about(instruction: &[u32], ids: &HashSet<u32>) -> bool {
    let about = opcode(instruction) == Some(Op::Name) || is_decoration(instruction);
    about && instruction.get(1).is_some_and(|id| ids.contains(id))
}

fn is_decoration(instruction: &[u32]) -> bool {
    matches!(opcode(instruction), Some(Op::Decorate | Op::DecorateId))
}

/// Decorates all arithmetic with NoContraction.
fn forbid_contraction(globals: &mut Vec<Instruction>, functions: &[Function]) {
    let forbids = |i: &Instruction| is_decoration(i) && i.get(2) == Some(&(Decoration::NoContraction as u32));
    let exact: HashSet<u32> = globals.iter().filter(|i| forbids(i)).map(|i| i[1]).collect();
    let results = functions.iter().flat_map(Function::bodies).filter(|i| is_arithmetic(i)).map(|i| i[2]);
    let forbidden = results.filter(|id| !exact.contains(id));
    let decorations: Vec<_> = forbidden.map(|id| made(Op::Decorate, &[id, Decoration::NoContraction as u32])).collect();
    let after_last = globals.iter().rposition(|i| is_decoration(i)).map_or(globals.len(), |last| last + 1);
    globals.splice(after_last..after_last, decorations);
}

/// Whether a compiler may fuse an instruction's product or sum with another.
fn is_arithmetic(instruction: &Instruction) -> bool {
    use Op::{Dot, FAdd, FMul, FSub};
    use Op::{MatrixTimesMatrix, MatrixTimesScalar, MatrixTimesVector, VectorTimesMatrix, VectorTimesScalar};
    matches!(
        opcode(instruction),
        Some(
            FAdd | FSub
                | FMul
                | Dot
                | VectorTimesScalar
                | MatrixTimesScalar
                | VectorTimesMatrix
                | MatrixTimesVector
                | MatrixTimesMatrix
        )
    )
}

fn is_specialization_id(instruction: &[u32]) -> bool {
    opcode(instruction) == Some(Op::Decorate) && instruction.get(2) == Some(&(Decoration::SpecId as u32))
}

#[cfg(test)]
mod tests;
