//! COLMAP's model, cameras.txt and images.txt, or the same in binary (<https://colmap.github.io/format.html>).
//!
//! A pose is world to camera, X' = R(q) X + t with a unit quaternion q = (w, x, y, z), and the camera's axes are x right,
//! y down, z forward. The centre of the upper left pixel is (0.5, 0.5). The points of pictures are skipped.

use super::{Entry, Lens, MAX_PICTURES, posed};
use crate::{fault, input};
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
    reader: Box<dyn BufRead>,
    line: usize,
    /// A line that was looked at and not taken.
    waiting: Option<String>,
}

impl<'a> Lines<'a> {
    fn open(path: &'a Path) -> Result<Self> {
        let file = input::open(path)?;
        input::refuse_empty(path, file.metadata().map_or(1, |metadata| metadata.len()))?;
        let mut reader = BufReader::new(file);
        // A file of another kind looks like a model that is cut off.
        let wrong = |error: std::io::Error| {
            let is_cut = error.kind() == std::io::ErrorKind::UnexpectedEof;
            let what = if is_cut {
                "no binary COLMAP model, or cut off".into()
            } else {
                format!("as a binary COLMAP model: {error}")
            };
            fault(path, what, "copy it again, or write it as text: colmap model_converter --output_type TXT")
        };
        let reader: Box<dyn BufRead> =
            match is_binary(path).then(|| as_text(path, &mut reader)).transpose().map_err(wrong)? {
                Some(text) => Box::new(std::io::Cursor::new(text)),
                None => Box::new(reader),
            };
        Ok(Self { path, reader, line: 0, waiting: None })
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
            // A mark may stand before a text, and padding behind it.
            let text = text.trim_matches(|c: char| c.is_whitespace() || matches!(c, '\u{feff}' | '\0'));
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
    bend: Option<[f64; 4]>,
}

fn is_binary(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "bin")
}

/// A binary file of the model converted to the text form, without points.
fn as_text(path: &Path, reader: &mut impl BufRead) -> std::io::Result<String> {
    fn some<const N: usize>(reader: &mut impl Read) -> std::io::Result<[u8; N]> {
        let mut bytes = [0; N];
        reader.read_exact(&mut bytes).map(|()| bytes)
    }
    let bad = |what: &str| std::io::Error::new(std::io::ErrorKind::InvalidData, what.to_string());
    let mut text = String::new();
    let count = u64::from_le_bytes(some(reader)?);
    if count > MAX_PICTURES as u64 {
        return Err(bad("more than 100000 entries"));
    }
    for _ in 0..count {
        text += &i32::from_le_bytes(some(reader)?).to_string();
        let numbers = |reader: &mut _, count: usize| -> std::io::Result<String> {
            (0..count).map(|_| Ok(format!(" {}", f64::from_le_bytes(some(reader)?)))).collect()
        };
        if path.file_name().is_some_and(|name| name == "cameras.bin") {
            let model = i32::from_le_bytes(some(reader)?);
            let (name, count) = *usize::try_from(model)
                .ok()
                .and_then(|model| MODELS.get(model))
                .ok_or_else(|| bad("an unknown camera model"))?;
            let [width, height] = [u64::from_le_bytes(some(reader)?), u64::from_le_bytes(some(reader)?)];
            text += &format!(" {name} {width} {height}{}\n", numbers(reader, count)?);
        } else {
            let pose = numbers(reader, 7)?;
            let camera = i32::from_le_bytes(some(reader)?);
            let mut name = Vec::new();
            (&mut *reader).take(MAX_LINE).read_until(0, &mut name)?;
            let name = name.strip_suffix(&[0]).filter(|name| !name.contains(&b'\n'));
            let name = name.ok_or_else(|| bad("a name without an end, or of two lines"))?;
            let points = u64::from_le_bytes(some(reader)?).checked_mul(24).ok_or_else(|| bad("too many points"))?;
            if std::io::copy(&mut (&mut *reader).take(points), &mut std::io::sink())? < points {
                return Err(bad("fewer points than are said"));
            }
            text += &format!("{pose} {camera} {}\n\n", String::from_utf8_lossy(name));
        }
    }
    Ok(text)
}

/// COLMAP's camera models by their numbers, with the numbers of their parameters.
const MODELS: [(&str, usize); 11] = [
    ("SIMPLE_PINHOLE", 3),
    ("PINHOLE", 4),
    ("SIMPLE_RADIAL", 4),
    ("RADIAL", 5),
    ("OPENCV", 8),
    ("OPENCV_FISHEYE", 8),
    ("FULL_OPENCV", 12),
    ("FOV", 5),
    ("SIMPLE_RADIAL_FISHEYE", 4),
    ("RADIAL_FISHEYE", 5),
    ("THIN_PRISM_FISHEYE", 12),
];

