//! A host's view and projection matrices as a softras camera, and its depth buffer's values from view depths.

use crate::error::{Error, Result};
use crate::scene::{Camera, Projection, validate_rotation};
use glam::DMat4;

/// The clip space that a host's projection matrices map to. The default is Vulkan's as it is; wgpu's is `y_up`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ClipSpace {
    /// y = 1 is the upper border of the image: wgpu, Direct3D, OpenGL, and Vulkan with a viewport of negative height. By
    /// default it is the lower one.
    pub y_up: bool,
    /// z runs from -1 to 1, as in OpenGL, and the depth buffer holds (z + 1) / 2. By default it runs from 0 to 1.
    pub symmetric_z: bool,
    /// Nearer points have a larger z. Only orthographic projections need to be told: a perspective projection's matrix says
    /// which way the camera looks.
    pub reversed_z: bool,
}

/// A host's two matrices of a view, by their columns and for column vectors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraMatrices {
    /// From the world to view space.
    pub view: [[f64; 4]; 4],
    /// From view space to clip space.
    pub projection: [[f64; 4]; 4],
}

/// A host's camera: what softras renders with, and how its depths become those of the host's depth buffer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HostCamera {
    camera: Camera,
    depth: DepthMap,
    planes: [f64; 2],
}

/// The value of a depth buffer at a view depth z: `constant + factor / z` with perspective, `constant + factor z` without.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct DepthMap {
    pub perspective: bool,
    pub constant: f64,
    pub factor: f64,
    /// The value that the host clears its depth buffer to: the one farthest away.
    pub clear: f64,
}

impl DepthMap {
    /// The value at a view depth.
    pub fn at(&self, z: f64) -> f64 {
        self.constant + if self.perspective { self.factor / z } else { self.factor * z }
    }
}

fn bad<T>(field: &'static str, value: impl std::fmt::Debug, fix: &str) -> Result<T> {
    Err(Error::Camera { field, value: format!("{value:?}"), fix: fix.into() })
}

/// Whether an entry is negligible compared with the entry that it would add to.
fn nothing(entry: f64, beside: f64) -> bool {
    entry.abs() <= 1e-12 * beside.abs()
}

impl HostCamera {
    /// The camera of these matrices, in an image of this size. It projects points to the same pixel positions as the
    /// matrices. A point's depth is its distance along the view's z axis, in units of view space, away from the viewer.
    ///
    /// View space may be of either handedness; the projection may be reversed, infinite, mirrored, or off centre (jitter).
    ///
    /// # Errors
    /// [`Error::Camera`] naming the matrix and the entry: for a view matrix that is no rotation and translation, mirrored or not, and for a projection with
    /// skew, whose w does not run along z alone, or that does not project at all.
    pub fn new(matrices: &CameraMatrices, clip: ClipSpace, (width, height): (u32, u32)) -> Result<Self> {
        let [view, projection] =
            [matrices.view, matrices.projection].map(|columns| DMat4::from_cols_array_2d(&columns));
        if !view.is_finite() || !projection.is_finite() {
            return bad("view or projection matrix", (view, projection), "every entry must be a finite number");
        }
        if view.row(3).to_array() != [0.0, 0.0, 0.0, 1.0] {
            return bad("view matrix, last row", view.row(3), "it must be (0, 0, 0, 1): the projection is given apart");
        }
        validate_rotation(view)?;
        let rows = [0, 1, 2, 3].map(|i| projection.row(i).to_array());
        let [x, mut y, z, w] = rows;
        if !clip.y_up {
            y = y.map(|entry| -entry);
        }
        let perspective = w[2] != 0.0;
        let along = if perspective { w[2] } else { w[3] };
        if along == 0.0 || !nothing(w[0], along) || !nothing(w[1], along) || (perspective && !nothing(w[3], along)) {
            return bad("projection matrix, last row", w, "use (0, 0, ±s, 0) for perspective, (0, 0, 0, s) without");
        }
        if x[0] == 0.0 || y[1] == 0.0 || !nothing(x[1], x[0]) || !nothing(y[0], y[1]) {
            return bad("projection matrix, x and y", (x, y), "each axis must depend on its own coordinate: no skew");
        }
        if !nothing(z[0], x[0]) || !nothing(z[1], y[1]) {
            return bad("projection matrix, z", z, "depth must run along the view's z axis: no oblique near plane");
        }
        let size = [f64::from(width), f64::from(height)];
        let axes = [view.row(0), view.row(1), view.row(2)].map(|row| row.to_array());
        if perspective {
            Self::perspective(axes, [x, y, z], along, clip, size)
        } else {
            Self::parallel(axes, [x, y, z], along, clip, size)
        }
    }

