//! Methods without a network, for comparison: the mean shape, the nearest training picture, and the best training shape.

use crate::bits::Bits;
use crate::data::{Object, PICTURE, Set};
use crate::{SIZE, VIEWS};

/// Pixels along the side of the small pictures that are compared.
const SMALL: usize = 16;
const SMALL_PICTURE: usize = 4 * SMALL * SMALL;

/// A training set prepared for look-ups.
pub struct Known<'a> {
    set: &'a Set,
    /// The mean of all training shapes, and of each class's; `None` for no shapes.
    mean: Option<Bits>,
    means: Vec<Option<Bits>>,
    /// Small pictures and silhouettes of every view of every object.
    small: Vec<[u8; SMALL_PICTURE]>,
    silhouettes: Vec<Bits>,
}

impl<'a> Known<'a> {
    pub fn new(set: &'a Set) -> Self {
        let of_class = |class: usize| set.objects.iter().filter(move |object| object.class == class);
        let views = || set.objects.iter().flat_map(|object| (0..VIEWS).map(|view| object.picture(view)));
        Self {
            mean: Bits::mean(set.objects.iter().map(|object| &object.solid)),
            means: (0..set.classes.len()).map(|class| Bits::mean(of_class(class).map(|o| &o.solid))).collect(),
            small: views().map(small).collect(),
            silhouettes: views().map(silhouette).collect(),
            set,
        }
    }

    /// The overlap with the mean of all training shapes.
    pub fn mean(&self, object: &Object) -> f64 {
        self.mean.as_ref().map_or(0.0, |mean| mean.iou(&object.solid))
    }

    /// The overlap with the mean of the class's training shapes, or of all if none is of that class.
    pub fn mean_of(&self, class: &str, object: &Object) -> f64 {
        let known = self.set.classes.iter().position(|name| name == class);
        let mean = known.and_then(|class| self.means[class].as_ref());
        mean.map_or_else(|| self.mean(object), |mean| mean.iou(&object.solid))
    }

    /// The training object of the picture that is nearest by its squared difference at 16×16 pixels.
    pub fn by_picture(&self, picture: &[u8]) -> &Object {
        let wanted = small(picture);
        let distance = |other: &[u8; SMALL_PICTURE]| -> u32 {
            other.iter().zip(&wanted).map(|(a, b)| u32::from(a.abs_diff(*b)).pow(2)).sum()
        };
        self.nearest(self.small.iter().map(|other| f64::from(distance(other))))
    }

    /// The training object of the picture whose silhouette overlaps this one's most.
    pub fn by_silhouette(&self, picture: &[u8]) -> &Object {
        let wanted = silhouette(picture);
        self.nearest(self.silhouettes.iter().map(|other| 1.0 - wanted.iou(other)))
    }

    fn nearest(&self, distances: impl Iterator<Item = f64>) -> &Object {
        let best = distances.enumerate().min_by(|(_, a), (_, b)| a.total_cmp(b)).map_or(0, |(i, _)| i);
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

/// The pixels that are more than half covered.
fn silhouette(picture: &[u8]) -> Bits {
    Bits::new(picture[3 * SIZE * SIZE..PICTURE].iter().map(|alpha| *alpha > 127))
}
