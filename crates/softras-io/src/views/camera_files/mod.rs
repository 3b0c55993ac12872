//! The files that say from where pictures were taken: cameras.json, that of 3D Gaussian Splatting too, NeRF's transforms.json, COLMAP's
//! models, Middlebury's `_par.txt`, the cameras.npz of IDR and NeuS, LLFF's poses_bounds.npy, and the folders `pose` of NSVF and SRN.
//!
//! Each gives the pictures with a pose and a lens. Their camera axes differ, and become x right, y up, z forward here. A pixel
//! position counts from the upper left corner of the picture, so that the centre of the first pixel is (0.5, 0.5).

mod calibrated;
mod colmap;
mod list;
mod missing;
mod poses;
mod transforms;
mod write;

pub use write::{cameras, files, names};

use crate::{input, refuse, text, views::files::Files};
use glam::{DMat3, DMat4, DVec3, DVec4};
use softras::{Camera, Error, Projection, Result};
use std::path::{Path, PathBuf};

/// The most bytes of a JSON file: a hundred thousand cameras.
const MAX_JSON: u64 = 16 << 20;

/// The most pictures.
const MAX_PICTURES: usize = 100_000;

/// How far the rows of a rotation may be from unit length and from right angles.
const ROTATION_ERROR: f64 = 1e-3;

/// How far 0 and 1 may be from what they are in files that were computed in 32 bits.
const ROUNDING: f64 = 1e-5;

/// A picture and its camera.
#[derive(Clone, Debug)]
pub struct Entry {
    /// The picture's path, from the folder of views.
    pub file: PathBuf,
    /// Width and height that the file says the picture has.
    pub size: Option<(u32, u32)>,
    /// The entry, for messages: `camera 3`, `frames[3]`.
    place: String,
    /// World to view, x right, y up, z forward.
    view: DMat4,
    lens: Lens,
    /// OpenCV's distortion k1, k2, p1, p2, where there is any. Its lens is in pixels.
    pub bend: Option<[f64; 4]>,
    /// The picture's mask.
    pub mask: Option<PathBuf>,
    /// Whether the camera is that of the pixels as they are stored, and not as an EXIF orientation turns them.
    pub is_stored: bool,
}

/// From view space to the picture.
#[derive(Clone, Copy, Debug)]
enum Lens {
    /// Vertical angle of view in degrees, with square pixels and the axis in the picture's middle.
    Degrees(f64),
    /// column = (fx x - skew y) / z + cx, row = cy - fy y / z.
    Pixels { fx: f64, fy: f64, cx: f64, cy: f64, skew: f64 },
    /// Horizontal and vertical angle of view in radians; without the latter, pixels are square. The principal point is in the
    /// picture's middle unless it is given.
    Angles { x: f64, y: Option<f64>, center: [Option<f64>; 2] },
}

/// Reads the file of cameras of a folder of pictures: `given`, which may be the folder of a COLMAP model, or what the folder of
/// pictures has.
///
/// # Errors
/// [`Error::File`] naming the place and the field, or the line, of anything that does not belong there.
pub fn read(folder: &Path, given: Option<&Path>, fov: f64, notes: &mut Vec<String>) -> Result<(PathBuf, Vec<Entry>)> {
    let (path, views) = match given {
        Some(given) if given.is_dir() => {
            first(folder, &candidates(given), notes, fov)?.map_or_else(|| missing::refuse(given), Ok)?
        }
        Some(given) if !given.exists() => return refuse(given, "not found", missing::FORMAT),
        Some(given) => (given.to_path_buf(), one(given, folder, fov, notes)?),
        None => first(folder, &candidates(folder), notes, fov)?.map_or_else(|| missing::refuse(folder), Ok)?,
    };
    match views.len() {
        0 => return refuse(&path, "is a list without cameras", "give at least one picture with its camera"),
        n if n > MAX_PICTURES => return refuse(&path, format!("has {n} pictures"), "use at most 100000"),
        _ => {}
    }
    // View space is left-handed, so that the matrix of a world that is not mirrored has a negative determinant.
    let is_mirrored = |view: &&Entry| view.view.determinant() > 0.0;
    match views.iter().filter(is_mirrored).count() {
        0 => {}
        n if n == views.len() => notes.push("the cameras' world is mirrored, and so is the mesh that is fitted".into()),
        n => {
            let first = views.iter().find(is_mirrored).map_or("", |view| &view.place);
            let what = format!("{first}: mirrors the world, as {n} of {} cameras do", views.len());
            return refuse(&path, what, "give all cameras in one world: a rotation's determinant is 1");
        }
    }
    Ok((path, views))
}

