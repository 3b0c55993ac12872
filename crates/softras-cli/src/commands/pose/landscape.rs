//! A picture of the loss over two angles, which shows its local minima, sharp and blurred.

use super::Target;
use crate::commands::render::formats;
use crate::commands::render::picture::Picture;
use crate::commands::render::sheet;
use glam::DQuat;
use softras::fit::{Pose, PoseFit};
use softras::{Renderer, Result};
use std::path::Path;

/// Number of values of each angle.
const GRID: usize = 61;
/// Side of the pixels' squares in the picture, one for each value.
const CELL: usize = 4;
/// Poses rendered at once.
const BATCH: usize = 244;
/// σ and γ of the two panels.
const PANELS: [(&str, (f64, f64)); 2] =
    [("sigma=1e-6 gamma=1e-3", (1e-6, 1e-3)), ("sigma=1e-2 gamma=3e-1", (1e-2, 3e-1))];

/// Writes both panels: the pose turned by -180 to 180 degrees about the vertical axis (across) and about the horizontal
/// one (up), dark where the loss of plain colours is least.
///
/// The fit should draw faces from both sides: a face that disappears as it turns away is a step in the loss even when
/// blurred.
pub fn write(path: &Path, fit: &PoseFit, about: &Pose, target: &Target, renderer: &mut Renderer) -> Result<()> {
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
            losses.extend(fit.losses(renderer, some, softness, &target.repeated(some.len())?.plain())?);
        }
        panels.push((panel(&losses), label.to_string()));
    }
    formats::write_png(path, &sheet::sheet(&panels, [255; 3]))
}

fn panel(losses: &[f64]) -> Picture {
    let low = losses.iter().copied().fold(f64::INFINITY, f64::min);
    let high = losses.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut picture = Picture::filled(GRID * CELL, GRID * CELL, [255; 4]);
    for (i, loss) in losses.iter().enumerate() {
        let cell = Picture::filled(CELL, CELL, shade((loss - low) / (high - low).max(1e-12)));
        picture.paste(&cell, i % GRID * CELL, i / GRID * CELL);
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_loss_is_the_darkest() {
        let mut losses = vec![1.0; GRID * GRID];
        losses[GRID + 2] = 0.0;
        let picture = panel(&losses);
        assert_eq!(picture.pixels[(CELL * picture.width) + 2 * CELL], shade(0.0));
        assert_eq!(picture.pixels[0], shade(1.0));
        assert!(shade(0.0)[..3].iter().sum::<u8>() < 128 && shade(1.0)[0] == 250);
    }
}
