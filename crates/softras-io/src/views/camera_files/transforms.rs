//! transforms.json, as NeRF's synthetic scenes, instant-ngp and nerfstudio have it.
//!
//! `transform_matrix` is camera to world, and the camera's axes are those of OpenGL and Blender: x right, y up, z backward
//! (<https://docs.nerf.studio/quickstart/data_conventions.html>). Names without an extension are those of PNG files, as in
//! the scenes of the NeRF paper.

use super::{Entry, Lens, json, matrix, posed};
use crate::{refuse, text};
use glam::DVec3;
use serde::Deserialize;
use softras::Result;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Camera axes as in OpenGL.
pub(super) const OPENGL: DVec3 = DVec3::new(1.0, 1.0, -1.0);
/// The most fields that a note names.
const MOST_NAMED: usize = 12;

/// The whole file or one of its frames, whose fields replace the file's. Fields that scale or bound a radiance field's scene, or
/// describe how it was made, have nothing to do with cameras: the common ones are parsed, so that their types are tested, and not used. A note
/// names all others.
#[derive(Deserialize)]
#[allow(dead_code)]
struct Transforms {
    #[serde(default)]
    frames: Vec<Self>,
    file_path: Option<PathBuf>,
    transform_matrix: Option<[[f64; 4]; 4]>,
    camera_model: Option<String>,
    camera_angle_x: Option<f64>,
    camera_angle_y: Option<f64>,
    fl_x: Option<f64>,
    fl_y: Option<f64>,
    cx: Option<f64>,
    cy: Option<f64>,
    w: Option<f64>,
    h: Option<f64>,
    k1: Option<f64>,
    k2: Option<f64>,
    k3: Option<f64>,
    k4: Option<f64>,
    p1: Option<f64>,
    p2: Option<f64>,
    is_fisheye: Option<bool>,
    mask_path: Option<PathBuf>,
    depth_file_path: Option<String>,
    sharpness: Option<f64>,
    rotation: Option<f64>,
    colmap_im_id: Option<u64>,
    aabb_scale: Option<f64>,
    scale: Option<f64>,
    offset: Option<[f64; 3]>,
    ply_file_path: Option<String>,
    applied_transform: Option<Vec<[f64; 4]>>,
    applied_scale: Option<f64>,
    orientation_override: Option<String>,
}

/// The pictures of a transforms.json.
pub(super) fn read(path: &Path, bytes: &[u8], fov: f64, notes: &mut Vec<String>) -> Result<Vec<Entry>> {
    let mut others: BTreeSet<String> = BTreeSet::new();
    let file: Transforms = json(path, bytes, |field| {
        // The same field of every frame is told once.
        others.insert(text::name(field.rsplit('.').next().unwrap_or_default()));
    })?;
    if !others.is_empty() {
        let names = others.into_iter().take(MOST_NAMED).collect::<Vec<_>>().join(", ");
        let has_lens = |part: &Transforms| part.fl_x.is_some() || part.camera_angle_x.is_some();
        if !has_lens(&file) && !file.frames.iter().all(has_lens) {
            let what = format!("no focal length, and fields that are not known: {names}");
            return refuse(path, what, "give fl_x or camera_angle_x, or --fov without these fields");
        }
        notes.push(format!("{}: fields that are not used: {names}", path.display()));
    }
    let of_frame = file.file_path.is_some() || file.transform_matrix.is_some() || file.mask_path.is_some();
    if of_frame || file.frames.iter().any(|frame| !frame.frames.is_empty()) {
        let what = "a frame outside of `frames`, or frames within a frame";
        return refuse(path, what, "list file_path, transform_matrix and mask_path of each frame in `frames`");
    }
    let higher = file.frames.iter().flat_map(|frame| [frame.k3, frame.k4]).chain([file.k3, file.k4]);
    let distorted = higher.flatten().any(|k| k != 0.0);
    let models = file.frames.iter().filter_map(|frame| frame.camera_model.as_deref());
    let is_straight = |model: &&str| ["PINHOLE", "SIMPLE_PINHOLE", "OPENCV"].contains(model);
    let bent = models.chain(file.camera_model.as_deref()).find(|model| !is_straight(model));
    let model = bent.or(file.camera_model.as_deref()).unwrap_or("PINHOLE");
    let is_fisheye = file.frames.iter().chain([&file]).any(|part| part.is_fisheye == Some(true));
    if distorted || is_fisheye || bent.is_some() {
        let what = format!("cameras with distortion (camera_model {model:?})");
        return refuse(path, what, "undistort the pictures first, then leave the distortion out");
    }
    file.frames.iter().enumerate().map(|(i, frame)| view(path, &file, i, frame, fov)).collect()
}

