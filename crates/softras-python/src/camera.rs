//! Cameras.

use crate::arrays::{matrix, vector};
use crate::exceptions::{Raise, bad_input, exception};
use numpy::PyArray2;
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use softras::Projection;
use softras::embed::{CameraMatrices, ClipSpace, HostCamera};
use softras::glam::{DMat3, DMat4, DVec3};

/// A view transform and a projection.
#[pyclass(module = "softras", frozen, from_py_object)]
#[derive(Clone)]
pub struct Camera {
    pub camera: softras::Camera,
}

/// The projection that exactly one of the arguments gives.
fn projection(fov_y: Option<f64>, half_height: Option<f64>, pinhole: Option<[f64; 4]>) -> PyResult<Projection> {
    match (fov_y, half_height, pinhole) {
        (Some(fov_y), None, None) => Ok(Projection::Perspective { fov_y }),
        (None, Some(half_height), None) => Ok(Projection::Orthographic { half_height }),
        (None, None, Some([fx, fy, cx, cy])) => Ok(Projection::Pinhole { fx, fy, cx, cy }),
        _ => Err(bad_input(
            "a camera needs one projection",
            "give exactly one of fov_y (radians), half_height (world units) and pinhole ((fx, fy, cx, cy) in pixels)",
        )),
    }
}

fn point(value: &Bound<'_, PyAny>, name: &str) -> PyResult<DVec3> {
    vector::<3>(value, name).map(DVec3::from_array)
}

/// A world-to-view matrix, with or without its last row.
fn affine(view: &Bound<'_, PyAny>) -> PyResult<DMat4> {
    let rows = match matrix::<3, 4>(view, "view") {
        Ok([x, y, z]) => [x, y, z, [0.0, 0.0, 0.0, 1.0]],
        Err(_) => matrix::<4, 4>(view, "view")?,
    };
    Ok(DMat4::from_cols_array_2d(&rows).transpose())
}

/// A rotation, and a translation after it.
fn rigid([x, y, z]: [[f64; 3]; 3], [a, b, c]: [f64; 3]) -> DMat4 {
    let rows = [[x[0], x[1], x[2], a], [y[0], y[1], y[2], b], [z[0], z[1], z[2], c], [0.0, 0.0, 0.0, 1.0]];
    DMat4::from_cols_array_2d(&rows).transpose()
}

fn flipped(axes: [f64; 3]) -> DMat4 {
    DMat4::from_scale(DVec3::from_array(axes))
}

/// Refuses a view matrix that mirrors: one of a determinant above 0.
fn unmirrored(view: DMat4) -> PyResult<DMat4> {
    if DMat3::from_mat4(view).determinant() <= 0.0 {
        return Ok(view);
    }
    Err(exception(
        "CameraError",
        "the view matrix mirrors: its y points down, or its z backward, or its rotation is a reflection: \
         use from_opencv, from_opengl or from_pytorch3d for their matrices, or say mirrored=True to from_matrix",
    ))
}

impl Camera {
    fn of(view: DMat4, projection: Projection) -> PyResult<Self> {
        Ok(Self { camera: softras::Camera::from_matrix(view, projection).raise()? })
    }
}

#[pymethods]
impl Camera {
    /// Looks from `eye` at `target`, world units; `up` is (0, 1, 0) unless given, and along the view it is refused.
    ///
    /// Exactly one projection: `fov_y`, the full vertical angle in radians; `half_height`, world units from the image's
    /// centre to its upper border; or `pinhole`, (fx, fy, cx, cy) in pixels, where the centre of the upper left pixel is
    /// (0.5, 0.5). Raises CameraError.
    #[staticmethod]
    #[pyo3(signature = (eye, target, up = None, *, fov_y = None, half_height = None, pinhole = None))]
    fn look_at(
        eye: &Bound<'_, PyAny>,
        target: &Bound<'_, PyAny>,
        up: Option<&Bound<'_, PyAny>>,
        fov_y: Option<f64>,
        half_height: Option<f64>,
        pinhole: Option<[f64; 4]>,
    ) -> PyResult<Self> {
        let up = up.map_or(Ok(DVec3::Y), |up| point(up, "up"))?;
        let projection = projection(fov_y, half_height, pinhole)?;
        let camera = softras::Camera::look_at(point(eye, "eye")?, point(target, "target")?, up, projection).raise()?;
        Ok(Self { camera })
    }

