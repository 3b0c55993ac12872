//! Cameras as matrices K (R | t): the `_par.txt` of Middlebury's multi-view data, and the `cameras.npz` of IDR and NeuS.
//!
//! Camera axes are OpenCV's: x right, y down, z forward.

use super::{Entry, Lens, MAX_JSON, MAX_PICTURES, ROUNDING, matrix, posed};
use crate::{Budget, input, npz::Archive, refuse, text, views::files::Files};
use glam::{DMat3, DVec3};
use softras::Result;
use std::{
    collections::HashSet,
    path::{Path, PathBuf},
};

/// The words of a picture in a `_par.txt`.
const COLUMNS: usize = 22;
pub(super) const OPENCV: DVec3 = DVec3::new(1.0, -1.0, 1.0);

/// The lens of an upper triangular K; `None` for another matrix.
pub(super) fn lens([[fx, skew, cx], [zero, fy, cy], [a, b, one]]: [[f64; 3]; 3]) -> Option<Lens> {
    let off = [zero / fy.abs().max(1.0), a, b, one - 1.0];
    off.iter().all(|x| x.abs() <= ROUNDING).then_some(Lens::Pixels { fx, fy, cx, cy, skew })
}

/// The pictures of a `_par.txt`: their count, then for each a line of its name, K, R and t, row by row. In place of the count there may
/// be the names of the columns, or nothing.
pub(super) fn middlebury(path: &Path) -> Result<Vec<Entry>> {
    let text = text::whole(path, input::read(path, MAX_JSON)?)?;
    let mut views = Vec::new();
    let mut lines = text.lines().filter(|line| !line.trim().is_empty()).peekable();
    let count = lines.peek().and_then(|line| line.trim().parse::<usize>().ok());
    let is_header = |line: &str| line.split_whitespace().skip(1).all(|word| word.parse::<f64>().is_err());
    if count.is_some() || lines.peek().is_some_and(|line| line.split_whitespace().count() == COLUMNS && is_header(line))
    {
        lines.next();
    }
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
        let view = posed(matrix(&[pose[0], pose[1], pose[2], [0.0, 0.0, 0.0, 1.0]]), false, OPENCV)
            .or_else(|what| refuse(path, format!("{place}: {what}"), "give R as a rotation"))?;
        views.push(Entry::new(file, place, view, lens));
    }
    if let Some(count) = count.filter(|count| *count != views.len()) {
        let what = format!("{} pictures, but the first line says {count}", views.len());
        return refuse(path, what, "give a line for each picture");
    }
    Ok(views)
}

/// The pictures of a folder in the order of the numbers in their names, with the matrices `world_mat_0`, ... of an archive. Where some
/// pictures are missing, these numbers tell which.
pub(super) fn archive(path: &Path, folder: &Path, notes: &mut Vec<String>) -> Result<Vec<Entry>> {
    let archive = Archive::open(path, Budget::new(Some(MAX_JSON)))?;
    let pictures = Files::default().pictures(folder);
    let count = (0..=MAX_PICTURES).take_while(|i| archive.has(&format!("world_mat_{i}"))).count();
    let numbers = if count > pictures.len() { numbers(&pictures, count) } else { Some((0..pictures.len()).collect()) };
    if count > 0 && count < pictures.len() {
        let what = format!("{count} matrices for {} pictures", pictures.len());
        return Err(archive.fault("world_mat_0", &what, "move files that are no views out of the folder of pictures"));
    }
    let Some(numbers) = numbers else {
        let what = format!("the folder has only {} pictures", pictures.len());
        let fix = "give a picture for each matrix, in the order of their names, or names with the matrices' numbers";
        return Err(archive.fault(&format!("world_mat_{}", count - 1), &what, fix));
    };
    if !pictures.is_sorted() {
        notes.push(format!(
            "{}: matrices belong to pictures in the order of the numbers in their names",
            path.display()
        ));
    }
    let one = |i: &usize| {
        let key = format!("world_mat_{i}");
        let array =
            archive.require(&key, "a matrix of 4×4 for each picture of the folder, in the order of their names")?;
        let values = archive.numbers(&key, array)?;
        match values.all::<16>().filter(|p| p.iter().all(|x| x.is_finite())) {
            Some(p) => Ok([0, 1, 2].map(|r| [p[4 * r], p[4 * r + 1], p[4 * r + 2], p[4 * r + 3]])),
            None => Err(archive.fault(&key, "not 16 finite numbers", "give P = K (R | t) as 4×4")),
        }
    };
    let matrices = numbers.iter().map(one).collect::<Result<Vec<_>>>()?;
    let ahead = ahead(&matrices);
    let entry = |((file, i), p): ((PathBuf, &usize), &[[f64; 4]; 3])| {
        let key = format!("world_mat_{i}");
        match parts(*p, ahead) {
            Some((lens, view)) => Ok(Entry::new(file, key, view, lens)),
            None => Err(archive.fault(&key, "no K (R | t)", "give the product of an upper triangular K and a pose")),
        }
    };
    pictures.into_iter().zip(&numbers).zip(&matrices).map(entry).collect()
}

