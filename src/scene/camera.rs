//! Cameras: a 3×4 view transform into view space, and a projection onto the screen.
//!
//! View space has x right, y up and depth z growing forward. Screen space has y in [-1, 1] up and x in [-a, a] to the
//! right, a = width / height. View space is left-handed and world space right-handed, so the matrix between them has a
//! negative determinant: that of every constructor here does. A view matrix of positive determinant mirrors the image.
//!
//! A view matrix is a rotation and a translation, up to the rounding of single precision and of files. [`Camera::from_affine`] is for
//! what no rotation can say.

use crate::error::{Error, Result};
use glam::{DMat3, DMat4, DVec3, DVec4};

/// From view space to the screen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// x / (z tan(fov_y / 2)), the same for y.
    Perspective {
        /// The full vertical angle of view, radians, in (0, π).
        fov_y: f64,
    },
    /// x / half_height, whatever the depth.
    Orthographic {
        /// World units from the image's centre to its upper border, above 0.
        half_height: f64,
    },
    /// A calibrated camera: column = fx x / z + cx, row = cy - fy y / z, in pixels of the rendered image, where the
    /// centre of the upper left pixel is (0.5, 0.5).
    Pinhole {
        /// Horizontal focal length in pixels, above 0.
        fx: f64,
        /// Vertical focal length in pixels, above 0.
        fy: f64,
        /// Column of the principal point.
        cx: f64,
        /// Row of the principal point.
        cy: f64,
    },
    /// The official renderer's "projection" camera: the 3×4 matrix P (the view transform here) gives (x, y, z);
    /// x' = x / (z + 1e-5), y' alike, then radial and tangential distortion, then 2 (x'' - S/2) / S on both axes.
    Official {
        /// k1, k2, p1, p2, k3.
        distortion: [f64; 5],
        /// S, the side in pixels of the square image that P was made for, above 0.
        original_size: f64,
    },
    /// Vertices are given on the screen already: (x, y) in screen units, z the view depth. A camera with this
    /// projection has no view transform: a matrix that is given for it is ignored.
    Screen,
}

/// A view transform and a projection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    view: [[f64; 4]; 3],
    projection: Projection,
}

fn bad<T>(field: &'static str, value: impl std::fmt::Debug, fix: &str) -> Result<T> {
    Err(Error::Camera { field, value: format!("{value:?}"), fix: fix.into() })
}

/// # Errors
/// [`Error::Camera`] for a view matrix that neither turns nor mirrors alone, which changes lengths or angles.
pub(crate) fn validate_rotation(view: DMat4) -> Result<()> {
    let rotation = DMat3::from_mat4(view);
    if (rotation * rotation.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-3) {
        return Ok(());
    }
    let fix = "give a rotation and a translation, without scale or shear; where a camera looks along its up vector, give another up";
    bad("view", view.transpose().to_cols_array_2d(), fix)
}

impl Camera {
    /// Looks from `eye` at `target`; `up` is world space and need not be perpendicular.
    ///
    /// # Errors
    /// [`Error::Camera`] when a value is not finite, eye and target coincide, or `up` is along the view direction.
    pub fn look_at(eye: DVec3, target: DVec3, up: DVec3, projection: Projection) -> Result<Self> {
        if !target.is_finite() {
            return bad("target", target, "use finite coordinates");
        }
        Self::look_direction(eye, target - eye, up, projection)
    }

    /// Looks from `eye` along `direction`.
    ///
    /// # Errors
    /// As [`Camera::look_at`].
    pub fn look_direction(eye: DVec3, direction: DVec3, up: DVec3, projection: Projection) -> Result<Self> {
        if !eye.is_finite() {
            return bad("eye", eye, "use finite coordinates");
        }
        let (Some(forward), Some(up_unit)) = (direction.try_normalize(), up.try_normalize()) else {
            return bad("direction", (direction, up), "eye and target must differ, up must have a length");
        };
        let Some(right) = forward.cross(up_unit).try_normalize().filter(|_| forward.cross(up_unit).length() > 1e-9)
        else {
            return bad("up", up, "it is along the view direction: give another up");
        };
        let up = right.cross(forward);
        let row = |axis: DVec3| [axis.x, axis.y, axis.z, -axis.dot(eye)];
        Self::from_rows([row(right), row(up), row(forward)], projection)
    }