fn view(path: &Path, file: &Transforms, i: usize, frame: &Transforms, fov: f64) -> Result<Entry> {
    let place = format!("frames[{i}]");
    let refuse = |what: String, fix: &str| refuse(path, format!("{place}: {what}"), fix);
    let (Some(rows), Some(mut name)) = (&frame.transform_matrix, frame.file_path.clone()) else {
        return refuse("without file_path or transform_matrix".into(), "give both");
    };
    let view = match posed(matrix(rows), true, OPENGL) {
        Ok(view) => view,
        Err(what) => return refuse(format!("transform_matrix: {what}"), "give camera to world"),
    };
    let size = match (frame.w.or(file.w), frame.h.or(file.h)) {
        (None, None) => None,
        (Some(w), Some(h)) if [w, h].iter().all(|side| side.fract() == 0.0 && (1.0..=16384.0).contains(side)) => {
            Some((w as u32, h as u32))
        }
        (w, h) => return refuse(format!("w, h are {w:?}, {h:?}"), "give both, from 1 to 16384, or none"),
    };
    let center = [frame.cx.or(file.cx), frame.cy.or(file.cy)];
    let focal = [frame.fl_x.or(file.fl_x), frame.fl_y.or(file.fl_y)];
    let angles = [frame.camera_angle_x.or(file.camera_angle_x), frame.camera_angle_y.or(file.camera_angle_y)];
    let is_angle = |angle: f64| angle > 0.0 && angle < std::f64::consts::PI;
    let lens = match (focal, angles[0], angles[1]) {
        ([Some(fx), fy], ..) => match (center, size) {
            ([Some(cx), Some(cy)], _) => Lens::Pixels { fx, fy: fy.unwrap_or(fx), cx, cy, skew: 0.0 },
            ([cx, cy], Some((w, h))) => Lens::Pixels {
                fx,
                fy: fy.unwrap_or(fx),
                cx: cx.unwrap_or(f64::from(w) / 2.0),
                cy: cy.unwrap_or(f64::from(h) / 2.0),
                skew: 0.0,
            },
            _ => return refuse("fl_x without a principal point".into(), "give cx and cy, or w and h"),
        },
        ([None, Some(_)], ..) => return refuse("fl_y without fl_x".into(), "give fl_x"),
        (_, Some(x), y) if is_angle(x) && y.is_none_or(is_angle) => Lens::Angles { x, y, center },
        (_, Some(x), y) => {
            return refuse(
                format!("camera_angle_x, camera_angle_y are {x:?}, {y:?}"),
                "use radians above 0 and below π",
            );
        }
        (_, None, Some(_)) => return refuse("camera_angle_y without camera_angle_x".into(), "give camera_angle_x"),
        (_, None, None) => Lens::Degrees(fov),
    };
    if name.extension().is_none() {
        name.set_extension("png");
    }
    let bend = [frame.k1.or(file.k1), frame.k2.or(file.k2), frame.p1.or(file.p1), frame.p2.or(file.p2)];
    let bend = Some(bend.map(|k| k.unwrap_or(0.0))).filter(|bend| bend.iter().any(|k| *k != 0.0));
    if bend.is_some() && !matches!(lens, Lens::Pixels { .. }) {
        return refuse("distortion without fl_x".into(), "give fl_x");
    }
    Ok(Entry { size, bend, mask: frame.mask_path.clone(), ..Entry::new(name, place, view, lens) })
}
