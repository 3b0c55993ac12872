//! The connected parts of masks, as runs of pixels along rows: a picture has many pixels and few runs.

/// Neighbouring pixels of a row.
pub struct Run {
    pub row: usize,
    pub columns: std::ops::Range<usize>,
    /// The number of its part.
    pub part: usize,
}

/// A connected part.
#[derive(Clone, Copy, Debug, Default)]
pub struct Part {
    pub area: usize,
    /// The first column and row, and those after the last.
    pub low: [usize; 2],
    pub high: [usize; 2],
}

impl Part {
    /// The smallest part that holds both.
    pub fn with(self, other: Self) -> Self {
        let low = [0, 1].map(|k| self.low[k].min(other.low[k]));
        let high = [0, 1].map(|k| self.high[k].max(other.high[k]));
        Self { area: self.area + other.area, low, high }
    }

    /// Whether it reaches the border of a picture.
    pub fn is_cut(&self, size: [usize; 2]) -> bool {
        self.low.contains(&0) || self.high[0] == size[0] || self.high[1] == size[1]
    }
}

/// The parts of the pixels that `is_in` tells by column and row, with their runs. Pixels that meet at a corner are of one part where
/// `corners` says so.
pub fn parts(
    [width, height]: [usize; 2],
    corners: bool,
    is_in: impl Fn(usize, usize) -> bool,
) -> (Vec<Run>, Vec<Part>) {
    let reach = usize::from(corners);
    let mut runs: Vec<Run> = Vec::new();
    // Each run's parent in a forest, whose roots stand for the parts.
    let mut parents: Vec<usize> = Vec::new();
    let (mut above, mut first) = (0, 0);
    for row in 0..height {
        let mut column = 0;
        while column < width {
            if !is_in(column, row) {
                column += 1;
                continue;
            }
            let from = column;
            while column < width && is_in(column, row) {
                column += 1;
            }
            let this = runs.len();
            parents.push(this);
            // Runs above that end before this one meet none after it either.
            while above < first && runs[above].columns.end + reach <= from {
                above += 1;
            }
            let meeting = (above..first).take_while(|&other| runs[other].columns.start < column + reach);
            for other in meeting {
                let (a, b) = (root(&mut parents, other), root(&mut parents, this));
                parents[a.max(b)] = a.min(b);
            }
            runs.push(Run { row, columns: from..column, part: 0 });
        }
        (above, first) = (first, runs.len());
    }
    let mut found: Vec<Part> = Vec::new();
    for this in 0..runs.len() {
        let top = root(&mut parents, this);
        let Run { row, columns, .. } = &runs[this];
        let own = Part { area: columns.len(), low: [columns.start, *row], high: [columns.end, row + 1] };
        runs[this].part = if top == this { found.len() } else { runs[top].part };
        match found.get_mut(runs[this].part) {
            Some(part) => *part = part.with(own),
            None => found.push(own),
        }
    }
    (runs, found)
}

fn root(parents: &mut [usize], mut of: usize) -> usize {
    while parents[of] != of {
        parents[of] = parents[parents[of]];
        of = parents[of];
    }
    of
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_what_neighbours_connect() {
        let picture = ["x..xx.x", "xx..x..", "..x.xxx", "xxx...."];
        let is_in = |column: usize, row: usize| picture[row].as_bytes()[column] == b'x';
        let of = |corners: bool| {
            let (runs, parts) = parts([7, 4], corners, is_in);
            assert_eq!(runs.iter().map(|run| run.columns.len()).sum::<usize>(), 14);
            let mut all: Vec<_> = parts.iter().map(|part| (part.area, part.low, part.high)).collect();
            all.sort_unstable();
            all
        };
        let apart = [(1, [6, 0], [7, 1]), (3, [0, 0], [2, 2]), (4, [0, 2], [3, 4]), (6, [3, 0], [7, 3])];
        assert_eq!(of(false), apart);
        assert_eq!(of(true), [(1, [6, 0], [7, 1]), (6, [3, 0], [7, 3]), (7, [0, 0], [3, 4])]);
    }
}
