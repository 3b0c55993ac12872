//! Poses in files of numbers: LLFF's poses_bounds.npy, and the folders `pose` of NSVF and SRN with their intrinsics.txt.

use super::{Entry, Lens, MAX_JSON, calibrated::OPENCV, matrix, posed, transforms::OPENGL};
use crate::{Budget, fault, input, npy, refuse, text, views::files::Files};
use softras::Result;
use std::path::{Path, PathBuf};

/// The file of the lens that all pictures have.
pub(super) const INTRINSICS: &str = "intrinsics.txt";
/// The folders beside pictures that may have their poses.
const POSES: [&str; 2] = ["pose", "poses"];

/// The pictures of a folder with LLFF's rows of 17 numbers, in the order of their names: camera to world with the camera's axes down, right
/// and backwards, then height, width and focal length as a fifth column, and two depths
/// (<https://github.com/Fyusion/LLFF#using-your-own-poses-without-running-colmap>).
pub(super) fn llff(path: &Path, folder: &Path) -> Result<Vec<Entry>> {
    let array = npy::read_file(path, &Budget::new(Some(MAX_JSON)))?;
    let bad = |what: String| fault(path, what, "give [N, 17] numbers: a pose of 3×5, a near and a far depth");
    let Some(rows) = array.numbers().filter(|_| array.shape.len() == 2 && array.shape[1] == 17) else {
        return Err(bad(format!("has shape {:?}", array.shape)));
    };
    let rows: Vec<f64> = rows.iter().collect();
    let mut pictures = Files::default().pictures(folder);
    pictures.sort();
    if pictures.len() != rows.len() / 17 {
        let what = format!("{} poses for {} pictures", rows.len() / 17, pictures.len());
        return refuse(path, what, "give a picture for each pose, in the order of their names, and no others");
    }
    let entry = |(i, (file, row)): (usize, (PathBuf, &[f64]))| {
        let place = format!("pose {i}");
        let at = |r: usize| [row[5 * r + 1], -row[5 * r], row[5 * r + 2], row[5 * r + 3]];
        let [height, width, focal] = [row[4], row[9], row[14]];
        let sides =
            [width, height].map(|side| (side.fract() == 0.0 && (1.0..=65535.0).contains(&side)).then_some(side as u32));
        let [Some(w), Some(h)] = sides else {
            return Err(bad(format!("{place}: a picture of {width}×{height} pixels")));
        };
        let view = posed(matrix(&[at(0), at(1), at(2), [0.0, 0.0, 0.0, 1.0]]), true, OPENGL)
            .map_err(|what| bad(format!("{place}: {what}")))?;
        let lens = Lens::Pixels { fx: focal, fy: focal, cx: width / 2.0, cy: height / 2.0, skew: 0.0 };
        Ok(Entry { size: Some((w, h)), ..Entry::new(file, place, view, lens) })
    };
    pictures.into_iter().zip(rows.chunks_exact(17)).enumerate().map(entry).collect()
}

fn numbers(path: &Path) -> Result<Vec<f64>> {
    let text = text::whole(path, input::read(path, MAX_JSON)?)?;
    let all: Option<Vec<f64>> =
        text.split_whitespace().map(|word| word.parse().ok().filter(|x: &f64| x.is_finite())).collect();
    all.ok_or_else(|| fault(path, "has words that are no numbers", "give numbers alone"))
}

/// The pictures of a folder, each with a text of its name in the folder `pose`: 16 numbers, camera to world with OpenCV's axes. The lens is
/// a matrix of 4×4 or 3×3, or SRN's focal length and principal point, whose last two numbers are height and width
/// (<https://github.com/facebookresearch/NSVF#prepare-your-own-dataset>, <https://github.com/vsitzmann/scene-representation-networks>).
pub(super) fn folder(path: &Path, folder: &Path) -> Result<Vec<Entry>> {
    let bad = |what: String| refuse(path, what, "give a matrix of 4×4, or f, cx, cy, 0 and last height and width");
    let values = numbers(path)?;
    let (lens, size) = match values[..] {
        [fx, skew, cx, _, _, fy, cy, ..] if values.len() == 16 => (Lens::Pixels { fx, fy, cx, cy, skew }, None),
        [fx, skew, cx, _, fy, cy, _, _, _] => (Lens::Pixels { fx, fy, cx, cy, skew }, None),
        [f, cx, cy, .., h, w] if h.fract() + w.fract() == 0.0 && h.min(w) >= 1.0 && h.max(w) <= 65535.0 => {
            (Lens::Pixels { fx: f, fy: f, cx, cy, skew: 0.0 }, Some((w as u32, h as u32)))
        }
        _ => return bad("has another number of numbers".into()),
    };
    let pictures = Files::default().pictures(folder);
    let home = path.parent().unwrap_or(folder);
    let mut entries = Vec::new();
    for file in pictures {
        let place = format!("{}.txt", file.file_stem().unwrap_or_default().display());
        let Some(pose) = POSES.iter().map(|poses| home.join(poses).join(&place)).find(|pose| pose.exists()) else {
            continue;
        };
        let wrong = |what: String| fault(&pose, what, "give camera to world, as 4×4 numbers");
        let Ok(rows) = <[f64; 16]>::try_from(numbers(&pose)?) else { return Err(wrong("not 16 numbers".into())) };
        let row = |r: usize| [0, 1, 2, 3].map(|k| rows[4 * r + k]);
        let view = posed(matrix(&[row(0), row(1), row(2), row(3)]), true, OPENCV).map_err(wrong)?;
        entries.push(Entry { size, ..Entry::new(file, place, view, lens) });
    }
    if entries.is_empty() {
        return refuse(path, "no picture has a text of its pose", "give pose/NAME.txt for each picture");
    }
    Ok(entries)
}
