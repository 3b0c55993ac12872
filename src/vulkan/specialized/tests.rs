//! Tests of the pass on the crate's own kernels, on a function made by hand, and on single operations.

use super::constants::Constants;
use super::function::Function;
use super::ids::{Ids, ids, result};
use super::types::Types;
use super::{BOUND, Depth, HEADER_WORDS, Instruction, instructions, is_arithmetic, made, opcode, specialized};
use crate::vulkan::{Kernel, kernels};
use spirv::{Decoration, Op, StorageClass};
use std::collections::{HashMap, HashSet};

const KERNELS: [&Kernel; 4] =
    [&kernels::BACKWARD, &kernels::FORWARD_SOFT_SUBGROUP, &kernels::TRIANGLE, &kernels::SELFTEST];

/// The kernel with every constant at `value`, true where that is not 0.
fn all_at(kernel: &Kernel, value: u32) -> Vec<Instruction> {
    let values = kernel.specialization.iter().map(|s| (s.id, value)).collect();
    instructions(&specialized(kernel.spirv, &values, Depth::Flat)[HEADER_WORDS..])
}

fn count(code: &[Instruction], wanted: Op) -> usize {
    code.iter().filter(|i| opcode(i) == Some(wanted)).count()
}

/// The pass would mistake the numbers of a switch's cases for ids.
#[test]
fn no_kernel_has_a_switch() {
    for kernel in kernels::ALL {
        assert_eq!(count(&instructions(&kernel.spirv[HEADER_WORDS..]), Op::Switch), 0, "{}", kernel.name);
    }
}

#[test]
fn nothing_is_left_to_specialize() {
    for kernel in KERNELS {
        let before = instructions(&kernel.spirv[HEADER_WORDS..]);
        let is_id = |i: &&Instruction| opcode(i) == Some(Op::Decorate) && i[2] == Decoration::SpecId as u32;
        assert!(before.iter().any(|i| is_id(&i)), "{}", kernel.name);
        for value in [0, 1, 8] {
            let code = all_at(kernel, value);
            for op in [Op::SpecConstant, Op::SpecConstantTrue, Op::SpecConstantFalse] {
                assert_eq!(count(&code, op), 0, "{} at {value}: {op:?}", kernel.name);
            }
            assert!(!code.iter().any(|i| is_id(&i)), "{} at {value}", kernel.name);
        }
    }
}

/// The bits of a pair depend neither on the kernel that computes it nor on the room for lists.
#[test]
fn a_gpu_may_not_fuse_products_and_sums() {
    for kernel in kernels::ALL {
        let code = instructions(&specialized(kernel.spirv, &HashMap::new(), Depth::Cut)[HEADER_WORDS..]);
        let forbids =
            |i: &&Instruction| opcode(i) == Some(Op::Decorate) && i.get(2) == Some(&(Decoration::NoContraction as u32));
        let mut exact: Vec<u32> = code.iter().filter(forbids).map(|i| i[1]).collect();
        exact.sort_unstable();
        let mut arithmetic: Vec<u32> = code.iter().filter(|i| is_arithmetic(i)).map(|i| i[2]).collect();
        arithmetic.sort_unstable();
        assert!(arithmetic.iter().all(|id| exact.binary_search(id).is_ok()), "{}", kernel.name);
        assert!(exact.windows(2).all(|two| two[0] != two[1]), "{}: decorated twice", kernel.name);
    }
}

#[test]
fn what_is_switched_off_goes_and_what_is_on_stays() {
    for kernel in [&kernels::BACKWARD, &kernels::FORWARD] {
        let whole = instructions(&kernel.spirv[HEADER_WORDS..]).len();
        let [off, on] = [0, 1].map(|value| all_at(kernel, value));
        assert!(
            off.len() < on.len() && 3 * off.len() < 2 * whole,
            "{}: {} and {} of {whole}",
            kernel.name,
            off.len(),
            on.len()
        );
        assert_eq!(count(&on, Op::EntryPoint), 1);
    }
    // Its bool is whether to add an offset.
    let kernel = &kernels::SELFTEST;
    let [off, on] = [0, 1].map(|value| all_at(kernel, value));
    assert!(count(&off, Op::FAdd) < count(&on, Op::FAdd));
}