    /// Looks at the origin from eye = d (cos e sin a, sin e, -cos e cos a), angles in degrees, straight up and down too.
    ///
    /// One projection as for `look_at`. Raises CameraError.
    #[staticmethod]
    #[pyo3(signature = (distance, elevation, azimuth, *, fov_y = None, half_height = None, pinhole = None))]
    fn from_angles(
        distance: f64,
        elevation: f64,
        azimuth: f64,
        fov_y: Option<f64>,
        half_height: Option<f64>,
        pinhole: Option<[f64; 4]>,
    ) -> PyResult<Self> {
        let projection = projection(fov_y, half_height, pinhole)?;
        Ok(Self { camera: softras::Camera::from_angles(distance, elevation, azimuth, projection).raise()? })
    }

    /// A [4, 4] or [3, 4] world-to-view matrix; view space has x right, y up and z **forward**, so that its determinant is
    /// negative unless `mirrored`.
    ///
    /// One projection as for `look_at`. With `mirrored` the determinant is positive and images are mirrored. Raises CameraError for
    /// a matrix of another convention, and for one that is not a rotation and a translation.
    #[staticmethod]
    #[pyo3(signature = (view, *, fov_y = None, half_height = None, pinhole = None, mirrored = false))]
    fn from_matrix(
        view: &Bound<'_, PyAny>,
        fov_y: Option<f64>,
        half_height: Option<f64>,
        pinhole: Option<[f64; 4]>,
        mirrored: bool,
    ) -> PyResult<Self> {
        let view = affine(view)?;
        Self::of(if mirrored { view } else { unmirrored(view)? }, projection(fov_y, half_height, pinhole)?)
    }

    /// OpenCV's camera: the intrinsic matrix [3, 3] in pixels of the image that is rendered, the rotation [3, 3] and translation [3]
    /// from the world to a view with y down. OpenCV counts from the centre of the first pixel, COLMAP from its corner: subtract 0.5
    /// from COLMAP's cx and cy. Raises CameraError; InputError for skew.
    #[staticmethod]
    #[pyo3(signature = (intrinsics, rotation, translation))]
    fn from_opencv(
        intrinsics: &Bound<'_, PyAny>,
        rotation: &Bound<'_, PyAny>,
        translation: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let k = matrix::<3, 3>(intrinsics, "intrinsics")?;
        if k[0][1] != 0.0 || k[1][0] != 0.0 || k[2] != [0.0, 0.0, 1.0] {
            return Err(bad_input("the intrinsic matrix has skew", "use [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]"));
        }
        let view = rigid(matrix(rotation, "rotation")?, vector(translation, "translation")?);
        let (fx, fy, cx, cy) = (k[0][0], k[1][1], k[0][2] + 0.5, k[1][2] + 0.5);
        Self::of(unmirrored(flipped([1.0, -1.0, 1.0]) * view)?, Projection::Pinhole { fx, fy, cx, cy })
    }

    /// OpenGL's camera: the view matrix [4, 4], whose z points backward, the projection matrix [4, 4], both for column vectors, and
    /// (width, height) of the image that is rendered. Raises CameraError.
    #[staticmethod]
    #[pyo3(signature = (view, projection, size))]
    fn from_opengl(view: &Bound<'_, PyAny>, projection: &Bound<'_, PyAny>, size: (u32, u32)) -> PyResult<Self> {
        let clip = ClipSpace { y_up: true, symmetric_z: true, reversed_z: false };
        let projection = DMat4::from_cols_array_2d(&matrix::<4, 4>(projection, "projection")?).transpose();
        let view = affine(view)?;
        unmirrored(flipped([1.0, 1.0, -1.0]) * view)?;
        let matrices = CameraMatrices { view: view.to_cols_array_2d(), projection: projection.to_cols_array_2d() };
        Ok(Self { camera: *HostCamera::new(&matrices, clip, size).raise()?.camera() })
    }