    /// x / w = (x0 X + x3) / (|s| d) + x2 / s, with the depth d = Z s / |s|: x2 / s is the principal point, since it
    /// does not depend on the depth, and x3 moves the eye.
    fn perspective(
        axes: [[f64; 4]; 3],
        [x, y, z]: [[f64; 4]; 3],
        along: f64,
        clip: ClipSpace,
        [width, height]: [f64; 2],
    ) -> Result<Self> {
        let (sign, size) = (along.signum(), along.abs());
        let moved = |axis: [f64; 4], by: f64, offset: f64| {
            let [a, b, c, d] = axis.map(|entry| entry * by.signum());
            [a, b, c, d + offset / by.abs()]
        };
        let view = [moved(axes[0], x[0], x[3]), moved(axes[1], y[1], y[3]), axes[2].map(|entry| entry * sign)];
        let projection = Projection::Pinhole {
            fx: width / 2.0 * x[0].abs() / size,
            fy: height / 2.0 * y[1].abs() / size,
            cx: width / 2.0 * (1.0 + x[2] / along),
            cy: height / 2.0 * (1.0 - y[2] / along),
        };
        // z / w = z2 / s + z3 / (|s| d).
        let depth = DepthMap { perspective: true, constant: z[2] / along, factor: z[3] / size, clear: 0.0 };
        Self::made(view, projection, depth, clip)
    }

    /// x / w = (x0 X + x3) / s. The scale and the centre go into the view's rows.
    fn parallel(
        axes: [[f64; 4]; 3],
        [x, y, z]: [[f64; 4]; 3],
        along: f64,
        clip: ClipSpace,
        [width, height]: [f64; 2],
    ) -> Result<Self> {
        if !nothing(x[2], x[0]) || !nothing(y[2], y[1]) {
            return bad(
                "projection matrix, x and y",
                (x, y),
                "a projection without perspective must not shear along z",
            );
        }
        let half_height = (along / y[1]).abs();
        let scaled = |axis: [f64; 4], [by, offset]: [f64; 2]| {
            let [a, b, c, d] = axis.map(|entry| entry * by);
            [a, b, c, d + offset]
        };
        let across = half_height * width / height / along;
        let up = half_height / along;
        let forward = (z[2] / along).signum() * if clip.reversed_z { -1.0 } else { 1.0 };
        let view = [
            scaled(axes[0], [x[0] * across, x[3] * across]),
            scaled(axes[1], [y[1] * up, y[3] * up]),
            axes[2].map(|entry| entry * forward),
        ];
        let depth = DepthMap { perspective: false, constant: z[3] / along, factor: z[2] / along * forward, clear: 0.0 };
        Self::made(view, Projection::Orthographic { half_height }, depth, clip)
    }

    fn made(view: [[f64; 4]; 3], projection: Projection, mut depth: DepthMap, clip: ClipSpace) -> Result<Self> {
        if clip.symmetric_z {
            depth = DepthMap { constant: (depth.constant + 1.0) / 2.0, factor: depth.factor / 2.0, ..depth };
        }
        // The depths at which the value is 0 and 1: factor / z or factor z is the value less the constant.
        let plane = |value: f64| {
            let left = value - depth.constant;
            if depth.perspective { depth.factor / left } else { left / depth.factor }
        };
        let ends = [plane(0.0), plane(1.0)];
        // With perspective a plane that is not in front of the viewer is infinitely far away: the rounding of an infinite
        // projection may put it anywhere beyond. Without, it may lie behind the viewer.
        let front = ends.map(|z| if z > 0.0 || !depth.perspective { z } else { f64::INFINITY });
        let (near, far) = (front[0].min(front[1]), front[0].max(front[1]));
        depth.clear = if front[0] > front[1] { 0.0 } else { 1.0 };
        if depth.factor == 0.0 || !near.is_finite() {
            return bad("projection matrix, z", (depth.constant, depth.factor), "depth must change with z");
        }
        let view = DMat4::from_cols_array_2d(&[view[0], view[1], view[2], [0.0, 0.0, 0.0, 1.0]]).transpose();
        Ok(Self { camera: Camera::from_affine(view, projection)?, depth, planes: [near, far] })
    }