/// The violations of the rules of structured control flow in a module, as far as the pass could cause them.
fn problems(code: &[Instruction]) -> Vec<String> {
    let mut found = Vec::new();
    let defined: HashSet<u32> = code.iter().filter(|i| matches!(opcode(i), Some(Op::Label))).map(|i| i[1]).collect();
    let functions: HashSet<u32> = code.iter().filter(|i| opcode(i) == Some(Op::Function)).map(|i| i[2]).collect();
    let mut leading: HashMap<u32, HashSet<u32>> = HashMap::new();
    let mut label = 0;
    for i in code {
        let targets: &[u32] = match opcode(i) {
            Some(Op::Label) => {
                label = i[1];
                &[]
            }
            Some(Op::Branch) => &i[1..2],
            Some(Op::BranchConditional) => &i[2..4],
            Some(Op::LoopMerge) => &i[1..3],
            Some(Op::SelectionMerge) => &i[1..2],
            _ => &[],
        };
        if targets.iter().any(|target| !defined.contains(target)) {
            found.push(format!("{:?} of block {label} names a block that is not there", opcode(i)));
        }
        if matches!(opcode(i), Some(Op::Branch | Op::BranchConditional)) {
            targets.iter().for_each(|&target| _ = leading.entry(target).or_default().insert(label));
        }
        if opcode(i) == Some(Op::FunctionCall) && !functions.contains(&i[3]) {
            found.push(format!("block {label} calls a function that is not there"));
        }
    }
    for i in code {
        match opcode(i) {
            Some(Op::Label) => label = i[1],
            Some(Op::Phi) => {
                let from: HashSet<u32> = i[3..].chunks_exact(2).map(|pair| pair[1]).collect();
                if leading.get(&label).cloned().unwrap_or_default() != from {
                    found.push(format!("a phi of block {label} is not of the blocks that lead to it"));
                }
            }
            Some(Op::LoopMerge) if leading.get(&label).is_none_or(|from| from.len() != 2) => {
                found.push(format!("the loop of block {label} has no way back, or several"));
            }
            _ => {}
        }
    }
    found
}

#[test]
fn control_flow_stays_whole() {
    for kernel in KERNELS {
        for value in [0, 1, 2, 8] {
            let code = all_at(kernel, value);
            assert_eq!(problems(&code), [""; 0], "{} at {value}", kernel.name);
            // If this fails, the SPIR-V tools can show what is wrong with the module.
            let without = |op: Op| code.iter().filter(|i| opcode(i) != Some(op)).cloned().collect::<Vec<_>>();
            assert_ne!(problems(&without(Op::Label)), [""; 0], "{} at {value}", kernel.name);
        }
    }
}

/// Every id is defined once, before it is used but by a phi, and below the bound; no name or decoration is left of what is gone.
#[test]
fn ids_are_defined_before_their_use() {
    for kernel in KERNELS {
        for (value, depth) in [0, 1, 2, 8].into_iter().flat_map(|value| [(value, Depth::Cut), (value, Depth::Flat)]) {
            let values = kernel.specialization.iter().map(|s| (s.id, value)).collect();
            let words = specialized(kernel.spirv, &values, depth);
            assert_eq!(words, specialized(kernel.spirv, &values, depth), "{}: the same again", kernel.name);
            let code = instructions(&words[HEADER_WORDS..]);
            let first = code.iter().take_while(|i| opcode(i) != Some(Op::Function)).count();
            let labels = code.iter().filter(|i| opcode(i) == Some(Op::Label)).map(|i| i[1]);
            let functions = code.iter().filter(|i| opcode(i) == Some(Op::Function)).map(|i| i[2]);
            let mut defined: HashSet<u32> = labels.chain(functions).collect();
            let of_labels = defined.len();
            // Types and imported instructions have their id first; constants and variables have their type before it.
            let global = |i: &Instruction| match opcode(i)? {
                op if (Op::TypeVoid..=Op::TypeForwardPointer).contains(&op) => Some(i[1]),
                Op::ExtInstImport => Some(i[1]),
                op if (Op::ConstantTrue..=Op::SpecConstantOp).contains(&op) => Some(i[2]),
                Op::Undef | Op::Variable => Some(i[2]),
                _ => None,
            };
            defined.extend(code[..first].iter().filter_map(global));
            assert!(defined.len() > of_labels);
            for mut i in code[first..].iter().cloned() {
                let (op, own) = (opcode(&i), result(&i));
                assert!(
                    op == Some(Op::Function) || own.is_none_or(|id| id < words[BOUND] && defined.insert(id)),
                    "{} at {value}: {i:?}",
                    kernel.name
                );
                if !matches!(op, Some(Op::Phi | Op::Function)) {
                    assert!(ids(&mut i).all(|id| defined.contains(id)), "{} at {value}: {i:?}", kernel.name);
                }
            }
            for i in code[..first].iter().filter(|i| matches!(opcode(i), Some(Op::Name | Op::Decorate))) {
                assert!(defined.contains(&i[1]), "{} at {value}: {i:?}", kernel.name);
            }
        }
    }
}

