//! Local variables replaced by the values that they hold (Braun et al. 2013, Simple and Efficient Construction of Static Single
//! Assignment Form). A variable that a loop changes from one turn to the next stays.

use super::constants::Constants;
use super::function::{Block, Function};
use super::ids::{Ids, ids, renamed, result};
use super::types::{Place, Types};
use super::{Instruction, made, opcode};
use spirv::Op;
use std::collections::{HashMap, HashSet};

/// A part of a variable that is no struct, array or matrix, by number.
type PartNumber = usize;

/// Values of slots while the blocks of a function are gone through.
struct Promotion<'a> {
    constants: &'a mut Constants,
    ids: &'a mut Ids,
    types: &'a Types,
    /// The places that the pointers to promoted variables and their parts point to.
    places: HashMap<u32, Place>,
    /// The types of the slots.
    slots: Vec<u32>,
    /// The blocks before each that lead to it.
    leading: Vec<Vec<usize>>,
    /// The labels of the blocks.
    labels: Vec<u32>,
    /// The values of all slots at the end of each block, as far as they were asked for; 0 for others.
    values: Vec<u32>,
    /// The phis of each block.
    phis: Vec<Vec<Instruction>>,
    /// The values that replace removed results.
    same: HashMap<u32, u32>,
    /// The values of the slots in a composite value.
    parts: HashMap<u32, Vec<u32>>,
}

impl Function {
    /// Promotes the variables whose every use is a load or a store of a known part, and computes what follows from constants.
    pub(super) fn promote(mut self, types: &Types, constants: &mut Constants, ids: &mut Ids) -> Self {
        let mut slots = Vec::new();
        let places = self.promoted(types, constants, &mut slots);
        let leading = self.leading();
        let labels = self.blocks.iter().map(|block| block.label).collect();
        let values = vec![0; slots.len() * self.blocks.len()];
        let (phis, same, parts) = (vec![Vec::new(); self.blocks.len()], HashMap::new(), HashMap::new());
        let mut all = Promotion { constants, ids, types, places, slots, leading, labels, values, phis, same, parts };
        for (at, block) in self.blocks.iter_mut().enumerate() {
            block.body = all.block(at, std::mem::take(&mut block.body));
        }
        for (block, phis) in self.blocks.iter_mut().zip(all.phis) {
            block.body.splice(0..0, phis);
        }
        self
    }

    /// The places that the pointers to the variables that can be promoted point to; `slots` gets the types of their parts.
    fn promoted(&self, types: &Types, constants: &Constants, slots: &mut Vec<u32>) -> HashMap<u32, Place> {
        let mut places: HashMap<u32, Place> = HashMap::new();
        let mut kept = self.carried();
        for instruction in self.bodies() {
            let i = &instruction[..];
            match opcode(i) {
                Some(Op::Variable) if i.len() == 4 => {
                    if let Some(kind) = types.pointee(i[1]) {
                        places.insert(i[2], Place { variable: i[2], slot: slots.len(), kind, component: None });
                        types.add_parts(kind, slots);
                        continue;
                    }
                }
                Some(Op::AccessChain) => {
                    let indices = i[4..].iter().map(|id| constants.scalar(*id));
                    let place = places.get(&i[3]).and_then(|base| types.place(*base, indices));
                    if let Some(place) = place {
                        places.insert(i[2], place);
                        continue;
                    }
                }
                Some(Op::Load) => continue,
                _ => {}
            }
            let skipped = usize::from(opcode(i) == Some(Op::Store));
            let mut copy = instruction.clone();
            kept.extend(ids(&mut copy).skip(skipped).filter_map(|id| places.get(id).map(|place| place.variable)));
        }
        places.retain(|_, place| !kept.contains(&place.variable));
        places
    }

    /// The variables that a loop changes and that are used outside of it. They stay variables: as values in registers
    /// some are wrong after the loop in Mesa 22.3, where a lane that has left the loop still takes branches of its
    /// body.
    fn carried(&self) -> HashSet<u32> {
        let mut bases = HashMap::new();
        let mut stored: HashMap<u32, Vec<&[u32]>> = HashMap::new();
        let mut used: HashMap<u32, Vec<&[u32]>> = HashMap::new();
        let nests = self.nests();
        for (block, nest) in self.blocks.iter().zip(&nests) {
            for i in &block.body {
                let base = |at: usize| i.get(at).map(|id| bases.get(id).copied().unwrap_or(*id));
                match opcode(i) {
                    Some(Op::AccessChain) => _ = base(3).map(|base| bases.insert(i[2], base)),
                    Some(Op::Load) => used.entry(base(3).unwrap_or(0)).or_default().push(nest),
                    Some(Op::Store) => stored.entry(base(1).unwrap_or(0)).or_default().push(nest),
                    _ => {}
                }
            }
        }
        let is_carried = |variable: &u32, stored: &[&[u32]]| {
            let mut all = stored.iter().chain(used.get(variable).into_iter().flatten());
            all.any(|nest| stored.iter().any(|store| !nest.starts_with(store)))
        };
        stored.iter().filter(|(variable, stores)| is_carried(variable, stores)).map(|(variable, _)| *variable).collect()
    }

    /// The loops that each block is in, the outermost first.
    fn nests(&self) -> Vec<Vec<u32>> {
        let mut open: Vec<u32> = Vec::new();
        let nest = |block: &Block| {
            open.retain(|end| *end != block.label);
            open.extend(block.body.iter().filter(|i| opcode(i) == Some(Op::LoopMerge)).map(|i| i[1]));
            open.clone()
        };
        self.blocks.iter().map(nest).collect()
    }

