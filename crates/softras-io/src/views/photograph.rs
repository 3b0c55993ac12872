//! Keeps the part of each picture that shows the object, in bytes, and makes views of one size from these parts.

use super::{
    Views, ViewsOptions,
    kept::Kept,
    parts::{Part, parts},
};
use crate::Curve;
use image::{Rgba, RgbaImage};
use softras::{Camera, Image, Projection, Result};
use std::sync::{Arc, LazyLock};

/// A part of a mask with a smaller share of the largest part does not tell where the object is.
const SPECK: f64 = 2e-3;
/// The sides of a crop as multiples of its mask's box.
const MARGIN: f64 = 1.25;
/// The smallest side of crops.
const LEAST: usize = 32;

/// A picture as it was taken: the part of it that shows the object.
#[derive(Clone, Debug)]
pub struct Photograph {
    /// Columns and rows of the whole picture.
    pub whole: (u32, u32),
    /// The focal lengths and the principal point in pixels of the whole picture.
    lens: [f64; 4],
    /// Where the object is in the whole picture, without specks; all of the picture where it shows none.
    object: Part,
    /// The upper left corner of the part that is kept, in pixels of the whole picture.
    corner: [usize; 2],
    /// Pixels of the whole picture along a side of one that is kept.
    step: usize,
    pixels: Arc<Kept>,
    /// The gains that channels are divided by, and the values from which on they are only bounds.
    levels: [[f64; 2]; 3],
}

impl Photograph {
    /// The object of a picture, whose alpha is the silhouette, in at most `most` pixels a side; the whole picture for `None`.
    pub(super) fn of(picture: RgbaImage, lens: [f64; 4], most: Option<usize>) -> Self {
        let whole = picture.dimensions();
        let all = Part { area: 0, low: [0; 2], high: [whole.0 as usize, whole.1 as usize] };
        let object = object(&picture).unwrap_or(all);
        let kept = if most.is_some() { object } else { all };
        let sides = [0, 1].map(|k| kept.high[k] - kept.low[k]);
        let step = most.map_or(1, |most| sides[0].max(sides[1]).div_ceil(most));
        let pixels = smaller(&picture, kept.low, sides, step);
        let levels = [[1.0, f64::INFINITY]; 3];
        Self { whole, lens, object, corner: kept.low, step, pixels: Arc::new(pixels), levels }
    }

    /// The camera of the part, for a view of this position.
    ///
    /// # Errors
    /// Those of [`Camera::from_matrix`].
    pub fn camera(&self, view: &Camera) -> Result<Camera> {
        let [left, top] = self.corner.map(|x| x as f64);
        self.camera_of(view, [left, top], [1.0 / self.step as f64; 2])
    }

    /// The camera of the whole picture, for a view of this position.
    pub(super) fn whole_camera(&self, view: &Camera) -> Result<Camera> {
        self.camera_of(view, [0.0; 2], [1.0; 2])
    }

    /// The camera of a part of the picture, enlarged by factors.
    fn camera_of(&self, view: &Camera, [left, top]: [f64; 2], [x, y]: [f64; 2]) -> Result<Camera> {
        let [fx, fy, cx, cy] = self.lens;
        let lens = Projection::Pinhole { fx: x * fx, fy: y * fy, cx: x * (cx - left), cy: y * (cy - top) };
        Camera::from_affine(view.matrix(), lens)
    }

    /// Columns and rows of the part.
    pub fn size(&self) -> (u32, u32) {
        self.pixels.size()
    }

    /// The linear colour of a pixel of the part, over black, and its silhouette. A channel below 0 is at least its opposite.
    pub fn pixel(&self, column: u32, row: u32) -> [f32; 4] {
        let pixel = premultiplied(&self.pixels.pixel(column, row));
        let [r, g, b] = [0, 1, 2].map(|k| {
            let ([gain, end], value) = (self.levels[k], f64::from(pixel[k]));
            (if value < end { value } else { -value } / gain) as f32
        });
        [r, g, b, pixel[3]]
    }

    /// Divides each channel by a gain. From a value on it is only a bound.
    pub fn level(&mut self, levels: [[f64; 2]; 3]) {
        self.levels = levels;
    }

    /// Linear colour over black, and alpha, of the whole picture at a column and a row.
    fn at(&self, column: usize, row: usize) -> [f32; 4] {
        let place = |x: usize, k: usize| Some((x.checked_sub(self.corner[k])? / self.step) as u32);
        let pixel = || Some(self.pixels.pixel(place(column, 0)?, place(row, 1)?));
        pixel().map_or([0.0; 4], |pixel| premultiplied(&pixel))
    }

