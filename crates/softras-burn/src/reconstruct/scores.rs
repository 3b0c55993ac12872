//! What needs no network, to compare with: the mean shape, the nearest training picture, and the best training shape.

use super::data::{Object, PICTURE, Set};
use super::fill::Grid;
use super::{SIZE, VIEWS};

/// Pixels along the side of the small pictures that are compared.
const SMALL: usize = 16;
const SMALL_PICTURE: usize = 4 * SMALL * SMALL;

/// A training set prepared for look-ups.
pub struct Known<'a> {
    set: &'a Set,
    mean: Grid,
    means: Vec<Grid>,
    /// Small pictures and masks of every view of every object.
    small: Vec<[u8; SMALL_PICTURE]>,
    masks: Vec<[u64; SIZE * SIZE / 64]>,
}

impl<'a> Known<'a> {
    pub fn new(set: &'a Set) -> Self {
        let all: Vec<&Grid> = set.objects.iter().map(|object| &object.solid).collect();
        let of = |class: usize| {
            let solids: Vec<&Grid> = set.objects.iter().filter(|o| o.class == class).map(|o| &o.solid).collect();
            Grid::mean(&solids)
        };
        let views = || set.objects.iter().flat_map(|object| (0..VIEWS).map(|view| object.picture(view)));
        Self {
            mean: Grid::mean(&all),
            means: (0..set.classes.len()).map(of).collect(),
            small: views().map(small).collect(),
            masks: views().map(mask).collect(),
            set,
        }
    }

    /// The mean of all training shapes.
    pub fn mean(&self) -> &Grid {
        &self.mean
    }

    /// The mean of the class's training shapes.
    pub fn mean_of(&self, class: &str) -> &Grid {
        self.set.classes.iter().position(|name| name == class).map_or(&self.mean, |class| &self.means[class])
    }

    /// The training object of the picture that is nearest by its squared difference at 16×16 pixels.
    pub fn by_picture(&self, picture: &[u8]) -> &Object {
        let wanted = small(picture);
        let distance = |other: &[u8; SMALL_PICTURE]| -> u32 {
            other.iter().zip(&wanted).map(|(a, b)| u32::from(a.abs_diff(*b)).pow(2)).sum()
        };
        self.nearest(self.small.iter().map(distance))
    }

    /// The training object of the picture whose silhouette overlaps this one's most.
    pub fn by_silhouette(&self, picture: &[u8]) -> &Object {
        let wanted = mask(picture);
        let distance = |other: &[u64; SIZE * SIZE / 64]| {
            let (mut both, mut either) = (0u32, 0u32);
            for (a, b) in other.iter().zip(&wanted) {
                both += (a & b).count_ones();
                either += (a | b).count_ones();
            }
            // Shares of 2³⁰, the least for the most overlap.
            (1u64 << 30) - (u64::from(both) << 30) / u64::from(either.max(1))
        };
        self.nearest(self.masks.iter().map(distance))
    }

    fn nearest<T: Ord>(&self, distances: impl Iterator<Item = T>) -> &Object {
        let best = distances.enumerate().min_by(|(_, a), (_, b)| a.cmp(b)).map_or(0, |(i, _)| i);
        &self.set.objects[best / VIEWS]
    }

    /// The overlap with the training shape that overlaps most: what no retrieval can exceed.
    pub fn best(&self, object: &Object) -> f64 {
        self.set.objects.iter().map(|known| known.solid.iou(&object.solid)).fold(0.0, f64::max)
    }
}

/// The picture at 16×16 pixels.
fn small(picture: &[u8]) -> [u8; SMALL_PICTURE] {
    const FACTOR: usize = SIZE / SMALL;
    std::array::from_fn(|i| {
        let (plane, row, column) = (i / (SMALL * SMALL), i / SMALL % SMALL, i % SMALL);
        let at = |k: usize| picture[(plane * SIZE + row * FACTOR + k / FACTOR) * SIZE + column * FACTOR + k % FACTOR];
        ((0..FACTOR * FACTOR).map(|k| usize::from(at(k))).sum::<usize>() / (FACTOR * FACTOR)) as u8
    })
}

/// A bit for each pixel that is more than half covered.
fn mask(picture: &[u8]) -> [u64; SIZE * SIZE / 64] {
    let alpha = &picture[3 * SIZE * SIZE..PICTURE];
    std::array::from_fn(|word| (0..64).filter(|bit| alpha[64 * word + bit] > 127).fold(0, |bits, bit| bits | 1 << bit))
}