    /// PyTorch3D's camera: R [3, 3] and T [3] of its cameras, which take row vectors to a view with x to the left.
    ///
    /// One projection as for `look_at`: `fov_y` is FoVPerspectiveCameras' fov in radians where the image is not higher than
    /// wide. Raises CameraError.
    #[staticmethod]
    #[pyo3(signature = (R, T, *, fov_y = None, half_height = None, pinhole = None))]
    #[expect(non_snake_case, reason = "PyTorch3D's names")]
    fn from_pytorch3d(
        R: &Bound<'_, PyAny>,
        T: &Bound<'_, PyAny>,
        fov_y: Option<f64>,
        half_height: Option<f64>,
        pinhole: Option<[f64; 4]>,
    ) -> PyResult<Self> {
        let rows = matrix::<3, 3>(R, "R")?;
        let columns = std::array::from_fn(|i| std::array::from_fn(|j| rows[j][i]));
        let view = rigid(columns, vector(T, "T")?);
        Self::of(unmirrored(flipped([-1.0, 1.0, 1.0]) * view)?, projection(fov_y, half_height, pinhole)?)
    }

    /// The official renderer's projection camera: a [3, 4] matrix, distortion (k1, k2, p1, p2, k3), and the side of its
    /// image in pixels. Raises CameraError.
    #[staticmethod]
    #[pyo3(signature = (matrix, distortion = [0.0; 5], original_size = 512.0))]
    fn official(matrix: &Bound<'_, PyAny>, distortion: [f64; 5], original_size: f64) -> PyResult<Self> {
        let rows = crate::arrays::matrix::<3, 4>(matrix, "matrix")?;
        Ok(Self { camera: softras::Camera::official(rows, distortion, original_size).raise()? })
    }

    /// For meshes whose vertices are screen x, y (half the image's height each) and view depth z already.
    #[staticmethod]
    fn screen() -> Self {
        Self { camera: softras::Camera::screen() }
    }

    /// The world-to-view transform, [3, 4] float64.
    #[getter]
    fn view<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        crate::arrays::array(py, self.camera.view().to_vec())
    }

    /// The projection's fields by name; none for screen cameras.
    #[getter]
    fn projection<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let named = PyDict::new(py);
        match *self.camera.projection() {
            Projection::Perspective { fov_y } => named.set_item("fov_y", fov_y)?,
            Projection::Orthographic { half_height } => named.set_item("half_height", half_height)?,
            Projection::Pinhole { fx, fy, cx, cy } => named.set_item("pinhole", (fx, fy, cx, cy))?,
            Projection::Official { distortion, original_size } => {
                named.set_item("distortion", distortion.to_vec())?;
                named.set_item("original_size", original_size)?;
            }
            Projection::Screen => {}
        }
        Ok(named)
    }

    fn __repr__(&self) -> String {
        let [x, y, z] = self.camera.view().map(|row| row.map(|x| (1e6 * x).round() / 1e6));
        format!("softras.Camera(view=[{x:?}, {y:?}, {z:?}], {:?})", self.camera.projection())
    }

    /// The camera with this view and these fields of a projection, as another camera has them.
    #[staticmethod]
    fn _restored(view: &Bound<'_, PyAny>, fields: &Bound<'_, PyDict>) -> PyResult<Self> {
        let number = |name: &str| fields.get_item(name)?.map(|value| value.extract::<f64>()).transpose();
        let pinhole = fields.get_item("pinhole")?.map(|value| value.extract()).transpose()?;
        let projection = match number("original_size")? {
            _ if fields.is_empty() => Projection::Screen,
            None => projection(number("fov_y")?, number("half_height")?, pinhole)?,
            Some(original_size) => {
                Projection::Official { distortion: fields.as_any().get_item("distortion")?.extract()?, original_size }
            }
        };
        Ok(Self { camera: softras::Camera::from_affine(affine(view)?, projection).raise()? })
    }

    fn __reduce__(&self, py: Python<'_>) -> PyResult<(Py<PyAny>, Py<PyAny>)> {
        let rebuild = py.get_type::<Self>().getattr("_restored")?;
        Ok((rebuild.unbind(), (self.view(py)?, self.projection(py)?).into_py_any(py)?))
    }
}
