//! World to view space, and view space to the screen.

use super::parameters::{Parameters, Source};
use super::real::{Real, add, cross, dot};
use softras::scene::{Camera, Projection, Settings};

/// A camera as numbers `R` that may carry derivatives.
pub struct Lens<'a, R> {
    camera: &'a Camera,
    /// v, ω.
    twist: [[R; 3]; 2],
    /// fov_y; half_height; fx, fy, cx, cy.
    projection: Vec<R>,
    width: f64,
    height: f64,
}

impl<'a, R: Real> Lens<'a, R> {
    /// Reads a view's camera.
    pub fn load<S: Source<R = R>>(
        camera: &'a Camera,
        settings: &Settings,
        parameters: &Parameters,
        view: usize,
        source: &S,
    ) -> Self {
        let slots = &parameters.layout().views[view];
        let twist = [source.row(slots.twist.start), source.row(slots.twist.start + 3)];
        let projection = slots.projection.clone().map(|slot| source.load(slot)).collect();
        Self { camera, twist, projection, width: settings.width.into(), height: settings.height.into() }
    }

    /// The view-space point. Points given on the screen become (x z, y z, z), so that lines stay lines.
    pub fn to_view(&self, p: [R; 3]) -> [R; 3] {
        if matches!(self.camera.projection(), Projection::Screen) {
            return [p[0] * p[2], p[1] * p[2], p[2]];
        }
        let [v, omega] = self.twist;
        let q = self.camera.view().map(|row| dot([row[0], row[1], row[2]].map(R::constant), p).shift(row[3]));
        add(add(q, cross(omega, q)), v)
    }

    /// The screen point of a view-space point.
    pub fn to_screen(&self, [x, y, z]: [R; 3]) -> [R; 2] {
        match *self.camera.projection() {
            Projection::Perspective { .. } => {
                let scale = (z * self.projection[0].scale(0.5).tan()).recip();
                [x * scale, y * scale]
            }
            Projection::Orthographic { .. } => [x / self.projection[0], y / self.projection[0]],
            Projection::Pinhole { .. } => self.pinhole(x / z, y / z),
            Projection::Official { distortion, original_size } => {
                let z = z.shift(1e-5);
                distort([x / z, y / z], distortion).map(|c| c.scale(2.0 / original_size).shift(-1.0))
            }
            Projection::Screen => [x / z, y / z],
        }
    }

    fn pinhole(&self, x: R, y: R) -> [R; 2] {
        let [fx, fy, cx, cy] = [0, 1, 2, 3].map(|k| self.projection[k]);
        let (column, row) = (fx * x + cx, cy - fy * y);
        let to_units = 1.0 / self.height;
        [column.scale(2.0).shift(-self.width).scale(to_units), row.scale(-2.0).shift(self.height).scale(to_units)]
    }
}

/// Radial (k1, k2, k3) and tangential (p1, p2) distortion.
fn distort<R: Real>([x, y]: [R; 2], [k1, k2, p1, p2, k3]: [f64; 5]) -> [R; 2] {
    let r2 = x.square() + y.square();
    let radial = (r2 * (r2 * (r2.scale(k3).shift(k2))).shift(k1)).shift(1.0);
    let xy = (x * y).scale(2.0);
    [
        x * radial + xy.scale(p1) + (r2 + x.square().scale(2.0)).scale(p2),
        y * radial + xy.scale(p2) + (r2 + y.square().scale(2.0)).scale(p1),
    ]
}
