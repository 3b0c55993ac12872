//! Pictures and cameras.json as `--write-views` writes them.

use crate::{Curve, failed, picture};
use glam::DVec4;
use image::ExtendedColorType;
use serde_json::{Value, json};
use softras::{Camera, Image, Result};
use std::path::{Path, PathBuf};

/// The files of `count` views: pictures, and last the file that names them.
pub fn names(folder: &Path, count: usize) -> Vec<PathBuf> {
    let picture = |view: usize| folder.join(name(view));
    (0..count).map(picture).chain([folder.join("cameras.json")]).collect()
}

fn name(view: usize) -> String {
    format!("view_{view:03}.png")
}

/// The contents of these files: PNG files, sRGB with the silhouette as alpha, and their cameras with intrinsics and matrices.
///
/// # Errors
/// [`softras::Error::Io`] for a picture that cannot be encoded.
pub fn files(folder: &Path, cameras: &[Camera], silhouette: &Image, color: &Image) -> Result<Vec<(PathBuf, Vec<u8>)>> {
    let size = (silhouette.width, silhouette.height);
    let mut written = Vec::with_capacity(cameras.len() + 1);
    let mut entries = Vec::with_capacity(cameras.len());
    for (view, camera) in cameras.iter().enumerate() {
        let path = folder.join(name(view));
        let bytes = png(silhouette.view(view), color.view(view), size).map_err(|error| failed(&path, error))?;
        written.push((path, bytes));
        entries.push(entry(&name(view), camera, size));
    }
    written.push((folder.join("cameras.json"), listed(&entries)));
    Ok(written)
}

/// A cameras.json of pictures of a width and a height.
pub fn cameras(names: &[String], cameras: &[Camera], size: (usize, usize)) -> Vec<u8> {
    listed(&names.iter().zip(cameras).map(|(name, camera)| entry(name, camera, size)).collect::<Vec<Value>>())
}

fn listed(entries: &[Value]) -> Vec<u8> {
    let lines: Vec<String> = entries.iter().map(|entry| format!("  {entry}")).collect();
    format!("[\n{}\n]\n", lines.join(",\n")).into_bytes()
}

/// A picture of linear colours over black and of alpha.
fn png(alpha: &[f32], color: &[f32], (width, height): (usize, usize)) -> image::ImageResult<Vec<u8>> {
    let byte = |x: f64| (x * 255.0).round() as u8;
    let pixel = |(a, rgb): (&f32, &[f32])| {
        let a = f64::from(*a);
        let straight = |c: f32| byte(Curve::Srgb.encode(if a > 0.0 { f64::from(c) / a } else { 0.0 }));
        [straight(rgb[0]), straight(rgb[1]), straight(rgb[2]), byte(a.clamp(0.0, 1.0))]
    };
    let bytes: Vec<u8> = alpha.iter().zip(color.chunks_exact(3)).flat_map(pixel).collect();
    picture::png(&bytes, width as u32, height as u32, ExtendedColorType::Rgba8)
}

/// An entry of cameras.json.
fn entry(name: &str, camera: &Camera, (width, height): (usize, usize)) -> Value {
    let [x, y, z] = camera.view().map(DVec4::from);
    // OpenCV's y points down. A first row that leans towards the second is a skew.
    let y = -y;
    let lean = x.truncate().dot(y.truncate());
    let lean = if lean.abs() > 1e-12 { lean } else { 0.0 };
    let pose = [x - lean * y, y, z, DVec4::W].map(|row| row.to_array());
    let mut entry = json!({ "file": name, "world_to_camera": pose });
    if let Some([fx, fy, cx, cy]) = camera.intrinsics((width as u32, height as u32)) {
        entry["intrinsics"] = json!([[fx, fx * lean, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]);
    }
    entry
}