/// The folder of pictures that a file of cameras is given for: its own, or that above a COLMAP model. `None` for a file of another kind.
pub fn folder_of(file: &Path) -> Option<&Path> {
    let extension = file.extension()?;
    let is_one =
        ["json", "txt", "bin", "npz"].iter().any(|one| extension == *one) || file.ends_with("poses_bounds.npy");
    let is_model = file.file_stem().is_some_and(|stem| stem == "images" || stem == "cameras")
        && extension != "json"
        && extension != "npz";
    let is_below = |folder: &&Path| is_model && ["0", "sparse", "colmap"].iter().any(|name| folder.ends_with(name));
    is_one.then(|| file.ancestors().skip(1).find(|folder| !is_below(folder)))?
}

/// Reads a file of cameras for a folder of pictures.
fn one(path: &Path, folder: &Path, fov: f64, notes: &mut Vec<String>) -> Result<Vec<Entry>> {
    let extension = path.extension().unwrap_or_default();
    if extension == "npz" {
        return calibrated::archive(path, folder, notes);
    }
    if extension == "npy" {
        return poses::llff(path, folder);
    }
    if is_middlebury(path) {
        return calibrated::middlebury(path);
    }
    if path.ends_with(poses::INTRINSICS) {
        return poses::folder(path, folder);
    }
    if extension == "txt" || extension == "bin" {
        return colmap::read(path);
    }
    let bytes = input::read(path, MAX_JSON)?;
    input::refuse_empty(path, bytes.len() as u64)?;
    let text = text::whole(path, bytes)?;
    let is_object = text.trim_start().starts_with('{');
    if is_object { transforms::read(path, text.as_bytes(), fov, notes) } else { list::read(path, text.as_bytes(), fov) }
}

/// The first of some files whose cameras can be read and have pictures in the folder, with a note on those before it; where there is none,
/// the first, or its error.
fn first(folder: &Path, paths: &[PathBuf], notes: &mut Vec<String>, fov: f64) -> Result<Option<(PathBuf, Vec<Entry>)>> {
    let (mut files, mut failed) = (Files::default(), None);
    for path in paths {
        let mut told = Vec::new();
        let read = one(path, folder, fov, &mut told);
        let is_there = |entry: &Entry| files.picture(folder, &entry.file).is_some();
        if read.as_ref().is_ok_and(|entries| entries.iter().any(is_there)) || paths.len() == 1 {
            if let Some((path, what)) = failed.map(|(path, read): (&PathBuf, Result<Vec<Entry>>)| (path, read.err())) {
                let what = what.map_or_else(|| "none of its pictures is there".to_owned(), |error| error.to_string());
                notes.push(format!("{} is left out: {what}", path.display()));
            }
            notes.append(&mut told);
            return read.map(|entries| Some((path.clone(), entries)));
        }
        failed.get_or_insert((path, read));
    }
    failed.map(|(path, read)| Ok((path.clone(), read?))).transpose()
}

/// The files of cameras that a folder is searched for, besides those of Middlebury.
const NAMES: [&str; 9] = [
    "cameras.json",
    "transforms.json",
    "transforms_train.json",
    "images.txt",
    "images.bin",
    "cameras.npz",
    "cameras_sphere.npz",
    "poses_bounds.npy",
    poses::INTRINSICS,
];

/// The folders below a folder of pictures that have COLMAP's model.
const MODELS: [&str; 4] = ["", "sparse/0", "sparse", "colmap/sparse/0"];

/// The files of cameras of a folder, and of the models in it.
fn candidates(folder: &Path) -> Vec<PathBuf> {
    let of_model = |model: &str| {
        let folder = folder.join(model);
        let files = std::fs::read_dir(&folder).into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path()));
        let listed = files.filter(|path| is_middlebury(path)).min();
        NAMES.map(|name| folder.join(name)).into_iter().filter(|path| path.exists()).chain(listed)
    };
    MODELS.into_iter().flat_map(of_model).collect()
}

fn is_middlebury(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.to_string_lossy().ends_with("_par.txt"))
}