    /// Whether the border of the picture cuts the object.
    fn is_cut(&self) -> bool {
        self.object.area > 0 && self.object.is_cut([self.whole.0 as usize, self.whole.1 as usize])
    }

    /// The sides of the object's box.
    fn sides(&self) -> [f64; 2] {
        [0, 1].map(|k| (self.object.high[k] - self.object.low[k]) as f64)
    }

    /// The height of a crop around the object, `aspect` times as wide as high. Where the border cuts the object, the crop lies within the
    /// picture: nothing is known of what is beyond.
    fn height(&self, aspect: f64) -> f64 {
        let [width, height] = self.sides();
        let most = if self.is_cut() { f64::from(self.whole.1).min(f64::from(self.whole.0) / aspect) } else { f64::MAX };
        (MARGIN * height.max(width / aspect)).min(most)
    }

    /// The upper left corner of a crop of these sides around the object. If the border cuts the object, the crop stays inside the
    /// picture where it fits.
    fn corner_of(&self, sides: [f64; 2]) -> [f64; 2] {
        let whole = [f64::from(self.whole.0), f64::from(self.whole.1)];
        [0, 1].map(|k| {
            let corner = 0.5 * ((self.object.low[k] + self.object.high[k]) as f64 - sides[k]);
            if self.is_cut() { corner.clamp(0.0, (whole[k] - sides[k]).max(0.0)) } else { corner }
        })
    }

    /// A crop of `size` columns and rows: means over areas, with nothing beyond the border.
    fn crop(&self, corner: [f64; 2], sides: [f64; 2], size: [usize; 2], mut push: impl FnMut([f64; 4])) {
        let kept = [self.size().0 as usize, self.size().1 as usize];
        // The kept pixels that each column and each row of the crop covers, with their shares.
        let [columns, rows] = [0, 1].map(|k| {
            let step = sides[k] / size[k] as f64 / self.step as f64;
            let from = (corner[k] - self.corner[k] as f64) / self.step as f64;
            let one = |i: usize| -> Vec<(u32, f64)> {
                let (low, high) = (from + i as f64 * step, from + (i + 1) as f64 * step);
                let inside = low.max(0.0) as usize..(high.ceil().max(0.0) as usize).min(kept[k]);
                let share = |x: usize| (high.min(x as f64 + 1.0) - low.max(x as f64)).max(0.0) / step;
                inside.map(|x| (x as u32, share(x))).collect()
            };
            (0..size[k]).map(one).collect::<Vec<_>>()
        });
        for (row, column) in rows.iter().flat_map(|row| columns.iter().map(move |column| (row, column))) {
            let mut sums = [0.0; 4];
            for (y, down) in row {
                for (x, along) in column {
                    let pixel = self.pixels.pixel(*x, *y);
                    // Most of a picture is background.
                    if pixel.0[3] > 0 {
                        let value = premultiplied(&pixel);
                        sums.iter_mut().zip(value).for_each(|(sum, x)| *sum += down * along * f64::from(x));
                    }
                }
            }
            push(sums);
        }
    }
}

/// Photographs with the cameras of their views.
#[derive(Default)]
pub struct Album {
    pub photographs: Vec<Photograph>,
    pub cameras: Vec<Camera>,
    pub names: Vec<String>,
}

impl Album {
    /// Adds a picture, whose alpha is the silhouette, and keeps at most `most` pixels along a side of its object, or all.
    pub fn add(&mut self, picture: RgbaImage, camera: Camera, name: Option<String>, most: Option<usize>) {
        // Without perspective there is no lens to keep, and such a picture is not cropped.
        let lens = camera.intrinsics(picture.dimensions()).unwrap_or_default();
        self.photographs.push(Photograph::of(picture, lens, most));
        self.cameras.push(camera);
        self.names.extend(name);
    }

    /// The views for a fit: crops where these are asked for and leave out half of the pixels, else the pictures as they are.
    pub fn views(self, options: &ViewsOptions, is_cropped: bool, notes: &mut Vec<String>) -> Result<Views> {
        if is_cropped && let Some((mut views, note)) = self.cropped(options.crop as usize, options.color)? {
            notes.push(note);
            views.photographs = self.photographs;
            if options.detail == 0 {
                views.photographs.iter_mut().for_each(|photograph| photograph.pixels = Arc::default());
            }
            return Ok(views);
        }
        let (views, more) = self.whole(options.color)?;
        notes.extend(more);
        Ok(views)
    }

