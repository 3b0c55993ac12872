//! Gradients of a hard image estimated from the image itself, as a baseline for soft gradients.
//!
//! Each pixel's value is assumed to move with the surface point that it shows, and its change is estimated by central
//! differences between its neighbours (OpenDR, Loper and Black 2014). A background pixel moves with a neighbour that
//! shows the mesh.

use crate::bad;
use glam::DVec3;
use softras::{Camera, Frame, Image, ImageGradient, Result};

/// The estimated gradient dL by each view's twist (v, ω), see [`softras::CameraGradient::twist`].
///
/// # Errors
/// [`softras::Error::Fit`] for a frame without depth, gradients of another shape than its images, or a camera without
/// perspective.
pub fn flow_gradient(frame: &Frame, upstream: &ImageGradient, camera: &Camera) -> Result<Vec<[f64; 6]>> {
    let flow = Flow::new(frame, upstream)?;
    let size = (flow.depth.width as u32, flow.depth.height as u32);
    let Some(intrinsics) = camera.intrinsics(size) else {
        return bad("a camera without perspective", "use Projection::Perspective or Projection::Pinhole");
    };
    let one = |view: usize| {
        let mut twist = [0.0; 6];
        flow.each(view, intrinsics, |point, by_point| {
            let both = by_point.to_array().into_iter().chain(point.cross(by_point).to_array());
            twist.iter_mut().zip(both).for_each(|(sum, x)| *sum += x);
        });
        twist
    };
    Ok((0..flow.depth.batch).map(one).collect())
}

struct Flow<'a> {
    depth: &'a Image,
    /// The rendered images with their upstream gradients.
    images: Vec<(&'a Image, &'a Image)>,
}

impl<'a> Flow<'a> {
    fn new(frame: &'a Frame, upstream: &'a ImageGradient) -> Result<Self> {
        let depth = frame.depth()?;
        let pairs = [(frame.color().ok(), &upstream.color), (frame.silhouette().ok(), &upstream.silhouette)];
        let images: Vec<_> = pairs.into_iter().filter_map(|(image, gradient)| image.zip(gradient.as_ref())).collect();
        let shape = |image: &Image| ([image.batch, image.height, image.width, image.channels], image.data.len());
        if images.iter().any(|(image, gradient)| shape(image) != shape(gradient)) {
            return bad("gradients of another shape than the frame's images", "give one number for each of theirs");
        }
        Ok(Self { depth, images })
    }

    /// Visits every pixel that moves with the mesh, with the surface point that it shows and dL by the point's motion, both in
    /// view space.
    fn each(&self, view: usize, [fx, fy, cx, cy]: [f64; 4], mut visit: impl FnMut(DVec3, DVec3)) {
        let (height, width) = (self.depth.height, self.depth.width);
        for row in 0..height {
            for column in 0..width {
                let (left, right) = (column.saturating_sub(1), (column + 1).min(width - 1));
                let (above, below) = (row.saturating_sub(1), (row + 1).min(height - 1));
                let around = [(row, column), (row, left), (row, right), (above, column), (below, column)];
                let depth = |(r, c): (usize, usize)| f64::from(self.depth.pixel(view, r, c)[0]);
                let Some(z) = around.into_iter().map(depth).find(|z| *z > 0.0) else { continue };
                let difference = |a: (usize, usize), b: (usize, usize), pixels: usize| -> f64 {
                    let of = |(image, by): &(&Image, &Image)| -> f64 {
                        let (a, b) = (image.pixel(view, a.0, a.1), image.pixel(view, b.0, b.1));
                        let by = by.pixel(view, row, column);
                        by.iter().zip(b.iter().zip(a)).map(|(g, (b, a))| f64::from(*g) * f64::from(b - a)).sum()
                    };
                    self.images.iter().map(of).sum::<f64>() / pixels.max(1) as f64
                };
                // dL by the motion of the shown surface in pixels, to the right and up.
                let by_right = -difference((row, left), (row, right), right - left);
                let by_up = -difference((below, column), (above, column), below - above);
                let (x, y) = ((column as f64 + 0.5 - cx) / fx, (cy - row as f64 - 0.5) / fy);
                let point = DVec3::new(x * z, y * z, z);
                // Times the motion in pixels per view-space motion of the point.
                let (by_x, by_y) = (by_right * fx / z, by_up * fy / z);
                let by_point = DVec3::new(by_x, by_y, -(by_x * x + by_y * y));
                visit(point, by_point);
            }
        }
    }
}