/// The pass removes all calls except those of functions with several returns, and all loops with a known number of
/// passes. NoContraction remains on every copy.
#[test]
fn calls_and_short_loops_are_written_out() {
    let before = instructions(&kernels::TRIANGLE.spirv[HEADER_WORDS..]);
    let after = all_at(&kernels::TRIANGLE, 1);
    let precise = |code: &[Instruction]| {
        let precise = |i: &&Instruction| opcode(i) == Some(Op::Decorate) && i[2] == Decoration::NoContraction as u32;
        code.iter().filter(precise).count()
    };
    assert!(
        count(&after, Op::FunctionCall) < 4 && 10 * count(&after, Op::FunctionCall) < count(&before, Op::FunctionCall)
    );
    assert!(2 * count(&after, Op::LoopMerge) < count(&before, Op::LoopMerge));
    assert!(precise(&after) > 4 * precise(&before), "{} of {}", precise(&after), precise(&before));
    assert!(4 * count(&after, Op::Load) < count(&before, Op::Load) * 3);
}

/// `int i = 0; float x = 1.0; for (; i < 3; ++i) x += x;` with what follows from it.
#[test]
fn a_loop_is_written_out_and_its_variables_are_values() {
    let globals = [
        made(Op::TypeBool, &[1]),
        made(Op::TypePointer, &[4, StorageClass::Function as u32, 2]),
        made(Op::TypePointer, &[5, StorageClass::Function as u32, 3]),
    ];
    let mut constants = Constants::new(&globals, &HashMap::new());
    let types = Types::new(&globals, &constants);
    for (id, value) in [(10, 0), (11, 1), (12, 3)] {
        constants.freeze(&mut made(Op::Constant, &[2, id, value]));
    }
    let code = [
        made(Op::Function, &[1, 6, 0, 7]),
        made(Op::Label, &[20]),
        made(Op::Variable, &[4, 30, StorageClass::Function as u32]),
        made(Op::Variable, &[5, 31, StorageClass::Function as u32]),
        made(Op::Store, &[30, 10]),
        made(Op::Store, &[31, 13]),
        made(Op::Branch, &[21]),
        made(Op::Label, &[21]),
        made(Op::LoopMerge, &[25, 24, 0]),
        made(Op::Branch, &[22]),
        made(Op::Label, &[22]),
        made(Op::Load, &[2, 40, 30]),
        made(Op::SLessThan, &[1, 41, 40, 12]),
        made(Op::BranchConditional, &[41, 23, 25]),
        made(Op::Label, &[23]),
        made(Op::Load, &[3, 42, 31]),
        made(Op::FAdd, &[3, 43, 42, 42]),
        made(Op::Store, &[31, 43]),
        made(Op::Branch, &[24]),
        made(Op::Label, &[24]),
        made(Op::Load, &[2, 44, 30]),
        made(Op::IAdd, &[2, 45, 44, 11]),
        made(Op::Store, &[30, 45]),
        made(Op::Branch, &[21]),
        made(Op::Label, &[25]),
        made(Op::Load, &[3, 46, 31]),
        made(Op::Load, &[2, 47, 30]),
        made(Op::Store, &[99, 46]),
        made(Op::Store, &[98, 47]),
        made(Op::Return, &[]),
        made(Op::FunctionEnd, &[]),
    ];
    let mut ids = Ids::new(100);
    let promoted = |function: Function, constants: &mut Constants, ids: &mut Ids| {
        function.promote(&types, constants, ids).cut(constants).into_instructions().collect::<Vec<_>>()
    };
    // While it is a loop, it carries on both variables, so both stay.
    let kept = promoted(Function::parse(&mut code.iter().cloned()), &mut constants, &mut ids);
    assert_eq!(kept, code);
    let mut function = Function::parse(&mut code.into_iter());
    function.unroll(&mut constants, &mut ids);
    let written = promoted(function, &mut constants, &mut ids);
    assert_eq!(count(&written, Op::LoopMerge) + count(&written, Op::Load) + count(&written, Op::Variable), 0);
    let sums: Vec<&Instruction> = written.iter().filter(|i| opcode(i) == Some(Op::FAdd)).collect();
    assert_eq!(sums.iter().map(|i| i[3]).collect::<Vec<_>>(), [13, sums[0][2], sums[1][2]]);
    assert!(written.contains(&made(Op::Store, &[99, sums[2][2]])) && written.contains(&made(Op::Store, &[98, 12])));
}

