//! The gradient of a hard image by its camera, from the image alone: the baseline that soft gradients are held against.

use crate::error::Result;
use crate::fit::bad;
use crate::gradients::ImageGradient;
use crate::image::Image;
use crate::renderer::Frame;
use crate::scene::{Camera, Projection};
use glam::DVec3;

/// dL by each view's twist (v, ω), as [`crate::gradients::CameraGradient::twist`].
///
/// A pixel's colour is taken to move with the surface point that it shows, and to change as the image changes from one
/// neighbour to the other (central differences, as in OpenDR, Loper and Black 2014). A pixel of the background moves
/// with a neighbour that shows the mesh.
///
/// # Errors
/// [`crate::Error::Fit`] for a frame without depth or a camera without perspective.
pub fn flow_gradient(frame: &Frame, upstream: &ImageGradient, camera: &Camera) -> Result<Vec<[f64; 6]>> {
    let Some(depth) = frame.depth() else {
        return bad("a frame without depth", "ask for it in Settings::outputs");
    };
    let Projection::Perspective { fov_y } = *camera.projection() else {
        return bad("a camera without perspective", "use Projection::Perspective");
    };
    let pairs = [(frame.color(), &upstream.color), (frame.silhouette(), &upstream.silhouette)];
    let flow = Flow { depth, slope: (fov_y / 2.0).tan() };
    let one = |view: usize| {
        let mut twist = [0.0; 6];
        for (image, gradient) in pairs {
            if let (Some(image), Some(gradient)) = (image, gradient) {
                flow.add(view, image, gradient, &mut twist);
            }
        }
        twist
    };
    Ok((0..depth.batch).map(one).collect())
}

struct Flow<'a> {
    depth: &'a Image,
    /// Tangent of half the angle of view.
    slope: f64,
}

impl Flow<'_> {
    fn add(&self, view: usize, image: &Image, gradient: &Image, twist: &mut [f64; 6]) {
        let (height, width) = (image.height, image.width);
        for row in 0..height {
            for column in 0..width {
                let (left, right) = (column.saturating_sub(1), (column + 1).min(width - 1));
                let (above, below) = (row.saturating_sub(1), (row + 1).min(height - 1));
                let around = [(row, column), (row, left), (row, right), (above, column), (below, column)];
                let depths = around.map(|(r, c)| f64::from(self.depth.pixel(view, r, c)[0]));
                let Some(z) = depths.into_iter().find(|z| *z > 0.0) else { continue };
                let difference = |a: (usize, usize), b: (usize, usize), pixels: usize| -> f64 {
                    let (a, b) = (image.pixel(view, a.0, a.1), image.pixel(view, b.0, b.1));
                    let by = gradient.pixel(view, row, column);
                    let sum: f64 =
                        by.iter().zip(b.iter().zip(a)).map(|(g, (b, a))| f64::from(*g) * f64::from(b - a)).sum();
                    sum / pixels.max(1) as f64
                };
                // dL by how far what is seen here moves, in pixels to the right and up.
                let by_right = -difference((row, left), (row, right), right - left);
                let by_up = -difference((below, column), (above, column), below - above);
                let half = height as f64 / 2.0;
                let (x, y) = ((column as f64 + 0.5 - width as f64 / 2.0) / half, (half - row as f64 - 0.5) / half);
                let point = DVec3::new(x * self.slope * z, y * self.slope * z, z);
                // Pixels by view-space motion of the point.
                let scale = half / (self.slope * z);
                let by_point =
                    DVec3::new(by_right * scale, by_up * scale, -(by_right * x + by_up * y) * self.slope * scale);
                let by_turn = point.cross(by_point);
                let both = by_point.to_array().into_iter().chain(by_turn.to_array());
                twist.iter_mut().zip(both).for_each(|(sum, x)| *sum += x);
            }
        }
    }
}
