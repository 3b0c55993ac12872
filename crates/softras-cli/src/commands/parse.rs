//! Parsers of option values; clap prints their errors after the option's name.

use clap::builder::{PathBufValueParser, TypedValueParser};
use softras_io::Curve;
use softras_view::{HalfHeight, Swept};
use std::path::PathBuf;

/// The path of a file to write, whose name must end as its format does: in upper or lower case, and without the dot here.
pub fn file_ending(ending: &'static str) -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(move |path: PathBuf| {
        let fits = path.extension().is_some_and(|own| own.eq_ignore_ascii_case(ending));
        if fits { Ok(path) } else { Err(format!("a .{ending} file is written: give a name that ends in .{ending}")) }
    })
}

/// `x,y,z`.
pub fn triple(text: &str) -> Result<[f64; 3], String> {
    let numbers: Result<Vec<f64>, String> = text.split(',').map(number).collect();
    match numbers?[..] {
        [x, y, z] => Ok([x, y, z]),
        ref other => Err(format!("{} numbers, three are expected, as in 1,0.5,-2", other.len())),
    }
}

/// A finite number.
pub fn number(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        _ => Err(format!("{text:?} is not a finite number")),
    }
}

/// A finite number above 0.
pub fn positive(text: &str) -> Result<f64, String> {
    number(text).and_then(|x| if x > 0.0 { Ok(x) } else { Err(format!("{x} is not above 0")) })
}

/// A vertical angle of view in degrees.
pub fn angle_of_view(text: &str) -> Result<f64, String> {
    positive(text).and_then(|x| if x < 179.0 { Ok(x) } else { Err("use degrees below 179".into()) })
}

/// An angle between two faces in degrees.
pub fn crease(text: &str) -> Result<f64, String> {
    number(text).and_then(|x| if (0.0..=180.0).contains(&x) { Ok(x) } else { Err("use 0 to 180 degrees".into()) })
}

/// An elevation in degrees.
pub fn elevation(text: &str) -> Result<f64, String> {
    number(text).and_then(|x| if x.abs() <= 90.0 { Ok(x) } else { Err("use -90 to 90 degrees".into()) })
}

/// A number of bytes: `4096`, `512M` or `8GiB`; the letters K, M, G and T count in steps of 1024.
pub fn bytes(text: &str) -> Result<u64, String> {
    let number = text.trim().trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let unit = text.trim()[number.len()..].to_ascii_lowercase();
    let shift = match unit.trim_end_matches("ib").trim_end_matches('b') {
        "" => 0,
        "k" => 10,
        "m" => 20,
        "g" => 30,
        "t" => 40,
        _ => return Err(format!("{text:?} has no unit of K, M, G or T")),
    };
    match number.trim().parse::<u64>().ok().and_then(|n| n.checked_mul(1 << shift)) {
        Some(n) if n > 0 => Ok(n),
        _ => Err(format!("{text:?} is not a number of bytes above 0")),
    }
}

/// Three numbers that are not all 0.
pub fn direction(text: &str) -> Result<[f64; 3], String> {
    let direction = triple(text)?;
    let fix = "0,0,0 has no length, and so no direction: use 0,1,0 for y, or another one";
    if direction == [0.0; 3] { Err(fix.into()) } else { Ok(direction) }
}

/// `256` or `640x480`: width and height.
pub fn size(text: &str) -> Result<(u32, u32), String> {
    let side = |side: &str| match side.trim().parse::<u32>() {
        Ok(n) if (1..=softras::Settings::MAX_SIZE).contains(&n) => Ok(n),
        _ => Err(format!(
            "{text:?} is no size: use 256 or 640x480, sides of 1 to {} pixels",
            softras::Settings::MAX_SIZE
        )),
    };
    match text.split_once(['x', 'X', '×']) {
        Some((width, height)) => Ok((side(width)?, side(height)?)),
        None => side(text).map(|n| (n, n)),
    }
}

/// A colour as the user wrote it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rgb {
    /// In the renderer's numbers.
    Numbers([f64; 3]),
    /// As bytes of a picture file, scaled to 0 to 1.
    Bytes([f64; 3]),
}

impl Rgb {
    /// The colour in the renderer's numbers; bytes are decoded by the curve that pictures are written with.
    pub fn numbers(self, curve: Curve) -> [f64; 3] {
        match self {
            Self::Numbers(numbers) => numbers,
            Self::Bytes(bytes) => bytes.map(|byte| curve.decode(byte)),
        }
    }
}

/// `r,g,b` in the renderer's numbers, or an opaque colour as in CSS.
pub fn rgb(text: &str) -> Result<Rgb, String> {
    if text.contains(',') && !text.contains('(') {
        return triple(text).map(Rgb::Numbers);
    }
    let forms = "use #rrggbb, #rgb, r,g,b in linear light from 0 to 1, or a name of CSS, as white";
    match csscolorparser::parse(text).map(|color| color.to_rgba8()) {
        Ok([r, g, b, 255]) => Ok(Rgb::Bytes([r, g, b].map(|byte| f64::from(byte) / 255.0))),
        _ => Err(format!("{text:?} is no colour: {forms}")),
    }
}

