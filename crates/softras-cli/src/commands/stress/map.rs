//! A map of the error of images over the σ-γ plane.

use crate::commands::{progress::Progress, svg};
use plotters::prelude::*;
use softras::Result;
use softras_check::stress::{Stress, at, image_error};
use std::path::Path;

/// Number of scenes at each σ and γ.
const SCENES: u64 = 8;
/// The powers of ten of σ and γ.
const SIGMA: std::ops::RangeInclusive<i32> = -12..=1;
const GAMMA: std::ops::RangeInclusive<i32> = -10..=1;
/// Side of a cell in pixels.
const CELL: i32 = 52;
const LEFT: i32 = 90;
const TOP: i32 = 50;

/// Measures and draws the map: at each σ and γ the largest error of any value of any image of the same few scenes, without
/// pixels near a discontinuity of the model.
pub fn draw(path: &Path, stress: &mut Stress) -> Result<()> {
    let progress = Progress::counted("place", SIGMA.count() * GAMMA.count());
    let mut cells = Vec::new();
    for gamma in GAMMA {
        for sigma in SIGMA {
            let mut worst = 0f64;
            for seed in 0..SCENES {
                let case = at(seed, 10f64.powi(sigma), 10f64.powi(gamma))?;
                let frame = stress.renderer().render(&case.scene, &case.cameras, &case.settings)?;
                worst = worst.max(image_error(&frame, &case)?);
            }
            cells.push((sigma, gamma, worst));
            progress.step();
        }
    }
    let size = ((LEFT + columns() * CELL + 20) as u32, (TOP + rows() * CELL + 70) as u32);
    svg::write(path, size, |area| picture(area, &cells))
}

fn columns() -> i32 {
    SIGMA.count() as i32
}

fn rows() -> i32 {
    GAMMA.count() as i32
}

/// The colour of an error: from white for 1e-7 through yellow and red to black for 1.
fn shade(error: f64) -> RGBColor {
    let x = ((error.max(1e-7).log10() + 7.0) / 7.0).clamp(0.0, 1.0);
    let stops = [[255.0, 255.0, 255.0], [254.0, 217.0, 118.0], [227.0, 26.0, 28.0], [40.0, 0.0, 20.0]];
    let at = x * 3.0;
    let low = (at as usize).min(2);
    let mix = |k: usize| (stops[low][k] + (stops[low + 1][k] - stops[low][k]) * (at - low as f64)) as u8;
    RGBColor(mix(0), mix(1), mix(2))
}

fn picture(root: &svg::Area<'_>, cells: &[(i32, i32, f64)]) -> std::result::Result<(), Box<dyn std::error::Error>> {
    let (columns, rows) = (columns(), rows());
    root.fill(&WHITE)?;
    let text = |size: i32| ("sans-serif", size).into_font();
    let title = "largest error of any value against the model in f64";
    root.draw(&Text::new(title, (LEFT, 18), text(17)))?;
    for &(sigma, gamma, error) in cells {
        let (x, y) = (LEFT + (sigma - SIGMA.start()) * CELL, TOP + (GAMMA.end() - gamma) * CELL);
        root.draw(&Rectangle::new([(x, y), (x + CELL, y + CELL)], shade(error).filled()))?;
        let ink = if error > 3e-3 { WHITE } else { BLACK };
        root.draw(&Text::new(format!("{error:.0e}"), (x + 9, y + CELL / 2 - 6), text(12).color(&ink)))?;
    }
    for sigma in SIGMA {
        let place = (LEFT + (sigma - SIGMA.start()) * CELL + 11, TOP + rows * CELL + 8);
        root.draw(&Text::new(format!("1e{sigma}"), place, text(13)))?;
    }
    for gamma in GAMMA {
        let place = (LEFT - 44, TOP + (GAMMA.end() - gamma) * CELL + CELL / 2 - 7);
        root.draw(&Text::new(format!("1e{gamma}"), place, text(13)))?;
    }
    root.draw(&Text::new("sigma", (LEFT + columns * CELL / 2 - 20, TOP + rows * CELL + 36), text(15)))?;
    root.draw(&Text::new("gamma", (8, TOP + rows * CELL / 2), text(15)))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn worse_is_darker() {
        let light = |error| {
            let RGBColor(r, g, b) = shade(error);
            u32::from(r) + u32::from(g) + u32::from(b)
        };
        let lights: Vec<u32> = (-8..=1).map(|power| light(10f64.powi(power))).collect();
        assert!(lights.windows(2).all(|pair| pair[0] >= pair[1]) && lights[0] > lights[9], "{lights:?}");
        assert_eq!(shade(f64::INFINITY), shade(1.0));
    }
}
