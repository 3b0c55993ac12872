//! Large photographs cropped to the object and made smaller, so that the fit's pixels are on the object.

use crate::subject::Subject;
use softras::{Camera, Image, Projection, Result};
use softras_io::Views;

/// The side of a crop as a multiple of the longer side of its mask's box.
const MARGIN: f64 = 1.25;
/// The smallest side of crops.
const LEAST: usize = 32;

/// A square of a picture, in its pixels.
#[derive(Clone, Copy)]
struct Square {
    left: f64,
    top: f64,
    side: f64,
}

/// Crops each picture of more than `most` pixels a side to its mask where that leaves at most half of the pixels. Crops have at most
/// `most` pixels a side. The photographs stay in [`Subject::photographs`].
pub fn cropped(subject: &mut Subject, most: usize, notes: &mut Vec<String>) -> Result<()> {
    let views = &subject.views;
    let is_pinhole = |camera: &Camera| camera.intrinsics((1, 1)).is_some();
    let Some(masks) = &views.silhouette else { return Ok(()) };
    let is_small = most == 0 || masks.height.min(masks.width) <= most;
    if is_small || views.depth.is_some() || views.normal.is_some() || !views.cameras.iter().all(is_pinhole) {
        return Ok(());
    }
    let squares: Option<Vec<Square>> = (0..masks.batch).map(|view| square(masks, view)).collect();
    let Some(squares) = squares else { return Ok(()) };
    let mut sides: Vec<f64> = squares.iter().map(|square| square.side).collect();
    sides.sort_by(f64::total_cmp);
    let side = (sides[sides.len() / 2] as usize).min(most).max(LEAST).next_multiple_of(2);
    if 2 * side * side > masks.height * masks.width {
        return Ok(());
    }
    let crop = |image: &Option<Image>| image.as_ref().map(|image| shrunk(image, &squares, side));
    let cameras = views.cameras.iter().zip(&squares);
    let cameras = cameras.map(|(camera, square)| square.camera(camera, masks, side)).collect::<Result<_>>()?;
    let (silhouette, color, names) = (crop(&views.silhouette), crop(&views.color), views.names.clone());
    let crops = Subject::of(Views { cameras, silhouette, color, names, ..Views::default() })?;
    notes.push(format!(
        "pictures of {}×{} pixels are cropped to the object, {side}×{side} pixels each",
        masks.width, masks.height
    ));
    (subject.bounds, subject.pixel, subject.depths) = (crops.bounds, crops.pixel, crops.depths);
    subject.photographs = Some(std::mem::replace(&mut subject.views, crops.views));
    Ok(())
}

/// The square around a mask, or around the whole picture if the mask is empty. If the mask reaches the picture's border, the square
/// lies within the picture; `None` where it is too large for that.
fn square(masks: &Image, view: usize) -> Option<Square> {
    let (width, height) = (masks.width, masks.height);
    let (mut low, mut high) = ([usize::MAX; 2], [0; 2]);
    for i in (0..width * height).filter(|i| masks.view(view)[*i] > 0.5) {
        for (k, x) in [i % width, i / width].into_iter().enumerate() {
            (low[k], high[k]) = (low[k].min(x), high[k].max(x + 1));
        }
    }
    if high == [0; 2] {
        (low, high) = ([0; 2], [width, height]);
    }
    let side = MARGIN * (high[0] - low[0]).max(high[1] - low[1]) as f64;
    let mut corner = [0, 1].map(|k| 0.5 * ((low[k] + high[k]) as f64 - side));
    // Nothing is known of the part of an object that lies beyond the border.
    let is_cut = low.contains(&0) || high[0] == width || high[1] == height;
    for (corner, size) in corner.iter_mut().zip([width, height]).filter(|_| is_cut) {
        *corner = corner.clamp(0.0, (size as f64 - side).max(0.0));
        if side > size as f64 {
            return None;
        }
    }
    Some(Square { left: corner[0], top: corner[1], side })
}

impl Square {
    /// The camera of the crop.
    fn camera(&self, camera: &Camera, picture: &Image, side: usize) -> Result<Camera> {
        let size = (picture.width as u32, picture.height as u32);
        let Some([fx, fy, cx, cy]) = camera.intrinsics(size) else { return Ok(*camera) };
        let times = side as f64 / self.side;
        let [fx, fy, cx, cy] = [fx, fy, cx - self.left, cy - self.top].map(|x| times * x);
        Camera::from_affine(camera.matrix(), Projection::Pinhole { fx, fy, cx, cy })
    }
}

/// The squares of pictures with `side` pixels a side: means over areas, with nothing beyond the border.
fn shrunk(image: &Image, squares: &[Square], side: usize) -> Image {
    let channels = image.channels;
    // The pixels that a pixel of the crop covers along an axis, with their shares.
    let along = |from: f64, step: f64, size: usize| -> Vec<Vec<(usize, f64)>> {
        let one = |i: usize| {
            let (low, high) = (from + i as f64 * step, from + (i + 1) as f64 * step);
            let inside = (low.max(0.0) as usize)..(high.ceil().max(0.0) as usize).min(size);
            let share = |x: usize| (high.min(x as f64 + 1.0) - low.max(x as f64)).max(0.0) / step;
            inside.map(|x| (x, share(x))).collect()
        };
        (0..side).map(one).collect()
    };
    let mut data = Vec::with_capacity(squares.len() * side * side * channels);
    for (view, square) in squares.iter().enumerate() {
        let (pixels, step) = (image.view(view), square.side / side as f64);
        let (columns, rows) = (along(square.left, step, image.width), along(square.top, step, image.height));
        for (row, column) in rows.iter().flat_map(|row| columns.iter().map(move |column| (row, column))) {
            for k in 0..channels {
                let part = |(y, a): &(usize, f64)| {
                    let at = |x: usize| f64::from(pixels[(y * image.width + x) * channels + k]);
                    a * column.iter().map(|(x, b)| b * at(*x)).sum::<f64>()
                };
                data.push(row.iter().map(part).sum::<f64>() as f32);
            }
        }
    }
    Image { batch: squares.len(), height: side, width: side, channels, data }
}
