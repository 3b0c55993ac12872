//! Connected regions of pixels, samples and vertices.

/// The connected sets of those of `0..count` for which `is_in` holds, in the order of their first members. `beside` appends the
/// neighbours of one.
pub fn regions(
    count: usize,
    is_in: impl Fn(usize) -> bool,
    beside: impl Fn(usize, &mut Vec<usize>),
) -> Vec<Vec<usize>> {
    let mut left: Vec<bool> = (0..count).map(is_in).collect();
    let (mut all, mut around) = (Vec::new(), Vec::new());
    for first in 0..count {
        if !std::mem::take(&mut left[first]) {
            continue;
        }
        let (mut region, mut next) = (vec![first], 0);
        while let Some(&at) = region.get(next) {
            next += 1;
            beside(at, &mut around);
            region.extend(around.drain(..).filter(|&other| std::mem::take(&mut left[other])));
        }
        all.push(region);
    }
    all
}

/// The connected regions of pixels of an image of a height and a width: those that share a side, or a corner too.
pub fn of_pixels(size: (usize, usize), is_in: impl Fn(usize) -> bool, corners: bool) -> Vec<Vec<usize>> {
    regions(size.0 * size.1, is_in, |pixel, around| around.extend(pixels_around(pixel, size, corners)))
}

/// The holes of a mask: the regions outside of it that do not reach the border.
pub fn holes(size: (usize, usize), is_inside: impl Fn(usize) -> bool) -> Vec<Vec<usize>> {
    let mut outside = of_pixels(size, |pixel| !is_inside(pixel), false);
    outside.retain(|region| !region.iter().any(|&pixel| is_border(pixel, size)));
    outside
}

/// A pixel and those that share a side with it, or a corner too.
pub fn pixels_around(pixel: usize, (height, width): (usize, usize), corners: bool) -> impl Iterator<Item = usize> {
    let (row, column) = (pixel / width, pixel % width);
    let columns = column.saturating_sub(1)..(column + 2).min(width);
    let around = (row.saturating_sub(1)..(row + 2).min(height)).flat_map(move |r| columns.clone().map(move |c| (r, c)));
    around.filter(move |&(r, c)| corners || r == row || c == column).map(move |(r, c)| r * width + c)
}

/// Whether a pixel is one of the first or last row or column.
pub fn is_border(pixel: usize, (height, width): (usize, usize)) -> bool {
    let (row, column) = (pixel / width, pixel % width);
    row == 0 || column == 0 || row + 1 == height || column + 1 == width
}