    /// Crops of one size around the objects, with at most `most` pixels a side, and a note; `None` where pictures of one size would
    /// keep more than half of their pixels.
    pub fn cropped(&self, most: usize, color: bool) -> Result<Option<(Views, String)>> {
        let all = &self.photographs;
        // As near to a square as lets the crop of an object that a border cuts hold it within its picture.
        let aspect = |photograph: &Photograph| {
            let ([width, height], (columns, rows)) = (photograph.sides(), photograph.whole);
            if !photograph.is_cut() {
                return 1.0;
            }
            1f64.clamp(width / f64::from(rows), f64::from(columns) / height)
        };
        let aspect = median(all.iter().map(aspect));
        let side = median(all.iter().map(|photograph| photograph.height(aspect) * aspect.max(1.0)));
        let side = (side as usize).min(most).max(LEAST);
        let even = |side: f64| (side as usize).next_multiple_of(2);
        let size = [side as f64 * aspect.min(1.0), side as f64 / aspect.max(1.0)].map(even);
        let pixels: u64 =
            all.iter().map(|photograph| u64::from(photograph.whole.0) * u64::from(photograph.whole.1)).sum();
        let whole = all.first().map_or((0, 0), |first| first.whole);
        let are_alike = all.iter().all(|photograph| photograph.whole == whole);
        if are_alike && 2 * (size[0] * size[1] * all.len()) as u64 > pixels {
            return Ok(None);
        }
        let aspect = size[0] as f64 / size[1] as f64;
        let mut images = Images::new(color, [all.len(), size[1], size[0]]);
        let mut cameras = Vec::with_capacity(all.len());
        for (photograph, camera) in all.iter().zip(&self.cameras) {
            let height = photograph.height(aspect);
            let sides = [aspect * height, height];
            let corner = photograph.corner_of(sides);
            let times = [0, 1].map(|k| size[k] as f64 / sides[k]);
            cameras.push(photograph.camera_of(camera, corner, times)?);
            photograph.crop(corner, sides, size, |pixel| images.push(pixel.map(|x| x as f32)));
        }
        let of = if are_alike { format!("{}×{} pixels", whole.0, whole.1) } else { "several sizes".into() };
        let mut note = format!("pictures of {of} are cropped to the object, {}×{} pixels each", size[0], size[1]);
        let cut = all.iter().filter(|photograph| photograph.is_cut()).count();
        if cut > 0 {
            note += &format!(
                "; the border cuts the object in {cut} of {}, and tells nothing of what lies beyond",
                all.len()
            );
        }
        Ok(Some((images.views(cameras, self.names.clone()), note)))
    }

    /// The pictures as they are. Those of several sizes get empty columns at the right and empty rows below. One whose right or lower
    /// border cuts the object is left out then, since it is not known to end there. Returns notes as well.
    pub fn whole(&self, color: bool) -> Result<(Views, Vec<String>)> {
        let sides = self.photographs.iter().map(|photograph| photograph.whole);
        let whole = sides.clone().fold((0, 0), |(w, h), side| (side.0.max(w), side.1.max(h)));
        let mut notes = Vec::new();
        if sides.clone().any(|side| side != whole) {
            notes
                .push(format!("pictures of several sizes: all become {}×{}, empty beyond their own", whole.0, whole.1));
        }
        let is_cut = |photograph: &Photograph| {
            let (high, (width, height)) = (photograph.object.high, photograph.whole);
            let is_at = |at: usize, own: u32, all: u32| own < all && at == own as usize;
            photograph.object.area > 0 && (is_at(high[0], width, whole.0) || is_at(high[1], height, whole.1))
        };
        let (cut, kept): (Vec<usize>, Vec<usize>) =
            (0..self.cameras.len()).partition(|view| is_cut(&self.photographs[*view]));
        let what = "left out: its right or lower border cuts the object, and other pictures are larger";
        let name = |view: usize| self.names.get(view).cloned().unwrap_or_else(|| format!("view {view}"));
        notes.extend(cut.iter().map(|view| format!("{}: {what}", name(*view))));
        let size = [kept.len(), whole.1 as usize, whole.0 as usize];
        let mut images = Images::new(color, size);
        let mut cameras = Vec::new();
        for photograph in kept.iter().map(|view| &self.photographs[*view]) {
            (0..size[1]).for_each(|row| (0..size[2]).for_each(|column| images.push(photograph.at(column, row))));
        }
        for view in &kept {
            let (own, photograph) = (self.cameras[*view], &self.photographs[*view]);
            cameras.push(if photograph.whole == whole { own } else { photograph.whole_camera(&own)? });
        }
        let names = kept.iter().filter_map(|view| self.names.get(*view).cloned()).collect();
        Ok((images.views(cameras, names), notes))
    }
}

