//! cameras.json: a list of pictures, each with its position in one of four forms, and its lens in one of two.

use super::{Entry, Lens, calibrated, json, matrix, perspective, posed};
use crate::refuse;
use glam::{DMat4, DVec3};
use serde::Deserialize;
use softras::{Camera, Result};
use std::path::Path;

/// Camera axes as in OpenCV: x right, y down, z forward.
const OPENCV: DVec3 = DVec3::new(1.0, -1.0, 1.0);

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

/// The pictures of a cameras.json.
pub(super) fn read(path: &Path, bytes: &[u8], fov: f64) -> Result<Vec<Entry>> {
    let entries: Vec<Listed> = json(path, bytes)?;
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
