//! Views as numpy arrays: a file of images, and one of their cameras.

use super::{
    Views, ViewsOptions,
    background::Plain,
    folder::{claim, kept_side, no_background},
    masks::{LABELS, lift_alpha},
    photograph::{Album, straight},
};
use crate::{
    Budget,
    npy::{self, Numbers},
    picture_file::{MAX_SIDE, is_opaque},
    refuse,
};
use glam::DMat4;
use image::{Rgba, RgbaImage};
use softras::{Camera, Error, Projection, Result};
use std::path::Path;

/// How far beyond 0 and 1 rounding takes numbers.
const ROUNDING: f64 = 1e-3;

/// The images of an array, whatever the order of its axes.
struct Grid<'a> {
    values: Numbers<'a>,
    /// Views, rows, columns and channels, and how far apart their values are.
    sizes: [usize; 4],
    strides: [usize; 4],
}

impl Grid<'_> {
    fn at(&self, view: usize, row: usize, column: usize, channel: usize) -> f64 {
        let place = [view, row, column, channel];
        self.values.at(place.iter().zip(self.strides).map(|(at, stride)| at * stride).sum())
    }

    /// The channels of all pixels of a view.
    fn pixels(&self, view: usize) -> impl Iterator<Item = [f64; 4]> + '_ {
        let [_, height, width, channels] = self.sizes;
        (0..height * width).map(move |i| {
            std::array::from_fn(|k| if k < channels { self.at(view, i / width, i % width, k) } else { 0.0 })
        })
    }
}

/// The meaning of an array's numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Scale {
    /// sRGB, not multiplied by alpha: this number is 1.
    Encoded(f64),
    /// Numbers of classes, of which 0 is background.
    Labels,
    /// Linear light, as `softras render` writes it.
    Linear { is_multiplied: bool },
}

impl Scale {
    /// The meaning of an array's numbers, by their type, their range, and whether they are whole.
    fn of(path: &Path, grid: &Grid<'_>, is_float: bool) -> Result<Self> {
        let all = || grid.values.iter();
        let (least, most) = all().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
        let is_whole = !is_float || all().all(|x| x.fract() == 0.0);
        let is_bytes = || all().all(|x| (255.0 * x - (255.0 * x).round()).abs() < ROUNDING);
        match most {
            _ if least < -ROUNDING => {}
            // One number a pixel is a mask, or a class.
            most if is_whole && most < f64::from(LABELS) && grid.sizes[3] == 1 => return Ok(Self::Labels),
            most if is_whole && most <= 1.0 => return Ok(Self::Encoded(1.0)),
            most if is_whole && most <= 255.0 => return Ok(Self::Encoded(255.0)),
            most if is_whole && most <= 65535.0 => return Ok(Self::Encoded(65535.0)),
            most if most <= 1.0 + ROUNDING && is_bytes() => return Ok(Self::Encoded(1.0)),
            most if most <= 1.0 + ROUNDING => {
                let fits = |p: [f64; 4]| (0..3).all(|k| p[k] <= p[3] + ROUNDING);
                let is_multiplied = (0..grid.sizes[0]).all(|view| grid.pixels(view).all(fits));
                return Ok(Self::Linear { is_multiplied });
            }
            _ => {}
        }
        refuse(path, format!("has numbers from {least:?} to {most:?}"), "use 0 to 1, or bytes from 0 to 255")
    }

    /// A pixel of `channels` channels as bytes. One channel is the silhouette, and three are opaque.
    fn pixel(self, [a, b, c, d]: [f64; 4], channels: usize) -> Rgba<u8> {
        let byte = |x: f64| (255.0 * x.clamp(0.0, 1.0)).round() as u8;
        let one = if let Self::Encoded(one) = self { one } else { 1.0 };
        let alpha = match channels {
            1 => a / one,
            3 => 1.0,
            _ => d / one,
        };
        match self {
            Self::Labels => Rgba([255, 255, 255, if a > 0.0 { 255 } else { 0 }]),
            _ if channels == 1 => Rgba([255, 255, 255, byte(alpha)]),
            Self::Encoded(_) => {
                let [r, g, b] = [a, b, c].map(|x| byte(x / one));
                Rgba([r, g, b, byte(alpha)])
            }
            Self::Linear { is_multiplied } if is_multiplied || channels == 3 => straight([a, b, c, alpha]),
            Self::Linear { .. } => straight([alpha * a, alpha * b, alpha * c, alpha]),
        }
    }
}

