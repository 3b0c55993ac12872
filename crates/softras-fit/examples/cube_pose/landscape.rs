//! A picture of the loss over two angles, which shows its local minima, sharp and blurred.

use softras::glam::DQuat;
use softras::{Renderer, Result};
use softras_fit::{Pose, PoseFit, PoseTarget};
use softras_io::Picture;
use softras_view::{sheet, text_width, write_text};
use std::path::Path;

/// Number of values of each angle.
const GRID: usize = 61;
/// Side in pixels of the square that shows one value.
const CELL: usize = 4;
/// Poses rendered at once.
const BATCH: usize = 244;
/// σ and γ of the two panels.
const PANELS: [(&str, (f64, f64)); 2] =
    [("sharp: sigma=1e-6 gamma=1e-3", (1e-6, 1e-3)), ("soft: sigma=1e-2 gamma=3e-1", (1e-2, 3e-1))];
/// Pixels around a panel for the names and numbers of its axes: left, above, right, below.
const EDGES: [usize; 4] = [30, 12, 12, 24];
const INK: [u8; 4] = [40, 40, 40, 255];

/// Writes both panels: the pose turned by -180 to 180 degrees about the vertical axis (across) and about the horizontal
/// one (up), dark where the loss of plain colours is least. `target(n)` gives the target of n poses, all of one picture.
pub fn write(
    path: &Path,
    fit: &PoseFit,
    about: &Pose,
    target: impl Fn(usize) -> Result<PoseTarget>,
    renderer: &mut Renderer,
) -> Result<()> {
    let degrees = |i: usize| 360.0 * i as f64 / (GRID - 1) as f64 - 180.0;
    let pose = |i: usize| {
        let (across, up) = (degrees(i % GRID).to_radians(), degrees(GRID - 1 - i / GRID).to_radians());
        Pose { rotation: DQuat::from_rotation_x(up) * DQuat::from_rotation_y(across) * about.rotation, ..*about }
    };
    let poses: Vec<Pose> = (0..GRID * GRID).map(pose).collect();
    let mut panels = Vec::new();
    for (label, softness) in PANELS {
        let mut losses = Vec::with_capacity(poses.len());
        for some in poses.chunks(BATCH) {
            losses.extend(fit.losses(renderer, some, softness, &target(some.len())?.plain())?);
        }
        panels.push((panel(&losses), label.to_string()));
    }
    sheet(&panels, [255; 3]).save(path)
}

/// A square for each loss, the names of the axes, and numbers at their ends and in their middle.
fn panel(losses: &[f64]) -> Picture {
    let low = losses.iter().copied().fold(f64::INFINITY, f64::min);
    let high = losses.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let [left, above, right, below] = EDGES;
    let side = GRID * CELL;
    let mut picture = Picture::filled(left + side + right, above + side + below, [255; 4]);
    for (i, loss) in losses.iter().enumerate() {
        let square = Picture::filled(CELL, CELL, shade((loss - low) / (high - low).max(1e-12)));
        picture.paste(&square, left + i % GRID * CELL, above + i / GRID * CELL);
    }
    let wide = |text: &str| text_width(text, 1);
    for (i, degrees) in ["-180", "0", "180"].into_iter().enumerate() {
        let (across, up) = (left + i * side / 2, above + (2 - i) * side / 2);
        write_text(&mut picture, degrees, across - wide(degrees) / 2, above + side + 3, 1, INK);
        write_text(&mut picture, degrees, left - 3 - wide(degrees), up - 3, 1, INK);
    }
    let across = "turned across by degrees";
    write_text(&mut picture, across, left + (side - wide(across)) / 2, above + side + 14, 1, INK);
    write_text(&mut picture, "turned up by degrees", 0, 0, 1, INK);
    picture
}

/// From dark blue through green to light yellow.
fn shade(part: f64) -> [u8; 4] {
    const STOPS: [[f64; 3]; 4] =
        [[28.0, 20.0, 70.0], [40.0, 110.0, 140.0], [95.0, 190.0, 110.0], [250.0, 235.0, 130.0]];
    let at = part.clamp(0.0, 1.0) * 3.0;
    let from = (at as usize).min(2);
    let mix = |k: usize| STOPS[from][k] + (at - from as f64) * (STOPS[from + 1][k] - STOPS[from][k]);
    let [r, g, b] = [0, 1, 2].map(|k| mix(k).round() as u8);
    [r, g, b, 255]
}