/// `if (condition) x = y + y;` with a phi for x: label 10 branches to 11 or 12, and 12 joins both.
fn choice() -> Vec<Instruction> {
    vec![
        made(Op::Function, &[1, 2, 0, 3]),
        made(Op::Label, &[10]),
        made(Op::SelectionMerge, &[12, 0]),
        made(Op::BranchConditional, &[5, 11, 12]),
        made(Op::Label, &[11]),
        made(Op::FAdd, &[4, 20, 6, 6]),
        made(Op::Branch, &[12]),
        made(Op::Label, &[12]),
        made(Op::Phi, &[4, 21, 6, 10, 20, 11]),
        made(Op::Return, &[]),
        made(Op::FunctionEnd, &[]),
    ]
}

#[test]
fn a_known_choice_becomes_a_branch_and_phis_follow() {
    let mut on = made(Op::ConstantTrue, &[3, 5]);
    let mut off = made(Op::ConstantFalse, &[3, 5]);
    let cut = |constant: &mut Instruction| {
        let mut constants = Constants::new(&[made(Op::TypeBool, &[3])], &HashMap::new());
        constants.freeze(constant);
        let function = Function::parse(&mut choice().into_iter()).cut(&constants);
        function.into_instructions().collect::<Vec<_>>()
    };
    // Blocks that follow each other without another way in become one.
    let code = cut(&mut on);
    assert_eq!(code[2], made(Op::FAdd, &[4, 20, 6, 6]));
    assert!(code.contains(&made(Op::Phi, &[4, 21, 20, 10])));
    let code = cut(&mut off);
    assert_eq!(code[2], made(Op::Branch, &[12]));
    assert!(code.contains(&made(Op::Phi, &[4, 21, 6, 10])));
    assert_eq!(count(&code, Op::FAdd), 0);
    // An unknown condition changes nothing.
    assert_eq!(cut(&mut made(Op::Undef, &[3, 5])), choice());
}