    /// The camera that softras renders with.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// View depths of the near and the far plane; the far one is infinite where the projection has none, and an orthographic
    /// projection's near one may be negative.
    pub fn planes(&self) -> [f64; 2] {
        self.planes
    }

    /// The value of the host's depth buffer at a view depth.
    pub fn buffer_depth(&self, view_depth: f64) -> f64 {
        self.depth.at(view_depth)
    }

    pub(crate) fn depth(&self) -> DepthMap {
        self.depth
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use glam::{DVec3, DVec4};
    use softras_check::random::Random;

    const SIZE: (u32, u32) = (320, 200);

    fn vector(random: &mut Random) -> DVec3 {
        DVec3::from([(); 3].map(|()| random.range(-1.0, 1.0)))
    }

    fn of(view: DMat4, projection: DMat4) -> CameraMatrices {
        CameraMatrices { view: view.to_cols_array_2d(), projection: projection.to_cols_array_2d() }
    }

    fn look(eye: DVec3, toward: DVec3, left_handed: bool) -> DMat4 {
        let z = if left_handed { toward } else { -toward };
        let x = DVec3::Y.cross(z).normalize();
        let y = z.cross(x);
        let column = |k: usize| DVec4::new(x[k], y[k], z[k], 0.0);
        DMat4::from_cols(column(0), column(1), column(2), DVec4::new(-x.dot(eye), -y.dot(eye), -z.dot(eye), 1.0))
    }

    /// A random view and projection matrix. The bits of `kind` choose handedness, y, depth and projection.
    fn matrices(random: &mut Random, kind: u32) -> (DMat4, DMat4, ClipSpace) {
        let bit = |i: u32| kind >> i & 1 == 1;
        let (left_handed, symmetric, reversed, infinite, parallel) = (bit(0), bit(2), bit(3), bit(4), bit(5));
        let clip = ClipSpace { y_up: bit(1), symmetric_z: symmetric, reversed_z: reversed };
        let eye = 3.0 * vector(random);
        let toward = vector(random).normalize();
        let view = look(eye, toward, left_handed);
        let handed = if left_handed { 1.0 } else { -1.0 };
        let (near, far) = (0.1 + 0.05 * random.range(-1.0, 1.0), 50.0 + random.range(-1.0, 1.0));
        // Depths 0 and 1 as the standard: z = a + b / d with perspective, a + b d without.
        let (at_near, at_far) = if reversed { (1.0, 0.0) } else { (0.0, 1.0) };
        let (mut a, mut b) = if parallel {
            let b = (at_far - at_near) / (far - near);
            (at_near - b * near, b)
        } else if infinite {
            (at_far, (at_near - at_far) * near)
        } else {
            let b = (at_near - at_far) / (1.0 / near - 1.0 / far);
            (at_far - b / far, b)
        };
        if symmetric {
            (a, b) = (2.0 * a - 1.0, 2.0 * b);
        }
        let (fx, fy) = (
            1.5 + 0.5 * random.range(-1.0, 1.0),
            (1.5 + 0.5 * random.range(-1.0, 1.0)) * if bit(6) { -1.0 } else { 1.0 },
        );
        let jitter = [0.01 * random.range(-1.0, 1.0), 0.3 * random.range(-1.0, 1.0)];
        let rows = if parallel {
            [
                [fx / 3.0, 0.0, 0.0, jitter[0]],
                [0.0, fy / 3.0, 0.0, jitter[1]],
                [0.0, 0.0, b * handed, a],
                [0.0, 0.0, 0.0, 1.0],
            ]
        } else {
            [
                [fx, 0.0, jitter[0], 0.01 * random.range(-1.0, 1.0)],
                [0.0, fy, jitter[1], 0.0],
                [0.0, 0.0, a * handed, b],
                [0.0, 0.0, handed, 0.0],
            ]
        };
        (view, DMat4::from_cols_array_2d(&rows).transpose(), clip)
    }

    /// Column and row by the host's matrices, and the value in its depth buffer.
    fn by_matrices(p: DVec3, view: DMat4, projection: DMat4, clip: ClipSpace) -> [f64; 3] {
        let at = projection * (view * p.extend(1.0));
        let ndc = at / at.w;
        let y = if clip.y_up { -ndc.y } else { ndc.y };
        let (width, height) = (f64::from(SIZE.0), f64::from(SIZE.1));
        let z = if clip.symmetric_z { (ndc.z + 1.0) / 2.0 } else { ndc.z };
        [(ndc.x + 1.0) / 2.0 * width, (y + 1.0) / 2.0 * height, z]
    }

    #[test]
    fn points_project_as_by_the_hosts_matrices() {
        let random = &mut Random::new(7);
        for kind in 0..128 {
            for _ in 0..20 {
                let (view, projection, clip) = matrices(random, kind);
                let host = HostCamera::new(&of(view, projection), clip, SIZE).unwrap();
                for _ in 0..20 {
                    let p = 4.0 * vector(random);
                    // Points nearer than near are not compared: their quotients can be arbitrarily large.
                    let seen = host.camera().project(p, SIZE).filter(|[.., depth]| *depth >= host.planes()[0]);
                    let Some([column, row, depth]) = seen else { continue };
                    let one = by_matrices(p, view, projection, clip);
                    let other = [column, row, host.buffer_depth(depth)];
                    for (a, b) in one.iter().zip(&other) {
                        assert!((a - b).abs() < 1e-9 * a.abs().max(1.0), "kind {kind}: {one:?} {other:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn planes_and_clear_values_are_the_projections() {
        let random = &mut Random::new(3);
        for kind in 0..64 {
            let (view, projection, clip) = matrices(random, kind);
            let host = HostCamera::new(&of(view, projection), clip, SIZE).unwrap();
            let [near, far] = host.planes();
            assert!((0.05..=0.15).contains(&near), "kind {kind}: {near}");
            let infinite = kind >> 4 & 1 == 1 && kind >> 5 & 1 == 0;
            assert!(if infinite { far > 1e12 } else { (49.0..=51.0).contains(&far) }, "kind {kind}: {far}");
            assert_eq!(host.depth().clear, if clip.reversed_z { 0.0 } else { 1.0 }, "kind {kind}");
            assert!((host.buffer_depth(near) - if clip.reversed_z { 1.0 } else { 0.0 }).abs() < 1e-9, "kind {kind}");
        }
    }

    #[test]
    fn what_no_camera_can_be_is_named() {
        let (view, projection, clip) = matrices(&mut Random::new(1), 0);
        let made = |change: &dyn Fn(&mut DMat4, &mut DMat4)| {
            let (mut view, mut projection) = (view, projection);
            change(&mut view, &mut projection);
            HostCamera::new(&of(view, projection), clip, SIZE).map_or_else(|e| e.to_string(), |_| "fine".into())
        };
        assert_eq!(made(&|_, _| {}), "fine");
        assert!(made(&|v, _| v.x_axis.w = 0.1).contains("view matrix, last row"));
        assert!(made(&|_, p| p.y_axis.x = 0.1).contains("no skew"));
        assert!(made(&|_, p| p.x_axis.x = 0.0).contains("no skew"));
        assert!(made(&|_, p| p.x_axis.w = 0.1).contains("projection matrix, last row"));
        assert!(made(&|_, p| p.w_axis.w = 0.1).contains("projection matrix, last row"));
        assert!(made(&|_, p| p.x_axis.z = 0.1).contains("oblique"));
        assert!(made(&|_, p| p.w_axis.z = 0.0).contains("depth must change"));
        assert!(made(&|_, p| p.x_axis.x = f64::NAN).contains("finite"));
        let (view, mut projection, clip) = matrices(&mut Random::new(1), 32);
        projection.z_axis.x = 0.1;
        assert!(HostCamera::new(&of(view, projection), clip, SIZE).is_err());
    }
}
