//! The negative gradient of every vertex as arrows on the screen.

use super::engine::Images;
use glam::DVec3;
use softras::{Mesh, Result};
use softras_io::Picture;
use softras_view::Viewpoint;
use softras_view::canvas::{self, Arrow, Point};

/// A vertex is occluded if it lies behind the visible surface by more than this share of the depth range.
const OCCLUDED: f64 = 0.03;
/// The side of the cells of the grid that thins out the arrows, in pixels of the panel.
const CELL: f64 = 27.0;
/// The longest arrow, as a share of the panel's smaller side.
const LONGEST: f64 = 0.14;
/// Arrows for steps above this quantile are as long as the arrow of the quantile.
const QUANTILE: f64 = 0.99;
/// Arrows shorter than this many pixels are drawn as dots.
const SHORTEST: f64 = 3.5;

/// The colour of arrows of visible vertices.
pub const SEEN: [u8; 3] = [255, 176, 46];
/// The colour of arrows of occluded vertices.
pub const HIDDEN: [u8; 3] = [72, 176, 255];

/// A vertex inside the picture.
#[derive(Clone, Copy, Debug)]
pub struct Pull {
    /// Its position in pixels.
    pub at: Point,
    /// Its displacement in pixels for a unit step against the gradient.
    pub step: Point,
    /// Whether it is occluded.
    pub occluded: bool,
}

impl Pull {
    fn size(&self) -> f64 {
        self.step[0].hypot(self.step[1])
    }
}

/// The [`Pull`] of every vertex that a triangle uses and that lies in the picture; `depth` are images rendered sharply.
pub fn pulls(mesh: &Mesh, gradient: &[f64], view: &Viewpoint, size: [usize; 2], depth: &Images) -> Result<Vec<Pull>> {
    let [width, height] = size;
    let (w, h) = (width as f64, height as f64);
    let camera = view.camera()?;
    // Nothing outside of near and far is drawn.
    let project = |p: DVec3| {
        let [column, row, z] = camera.project(p, (width as u32, height as u32))?;
        (view.near..=view.far).contains(&z).then_some(([column, row], z))
    };
    let mut used: Vec<usize> = mesh.triangles().iter().flatten().map(|&i| i as usize).collect();
    used.sort_unstable();
    used.dedup();
    let reach = view.eye.distance(view.target).max(1e-9);
    let pull = |i: usize| {
        let position = DVec3::from_array(mesh.positions()[i].map(f64::from));
        let downhill = -DVec3::from_slice(&gradient[3 * i..3 * i + 3]);
        let (at, z) = project(position)?;
        let inside = (0.0..w).contains(&at[0]) && (0.0..h).contains(&at[1]);
        let (direction, length) = (downhill.try_normalize()?, downhill.length());
        let small = 1e-5 * reach;
        let (moved, _) = project(position + small * direction)?;
        let step = [0, 1].map(|k| (moved[k] - at[k]) / small * length);
        let occluded = inside && hidden(at, z - OCCLUDED * (view.far - view.near), size, depth);
        inside.then_some(Pull { at, step, occluded })
    };
    Ok(used.into_iter().filter_map(pull).collect())
}

/// Whether all pixels around a position show something nearer. On an outline some of them show what is behind, so a vertex
/// there counts as visible.
fn hidden(at: Point, z: f64, [width, height]: [usize; 2], depth: &Images) -> bool {
    let around = |x: f64, side: usize| (x as usize).saturating_sub(1)..(x as usize + 2).min(side);
    let pixels = around(at[1], height).flat_map(|row| around(at[0], width).map(move |column| row * width + column));
    // A depth image is premultiplied by the silhouette.
    pixels.into_iter().all(|i| depth.silhouette[i] > 0.5 && depth.depth[i] / depth.silhouette[i] < z)
}

/// The visible and the occluded vertex with the longest step of every cell of the panel, in drawing order: occluded and
/// short ones first.
fn thinned(pulls: &[Pull], scale: f64, width: f64) -> Vec<Pull> {
    let columns = (width / CELL).ceil() as usize + 1;
    let cell = |pull: &Pull| {
        let [column, row] = pull.at.map(|x| (x * scale / CELL) as usize);
        2 * (row * columns + column) + usize::from(pull.occluded)
    };
    let mut strongest: std::collections::BTreeMap<usize, Pull> = std::collections::BTreeMap::new();
    for pull in pulls {
        let kept = strongest.entry(cell(pull)).or_insert(*pull);
        if pull.size() > kept.size() {
            *kept = *pull;
        }
    }
    let mut kept: Vec<Pull> = strongest.into_values().collect();
    kept.sort_by(|a, b| b.occluded.cmp(&a.occluded).then(a.size().total_cmp(&b.size())));
    kept
}

/// Draws the arrows on a panel whose pixels are `scale` times finer than the image's, and returns their number.
pub fn draw(panel: &mut Picture, pulls: &[Pull], scale: f64) -> usize {
    let mut sizes: Vec<f64> = pulls.iter().map(Pull::size).filter(|size| *size > 0.0).collect();
    sizes.sort_by(f64::total_cmp);
    let Some(&largest) = sizes.get((sizes.len() as f64 * QUANTILE) as usize).or(sizes.last()) else { return 0 };
    let longest = LONGEST * panel.width.min(panel.height) as f64;
    let line = (panel.width.min(panel.height) as f64 / 190.0).clamp(1.0, 4.0);
    let mut drawn = 0;
    for pull in thinned(pulls, scale, panel.width as f64) {
        let part = (pull.size() / largest).min(1.0).sqrt();
        let from = pull.at.map(|x| x * scale);
        let color = if pull.occluded { HIDDEN } else { SEEN };
        let length = longest * part;
        if length < SHORTEST {
            canvas::disc(panel, from, 0.6 * line, color);
            continue;
        }
        let to = [0, 1].map(|k| from[k] + length * pull.step[k] / pull.size());
        canvas::arrow(panel, &Arrow { from, to, width: line * (0.65 + 0.5 * part), color });
        drawn += 1;
    }
    drawn
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn on_an_outline_nothing_is_hidden() {
        let depth = Images { color: Vec::new(), silhouette: vec![1.0, 1.0, 1.0, 0.0], depth: vec![2.0, 2.0, 2.0, 0.0] };
        let hidden = |x: f64, z: f64| super::hidden([x, 0.5], z, [4, 1], &depth);
        assert!(hidden(0.5, 3.0) && hidden(1.5, 3.0) && !hidden(1.5, 2.0) && !hidden(2.5, 3.0));
    }

    #[test]
    fn every_cell_keeps_its_strongest_of_each_kind() {
        let pull = |x: f64, size: f64, occluded: bool| Pull { at: [x, 1.0], step: [size, 0.0], occluded };
        let all = [pull(1.0, 1.0, false), pull(2.0, 3.0, false), pull(3.0, 2.0, true), pull(90.0, 0.5, false)];
        let kept: Vec<f64> = thinned(&all, 1.0, 100.0).iter().map(Pull::size).collect();
        assert_eq!(kept, [2.0, 0.5, 3.0]);
    }
}
