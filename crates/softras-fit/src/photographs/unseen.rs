//! Faults of a fit that its outline shows: holes of the pictures that the mesh covers, and parts that it leaves out.

use crate::{
    mask_iou,
    mesh::regions::{holes, of_pixels},
    sized,
};
use softras::{
    Image, Mesh, Renderer, Result, Scene, Settings, parts,
    scene::{Outputs, SilhouetteAggregation},
};
use softras_io::Views;

/// Holes and parts of fewer pixels are not reported: they may come from how edges fall on pixels.
pub const LEAST_PIXELS: usize = 8;
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
    /// Compares the views' silhouettes with a mesh's hard ones: what is not seen, and each view's mask IoU.
    pub(crate) fn compare(
        mesh: &Mesh,
        views: &Views,
        settings: &Settings,
        renderer: &mut Renderer,
    ) -> Result<(Self, Vec<f64>)> {
        let (mut unseen, mut ious) = (Self::default(), Vec::new());
        let Some(silhouettes) = &views.silhouette else { return Ok((unseen, ious)) };
        let settings = hard(settings, views.size()?, 1);
        parts::in_batches(renderer, &Scene::new(mesh.clone()), &views.cameras, &settings, |some, frame| {
            let (image, target) = (frame.silhouette()?, silhouettes.views(some.clone()));
            unseen.add(some.start, image, &target);
            ious.extend(mask_iou(image, &target)?);
            Ok(())
        })?;
        Ok((unseen, ious))
    }

    /// Compares the views' silhouettes with those of the mesh from the `first`th view on.
    fn add(&mut self, first: usize, mesh: &Image, targets: &Image) {
        for view in 0..mesh.batch {
            let inside = |image: &Image| image.view(view).iter().map(|x| *x > 0.5).collect::<Vec<bool>>();
            let (mesh, target) = (inside(mesh), inside(targets));
            let wrong = |region: &[usize], shown: bool| {
                let count = region.iter().filter(|pixel| mesh[**pixel] == shown).count();
                region.len() >= LEAST_PIXELS && count as f64 >= WRONG * region.len() as f64
            };
            let size = (targets.height, targets.width);
            if holes(size, |pixel| target[pixel]).iter().any(|hole| wrong(hole, true)) {
                self.covered.push(first + view);
            }
            // Pixels of the object that share only a corner are connected, too.
            let parts = of_pixels(size, |pixel| target[pixel], true);
            let parts = parts.into_iter().filter(|part| wrong(part, false)).flatten();
            let before = self.parts.len();
            self.parts.extend(parts.map(|pixel| (first + view) * target.len() + pixel));
            if self.parts.len() > before {
                self.missed.push(first + view);
            }
        }
    }

    /// The faults of the mesh in words, with the names of the views that show them.
    pub fn reasons(&self, name: impl Fn(usize) -> String) -> Vec<String> {
        let list = |views: &[usize]| {
            let first: Vec<String> = views.iter().take(8).map(|view| name(*view)).collect();
            let more = if views.len() > first.len() {
                format!(" and {} more", views.len() - first.len())
            } else {
                String::new()
            };
            format!("{}{more}", first.join(", "))
        };
        let mut reasons = Vec::new();
        if !self.covered.is_empty() {
            reasons.push(format!("covers a hole that is seen in {}", list(&self.covered)));
        }
        if !self.missed.is_empty() {
            reasons.push(format!("leaves out a part that is seen in {}", list(&self.missed)));
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

/// The settings for hard silhouettes with `samples` samples along each side of a pixel.
pub fn hard(settings: &Settings, size: (usize, usize), samples: usize) -> Settings {
    let (outputs, silhouette) = (Outputs::SILHOUETTE, SilhouetteAggregation::Hard);
    Settings { outputs, silhouette, sigma: 1e-7, ..sized(settings, size, samples) }
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
        assert!(unseen.reasons(|_| String::new()).is_empty() && unseen.missing(&target).is_none());
        unseen.add(3, &picture(|r, c| block(r, c) || part(r, c)), &target);
        unseen.add(4, &picture(|r, c| block(r, c) && !hole(r, c)), &target);
        // A hole that is open to the outside is none, and a smaller one is not reported.
        let open = picture(|r, c| block(r, c) && !(hole(r, c) || c < 4 && r == 5));
        unseen.add(5, &picture(block), &open);
        unseen.add(6, &picture(block), &picture(|r, c| block(r, c) && (r, c) != (5, 5)));
        assert_eq!((&unseen.covered[..], &unseen.missed[..]), (&[3][..], &[4][..]));
        let told = ["covers a hole that is seen in 6.png", "leaves out a part that is seen in 8.png"];
        assert_eq!(unseen.reasons(|view| format!("{}.png", 2 * view)), told);
        // All of the part, in the view that shows it, and nothing else.
        let views = Image { batch: 7, data: target.data.repeat(7), ..target };
        let marks = unseen.missing(&views).map(|marks| marks.data).unwrap_or_default();
        let expected = (0..7 * 240).map(|i| f32::from(i / 240 == 4 && part(i % 240 / 20, i % 20)));
        assert_eq!(marks, expected.collect::<Vec<f32>>());
    }
}
