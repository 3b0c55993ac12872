//! A plot of the loss by step, with a logarithmic scale.

use crate::commands::grad::canvas;
use crate::commands::render::formats;
use crate::commands::render::picture::Picture;
use crate::commands::render::sheet::{text_width, write_text};
use softras::Result;
use std::path::Path;

const WIDTH: usize = 560;
const HEIGHT: usize = 320;
const LEFT: usize = 64;
const RIGHT: usize = 16;
const TOP: usize = 16;
const BOTTOM: usize = 32;
const INK: [u8; 4] = [70, 70, 70, 255];
const GRID: [u8; 3] = [225, 225, 225];
const LINE: [u8; 3] = [31, 100, 190];

/// Writes the plot of (step, loss) pairs.
pub fn write(path: &Path, losses: &[(usize, f64)]) -> Result<()> {
    formats::write_png(path, &plot(losses))
}

fn plot(losses: &[(usize, f64)]) -> Picture {
    let mut picture = Picture::filled(WIDTH, HEIGHT, [255; 4]);
    let positive: Vec<(f64, f64)> = losses.iter().filter(|(_, l)| *l > 0.0).map(|(s, l)| (*s as f64, l.ln())).collect();
    let (Some(first), Some(last)) = (positive.first(), positive.last()) else { return picture };
    let low = positive.iter().map(|p| p.1).fold(f64::INFINITY, f64::min);
    let high = positive.iter().map(|p| p.1).fold(f64::NEG_INFINITY, f64::max).max(low + 0.1);
    let (w, h) = ((WIDTH - LEFT - RIGHT) as f64, (HEIGHT - TOP - BOTTOM) as f64);
    let x = |step: f64| LEFT as f64 + (step - first.0) / (last.0 - first.0).max(1.0) * w;
    let y = |log: f64| TOP as f64 + (high - log) / (high - low) * h;
    for i in 0..=4 {
        let part = f64::from(i) / 4.0;
        let (log, step) = (low + part * (high - low), first.0 + part * (last.0 - first.0));
        canvas::line(&mut picture, [LEFT as f64, y(log)], [LEFT as f64 + w, y(log)], 1.0, GRID);
        let label = format!("{:.4}", log.exp());
        write_text(&mut picture, &label, LEFT - 8 - text_width(&label, 1), y(log) as usize - 3, 1, INK);
        let label = format!("{step:.0}");
        write_text(&mut picture, &label, x(step) as usize - text_width(&label, 1) / 2, HEIGHT - BOTTOM + 8, 1, INK);
    }
    write_text(&mut picture, "loss", LEFT, HEIGHT - 12, 1, INK);
    for pair in positive.windows(2) {
        canvas::line(&mut picture, [x(pair[0].0), y(pair[0].1)], [x(pair[1].0), y(pair[1].1)], 1.6, LINE);
    }
    picture
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_goes_from_upper_left_to_lower_right() {
        let picture = plot(&[(0, 1.0), (10, 0.5), (20, 0.25)]);
        // The line's ends and middle lie on corners of pixels, so those pixels are at least half covered.
        let on_line = |column: usize, row: usize| {
            let [red, _, blue, _] = picture.pixels[row * WIDTH + column];
            blue.abs_diff(red) > (LINE[2] - LINE[0]) / 2
        };
        assert!(on_line(LEFT, TOP));
        assert!(on_line(WIDTH - RIGHT, HEIGHT - BOTTOM));
        assert!(on_line(LEFT + (WIDTH - LEFT - RIGHT) / 2, TOP + (HEIGHT - TOP - BOTTOM) / 2));
        assert!(!on_line(WIDTH - RIGHT - 2, TOP + 2));
        assert_eq!(plot(&[]), Picture::filled(WIDTH, HEIGHT, [255; 4]));
    }
}