/// Parses [`HalfHeight`].
pub fn half_height(text: &str) -> Result<HalfHeight, String> {
    if text == "fit" { Ok(HalfHeight::Fit) } else { positive(text).map(HalfHeight::Given) }
}

/// One `--light`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// The direction towards the light, in world space.
    pub direction: [f64; 3],
    /// The factor on the colour.
    pub intensity: f64,
    /// Its colour.
    pub color: Rgb,
}

/// `x,y,z[:intensity[:r,g,b]]`.
pub fn light(text: &str) -> Result<Light, String> {
    let mut parts = text.split(':');
    let direction = direction(parts.next().unwrap_or_default())?;
    let intensity = parts.next().map_or(Ok(1.0), number)?;
    let color = parts.next().map_or(Ok(Rgb::Numbers([1.0; 3])), rgb)?;
    match parts.next() {
        None => Ok(Light { direction, intensity, color }),
        Some(_) => Err("use x,y,z[:intensity[:r,g,b]]".into()),
    }
}

/// One `--sweep`, with a number of steps if one is given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweep {
    /// The setting that changes.
    pub swept: Swept,
    from: f64,
    to: f64,
    steps: Option<usize>,
}

impl Sweep {
    /// The values, `default_steps` of them unless a number was given.
    pub fn of(&self, default_steps: usize) -> softras_view::Sweep {
        let Self { swept, from, to, steps } = *self;
        softras_view::Sweep { swept, from, to, steps: steps.unwrap_or(default_steps) }
    }
}

/// `sigma=1e-5..1e-2[:steps]`.
pub fn sweep(text: &str) -> Result<Sweep, String> {
    let usage = || "use sigma=1e-5..1e-2 or sigma=1e-5..1e-2:12 (or gamma=, tau=, blur=)".to_string();
    let (name, range) = text.split_once('=').ok_or_else(usage)?;
    let all = [Swept::Sigma, Swept::Gamma, Swept::Tau, Swept::Blur];
    let swept = all.into_iter().find(|s| s.name() == name.trim()).ok_or_else(usage)?;
    let (range, steps) = match range.split_once(':') {
        Some((range, steps)) => (range, Some(count(steps)?)),
        None => (range, None),
    };
    let (from, to) = range.split_once("..").ok_or_else(usage)?;
    Ok(Sweep { swept, from: positive(from)?, to: positive(to)?, steps })
}

/// A number of frames.
pub fn count(text: &str) -> Result<usize, String> {
    match text.trim().parse() {
        Ok(n @ 2..=1000) => Ok(n),
        _ => Err(format!("{text:?} is not a number of frames from 2 to 1000")),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn values_are_read() {
        assert_eq!(triple("1, -2,3e-1").unwrap(), [1.0, -2.0, 0.3]);
        assert_eq!(size("256").unwrap(), (256, 256));
        assert_eq!(size("640x480").unwrap(), (640, 480));
        assert_eq!(rgb("#fff").unwrap(), Rgb::Bytes([1.0; 3]));
        assert!((rgb("#808080").unwrap().numbers(Curve::Srgb)[1] - 0.2158605).abs() < 1e-6);
        assert!((rgb("#808080").unwrap().numbers(Curve::Raw)[1] - 0.5019608).abs() < 1e-6);
        let white = Rgb::Numbers([1.0; 3]);
        assert_eq!(light("0,1,0:0.5").unwrap(), Light { direction: [0.0, 1.0, 0.0], intensity: 0.5, color: white });
        assert_eq!(rgb("Blue").unwrap(), Rgb::Bytes([0.0, 0.0, 1.0]));
        assert_eq!(rgb("fuchsia"), rgb("#ff00ff"));
        assert_eq!(half_height("fit").unwrap(), HalfHeight::Fit);
    }

    #[test]
    fn sweeps_are_spaced_by_their_logarithm() {
        let values = sweep("sigma=1e-5..1e-2:4").unwrap().of(9).values();
        let expected = [1e-5, 1e-4, 1e-3, 1e-2];
        assert!(values.iter().zip(expected).all(|(a, b)| (a / b - 1.0).abs() < 1e-12), "{values:?}");
        assert_eq!(sweep("gamma=1e-2..1e-5").unwrap().of(9).values().len(), 9);
    }

    #[test]
    fn nonsense_is_refused() {
        assert!(triple("1,2").is_err() && triple("1,2,nan").is_err());
        assert!(size("0").is_err() && size("20000").is_err() && size("3x").is_err());
        assert!(rgb("bluish").unwrap_err().contains("#rrggbb, #rgb, r,g,b") && rgb("").is_err());
        assert!(light("0,0,0").is_err() && direction("0,0,0").is_err());
        assert!(
            rgb("#12345").is_err()
                && rgb("#é").is_err()
                && rgb("transparent").is_err()
                && light("1,2,3:4:5,6,7:8").is_err()
        );
        assert!(sweep("sigma=0..1").is_err() && sweep("width=1..2").is_err() && sweep("sigma=1..2:1").is_err());
        assert!(positive("-1").is_err() && angle_of_view("180").is_err() && elevation("91").is_err());
    }
}
