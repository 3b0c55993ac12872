//! The objects of a training step, each in two views.

use crate::VIEWS;
use crate::data::Set;
use softras_check::random::Random;

/// Objects of a step, by their index, each with two views.
pub struct Pairs(pub Vec<(usize, [usize; 2])>);

impl Pairs {
    /// Pairs of different views, drawn from a seed.
    pub fn draw(set: &Set, pairs: usize, seed: u64) -> Self {
        let mut random = Random::new(seed);
        let one = |_| {
            let (object, first) = (random.below(set.objects.len()), random.below(VIEWS));
            (object, [first, (first + 1 + random.below(VIEWS - 1)) % VIEWS])
        };
        Self((0..pairs).map(one).collect())
    }

    /// Objects with views: one of each pair after another, then the other of each.
    pub fn seen(&self) -> impl Iterator<Item = (usize, usize)> {
        self.sides([0, 1])
    }

    /// The view that each of [`Pairs::seen`] is paired with.
    pub fn others(&self) -> impl Iterator<Item = (usize, usize)> {
        self.sides([1, 0])
    }

    fn sides(&self, sides: [usize; 2]) -> impl Iterator<Item = (usize, usize)> {
        sides.into_iter().flat_map(|side| self.0.iter().map(move |(object, views)| (*object, views[side])))
    }
}
