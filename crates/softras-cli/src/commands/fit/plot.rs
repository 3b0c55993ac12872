//! A plot of the loss by step, with a logarithmic scale.

use softras::Result;
use softras_io::Picture;
use softras_view::canvas;
use softras_view::{text_width, write_text};
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
    plot(losses).save(path)
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
    for (value, label) in ticks_of_logarithm(low.exp(), high.exp()) {
        let at = y(value.ln());
        canvas::line(&mut picture, [LEFT as f64, at], [LEFT as f64 + w, at], 1.0, GRID);
        write_text(&mut picture, &label, LEFT - 8 - text_width(&label, 1), at as usize - 3, 1, INK);
    }
    for (step, label) in ticks(first.0, last.0.max(first.0 + 1.0), 6.0) {
        canvas::line(&mut picture, [x(step), TOP as f64], [x(step), TOP as f64 + h], 1.0, GRID);
        write_text(&mut picture, &label, x(step) as usize - text_width(&label, 1) / 2, HEIGHT - BOTTOM + 6, 1, INK);
    }
    let middle = LEFT + (WIDTH - LEFT - RIGHT - text_width("step", 1)) / 2;
    write_text(&mut picture, "step", middle, HEIGHT - 14, 1, INK);
    write_text(&mut picture, "loss", LEFT, 6, 1, INK);
    for pair in positive.windows(2) {
        canvas::line(&mut picture, [x(pair[0].0), y(pair[0].1)], [x(pair[1].0), y(pair[1].1)], 1.6, LINE);
    }
    picture
}

/// Up to `about` + 1 round values in a range, with their labels.
fn ticks(low: f64, high: f64, about: f64) -> Vec<(f64, String)> {
    let least = (high - low) / about;
    let power = 10f64.powf(least.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|factor| factor * power).into_iter().find(|step| *step >= least);
    let step = step.unwrap_or(10.0 * power).max(f64::MIN_POSITIVE);
    let digits = (-step.log10().floor()).max(0.0) as usize;
    let (from, to) = ((low / step - 1e-9).ceil() as i64, (high / step + 1e-9).floor() as i64);
    (from..=to).map(|i| i as f64 * step).map(|value| (value, format!("{value:.digits$}"))).collect()
}

/// Round values in a range of positive numbers that is drawn by its logarithm: 1, 2 and 5 times powers of ten or, in a
/// narrow range, evenly spaced ones.
fn ticks_of_logarithm(low: f64, high: f64) -> Vec<(f64, String)> {
    let powers = low.log10().floor() as i32..=high.log10().floor() as i32;
    let all = powers.flat_map(|power| [1.0, 2.0, 5.0].map(|factor| (power, factor * 10f64.powi(power))));
    let inside = all.filter(|(_, value)| (low..=high).contains(value));
    let label = |power: i32, value: f64| format!("{value:.*}", (-power).max(0) as usize);
    let found: Vec<_> = inside.map(|(power, value)| (value, label(power, value))).collect();
    if found.len() > 2 { found } else { ticks(low, high, 6.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round() {
        let labels = |ticks: Vec<(f64, String)>| ticks.into_iter().map(|(_, label)| label).collect::<Vec<_>>();
        assert_eq!(labels(ticks(0.0, 499.0, 6.0)), ["0", "100", "200", "300", "400"]);
        assert_eq!(labels(ticks(3.0, 4.0, 6.0)), ["3.0", "3.2", "3.4", "3.6", "3.8", "4.0"]);
        assert_eq!(labels(ticks_of_logarithm(0.03, 1.3)), ["0.05", "0.1", "0.2", "0.5", "1"]);
        assert_eq!(labels(ticks_of_logarithm(0.21, 0.34)), ["0.25", "0.30"]);
    }

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
