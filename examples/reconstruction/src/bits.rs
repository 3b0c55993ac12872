//! Yes or no for each voxel of a solid or pixel of a silhouette, and how far two of them overlap.

/// A bit for each voxel or pixel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Bits(Vec<u64>);

impl Bits {
    /// From one value for each.
    pub fn new(values: impl Iterator<Item = bool>) -> Self {
        let mut words = Vec::new();
        for (i, value) in values.enumerate() {
            if i % 64 == 0 {
                words.push(0);
            }
            words[i / 64] |= u64::from(value) << (i % 64);
        }
        Self(words)
    }

    /// A byte for each, 0 or 1.
    pub fn bytes(&self) -> impl Iterator<Item = u8> {
        self.0.iter().flat_map(|word| (0..64).map(move |bit| (word >> bit & 1) as u8))
    }

    /// The intersection over union; 1 where both are empty.
    pub fn iou(&self, other: &Self) -> f64 {
        let (mut both, mut either) = (0, 0);
        for (a, b) in self.0.iter().zip(&other.0) {
            both += (a & b).count_ones();
            either += (a | b).count_ones();
        }
        if either == 0 { 1.0 } else { f64::from(both) / f64::from(either) }
    }

    /// The bits that are set in at least some share of them, for the one of nine shares whose result overlaps them best; `None` for the
    /// mean of nothing.
    pub fn mean<'a>(all: impl Iterator<Item = &'a Self>) -> Option<Self> {
        let all: Vec<&Self> = all.collect();
        let mut counts = vec![0; 64 * all.first()?.0.len()];
        for one in &all {
            counts.iter_mut().zip(one.bytes()).for_each(|(count, bit)| *count += usize::from(bit));
        }
        let over = |tenths| Self::new(counts.iter().map(|count| 10 * count >= tenths * all.len()));
        let score = |mean: &Self| all.iter().map(|one| mean.iou(one)).sum::<f64>();
        // `max_by` takes the last of equal scores: a half before all other shares, then the smaller ones.
        [9, 8, 7, 6, 4, 3, 2, 1, 5].map(over).into_iter().max_by(|a, b| score(a).total_cmp(&score(b)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overlaps_and_means() {
        let of = |lit: std::ops::Range<usize>| Bits::new((0..128).map(|i| lit.contains(&i)));
        let (some, empty) = (of(10..90), of(0..0));
        assert_eq!(
            some.bytes().enumerate().filter(|(_, bit)| *bit == 1).map(|(i, _)| i).collect::<Vec<_>>(),
            Vec::from_iter(10..90)
        );
        assert_eq!((some.iou(&some), some.iou(&empty), empty.iou(&empty)), (1.0, 0.0, 1.0));
        assert_eq!(some.iou(&of(50..110)), 0.4);
        assert_eq!(Bits::mean([&some, &some, &empty].into_iter()), Some(some));
        assert_eq!(Bits::mean([].into_iter()), None);
    }
}
