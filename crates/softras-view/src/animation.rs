//! The frames of turntables and sweeps.

use crate::options::{Motion, Options, Swept};
use softras_io::Picture;

/// The setting that a sweep changes, and its value in one frame.
pub type Step = (Swept, f64);

/// One frame to render: its turn in degrees, its step of a sweep, and its label.
#[derive(Clone, Debug, PartialEq)]
pub struct Moment {
    /// Degrees around the vertical axis.
    pub turn: f64,
    /// The setting that a sweep changes, with its value.
    pub step: Option<Step>,
    /// The text under it in a contact sheet.
    pub label: String,
}

/// The frames of a picture's motion.
pub fn moments(options: &Options) -> Vec<Moment> {
    if let Motion::Sweep(sweep) = options.motion {
        let values = sweep.values();
        let labels = short(&values);
        let moment = |(value, label)| {
            let label = format!("{}={label}", sweep.swept.name());
            Moment { turn: 0.0, step: Some((sweep.swept, value)), label }
        };
        return values.into_iter().zip(labels).map(moment).collect();
    }
    let azimuth = options.camera.azimuth;
    let label = |turn: f64| format!("azimuth={}", ((azimuth + turn).rem_euclid(360.0) * 10.0).round() / 10.0);
    options.motion.turns().into_iter().map(|turn| Moment { turn, step: None, label: label(turn) }).collect()
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

/// The background of an animation or a contact sheet, which have no transparency: white unless one is given.
pub fn ground(options: &Options) -> [u8; 3] {
    let look = &options.look;
    look.background.unwrap_or([1.0; 3]).map(|c| (look.curve.encode(c) * 255.0).round() as u8)
}

/// The frames of a loop: a turntable ends where it began, a sweep runs there and back.
pub fn looped(mut frames: Vec<Picture>, motion: &Motion) -> Vec<Picture> {
    if matches!(motion, Motion::Sweep(_)) && frames.len() > 2 {
        let back: Vec<_> = frames[1..frames.len() - 1].iter().rev().cloned().collect();
        frames.extend(back);
    }
    frames
}

/// Hundredths of a second per frame: 25 frames of a turntable a second; a sweep takes about two seconds each way.
pub fn delay(motion: &Motion, count: usize) -> u16 {
    if matches!(motion, Motion::Sweep(_)) { (200 / count.max(1)).clamp(3, 50) as u16 } else { 4 }
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
