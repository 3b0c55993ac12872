//! COLMAP's text model, cameras.txt and images.txt (<https://colmap.github.io/format.html>).
//!
//! A pose is world to camera, X' = R(q) X + t with a unit quaternion q = (w, x, y, z), and the camera's axes are x right,
//! y down, z forward. The centre of the upper left pixel is (0.5, 0.5). Of the points of pictures nothing is kept.

use super::{Entry, Lens, MAX_PICTURES, posed};
use crate::input;
use glam::{DMat4, DQuat, DVec3};
use softras::{Error, Result};
use std::collections::HashMap;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

/// Camera axes as in OpenCV.
const COLMAP: DVec3 = DVec3::new(1.0, -1.0, 1.0);

/// The most bytes of a line that is read: numbers and a name.
const MAX_LINE: u64 = 16 << 10;

/// The lines of a file, and the number of the last one.
struct Lines<'a> {
    path: &'a Path,
    reader: BufReader<std::fs::File>,
    line: usize,
    /// A line that was looked at and not taken.
    waiting: Option<String>,
}

impl<'a> Lines<'a> {
    fn open(path: &'a Path) -> Result<Self> {
        let file = input::open(path)?;
        input::refuse_empty(path, file.metadata().map_or(1, |metadata| metadata.len()))?;
        Ok(Self { path, reader: BufReader::new(file), line: 0, waiting: None })
    }

    fn refuse<T>(&self, what: impl Into<String>, fix: &str) -> Result<T> {
        Err(Error::File { path: self.path.into(), line: Some(self.line), what: what.into(), fix: fix.into() })
    }

    fn io<T>(&self, result: std::io::Result<T>) -> Result<T> {
        result.map_err(|source| Error::Io { path: self.path.into(), source })
    }

    /// The next line that is neither empty nor a comment.
    fn next(&mut self) -> Result<Option<String>> {
        if self.waiting.is_some() {
            return Ok(self.waiting.take());
        }
        loop {
            let mut bytes = Vec::new();
            self.line += 1;
            let read = (&mut self.reader).take(MAX_LINE).read_until(b'\n', &mut bytes);
            if self.io(read)? == 0 {
                return Ok(None);
            }
            if bytes.len() as u64 == MAX_LINE && bytes.last() != Some(&b'\n') {
                return self
                    .refuse(format!("more than {MAX_LINE} bytes"), "write a line for each entry, as COLMAP does");
            }
            let Ok(text) = String::from_utf8(bytes) else {
                return self.refuse("not UTF-8", "write the model as text");
            };
            let text = text.trim();
            if !text.is_empty() && !text.starts_with('#') {
                return Ok(Some(text.to_string()));
            }
        }
    }

    /// Passes over a picture's line of points, of any length. A file may lack these lines: then this one is a picture's.
    fn skip_points(&mut self) -> Result<()> {
        self.line += 1;
        let mut bytes = Vec::new();
        let read = (&mut self.reader).take(MAX_LINE).read_until(b'\n', &mut bytes);
        if self.io(read)? as u64 == MAX_LINE && bytes.last() != Some(&b'\n') {
            let skipped = self.reader.skip_until(b'\n');
            return self.io(skipped).map(|_| ());
        }
        let text = String::from_utf8_lossy(&bytes);
        // Points are numbers alone; the tenth word of a picture is its name.
        let is_name = |word: &str| word.parse::<f64>().is_err();
        if text.split_whitespace().nth(9).is_some_and(is_name) && !text.trim_start().starts_with('#') {
            self.waiting = Some(text.trim().to_string());
        }
        Ok(())
    }

    /// The words as finite numbers.
    fn numbers<const N: usize>(&self, words: &[&str]) -> Result<[f64; N]> {
        let number = |word: &&str| word.parse().ok().filter(|x: &f64| x.is_finite());
        let numbers: Option<Vec<f64>> = words.iter().map(number).collect();
        match numbers.and_then(|numbers| numbers.try_into().ok()) {
            Some(numbers) => Ok(numbers),
            None => self.refuse(format!("{N} numbers are expected here"), "write finite numbers, as COLMAP does"),
        }
    }

    fn id(&self, word: &str) -> Result<u32> {
        word.parse().or_else(|_| self.refuse("an id is expected here", "write a whole number from 0"))
    }
}

/// A camera of cameras.txt.
struct Calibrated {
    size: (u32, u32),
    lens: Lens,
}

