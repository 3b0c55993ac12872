//! Turntables and sweeps, as GIF files or contact sheets.

use super::args::RenderArgs;
use super::developed::{Developed, Image};
use super::formats::{self, Format};
use super::picture::Picture;
use super::report::{Report, Written};
use super::{Failure, Stage, Target, gif, sheet};
use crate::commands::parse::Swept;
use crate::commands::progress::Progress;

/// What a sweep changes and its value in one frame.
pub type Step = (Swept, f64);

const SWEEP_FRAMES: usize = 24;
const SWEEP_CELLS: usize = 8;

/// One frame to render: its turn in degrees, its step of a sweep, and its label.
struct Moment {
    turn: f64,
    step: Option<Step>,
    label: String,
}

/// Renders all frames once and writes them into every target.
pub fn run(stage: &mut Stage<'_>, targets: &[Target], report: &mut Report) -> Result<(), Failure> {
    let moments = moments(stage, targets);
    let mut frames: Vec<Vec<Picture>> = targets.iter().map(|_| Vec::new()).collect();
    let progress = Progress::frames(moments.len());
    for moment in &moments {
        let mut made: Vec<_> = targets.iter().map(|target| Developed::new(target.output, target.format)).collect();
        let mut depths = None;
        stage.shoot(moment.turn, moment.step, |shot| {
            // Depth is shown between near and far, which are the same in all frames, so that greys do not flicker.
            depths = Some((shot.settings.near, shot.settings.far));
            report.add(shot);
            Ok(made.iter_mut().try_for_each(|made| made.add(shot))?)
        })?;
        for (made, frames) in made.into_iter().zip(&mut frames) {
            if let Image::Picture(picture, _) = made.finished(depths) {
                frames.push(picture.flattened(ground(stage)));
            }
        }
        progress.step();
    }
    drop(progress);
    report.values(moments.iter().filter_map(|m| m.step.map(|(_, value)| value)).collect());
    for (target, frames) in targets.iter().zip(frames) {
        let count = frames.len();
        match target.format {
            Format::Gif => gif::write(&target.path, &looped(frames, stage), delay(stage, count))?,
            _ => {
                let labels = moments.iter().map(|m| m.label.clone());
                let cells: Vec<_> = frames.into_iter().zip(labels).collect();
                formats::write_png(&target.path, &sheet::sheet(&cells, ground(stage)))?;
            }
        }
        report.wrote(Written::frames(target, count));
    }
    Ok(())
}

fn moments(stage: &Stage<'_>, targets: &[Target]) -> Vec<Moment> {
    if let Some(sweep) = stage.args.sweep {
        let gif = targets.iter().any(|t| t.format == Format::Gif);
        let values = sweep.values(if gif { SWEEP_FRAMES } else { SWEEP_CELLS });
        let labels = short(&values);
        let moment = |(value, label)| {
            let label = format!("{}={label}", sweep.swept.name());
            Moment { turn: 0.0, step: Some((sweep.swept, value)), label }
        };
        return values.into_iter().zip(labels).map(moment).collect();
    }
    let azimuth = stage.args.camera.azimuth;
    let label = |turn: f64| format!("azimuth={}", ((azimuth + turn).rem_euclid(360.0) * 10.0).round() / 10.0);
    turns(stage.args).into_iter().map(|turn| Moment { turn, step: None, label: label(turn) }).collect()
}

/// The turns of a turntable, in degrees; 0 alone for other pictures.
pub fn turns(args: &RenderArgs) -> Vec<f64> {
    let count = args.turntable.unwrap_or(1);
    (0..count).map(|i| 360.0 * i as f64 / count as f64).collect()
}

/// Numbers of up to three digits, with exponents if one of them needs one: 1e-4, 2.15e-3, 1e-2, but 0.5, 12.
pub fn short(values: &[f64]) -> Vec<String> {
    let plain = values.iter().all(|value| (0.01..10_000.0).contains(value));
    let one = |value: &f64| {
        let digits = format!("{value:.2e}");
        let Some((mantissa, exponent)) = digits.split_once('e') else { return digits };
        let mantissa = mantissa.trim_end_matches('0').trim_end_matches('.');
        match (plain, format!("{mantissa}e{exponent}").parse::<f64>()) {
            (true, Ok(rounded)) => rounded.to_string(),
            _ => format!("{mantissa}e{exponent}"),
        }
    };
    values.iter().map(one).collect()
}

/// The background of a GIF or a contact sheet, which have no transparency: white unless one is given.
fn ground(stage: &Stage<'_>) -> [u8; 3] {
    let look = &stage.args.look;
    let numbers = look.background.map_or([1.0; 3], |b| b.numbers(look.curve()));
    numbers.map(|c| (look.curve().encode(c) * 255.0).round() as u8)
}

/// The frames of a loop: a turntable ends where it began, a sweep runs there and back.
fn looped(mut frames: Vec<Picture>, stage: &Stage<'_>) -> Vec<Picture> {
    if stage.args.sweep.is_some() && frames.len() > 2 {
        let back: Vec<_> = frames[1..frames.len() - 1].iter().rev().cloned().collect();
        frames.extend(back);
    }
    frames
}

/// Hundredths of a second per frame: 25 frames of a turntable a second; a sweep takes about two seconds each way.
fn delay(stage: &Stage<'_>, count: usize) -> u16 {
    if stage.args.sweep.is_some() { (200 / count).clamp(3, 50) as u16 } else { 4 }
}

#[cfg(test)]
mod tests {
    use super::short;

    #[test]
    fn labels_are_short() {
        assert_eq!(short(&[0.5, 12.0, 1.0 / 3.0]), ["0.5", "12", "0.333"]);
        assert_eq!(short(&[1e-4, 2.154e-3, 0.01, 0.5]), ["1e-4", "2.15e-3", "1e-2", "5e-1"]);
    }
}