/// A loop that a known condition leaves at once keeps its way back, which nothing leads to any more.
#[test]
fn a_loop_that_ends_at_once_stays_a_loop() {
    let code = vec![
        made(Op::Function, &[1, 2, 0, 3]),
        made(Op::Label, &[10]),
        made(Op::Branch, &[11]),
        made(Op::Label, &[11]),
        made(Op::LoopMerge, &[16, 15, 0]),
        made(Op::Branch, &[12]),
        made(Op::Label, &[12]),
        made(Op::SelectionMerge, &[14, 0]),
        made(Op::BranchConditional, &[5, 13, 14]),
        made(Op::Label, &[13]),
        made(Op::Branch, &[16]),
        made(Op::Label, &[14]),
        made(Op::IAdd, &[4, 20, 6, 6]),
        made(Op::Branch, &[15]),
        made(Op::Label, &[15]),
        made(Op::IAdd, &[4, 21, 20, 6]),
        made(Op::BranchConditional, &[7, 11, 16]),
        made(Op::Label, &[16]),
        made(Op::Return, &[]),
        made(Op::FunctionEnd, &[]),
    ];
    let mut constants = Constants::new(&[made(Op::TypeBool, &[3])], &HashMap::new());
    constants.freeze(&mut made(Op::ConstantTrue, &[3, 5]));
    let cut: Vec<Instruction> = Function::parse(&mut code.into_iter()).cut(&constants).into_instructions().collect();
    assert_eq!(count(&cut, Op::IAdd), 0);
    assert_eq!(problems(&cut), [""; 0]);
    let way_back = [made(Op::Label, &[15]), made(Op::Branch, &[11])];
    assert!(cut.windows(2).any(|two| two == way_back));
}

#[test]
fn operations_on_constants_have_their_values() {
    let bits = |x: i32| x.cast_unsigned();
    let scalars = [(1, 7), (2, 3), (3, 0), (4, bits(-8)), (5, 1)];
    let mut constants = Constants::new(&[made(Op::TypeBool, &[90])], &HashMap::new());
    for (id, value) in scalars {
        constants.freeze(&mut made(Op::Constant, &[91, id, value]));
    }
    constants.freeze(&mut made(Op::SpecConstantComposite, &[92, 6, 1, 2, 99]));
    let cases = [
        (Op::IAdd, &[1, 2][..], Some(10)),
        (Op::ISub, &[2, 1], Some(bits(-4))),
        (Op::IMul, &[4, 2], Some(bits(-24))),
        (Op::SDiv, &[4, 2], Some(bits(-2))),
        (Op::UDiv, &[1, 2], Some(2)),
        (Op::UDiv, &[1, 3], None),
        (Op::SLessThan, &[4, 3], Some(1)),
        (Op::ULessThan, &[4, 3], Some(0)),
        (Op::INotEqual, &[1, 2], Some(1)),
        (Op::BitwiseAnd, &[1, 2], Some(3)),
        (Op::LogicalNot, &[5], Some(0)),
        (Op::LogicalAnd, &[3, 99], Some(0)),
        (Op::LogicalAnd, &[5, 99], None),
        (Op::LogicalOr, &[99, 5], Some(1)),
        (Op::Select, &[5, 1, 99], Some(7)),
        (Op::Select, &[3, 1, 99], None),
        (Op::CompositeExtract, &[6, 1], Some(3)),
        (Op::CompositeExtract, &[6, 2], None),
        (Op::FAdd, &[1, 2], None),
    ];
    for (op, operands, value) in cases {
        let before = made(Op::SpecConstantOp, &[&[91, 50, op as u32], operands].concat());
        let mut after = before.clone();
        constants.freeze(&mut after);
        let expected = value.map_or(before, |value| made(Op::Constant, &[91, 50, value]));
        assert_eq!(after, expected, "{op:?} {operands:?}");
    }
}

#[test]
fn given_values_replace_defaults() {
    let globals = [
        made(Op::Decorate, &[1, Decoration::SpecId as u32, 40]),
        made(Op::Decorate, &[2, Decoration::SpecId as u32, 41]),
        made(Op::TypeBool, &[90]),
    ];
    let values = HashMap::from([(40, 5)]);
    let mut constants = Constants::new(&globals, &values);
    let mut frozen = |op: Op, operands: &[u32]| {
        let mut instruction = made(op, operands);
        constants.freeze(&mut instruction);
        instruction
    };
    assert_eq!(frozen(Op::SpecConstant, &[91, 1, 3]), made(Op::Constant, &[91, 1, 5]));
    assert_eq!(frozen(Op::SpecConstant, &[91, 2, 3]), made(Op::Constant, &[91, 2, 3]));
    assert_eq!(frozen(Op::SpecConstantFalse, &[90, 1]), made(Op::ConstantTrue, &[90, 1]));
    assert_eq!(frozen(Op::SpecConstantTrue, &[90, 2]), made(Op::ConstantTrue, &[90, 2]));
}