/// Crops of views of one size, as [`Views::cropped`] has them.
pub fn cropped(views: &Views, most: usize) -> Result<Option<(Views, String)>> {
    let (height, width) = views.size()?;
    let is_small = most == 0 || height.min(width) <= most || !views.photographs.is_empty();
    let Some(silhouette) = views.silhouette.as_ref().filter(|_| !is_small) else { return Ok(None) };
    let have_lenses = views.cameras.iter().all(|camera| camera.intrinsics((1, 1)).is_some());
    if views.depth.is_some() || views.normal.is_some() || !have_lenses {
        return Ok(None);
    }
    let mut album = Album::default();
    for (view, camera) in views.cameras.iter().enumerate() {
        let picture = RgbaImage::from_fn(width as u32, height as u32, |column, row| {
            let alpha = f64::from(silhouette.pixel(view, row as usize, column as usize)[0]);
            let color = views.color.as_ref().map(|color| color.pixel(view, row as usize, column as usize));
            let [r, g, b] = [0, 1, 2].map(|k| color.map_or(alpha, |color| f64::from(color[k])));
            straight([r, g, b, alpha])
        });
        album.add(picture, *camera, views.names.get(view).cloned(), Some(width.max(height)));
    }
    Ok(album
        .cropped(most, views.color.is_some())?
        .map(|(crops, note)| (Views { photographs: album.photographs, ..crops }, note)))
}

/// The images of views, pixel by pixel.
struct Images {
    size: [usize; 3],
    silhouette: Vec<f32>,
    color: Option<Vec<f32>>,
}

impl Images {
    fn new(color: bool, size: [usize; 3]) -> Self {
        let pixels = size.iter().product();
        Self { size, silhouette: Vec::with_capacity(pixels), color: color.then(|| Vec::with_capacity(3 * pixels)) }
    }

    fn push(&mut self, [r, g, b, alpha]: [f32; 4]) {
        self.silhouette.push(alpha);
        self.color.iter_mut().for_each(|color| color.extend([r, g, b]));
    }

    fn views(self, cameras: Vec<Camera>, names: Vec<String>) -> Views {
        let [batch, height, width] = self.size;
        let image = |channels: usize, data: Vec<f32>| Image { batch, height, width, channels, data };
        let color = self.color.map(|color| image(3, color));
        Views { cameras, silhouette: Some(image(1, self.silhouette)), color, names, ..Views::default() }
    }
}

/// The linear number of each byte.
static LINEAR: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|byte| Curve::Srgb.decode(byte as f64 / 255.0) as f32));

/// Linear colour over black, and alpha, of a pixel that is not multiplied by its alpha.
pub(super) fn premultiplied(pixel: &Rgba<u8>) -> [f32; 4] {
    let alpha = f32::from(pixel.0[3]) / 255.0;
    let [r, g, b] = [0, 1, 2].map(|k| alpha * LINEAR[usize::from(pixel.0[k])]);
    [r, g, b, alpha]
}

/// Divides linear colour by the alpha that it is multiplied with, and encodes it as bytes in sRGB.
pub(super) fn straight(pixel: [f64; 4]) -> Rgba<u8> {
    let byte = |x: f64| (255.0 * x.clamp(0.0, 1.0)).round() as u8;
    let alpha = pixel[3];
    if alpha <= 0.0 {
        return Rgba([0; 4]);
    }
    let [r, g, b] = [0, 1, 2].map(|k| byte(Curve::Srgb.encode(pixel[k] / alpha)));
    Rgba([r, g, b, byte(alpha)])
}

/// The box of a picture's object, without specks; `None` where it shows none.
fn object(picture: &RgbaImage) -> Option<Part> {
    let size = [picture.width() as usize, picture.height() as usize];
    let (_, all) = parts(size, true, |column, row| picture[(column as u32, row as u32)].0[3] > 127);
    let largest = all.iter().map(|part| part.area).max()? as f64;
    all.into_iter().filter(|part| part.area as f64 >= SPECK * largest).reduce(Part::with)
}

/// A part of a picture, with means of `step` by `step` pixels.
fn smaller(picture: &RgbaImage, [left, top]: [usize; 2], sides: [usize; 2], step: usize) -> Kept {
    let [width, height] = sides.map(|side| side.div_ceil(step) as u32);
    Kept::of((width, height), |column, row| {
        let [column, row] = [left + column as usize * step, top + row as usize * step].map(|x| x as u32);
        if step == 1 {
            return picture[(column, row)];
        }
        let mut sums = [0.0; 4];
        for (x, y) in (0..step as u32).flat_map(|y| (0..step as u32).map(move |x| (column + x, row + y))) {
            let value = picture.get_pixel_checked(x, y).filter(|pixel| pixel.0[3] > 0).map_or([0.0; 4], premultiplied);
            sums.iter_mut().zip(value).for_each(|(sum, x)| *sum += f64::from(x));
        }
        straight(sums.map(|sum| sum / (step * step) as f64))
    })
}

/// 0 of no values.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}