impl Entry {
    fn new(file: impl Into<PathBuf>, place: String, view: DMat4, lens: Lens) -> Self {
        Self { file: file.into(), size: None, place, view, lens, bend: None, mask: None, is_stored: true }
    }

    /// Scales the camera to a picture that is smaller or larger than the file says, in both directions alike up to rounding. Returns the
    /// size that the file says if it does.
    pub fn scale_to(&mut self, (width, height): (u32, u32)) -> Option<(u32, u32)> {
        let (w, h) = self.size.filter(|size| *size != (width, height))?;
        let [width, height, w, h] = [width, height, w, h].map(f64::from);
        let (along, down) = (width / w, height / h);
        // Each side may be rounded up or down to whole pixels.
        if (along * h - height).abs() >= 1.0 && (down * w - width).abs() >= 1.0 {
            return None;
        }
        match &mut self.lens {
            Lens::Pixels { fx, fy, cx, cy, skew } => {
                (*fx, *cx, *skew) = (*fx * along, *cx * along, *skew * along);
                (*fy, *cy) = (*fy * down, *cy * down);
            }
            Lens::Angles { center: [x, y], .. } => {
                (*x, *y) = (x.map(|x| x * along), y.map(|y| y * down));
            }
            Lens::Degrees(_) => {}
        }
        self.size.replace((width as u32, height as u32))
    }

    /// Whether the camera is one of pictures as an EXIF orientation turns them from the stored size to another.
    pub fn is_turned(&self, stored: (u32, u32), turned: (u32, u32)) -> bool {
        // A size that is said decides where a quarter turn changes it, and a principal point that is near the middle of one alone.
        if self.size.is_some_and(|size| (size == stored) != (size == turned)) {
            return self.size == Some(turned);
        }
        self.is_nearer(stored, turned).unwrap_or(!self.is_stored)
    }

    /// Whether the principal point is much nearer to the middle of the turned picture than to that of the stored one, or the other way
    /// round; `None` where it is neither.
    fn is_nearer(&self, stored: (u32, u32), turned: (u32, u32)) -> Option<bool> {
        let Lens::Pixels { cx, cy, .. } = self.lens else { return None };
        let far = |(width, height): (u32, u32)| {
            (2.0 * cx / f64::from(width) - 1.0).abs().max((2.0 * cy / f64::from(height) - 1.0).abs())
        };
        match (far(stored), far(turned)) {
            (stored, turned) if 2.0 * stored < turned => Some(false),
            (stored, turned) if 2.0 * turned < stored => Some(true),
            _ => None,
        }
    }

    /// Whether the principal point is near the middle of a picture of the other format alone: somebody turned the picture, and saved
    /// it so, after its camera was found.
    pub fn was_turned(&self, (width, height): (u32, u32)) -> bool {
        self.size.is_none() && self.is_nearer((width, height), (height, width)) == Some(true)
    }

    /// Where the distorted picture shows what a pinhole's picture has at a column and a row.
    pub fn bent(&self, [column, row]: [f64; 2]) -> [f64; 2] {
        let (Some([k1, k2, p1, p2]), Lens::Pixels { fx, fy, cx, cy, .. }) = (self.bend, self.lens) else {
            return [column, row];
        };
        let (x, y) = ((column - cx) / fx, (row - cy) / fy);
        let square = x * x + y * y;
        let radial = 1.0 + square * (k1 + square * k2);
        let bent_x = x * radial + 2.0 * p1 * x * y + p2 * (square + 2.0 * x * x);
        let bent_y = y * radial + p1 * (square + 2.0 * y * y) + 2.0 * p2 * x * y;
        [fx * bent_x + cx, fy * bent_y + cy]
    }