/// The pictures of an images.txt, or of the images.txt beside a cameras.txt.
pub(super) fn read(path: &Path) -> Result<Vec<Entry>> {
    let cameras = cameras(&path.with_file_name("cameras.txt"))?;
    let path = path.with_file_name("images.txt");
    let mut lines = Lines::open(&path)?;
    let mut views = Vec::new();
    while let Some(text) = lines.next()? {
        let words: Vec<&str> = text.split_whitespace().collect();
        let [id, pose @ .., camera] = words.get(..9).filter(|_| words.len() > 9).unwrap_or_default() else {
            return lines.refuse("a picture needs ten words", "give IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME");
        };
        lines.id(id)?;
        let [w, x, y, z, tx, ty, tz] = lines.numbers::<7>(pose)?;
        let Some(Calibrated { size, lens }) = cameras.get(&lines.id(camera)?) else {
            return lines.refuse(format!("camera {camera} is not in cameras.txt"), "give its line there");
        };
        let turn = DQuat::from_xyzw(x, y, z, w);
        if (turn.length() - 1.0).abs() > 1e-2 {
            return lines.refuse("the quaternion has another length than 1", "give QW QX QY QZ of a rotation");
        }
        let matrix = DMat4::from_rotation_translation(turn.normalize(), DVec3::new(tx, ty, tz));
        let view = posed(matrix, COLMAP).or_else(|what| lines.refuse(what, "give a rotation"))?;
        // A name may hold spaces: it is the rest of the line.
        let name = words[..9].iter().fold(&text[..], |rest, word| rest.trim_start()[word.len()..].trim_start());
        let place = format!("line {}", lines.line);
        views.push(Entry { file: name.into(), size: Some(*size), place, view, lens: *lens });
        if views.len() > MAX_PICTURES {
            return lines.refuse("more than 100000 pictures", "use fewer");
        }
        lines.skip_points()?;
    }
    Ok(views)
}

/// The cameras of a cameras.txt by their ids.
fn cameras(path: &Path) -> Result<HashMap<u32, Calibrated>> {
    let mut lines = Lines::open(path)?;
    let mut cameras = HashMap::new();
    while let Some(text) = lines.next()? {
        let words: Vec<&str> = text.split_whitespace().collect();
        let [id, model, width, height, parameters @ ..] = &words[..] else {
            return lines.refuse("a camera needs five words or more", "give CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]");
        };
        let [id, width, height] = [lines.id(id)?, lines.id(width)?, lines.id(height)?];
        let (lens, distortion) = lens(&lines, model, parameters)?;
        if distortion.iter().any(|k| *k != 0.0) {
            let fix = "undistort the pictures first (`colmap image_undistorter`)";
            return lines.refuse("a camera with distortion", fix);
        }
        if cameras.insert(id, Calibrated { size: (width, height), lens }).is_some() {
            return lines.refuse(format!("camera {id} again"), "give each camera one line");
        }
        if cameras.len() > MAX_PICTURES {
            return lines.refuse("more than 100000 cameras", "use fewer");
        }
    }
    Ok(cameras)
}

/// The lens of a model, and the parameters of its distortion.
fn lens(lines: &Lines<'_>, model: &str, parameters: &[&str]) -> Result<(Lens, Vec<f64>)> {
    let single = |[f, cx, cy]: [f64; 3]| Lens::Pixels { fx: f, fy: f, cx, cy };
    let double = |[fx, fy, cx, cy]: [f64; 4]| Lens::Pixels { fx, fy, cx, cy };
    Ok(match model {
        "SIMPLE_PINHOLE" => (single(lines.numbers(parameters)?), Vec::new()),
        "PINHOLE" => (double(lines.numbers(parameters)?), Vec::new()),
        "SIMPLE_RADIAL" => {
            let [f, cx, cy, k] = lines.numbers(parameters)?;
            (single([f, cx, cy]), vec![k])
        }
        "RADIAL" => {
            let [f, cx, cy, k1, k2] = lines.numbers(parameters)?;
            (single([f, cx, cy]), vec![k1, k2])
        }
        "OPENCV" => {
            let [fx, fy, cx, cy, rest @ ..] = lines.numbers::<8>(parameters)?;
            (double([fx, fy, cx, cy]), rest.to_vec())
        }
        _ => {
            let fix = "use SIMPLE_PINHOLE or PINHOLE, as `colmap image_undistorter` writes";
            return lines.refuse("a camera model that is not read", fix);
        }
    })
}