    /// The blocks before each block that lead to it, which are all but the one that goes back to a loop's head.
    fn leading(&self) -> Vec<Vec<usize>> {
        let at: HashMap<u32, usize> = (0..).zip(&self.blocks).map(|(at, block)| (block.label, at)).collect();
        let mut leading = vec![Vec::new(); self.blocks.len()];
        for (from, block) in self.blocks.iter().enumerate() {
            let targets: HashSet<usize> = block.targets().iter().map(|target| at[target]).collect();
            targets.into_iter().filter(|target| *target > from).for_each(|target| leading[target].push(from));
        }
        leading
    }
}

impl Promotion<'_> {
    fn block(&mut self, at: usize, body: Vec<Instruction>) -> Vec<Instruction> {
        let mut kept = Vec::with_capacity(body.len());
        for instruction in body {
            let i = renamed(instruction, &self.same);
            let place = |word: usize| i.get(word).and_then(|pointer| self.places.get(pointer)).copied();
            match (opcode(&i), place(2), place(3), place(1)) {
                (Some(Op::Variable | Op::AccessChain), Some(_), ..) => {}
                (Some(Op::Load), _, Some(place), _) => self.load(at, i[2], place, &mut kept),
                (Some(Op::Store), .., Some(place)) => self.store(at, place, i[2], &mut kept),
                (Some(op), ..) => {
                    let value = if i.len() > 3 { self.constants.value_of(op, &i[3..]) } else { None };
                    match (value, result(&i)) {
                        (Some(value), Some(id)) => {
                            let constant = self.constants.id_of(i[1], value, self.ids);
                            self.same.insert(id, constant);
                        }
                        _ => kept.push(i),
                    }
                }
                _ => kept.push(i),
            }
        }
        kept
    }

    fn load(&mut self, block: usize, id: u32, place: Place, kept: &mut Vec<Instruction>) {
        if let Some(component) = place.component {
            let vector = self.read(block, place.slot);
            kept.push(made(Op::CompositeExtract, &[place.kind, id, vector, component]));
            return;
        }
        if self.types.parts(place.kind).is_none() {
            let value = self.read(block, place.slot);
            self.same.insert(id, value);
            return;
        }
        let values = (0..self.types.count(place.kind)).map(|i| self.read(block, place.slot + i)).collect::<Vec<_>>();
        self.construct(place.kind, id, &values, kept);
        self.parts.insert(id, values);
    }

    /// Makes a composite value of its parts.
    fn construct(&mut self, kind: u32, id: u32, mut values: &[u32], kept: &mut Vec<Instruction>) {
        let mut members = vec![kind, id];
        for &member in self.types.parts(kind).into_iter().flatten() {
            let (own, rest) = values.split_at(self.types.count(member));
            values = rest;
            if self.types.parts(member).is_none() {
                members.extend(own);
            } else {
                let part = self.ids.fresh();
                self.construct(member, part, own, kept);
                members.push(part);
            }
        }
        kept.push(made(Op::CompositeConstruct, &members));
    }

    fn store(&mut self, block: usize, place: Place, value: u32, kept: &mut Vec<Instruction>) {
        if let Some(component) = place.component {
            let (vector, next) = (self.read(block, place.slot), self.ids.fresh());
            kept.push(made(Op::CompositeInsert, &[self.slots[place.slot], next, value, vector, component]));
            *self.value(block, place.slot) = next;
            return;
        }
        if self.types.parts(place.kind).is_none() {
            *self.value(block, place.slot) = value;
            return;
        }
        let values = self.parts.get(&value).cloned().unwrap_or_else(|| {
            let mut paths = Vec::new();
            self.types.add_paths(place.kind, &mut Vec::new(), &mut paths);
            let extract = |(i, path): (usize, Vec<u32>)| {
                let id = self.ids.fresh();
                kept.push(made(Op::CompositeExtract, &[&[self.slots[place.slot + i], id, value], &path[..]].concat()));
                id
            };
            paths.into_iter().enumerate().map(extract).collect()
        });
        for (i, value) in values.into_iter().enumerate() {
            *self.value(block, place.slot + i) = value;
        }
    }

    /// The last value of a slot in a block: at its end, or, in the block that is being processed, at the current instruction. No variable
    /// that a loop changes is promoted, so only earlier blocks are asked.
    fn read(&mut self, block: usize, slot: PartNumber) -> u32 {
        // This does not recurse, because there may be thousands of blocks.
        let mut asked = vec![block];
        while let Some(&at) = asked.last() {
            let before = asked.len();
            if *self.value(at, slot) == 0 {
                let slots = self.slots.len();
                asked.extend(self.leading[at].iter().filter(|from| self.values[*from * slots + slot] == 0));
                if asked.len() > before {
                    continue;
                }
                *self.value(at, slot) = self.joined(at, slot);
            }
            asked.pop();
        }
        *self.value(block, slot)
    }

    fn value(&mut self, block: usize, slot: PartNumber) -> &mut u32 {
        &mut self.values[block * self.slots.len() + slot]
    }

    /// The value that a slot has when a block begins.
    fn joined(&mut self, block: usize, slot: PartNumber) -> u32 {
        let pairs = self.leading[block]
            .iter()
            .flat_map(|from| [self.values[*from * self.slots.len() + slot], self.labels[*from]]);
        let pairs: Vec<u32> = pairs.collect();
        let Some(first) = pairs.first() else { return self.constants.undefined(self.slots[slot], self.ids) };
        if pairs.iter().step_by(2).all(|value| value == first) {
            return *first;
        }
        let phi = self.ids.fresh();
        self.phis[block].push(made(Op::Phi, &[&[self.slots[slot], phi], &pairs[..]].concat()));
        phi
    }
}
