//! What a fit has not found, by its outline: holes of the pictures that the mesh covers, and parts that it leaves out.

use softras::Image;

/// Holes and parts of fewer pixels are not told: they may be of the edge of a pixel.
const LEAST_PIXELS: usize = 8;
/// The share of a hole or of a part that has to be wrong.
const WRONG: f64 = 0.9;

/// The views in which the mesh covers a hole, and those in which it leaves out a part, counted from 0.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Unseen {
    /// Views in which the mesh covers a hole.
    pub covered: Vec<usize>,
    /// Views in which the mesh leaves out a part.
    pub missed: Vec<usize>,
    /// The pixels of the parts that are left out, counted through all views.
    parts: Vec<usize>,
}

impl Unseen {
    /// Compares the views' silhouettes with those of the mesh from the `first`th view on.
    pub(crate) fn add(&mut self, first: usize, mesh: &Image, targets: &Image) {
        for view in 0..mesh.batch {
            let inside = |image: &Image| image.view(view).iter().map(|x| *x > 0.5).collect::<Vec<bool>>();
            let (mesh, target) = (inside(mesh), inside(targets));
            let wrong = |region: &[usize], shown: bool| {
                let count = region.iter().filter(|pixel| mesh[**pixel] == shown).count();
                region.len() >= LEAST_PIXELS && count as f64 >= WRONG * region.len() as f64
            };
            let width = targets.width;
            let holes = regions(&target, width, false);
            let inner = |region: &Vec<usize>| !region.iter().any(|pixel| on_border(*pixel, width, target.len()));
            if holes.iter().filter(|region| inner(region)).any(|region| wrong(region, true)) {
                self.covered.push(first + view);
            }
            let parts = regions(&target, width, true).into_iter().filter(|region| wrong(region, false)).flatten();
            let before = self.parts.len();
            self.parts.extend(parts.map(|pixel| (first + view) * target.len() + pixel));
            if self.parts.len() > before {
                self.missed.push(first + view);
            }
        }
    }

    /// What the mesh does wrong, with the numbers of the views that show it, times `stride`.
    pub fn reasons(&self, stride: usize) -> Vec<String> {
        let list = |views: &[usize]| {
            let first: Vec<String> = views.iter().take(8).map(|view| (view * stride).to_string()).collect();
            let more = if views.len() > first.len() {
                format!(" and {} more", views.len() - first.len())
            } else {
                String::new()
            };
            format!("{}{more}", first.join(", "))
        };
        let mut reasons = Vec::new();
        if !self.covered.is_empty() {
            reasons.push(format!("covers a hole that is seen in view {}", list(&self.covered)));
        }
        if !self.missed.is_empty() {
            reasons.push(format!("leaves out a part that is seen in view {}", list(&self.missed)));
        }
        reasons
    }

    /// The pixels of all parts that are left out as 1 in images like the targets; `None` where there are none.
    pub(crate) fn missing(&self, targets: &Image) -> Option<Image> {
        let mut marks = Image { data: vec![0.0; targets.data.len()], ..*targets };
        self.parts.iter().for_each(|pixel| marks.data[*pixel] = 1.0);
        (!self.parts.is_empty()).then_some(marks)
    }
}

fn on_border(pixel: usize, width: usize, pixels: usize) -> bool {
    let (row, column) = (pixel / width, pixel % width);
    row == 0 || column == 0 || row + 1 == pixels / width || column + 1 == width
}

/// The pixels of every connected region where `mask` is `value`: neighbours share a side, and inside a corner too.
fn regions(mask: &[bool], width: usize, value: bool) -> Vec<Vec<usize>> {
    let height = mask.len() / width;
    let mut left: Vec<bool> = mask.iter().map(|x| *x == value).collect();
    let mut found = Vec::new();
    for start in 0..mask.len() {
        if !std::mem::take(&mut left[start]) {
            continue;
        }
        let (mut region, mut next) = (vec![start], 0);
        while let Some(&pixel) = region.get(next) {
            next += 1;
            let (row, column) = (pixel / width, pixel % width);
            for r in row.saturating_sub(1)..(row + 2).min(height) {
                for c in column.saturating_sub(1)..(column + 2).min(width) {
                    let beside = value || r == row || c == column;
                    if beside && std::mem::take(&mut left[r * width + c]) {
                        region.push(r * width + c);
                    }
                }
            }
        }
        found.push(region);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture of 20 by 12 pixels, inside where `inside` says.
    fn picture(inside: impl Fn(usize, usize) -> bool) -> Image {
        let data = (0..240).map(|i| f32::from(u8::from(inside(i / 20, i % 20)))).collect();
        Image { batch: 1, height: 12, width: 20, channels: 1, data }
    }

    #[test]
    fn covered_holes_and_missed_parts_are_found() {
        let block = |r: usize, c: usize| (1..11).contains(&r) && (1..10).contains(&c);
        let hole = |r: usize, c: usize| (4..8).contains(&r) && (4..7).contains(&c);
        let part = |r: usize, c: usize| (3..8).contains(&r) && (14..17).contains(&c);
        let target = picture(|r, c| block(r, c) && !hole(r, c) || part(r, c));
        let mut unseen = Unseen::default();
        unseen.add(0, &target, &target);
        assert_eq!(unseen, Unseen::default());
        assert!(unseen.reasons(1).is_empty() && unseen.missing(&target).is_none());
        unseen.add(3, &picture(|r, c| block(r, c) || part(r, c)), &target);
        unseen.add(4, &picture(|r, c| block(r, c) && !hole(r, c)), &target);
        // A hole that is open to the outside is none, and a smaller one is not told.
        let open = picture(|r, c| block(r, c) && !(hole(r, c) || c < 4 && r == 5));
        unseen.add(5, &picture(block), &open);
        unseen.add(6, &picture(block), &picture(|r, c| block(r, c) && (r, c) != (5, 5)));
        assert_eq!((&unseen.covered[..], &unseen.missed[..]), (&[3][..], &[4][..]));
        let told = ["covers a hole that is seen in view 6", "leaves out a part that is seen in view 8"];
        assert_eq!(unseen.reasons(2), told);
        // All of the part, in the view that shows it, and nothing else.
        let views = Image { batch: 7, data: target.data.repeat(7), ..target };
        let marks = unseen.missing(&views).map(|marks| marks.data).unwrap_or_default();
        let expected = (0..7 * 240).map(|i| f32::from(i / 240 == 4 && part(i % 240 / 20, i % 20)));
        assert_eq!(marks, expected.collect::<Vec<f32>>());
    }
}
