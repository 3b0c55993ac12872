//! cameras.json: a list of pictures, each with its position in one of four forms, and its lens in one of two; or that which 3D Gaussian
//! Splatting writes beside what it trains.

use super::calibrated::{self, OPENCV};
use super::{Entry, Lens, json, matrix, perspective, posed};
use crate::refuse;
use glam::{DMat4, DVec3};
use serde::{Deserialize, de::IgnoredAny};
use softras::{Camera, Result};
use std::path::{Path, PathBuf};

/// An entry.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Listed {
    /// The picture's name.
    file: String,
    /// Vertical angle of view, degrees.
    fov: Option<f64>,
    /// Rows of the matrix ((fx, 0, cx), (0, fy, cy), (0, 0, 1)), in pixels.
    intrinsics: Option<[[f64; 3]; 3]>,
    eye: Option<[f64; 3]>,
    target: Option<[f64; 3]>,
    up: Option<[f64; 3]>,
    distance: Option<f64>,
    /// Degrees, as the azimuth.
    elevation: Option<f64>,
    azimuth: Option<f64>,
    /// Rows; the camera's axes are those of OpenCV.
    world_to_camera: Option<[[f64; 4]; 4]>,
    /// The inverse of the same.
    camera_to_world: Option<[[f64; 4]; 4]>,
}

/// The fields by which an entry of 3D Gaussian Splatting is told.
#[derive(Deserialize)]
struct Probe {
    img_name: Option<IgnoredAny>,
    rotation: Option<IgnoredAny>,
}

/// An entry of 3D Gaussian Splatting.
#[derive(Deserialize)]
struct Trained {
    img_name: PathBuf,
    width: u32,
    height: u32,
    /// The place of the camera, whose axes, the columns of `rotation`, are those of OpenCV.
    position: [f64; 3],
    rotation: [[f64; 3]; 3],
    fx: f64,
    fy: f64,
}

/// The pictures of a cameras.json of 3D Gaussian Splatting
/// (<https://github.com/graphdeco-inria/gaussian-splatting>, `camera_to_JSON`).
fn splats(path: &Path, bytes: &[u8]) -> Result<Vec<Entry>> {
    let entries: Vec<Trained> = json(path, bytes, |_| {})?;
    let one = |(i, entry): (usize, Trained)| {
        let Trained { img_name, width, height, position: t, rotation: r, fx, fy } = entry;
        let place = format!("camera {i}");
        let row = |k: usize| [r[k][0], r[k][1], r[k][2], t[k]];
        let view = posed(matrix(&[row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]), true, OPENCV)
            .or_else(|what| refuse(path, format!("{place}: {what}"), "give rotation as a rotation"))?;
        let (cx, cy) = (f64::from(width) / 2.0, f64::from(height) / 2.0);
        let lens = Lens::Pixels { fx, fy, cx, cy, skew: 0.0 };
        Ok(Entry { size: Some((width, height)), ..Entry::new(img_name, place, view, lens) })
    };
    entries.into_iter().enumerate().map(one).collect()
}

/// The pictures of a cameras.json.
pub(super) fn read(path: &Path, bytes: &[u8], fov: f64) -> Result<Vec<Entry>> {
    let is_splat = |probe: &Vec<Probe>| probe.iter().all(|one| one.img_name.is_some() && one.rotation.is_some());
    if serde_json::from_slice(bytes).is_ok_and(|probe: Vec<Probe>| !probe.is_empty() && is_splat(&probe)) {
        return splats(path, bytes);
    }
    let entries: Vec<Listed> = json(path, bytes, |_| {})?;
    let one = |(i, entry): (usize, Listed)| {
        let place = format!("camera {i}");
        let view = position(&entry).or_else(|(what, fix)| refuse(path, format!("{place}{what}"), fix))?;
        let lens = match (entry.intrinsics, entry.fov) {
            (Some(_), Some(_)) => return refuse(path, format!("{place}: has intrinsics and fov"), "give one of them"),
            (Some(intrinsics), None) => match calibrated::lens(intrinsics) {
                Some(lens) => lens,
                None => {
                    let fix = "give [[fx, skew, cx], [0, fy, cy], [0, 0, 1]] in pixels";
                    return refuse(path, format!("{place}: intrinsics of another form"), fix);
                }
            },
            (None, own) => Lens::Degrees(own.unwrap_or(fov)),
        };
        Ok(Entry { is_stored: false, ..Entry::new(entry.file, place, view, lens) })
    };
    entries.into_iter().enumerate().map(one).collect()
}

/// World to view; or what is wrong, as text that follows the entry's number, and how to fix it.
fn position(entry: &Listed) -> Result<DMat4, (String, &'static str)> {
    let angles = [entry.distance, entry.elevation, entry.azimuth];
    let matrices = (entry.world_to_camera.as_ref(), entry.camera_to_world.as_ref());
    let alone = entry.target.is_none() && entry.up.is_none();
    let bad = |what: String| (format!(": {what}"), "see docs/cameras.md");
    // A camera is made here only for its view, with any lens: that of the entry is in another field.
    let any = perspective(0.5);
    let of_camera = |camera: Result<Camera>| {
        let [x, y, z] = *camera.map_err(|error| bad(error.to_string()))?.view();
        Ok(matrix(&[x, y, z, [0.0, 0.0, 0.0, 1.0]]))
    };
    let named = |name: &str, pose: Result<DMat4, String>| pose.map_err(|what| bad(format!("{name}: {what}")));
    match (entry.eye, angles, matrices) {
        (Some(eye), [None, None, None], (None, None)) => {
            let target = DVec3::from(entry.target.unwrap_or_default());
            of_camera(Camera::look_at(eye.into(), target, entry.up.map_or(DVec3::Y, DVec3::from), any))
        }
        (None, [Some(distance), Some(elevation), Some(azimuth)], (None, None)) if alone => {
            of_camera(Camera::from_angles(distance, elevation, azimuth, any))
        }
        (None, [None, None, None], (Some(rows), None)) if alone => {
            named("world_to_camera", posed(matrix(rows), false, OPENCV))
        }
        (None, [None, None, None], (None, Some(rows))) if alone => {
            named("camera_to_world", posed(matrix(rows), true, OPENCV))
        }
        _ => {
            let fix = "give eye (and target, up), or distance, elevation and azimuth, or world_to_camera, or \
                       camera_to_world";
            Err((" has no position, or more than one".into(), fix))
        }
    }
}