    /// Looks at the origin from the official renderer's viewpoint: eye = d (cos e sin a, sin e, -cos e cos a).
    ///
    /// Angles in degrees. The image is not mirrored (the official renderer's is). Up is y; straight above and below it is the
    /// direction that y tends to in the image.
    ///
    /// # Errors
    /// [`Error::Camera`] when a value is not finite or the distance is not above 0.
    pub fn from_angles(distance: f64, elevation: f64, azimuth: f64, projection: Projection) -> Result<Self> {
        if !(distance > 0.0 && distance.is_finite() && elevation.is_finite() && azimuth.is_finite()) {
            return bad("distance, elevation, azimuth", (distance, elevation, azimuth), "use finite, distance above 0");
        }
        let (e, a) = (elevation.to_radians(), azimuth.to_radians());
        let outward = DVec3::new(a.sin(), 0.0, -a.cos());
        let eye = distance * (e.cos() * outward + e.sin() * DVec3::Y);
        let up = if e.cos().abs() < 1e-6 { -e.sin().signum() * outward } else { DVec3::Y };
        Self::look_at(eye, DVec3::ZERO, up, projection)
    }

    /// A 4×4 world-to-view matrix (column vectors; view space x right, y up, **z forward**): a rotation and a translation.
    ///
    /// A matrix of positive determinant mirrors the image. OpenGL's views look along -z: negate the third row first; OpenCV's have y
    /// down: negate the second.
    ///
    /// # Errors
    /// [`Error::Camera`] when a value is not finite, the last row is not (0, 0, 0, 1), or the rest is no rotation, mirrored or not: its
    /// rows have length 1 and are perpendicular, both within 1e-3.
    pub fn from_matrix(view: DMat4, projection: Projection) -> Result<Self> {
        validate_rotation(view)?;
        Self::from_affine(view, projection)
    }

    /// As [`Camera::from_matrix`], of any matrix that has an inverse: a calibrated camera's skew shears the first row along the second,
    /// and an orthographic camera whose pixels are not square scales it.
    ///
    /// # Errors
    /// [`Error::Camera`] when a value is not finite, the last row is not (0, 0, 0, 1), or the rest has no inverse.
    pub fn from_affine(view: DMat4, projection: Projection) -> Result<Self> {
        // Matrices that were inverted in 32 bits are off by a rounding.
        if !(view.row(3) - DVec4::W).abs().cmple(DVec4::splat(1e-5)).all() {
            return bad("view", view.row(3), "the last row must be (0, 0, 0, 1); give the projection apart");
        }
        Self::from_rows([0, 1, 2].map(|i| view.row(i).to_array()), projection)
    }

    /// The official renderer's 3×4 matrix P with distortion (k1, k2, p1, p2, k3) and original image size.
    ///
    /// # Errors
    /// [`Error::Camera`] when a value is not finite or the size is not above 0.
    pub fn official(p: [[f64; 4]; 3], distortion: [f64; 5], original_size: f64) -> Result<Self> {
        Self::from_rows(p, Projection::Official { distortion, original_size })
    }

