//! Makes one vertex of those at one position.

use std::{collections::HashMap, hash::Hash};

/// Vertices by their position and what else tells them apart.
pub(super) struct Weld<K> {
    index: HashMap<([u32; 3], K), u32>,
    pub positions: Vec<[f32; 3]>,
}

impl<K: Eq + Hash> Weld<K> {
    pub fn new() -> Self {
        Self { index: HashMap::new(), positions: Vec::new() }
    }

    /// The index of a vertex, and whether it is new.
    pub fn vertex(&mut self, position: [f32; 3], key: K) -> (u32, bool) {
        let next = self.positions.len() as u32;
        // -0 and 0 are one position.
        let index = *self.index.entry((position.map(|x| (x + 0.0).to_bits()), key)).or_insert(next);
        if index == next {
            self.positions.push(position);
        }
        (index, index == next)
    }
}