/// Images and cameras as numpy arrays.
pub fn read(options: &ViewsOptions, path: &Path, notes: &mut Vec<String>, budget: &Budget) -> Result<Views> {
    // A missing file is an error of its own, before that of missing cameras.
    std::fs::metadata(path).map_err(|source| Error::Io { path: path.into(), source })?;
    let Some(cameras) = &options.cameras else {
        return refuse(path, "images in a .npy file have no cameras with them", "give the file of their cameras too");
    };
    if options.depths.is_some() || options.normals.is_some() || options.masks.is_some() {
        let what = "masks, depths and normals are found by picture names, and a .npy file has no names";
        return refuse(path, what, "give a folder of pictures");
    }
    let array = npy::read_file(path, budget)?;
    let (sizes, strides) = match array.shape[..] {
        [n, c @ (1 | 3 | 4), h, w] => ([n, h, w, c], [c * h * w, w, 1, h * w]),
        [n, h, w, c @ (1 | 3 | 4)] => ([n, h, w, c], [h * w * c, w * c, c, 1]),
        [n, h, w] => ([n, h, w, 1], [h * w, w, 1, 0]),
        ref shape => {
            return refuse(path, format!("has shape {shape:?}"), "use [N, 4, H, W], [N, H, W, 4] or [N, H, W]");
        }
    };
    let [batch, height, width, channels] = sizes;
    if sizes.contains(&0) || height.max(width) > MAX_SIDE as usize {
        return refuse(path, format!("has shape {:?}", array.shape), format!("use 1 to {MAX_SIDE} pixels a side"));
    }
    let whole = vec![(width as u32, height as u32); batch];
    let most = kept_side(options, &whole);
    claim(options, path, &whole, most, budget)?;
    let grid = Grid { values: npy::numbers(path, &array)?, sizes, strides };
    let scale = Scale::of(path, &grid, array.dtype().starts_with("float"))?;
    if matches!(scale, Scale::Linear { .. }) && channels > 1 {
        notes.push("numbers between the steps of bytes: colours are linear, as `softras render` writes them".into());
    }
    let cameras = read_cameras(cameras, options.fov, budget)?;
    if cameras.len() != batch {
        return refuse(
            path,
            format!("has {batch} images for {} cameras", cameras.len()),
            "give a camera for each image",
        );
    }
    let picture = |view: usize| {
        let bytes = grid.pixels(view).flat_map(|pixel| scale.pixel(pixel, channels).0).collect();
        RgbaImage::from_raw(whole[0].0, whole[0].1, bytes).unwrap_or_default()
    };
    let mut pictures: Vec<RgbaImage> = (0..batch).map(picture).collect();
    // Where some picture is transparent, alpha tells all silhouettes.
    if channels > 1 && pictures.iter().all(is_opaque) {
        let plains: Vec<Plain> = pictures.iter().filter_map(|picture| Plain::of(picture, false)).collect();
        let shared = Plain::shared(&plains);
        if 2 * plains.len() < batch {
            return no_background(path, batch - plains.len(), batch, batch);
        }
        for picture in &mut pictures {
            match Plain::like(picture, false, shared) {
                Some(plain) => plain.remove(picture),
                None => return no_background(path, 1, batch, batch),
            }
        }
        notes.extend(shared.and_then(Plain::told));
    }
    let mut album = Album::default();
    for (mut picture, camera) in pictures.into_iter().zip(cameras) {
        lift_alpha(&mut picture);
        album.add(picture, camera, None, most);
    }
    album.views(options, most.is_some(), notes)
}

/// Reads cameras from a numpy array: the angles of the official data, or matrices.
pub fn read_cameras(path: &Path, fov: f64, budget: &Budget) -> Result<Vec<Camera>> {
    let array = npy::read_file(path, budget)?;
    let values = npy::numbers(path, &array)?;
    let row = |at: usize, i: usize| values.at(at + i);
    match array.shape[..] {
        [n, 3] => (0..n).map(|c| official([0, 1, 2].map(|i| row(3 * c, i)), fov)).collect(),
        [n, 4, 4] => {
            let matrix = |c: usize| DMat4::from_cols_array(&std::array::from_fn(|i| row(16 * c, i))).transpose();
            if let Some(c) = (0..n).find(|&c| matrix(c).determinant() > 0.0) {
                let what =
                    format!("the matrix of camera {c} mirrors: y points down as OpenCV's, or z backward as OpenGL's");
                let fix = "give x right, y up and z forward: negate row 1 (OpenCV) or row 2 (OpenGL); rows from 0";
                return refuse(path, what, fix);
            }
            (0..n).map(|c| Camera::from_matrix(matrix(c), perspective(fov))).collect()
        }
        ref shape => {
            refuse(path, format!("has shape {shape:?}"), "use [N, 3] (distance, elevation, azimuth) or [N, 4, 4]")
        }
    }
}

/// A camera of the official renderer, whose images are mirrored.
fn official([distance, elevation, azimuth]: [f64; 3], fov: f64) -> Result<Camera> {
    let straight = Camera::from_angles(distance, elevation, azimuth, perspective(fov))?;
    let [right, up, forward] = *straight.view();
    let rows = [right.map(|x| -x), up, forward, [0.0, 0.0, 0.0, 1.0]];
    Camera::from_matrix(DMat4::from_cols_array_2d(&rows).transpose(), perspective(fov))
}

fn perspective(fov: f64) -> Projection {
    Projection::Perspective { fov_y: fov.to_radians() }
}