/// The pictures of an images.txt or images.bin, or of that beside a file of cameras.
pub(super) fn read(path: &Path) -> Result<Vec<Entry>> {
    let ending = if is_binary(path) { "bin" } else { "txt" };
    let cameras = cameras(&path.with_file_name(format!("cameras.{ending}")))?;
    let path = path.with_file_name(format!("images.{ending}"));
    let mut lines = Lines::open(&path)?;
    let mut views = Vec::new();
    while let Some(text) = lines.next()? {
        let words: Vec<&str> = text.split_whitespace().collect();
        let [id, pose @ .., camera] = words.get(..9).filter(|_| words.len() > 9).unwrap_or_default() else {
            return lines.refuse("a picture needs ten words", "give IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME");
        };
        lines.id(id)?;
        let [w, x, y, z, tx, ty, tz] = lines.numbers::<7>(pose)?;
        let Some(Calibrated { size, lens, bend }) = cameras.get(&lines.id(camera)?) else {
            return lines.refuse(format!("camera {camera} is not in the file of cameras"), "give it there");
        };
        let turn = DQuat::from_xyzw(x, y, z, w);
        if (turn.length() - 1.0).abs() > 1e-2 {
            return lines.refuse("the quaternion has another length than 1", "give QW QX QY QZ of a rotation");
        }
        let matrix = DMat4::from_rotation_translation(turn.normalize(), DVec3::new(tx, ty, tz));
        let view = posed(matrix, false, COLMAP).or_else(|what| lines.refuse(what, "give a rotation"))?;
        // A name may hold spaces: it is the rest of the line.
        let name = words[..9].iter().fold(&text[..], |rest, word| rest.trim_start()[word.len()..].trim_start());
        let place = format!("line {}", lines.line);
        views.push(Entry { size: Some(*size), bend: *bend, ..Entry::new(name, place, view, *lens) });
        if views.len() > MAX_PICTURES {
            return lines.refuse("more than 100000 pictures", "use fewer");
        }
        lines.skip_points()?;
    }
    Ok(views)
}

/// The cameras of a file of cameras by their ids.
fn cameras(path: &Path) -> Result<HashMap<u32, Calibrated>> {
    let mut lines = Lines::open(path)?;
    let mut cameras = HashMap::new();
    while let Some(text) = lines.next()? {
        let words: Vec<&str> = text.split_whitespace().collect();
        let [id, model, width, height, parameters @ ..] = &words[..] else {
            return lines.refuse("a camera needs five words or more", "give CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]");
        };
        let [id, width, height] = [lines.id(id)?, lines.id(width)?, lines.id(height)?];
        let (lens, bend) = lens(&lines, model, parameters)?;
        let bend = Some(bend).filter(|bend| bend.iter().any(|k| *k != 0.0));
        if cameras.insert(id, Calibrated { size: (width, height), lens, bend }).is_some() {
            return lines.refuse(format!("camera {id} again"), "give each camera one line");
        }
        if cameras.len() > MAX_PICTURES {
            return lines.refuse("more than 100000 cameras", "use fewer");
        }
    }
    Ok(cameras)
}

/// The lens of a model, and the parameters of its distortion.
fn lens(lines: &Lines<'_>, model: &str, parameters: &[&str]) -> Result<(Lens, [f64; 4])> {
    let single = |[f, cx, cy]: [f64; 3]| Lens::Pixels { fx: f, fy: f, cx, cy, skew: 0.0 };
    let double = |[fx, fy, cx, cy]: [f64; 4]| Lens::Pixels { fx, fy, cx, cy, skew: 0.0 };
    Ok(match model {
        "SIMPLE_PINHOLE" => (single(lines.numbers(parameters)?), [0.0; 4]),
        "PINHOLE" => (double(lines.numbers(parameters)?), [0.0; 4]),
        "SIMPLE_RADIAL" => {
            let [f, cx, cy, k] = lines.numbers(parameters)?;
            (single([f, cx, cy]), [k, 0.0, 0.0, 0.0])
        }
        "RADIAL" => {
            let [f, cx, cy, k1, k2] = lines.numbers(parameters)?;
            (single([f, cx, cy]), [k1, k2, 0.0, 0.0])
        }
        "OPENCV" => {
            let [fx, fy, cx, cy, bend @ ..] = lines.numbers::<8>(parameters)?;
            (double([fx, fy, cx, cy]), bend)
        }
        _ => {
            let fix = "use SIMPLE_PINHOLE or PINHOLE, as `colmap image_undistorter` writes";
            return lines.refuse("a camera model that is not read", fix);
        }
    })
}
