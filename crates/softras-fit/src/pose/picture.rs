//! One picture of an object, in several sizes, and where the object lies in it.

use super::target::PoseTarget;
use crate::bad;
use glam::{DVec2, DVec3};
use softras::{Image, Result, scene::Camera};

/// A picture: colours on black and the silhouette.
#[derive(Clone, Debug)]
pub struct Picture {
    color: Image,
    silhouette: Image,
}

impl Picture {
    /// # Errors
    /// [`softras::Error::Fit`] for images of other shapes than `[1, height, width, 3]` and `[1, height, width, 1]`.
    pub fn new(color: Image, silhouette: Image) -> Result<Self> {
        if color.batch != 1 {
            return bad(format!("{} pictures", color.batch), "a pose is found from one");
        }
        PoseTarget::new(color.clone(), silhouette.clone())?;
        Ok(Self { color, silhouette })
    }

    pub fn width(&self) -> usize {
        self.color.width
    }

    pub fn height(&self) -> usize {
        self.color.height
    }

    /// The picture scaled down so that no side is longer than `most` pixels.
    pub fn at_most(&self, most: usize) -> Self {
        let longer = self.width().max(self.height());
        if longer <= most {
            return self.clone();
        }
        let side = |side: usize| ((side * most + longer / 2) / longer).max(1);
        let (width, height) = (side(self.width()), side(self.height()));
        Self { color: averaged(&self.color, width, height), silhouette: averaged(&self.silhouette, width, height) }
    }

    /// The picture as the target of each of several poses.
    pub fn repeated(&self, count: usize) -> Result<PoseTarget> {
        let one = |image: &Image| Image { batch: count, data: image.data.repeat(count), ..*image };
        PoseTarget::new(one(&self.color), one(&self.silhouette))
    }

    pub fn place(&self) -> Option<Place> {
        Place::of(&self.silhouette, 0)
    }
}

/// The image with fewer pixels, each the mean of those under it.
fn averaged(image: &Image, width: usize, height: usize) -> Image {
    let (rows, columns) = (shares(image.height, height), shares(image.width, width));
    let mut data = Vec::with_capacity(width * height * image.channels);
    for row in &rows {
        for column in &columns {
            for channel in 0..image.channels {
                let across = |r: usize| column.iter().map(move |&(c, w)| w * f64::from(image.pixel(0, r, c)[channel]));
                data.push(row.iter().map(|&(r, w)| w * across(r).sum::<f64>()).sum::<f64>() as f32);
            }
        }
    }
    Image { width, height, data, ..*image }
}

/// For each of `to` coarse intervals, the fine ones of `from` that it covers, with the share of each in it.
fn shares(from: usize, to: usize) -> Vec<Vec<(usize, f64)>> {
    let length = from as f64 / to as f64;
    let one = |i: usize| {
        let (begin, end) = (i as f64 * length, (i + 1) as f64 * length);
        let last = (end.ceil() as usize).min(from);
        (begin as usize..last)
            .map(|k| (k, ((end.min(k as f64 + 1.0)) - begin.max(k as f64)).max(0.0) / length))
            .collect()
    };
    (0..to).map(one).collect()
}

/// Where an object lies in an image: the centre of its silhouette and its area, as shares of the image's size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    center: DVec2,
    area: f64,
}

impl Place {
    /// `None` where the image shows nothing.
    pub fn of(silhouette: &Image, view: usize) -> Option<Self> {
        let (mut sum, mut area) = (DVec2::ZERO, 0.0);
        for (i, &a) in silhouette.view(view).iter().enumerate() {
            let (row, column) = (i / silhouette.width, i % silhouette.width);
            sum += f64::from(a) * (DVec2::new(column as f64, row as f64) + 0.5);
            area += f64::from(a);
        }
        let size = DVec2::new(silhouette.width as f64, silhouette.height as f64);
        (area > 0.5).then(|| Self { center: sum / area / size, area: area / size.element_product() })
    }

    /// The translation, in the camera's axes, that moves an object at view depth `depth` from here to `goal`, in images of this
    /// size. Zero for cameras without perspective.
    pub fn way_to(&self, goal: &Self, camera: &Camera, [width, height]: [f64; 2], depth: f64) -> DVec3 {
        let Some([fx, fy, cx, cy]) = camera.intrinsics((width as u32, height as u32)) else { return DVec3::ZERO };
        let (slope, middle) = (DVec2::new(1.0 / fx, -1.0 / fy), DVec2::new(cx, cy));
        // Twice as far is a quarter of the area.
        let to = depth * (self.area / goal.area).sqrt().clamp(0.5, 2.0);
        let [there, here] = [goal, self].map(|place| place.center * DVec2::new(width, height) - middle);
        let across = there * slope * to - here * slope * depth;
        across.extend(to - depth)
    }
}