    /// The camera, for a picture of this size.
    ///
    /// # Errors
    /// [`Error::File`] for a picture of another size than the file says, and for a lens that makes no camera.
    pub fn camera(&self, path: &Path, (width, height): (u32, u32)) -> Result<Camera> {
        if let Some((w, h)) = self.size.filter(|size| *size != (width, height)) {
            let name = self.file.display();
            let what = format!("{}: {name} is {width}×{height} pixels, and not {w}×{h} as is said here", self.place);
            return refuse(path, what, "scale the size, the focal lengths and the principal point with the picture");
        }
        let (w, h) = (f64::from(width), f64::from(height));
        let camera = match self.lens {
            Lens::Degrees(fov) => Camera::from_matrix(self.view, perspective(fov.to_radians())),
            Lens::Pixels { fx, fy, cx, cy, skew } => pinhole(self.view, [fx, fy, cx, cy], skew, [w, h]),
            Lens::Angles { x, y, center } => {
                let focal = |side: f64, angle: f64| side / 2.0 / (angle / 2.0).tan();
                let fx = focal(w, x);
                let fy = y.map_or(fx, |y| focal(h, y));
                let [cx, cy] = [center[0].unwrap_or(w / 2.0), center[1].unwrap_or(h / 2.0)];
                pinhole(self.view, [fx, fy, cx, cy], 0.0, [w, h])
            }
        };
        camera.or_else(|error| refuse(path, format!("{}: {error}", self.place), "see docs/cameras.md"))
    }
}

fn perspective(fov_y: f64) -> Projection {
    Projection::Perspective { fov_y }
}

/// A calibrated camera. The skew goes into the view's first row, x - skew / fx y.
fn pinhole(view: DMat4, [fx, fy, cx, cy]: [f64; 4], skew: f64, [width, height]: [f64; 2]) -> Result<Camera> {
    let good = |focal: f64| focal.is_finite() && focal > 0.0;
    if !good(fx) || !good(fy) || !(cx + cy + skew).is_finite() {
        let value = format!("{:?}", (fx, fy, cx, cy));
        let fix = "use pixels, focal lengths above 0".to_string();
        return Err(Error::Camera { field: "fx, fy, cx, cy", value, fix });
    }
    if (fx, cx, cy, skew) == (fy, width / 2.0, height / 2.0, 0.0) {
        return Camera::from_matrix(view, perspective(2.0 * (height / 2.0 / fy).atan()));
    }
    let shear = DMat4::from_cols(DVec4::X, DVec4::new(-skew / fx, 1.0, 0.0, 0.0), DVec4::Z, DVec4::W);
    Camera::from_affine(shear * view, Projection::Pinhole { fx, fy, cx, cy })
}

/// World to view of a pose: a world-to-camera matrix, or its inverse, whose camera axes point along `axes` of x right, y up, z
/// forward. It may mirror.
///
/// # Errors
/// A text that tells what is wrong with the matrix.
fn posed(pose: DMat4, is_inverse: bool, axes: DVec3) -> std::result::Result<DMat4, String> {
    if (pose.row(3) - DVec4::W).abs().max_element() > ROUNDING {
        return Err("the last row must be (0, 0, 0, 1)".into());
    }
    let (turn, shift) = (DMat3::from_mat4(pose), pose.col(3).truncate());
    let off = (turn.transpose() * turn - DMat3::IDENTITY).to_cols_array();
    if off.iter().any(|x| x.abs() > ROTATION_ERROR) {
        return Err("the upper left 3×3 part must be a rotation, without scale".into());
    }
    let (turn, shift) = if is_inverse { (turn.inverse(), -(turn.inverse() * shift)) } else { (turn, shift) };
    Ok(DMat4::from_scale(axes) * DMat4::from_translation(shift) * DMat4::from_mat3(turn))
}

/// A matrix of rows.
fn matrix(rows: &[[f64; 4]; 4]) -> DMat4 {
    DMat4::from_cols_array_2d(rows).transpose()
}

/// Parses JSON of typed fields; the error names the place of what does not belong there, and `ignored` is given the names of fields that
/// the type does not have.
fn json<'a, T: serde::Deserialize<'a>>(path: &Path, bytes: &'a [u8], mut ignored: impl FnMut(String)) -> Result<T> {
    let json = &mut serde_json::Deserializer::from_slice(bytes);
    let refuse = |what: String| refuse(path, what, "see docs/cameras.md");
    let mut track = serde_path_to_error::Track::new();
    let tracked = serde_path_to_error::Deserializer::new(&mut *json, &mut track);
    let mut note = |field: serde_ignored::Path<'_>| ignored(field.to_string());
    let parsed: T = match T::deserialize(serde_ignored::Deserializer::new(tracked, &mut note)) {
        Ok(parsed) => parsed,
        Err(error) => {
            let place = crate::text::name(&track.path().to_string());
            return refuse(format!("at {place}: {error}"));
        }
    };
    match json.end() {
        Ok(()) => Ok(parsed),
        Err(error) => refuse(error.to_string()),
    }
}

#[cfg(test)]
mod tests;