    /// For scenes whose vertices are screen x, y and view depth z already.
    pub fn screen() -> Self {
        Self {
            view: [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
            projection: Projection::Screen,
        }
    }

    fn from_rows(view: [[f64; 4]; 3], projection: Projection) -> Result<Self> {
        if !view.iter().flatten().all(|x| x.abs() <= 1e12) {
            return bad("view", view, "use finite entries within ±1e12");
        }
        // The volume of the rows over that of a box with their lengths.
        let [x, y, z] = view.map(|[x, y, z, _]| DVec3::new(x, y, z).normalize_or_zero());
        if x.cross(y).dot(z).abs() < 1e-9 {
            return bad("view", view, "it has no inverse: its rows must be three different directions");
        }
        let within = |values: &[f64], low: f64| values.iter().all(|x| (low..=1e9).contains(x));
        match projection {
            Projection::Perspective { fov_y } if !(1e-6..std::f64::consts::PI - 1e-6).contains(&fov_y) => {
                bad("fov_y", fov_y, "use radians above 1e-6 and below π")
            }
            Projection::Orthographic { half_height } if !within(&[half_height], 1e-9) => {
                bad("half_height", half_height, "use 1e-9 to 1e9 world units")
            }
            Projection::Pinhole { fx, fy, cx, cy } if !within(&[fx, fy], 1e-6) || !within(&[cx, cy], -1e9) => {
                bad("fx, fy, cx, cy", (fx, fy, cx, cy), "use pixels, focal lengths above 0")
            }
            Projection::Official { distortion, original_size }
                if !within(&[original_size], 1e-6) || !within(&distortion, -1e9) =>
            {
                bad("distortion, original_size", (distortion, original_size), "use finite, size above 0")
            }
            Projection::Screen => Ok(Self::screen()),
            _ => Ok(Self { view, projection }),
        }
    }

    /// World to view: three rows of four.
    pub fn view(&self) -> &[[f64; 4]; 3] {
        &self.view
    }

    /// World to view as a 4×4 matrix, as [`Camera::from_matrix`] takes it.
    pub fn matrix(&self) -> DMat4 {
        let [x, y, z] = self.view;
        DMat4::from_cols_array_2d(&[x, y, z, [0.0, 0.0, 0.0, 1.0]]).transpose()
    }

    /// The camera's right, up and forward direction in world space: the rows of the view without the translation.
    pub fn axes(&self) -> [DVec3; 3] {
        self.view.map(|[x, y, z, _]| DVec3::new(x, y, z))
    }

    /// A world point in view space.
    pub fn to_view(&self, point: DVec3) -> DVec3 {
        DVec3::from_array(self.view.map(|[x, y, z, shift]| x * point.x + y * point.y + z * point.z + shift))
    }

    /// Where a world point lies in an image of `columns` × `rows` pixels: its column, its row and its view depth. `None` if the
    /// point is not before the camera.
    ///
    /// Columns and rows are in pixels. The centre of the upper left pixel is (0.5, 0.5). The place may lie beyond the image.
    pub fn project(&self, point: DVec3, (columns, rows): (u32, u32)) -> Option<[f64; 3]> {
        let point = self.to_view(point);
        let [column, row] = self.place(point, (columns, rows));
        (point.z > 0.0).then_some([column, row, point.z])
    }

    /// The column and row of a point in view space, which may lie behind the camera.
    pub(crate) fn place(&self, DVec3 { x, y, z }: DVec3, (columns, rows): (u32, u32)) -> [f64; 2] {
        // A point of the camera's plane is infinitely far from the image's centre.
        let z = if z == 0.0 { 1e-30 } else { z };
        let (center, half_height) = (f64::from(columns) / 2.0, f64::from(rows) / 2.0);
        let on_screen = |x: f64, y: f64| [center + half_height * x, half_height - half_height * y];
        match self.projection {
            Projection::Perspective { fov_y } => {
                let unit = z * (fov_y / 2.0).tan();
                on_screen(x / unit, y / unit)
            }
            Projection::Orthographic { half_height } => on_screen(x / half_height, y / half_height),
            Projection::Pinhole { fx, fy, cx, cy } => [fx * x / z + cx, cy - fy * y / z],
            Projection::Official { distortion: [k1, k2, p1, p2, k3], original_size } => {
                let (x, y) = (x / (z + 1e-5), y / (z + 1e-5));
                let r2 = x * x + y * y;
                let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
                let distorted_x = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
                let distorted_y = y * radial + 2.0 * p2 * x * y + p1 * (r2 + 2.0 * y * y);
                on_screen(2.0 * distorted_x / original_size - 1.0, 2.0 * distorted_y / original_size - 1.0)
            }
            Projection::Screen => on_screen(x, y),
        }
    }

    /// The focal lengths and the principal point (fx, fy, cx, cy), in pixels, of an image of `columns` × `rows` pixels; `None`
    /// without perspective, and for [`Projection::Official`] and [`Projection::Screen`].
    pub fn intrinsics(&self, (columns, rows): (u32, u32)) -> Option<[f64; 4]> {
        match self.projection {
            Projection::Pinhole { fx, fy, cx, cy } => Some([fx, fy, cx, cy]),
            Projection::Perspective { fov_y } => {
                let f = f64::from(rows) / 2.0 / (fov_y / 2.0).tan();
                Some([f, f, f64::from(columns) / 2.0, f64::from(rows) / 2.0])
            }
            _ => None,
        }
    }

    /// The projection.
    pub fn projection(&self) -> &Projection {
        &self.projection
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    const FOV: Projection = Projection::Perspective { fov_y: 0.5 };

    #[test]
    fn look_at_does_not_mirror() {
        // A viewer on +z looking at the origin has world +x on the right.
        let camera = Camera::look_at(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, FOV).unwrap();
        let v = camera.to_view(DVec3::new(1.0, 2.0, 1.0));
        assert!((v - DVec3::new(1.0, 2.0, 4.0)).length() < 1e-12, "{v}");
    }

    #[test]
    fn angles_give_the_official_eye() {
        let camera = Camera::from_angles(2.732, 30.0, 40.0, FOV).unwrap();
        let eye = DVec3::new(1.52082353, 1.366, -1.81244691);
        assert!(camera.to_view(eye).length() < 1e-7);
        assert!((camera.to_view(DVec3::ZERO).z - 2.732).abs() < 1e-12);
    }

    /// The expected numbers are computed by hand.
    #[test]
    fn points_project_as_documented() {
        let distorted = Projection::Official { distortion: [0.1, 0.2, 0.01, 0.02, 0.3], original_size: 0.8 };
        let cases = [
            (Projection::Perspective { fov_y: 2.0 * 0.5f64.atan() }, 4.0, [40.0, 0.0]),
            (Projection::Orthographic { half_height: 4.0 }, 4.0, [35.0, 10.0]),
            (Projection::Pinhole { fx: 8.0, fy: 12.0, cx: 31.0, cy: 19.0 }, 4.0, [33.0, 13.0]),
            (distorted, 4.0 - 1e-5, [23.81170654296875, 12.8453369140625]),
        ];
        for (projection, depth, [column, row]) in cases {
            let view = DMat4::from_translation(DVec3::new(0.0, 0.0, depth - 1.0));
            let camera = Camera::from_matrix(view, projection).unwrap();
            let found = DVec3::from(camera.project(DVec3::new(1.0, 2.0, 1.0), (60, 40)).unwrap());
            let expected = DVec3::new(column, row, depth);
            assert!((found - expected).length() < 1e-12, "{projection:?}: {found}, not {expected}");
            assert_eq!(camera.project(DVec3::new(0.0, 0.0, -3.5), (60, 40)), None);
        }
        // A point of the screen is seen where it is, whatever view the camera was made with.
        let screen = Camera::look_at(DVec3::Z, DVec3::ZERO, DVec3::Y, Projection::Screen).unwrap();
        assert_eq!(screen, Camera::screen());
        assert_eq!(screen.project(DVec3::new(1.0, 2.0, 1.0), (60, 40)), Some([50.0, -20.0, 1.0]));
    }

    #[test]
    fn impossible_cameras_are_refused() {
        let origin = DVec3::ZERO;
        assert!(Camera::look_at(origin, origin, DVec3::Y, FOV).is_err());
        assert!(Camera::look_at(DVec3::Y, origin, DVec3::Y, FOV).is_err());
        assert!(Camera::from_angles(f64::NAN, 0.0, 0.0, FOV).is_err());
        assert!(Camera::from_angles(1.0, 0.0, 0.0, Projection::Perspective { fov_y: 4.0 }).is_err());
        assert!(
            Camera::official([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [1.0, 1.0, 0.0, 1.0]], [0.0; 5], 8.0)
                .is_err()
        );
    }

    #[test]
    fn a_view_matrix_is_a_rotation() {
        let turn =
            DMat4::from_rotation_translation(glam::DQuat::from_scaled_axis(DVec3::new(1.0, 2.0, 0.5)), DVec3::ONE);
        let scaled = |x, y, z| turn * DMat4::from_scale(DVec3::new(x, y, z));
        let sheared = |by| turn * DMat4::from_cols(DVec4::X, DVec4::new(by, 1.0, 0.0, 0.0), DVec4::Z, DVec4::W);
        // A mirror, and the rounding of single precision and of files.
        for good in [turn, scaled(-1.0, 1.0, 1.0), turn.as_mat4().as_dmat4(), scaled(1.0, 1.0004, 1.0), sheared(5e-4)] {
            assert!(Camera::from_matrix(good, FOV).is_ok(), "{good}");
        }
        let nan = scaled(f64::NAN, 1.0, 1.0);
        for bad in
            [DMat4::ZERO, nan, scaled(1.0, 1.0, 0.0), scaled(2.0, 2.0, 2.0), scaled(1.0, 1.0, 1.01), sheared(0.01)]
        {
            assert!(matches!(Camera::from_matrix(bad, FOV), Err(Error::Camera { field: "view", .. })), "{bad}");
        }
        assert!(
            Camera::from_affine(sheared(0.1), FOV).is_ok() && Camera::from_affine(scaled(1.0, 0.0, 1.0), FOV).is_err()
        );
    }

    #[test]
    fn straight_above_and_below_up_is_where_it_tends_to() {
        for (pole, near) in [(90.0, 89.9999), (-90.0, -89.9999), (270.0, 270.0001)] {
            let [pole, near] = [pole, near].map(|e| Camera::from_angles(3.0, e, 30.0, FOV).unwrap());
            assert!(pole.matrix().abs_diff_eq(near.matrix(), 1e-5), "{pole:?} {near:?}");
        }
    }
}
