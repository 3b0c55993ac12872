//! Cameras as matrices K (R | t): the `_par.txt` of Middlebury's multi-view data, and the `cameras.npz` of IDR and NeuS.
//!
//! Camera axes are OpenCV's: x right, y down, z forward.

use super::{Entry, Lens, MAX_JSON, matrix, posed};
use crate::{Budget, input, npz::Archive, refuse, text};
use glam::{DMat3, DVec3};
use softras::Result;
use std::path::{Path, PathBuf};

const OPENCV: DVec3 = DVec3::new(1.0, -1.0, 1.0);

/// The lens of an upper triangular K; `None` for another matrix.
pub(super) fn lens([[fx, skew, cx], [zero, fy, cy], last]: [[f64; 3]; 3]) -> Option<Lens> {
    (zero == 0.0 && last == [0.0, 0.0, 1.0]).then_some(Lens::Pixels { fx, fy, cx, cy, skew })
}

/// The pictures of a `_par.txt`: their count, then for each a line of its name, K, R and t, row by row.
pub(super) fn middlebury(path: &Path) -> Result<Vec<Entry>> {
    let text = text::whole(path, input::read(path, MAX_JSON)?)?;
    let mut views = Vec::new();
    let mut lines = text.lines().filter(|line| !line.trim().is_empty());
    let count = lines.next().and_then(|line| line.trim().parse().ok());
    for line in lines {
        let place = format!("picture {}", views.len());
        let mut words = line.split_whitespace();
        let file = PathBuf::from(words.next().unwrap_or_default());
        let numbers: Option<Vec<f64>> = words.map(|word| word.parse().ok()).collect();
        let numbers: Option<[f64; 21]> = numbers.and_then(|numbers| numbers.try_into().ok());
        let row = |n: &[f64; 21], i: usize| [n[i], n[i + 1], n[i + 2]];
        let Some((lens, n)) = numbers.and_then(|n| Some((lens([row(&n, 0), row(&n, 3), row(&n, 6)])?, n))) else {
            return refuse(path, format!("{place}: not a name, K, R and t"), "give the name and 21 numbers");
        };
        let pose = [0, 1, 2].map(|i| [n[9 + 3 * i], n[10 + 3 * i], n[11 + 3 * i], n[18 + i]]);
        let view = posed(matrix(&[pose[0], pose[1], pose[2], [0.0, 0.0, 0.0, 1.0]]), OPENCV)
            .or_else(|what| refuse(path, format!("{place}: {what}"), "give R as a rotation"))?;
        views.push(Entry::new(file, place, view, lens));
    }
    if count != Some(views.len()) {
        let what = format!("{} pictures, but the first line says otherwise", views.len());
        return refuse(path, what, "begin with the number of pictures");
    }
    Ok(views)
}

/// The pictures of a folder in the order of their names, with the matrices `world_mat_0`, ... of an archive.
pub(super) fn archive(path: &Path, folder: &Path) -> Result<Vec<Entry>> {
    let archive = Archive::open(path, Budget::new(Some(MAX_JSON)))?;
    let listed = std::fs::read_dir(folder)
        .map_err(|source| softras::Error::Io { path: folder.into(), source })?
        .filter_map(|entry| Some(PathBuf::from(entry.ok()?.file_name())));
    let is_picture = |name: &PathBuf| {
        let ending = name.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
        ["png", "jpg", "jpeg", "webp"].contains(&&ending[..])
    };
    let mut pictures: Vec<PathBuf> = listed.filter(is_picture).collect();
    pictures.sort();
    let next = format!("world_mat_{}", pictures.len());
    if archive.has(&next) {
        let what = format!("the folder has only {} pictures", pictures.len());
        return Err(archive.fault(&next, &what, "give a picture for each matrix, in the order of their names"));
    }
    let one = |(i, file): (usize, PathBuf)| {
        let key = format!("world_mat_{i}");
        let array =
            archive.require(&key, "a matrix of 4×4 for each picture of the folder, in the order of their names")?;
        let values = archive.numbers(&key, array)?;
        let Some(p) = values.all::<16>().filter(|p| p.iter().all(|x| x.is_finite())) else {
            return Err(archive.fault(&key, "not 16 finite numbers", "give P = K (R | t) as 4×4"));
        };
        let Some((lens, view)) = parts([0, 1, 2].map(|r| [p[4 * r], p[4 * r + 1], p[4 * r + 2], p[4 * r + 3]])) else {
            return Err(archive.fault(&key, "no K (R | t)", "give the product of an upper triangular K and a pose"));
        };
        Ok(Entry::new(file, key, view, lens))
    };
    pictures.into_iter().enumerate().map(one).collect()
}

/// The lens and the pose of P = s K (R | t) of any scale and sign s.
fn parts(p: [[f64; 4]; 3]) -> Option<(Lens, glam::DMat4)> {
    let rows = p.map(|row| DVec3::new(row[0], row[1], row[2]));
    let sign = DMat3::from_cols(rows[0], rows[1], rows[2]).determinant().signum();
    let scale = sign / rows[2].length();
    let [a, b, z] = rows.map(|row| row * scale);
    let (cx, cy) = (a.dot(z), b.dot(z));
    let fy = (b - cy * z).length();
    let y = (b - cy * z) / fy;
    let x = y.cross(z);
    let (fx, skew) = (a.dot(x), a.dot(y));
    let last = p.map(|row| row[3] * scale);
    let ty = (last[1] - cy * last[2]) / fy;
    let t = [(last[0] - skew * ty - cx * last[2]) / fx, ty, last[2]];
    let pose = [[x.x, x.y, x.z, t[0]], [y.x, y.y, y.z, t[1]], [z.x, z.y, z.z, t[2]], [0.0, 0.0, 0.0, 1.0]];
    Some((Lens::Pixels { fx, fy, cx, cy, skew }, posed(matrix(&pose), OPENCV).ok()?))
}