/// The last numbers in the names of pictures as those of some matrices, from 0 or from 1; `None` where that is not sure.
fn numbers(pictures: &[PathBuf], count: usize) -> Option<Vec<usize>> {
    let number = |path: &PathBuf| {
        let stem = path.file_stem()?.to_string_lossy().into_owned();
        stem.rsplit(|c: char| !c.is_ascii_digit()).find(|digits| !digits.is_empty())?.parse::<usize>().ok()
    };
    let all: Vec<usize> = pictures.iter().map(number).collect::<Option<_>>()?;
    let distinct = all.iter().collect::<HashSet<_>>().len() == all.len();
    let (least, most) = (*all.iter().min()?, *all.iter().max()?);
    let first = if least == 0 { 0 } else { 1 };
    // Numbers from 1 are sure only where the last picture is there.
    let sure = if first == 0 { most < count } else { most == count };
    (distinct && sure).then(|| all.iter().map(|n| n - first).collect())
}

/// The point nearest to the optical axes of P = K (R | t), which say neither forward nor backward.
fn ahead(matrices: &[[[f64; 4]; 3]]) -> Option<DVec3> {
    let (mut sum, mut vector) = (DMat3::ZERO, DVec3::ZERO);
    for p in matrices {
        let [a, b, c] = p.map(|row| DVec3::new(row[0], row[1], row[2]));
        let eye = -(DMat3::from_cols(a, b, c).transpose().inverse() * DVec3::new(p[0][3], p[1][3], p[2][3]));
        let axis = c.normalize_or_zero();
        let across = DMat3::IDENTITY - DMat3::from_cols(axis.x * axis, axis.y * axis, axis.z * axis);
        sum += across;
        vector += across * eye;
    }
    let point = sum.inverse() * vector;
    (sum.determinant() > 1e-6 * matrices.len() as f64 && point.is_finite()).then_some(point)
}

/// The lens and the pose of P = s K (R | t) of any scale and sign s. The point that all cameras look at lies before them; R mirrors where
/// P mirrors it. Without that point R does not mirror.
fn parts(p: [[f64; 4]; 3], ahead: Option<DVec3>) -> Option<(Lens, glam::DMat4)> {
    let rows = p.map(|row| DVec3::new(row[0], row[1], row[2]));
    let sign = ahead.map_or_else(
        || DMat3::from_cols(rows[0], rows[1], rows[2]).determinant().signum(),
        |point| (rows[2].dot(point) + p[2][3]).signum(),
    );
    let scale = sign / rows[2].length();
    let [a, b, z] = rows.map(|row| row * scale);
    let (cx, cy) = (a.dot(z), b.dot(z));
    let fy = (b - cy * z).length();
    let y = (b - cy * z) / fy;
    let x = y.cross(z);
    let x = x * a.dot(x).signum();
    let (fx, skew) = (a.dot(x), a.dot(y));
    let last = p.map(|row| row[3] * scale);
    let ty = (last[1] - cy * last[2]) / fy;
    let t = [(last[0] - skew * ty - cx * last[2]) / fx, ty, last[2]];
    let pose = [[x.x, x.y, x.z, t[0]], [y.x, y.y, y.z, t[1]], [z.x, z.y, z.z, t[2]], [0.0, 0.0, 0.0, 1.0]];
    Some((Lens::Pixels { fx, fy, cx, cy, skew }, posed(matrix(&pose), false, OPENCV).ok()?))
}
