//! Upstream gradients from arrays, and gradients as arrays.

use crate::arrays;
use crate::exceptions::bad_input;
use numpy::{PyArray1, PyArrayMethods};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use softras::GradientRequest;
use softras::scene::Appearance;

/// The images, with their channels; `None` for as many as the meshes have.
pub const IMAGES: [(&str, Option<usize>); 5] =
    [("color", Some(3)), ("silhouette", Some(1)), ("depth", Some(1)), ("normal", Some(3)), ("features", None)];

/// The keyword arguments of upstream gradients, in the order of the images, each read with its name and channels.
pub fn upstream<T>(
    given: Option<&Bound<'_, PyDict>>,
    read: impl Fn(&Bound<'_, PyAny>, &str, Option<usize>) -> PyResult<T>,
) -> PyResult<[Option<T>; 5]> {
    let mut all = [None, None, None, None, None];
    for (name, value) in given.iter().flat_map(|given| given.iter()).filter(|(_, value)| !value.is_none()) {
        let name: String = name.extract()?;
        let Some(at) = IMAGES.iter().position(|(known, _)| *known == name) else {
            let fix = "use color, silhouette, depth, normal and features";
            return Err(bad_input(format!("an upstream gradient of {name:?}"), fix));
        };
        all[at] = Some(read(&value, &name, IMAGES[at].1)?);
    }
    Ok(all)
}

/// The sizes of a mesh that its gradients' arrays have too.
pub struct Shapes {
    triangles: usize,
    channels: usize,
    uniform: bool,
    cells: usize,
    textures: Vec<[usize; 2]>,
}

impl Shapes {
    pub fn of(mesh: &softras::Mesh) -> Self {
        let appearance = mesh.appearance();
        let cells = if let Appearance::Surface { resolution, .. } = appearance { resolution.pow(2) } else { 0 };
        let textures = match appearance {
            Appearance::Textured { textures, .. } => {
                textures.iter().map(|t| [t.height() as usize, t.width() as usize]).collect()
            }
            _ => Vec::new(),
        };
        let uniform = matches!(appearance, Appearance::Uniform(_));
        let (triangles, channels) = (mesh.triangles().len(), mesh.feature_channels() as usize);
        Self { triangles, channels, uniform, cells: cells as usize, textures }
    }
}

/// dL by the arrays of one mesh; `None` for what was not asked for or the mesh does not have.
#[pyclass(module = "softras", frozen, get_all)]
pub struct MeshGradients {
    pub positions: Option<Py<PyAny>>,
    pub colors: Option<Py<PyAny>>,
    pub features: Option<Py<PyAny>>,
    pub surface: Option<Py<PyAny>>,
    pub textures: Option<Vec<Py<PyAny>>>,
    pub alphas: Option<Vec<Option<Py<PyAny>>>>,
    pub uvs: Option<Py<PyAny>>,
}

/// All gradients of a loss.
#[pyclass(module = "softras", frozen, get_all)]
pub struct Gradients {
    pub meshes: Vec<Py<MeshGradients>>,
    pub twists: Option<Py<PyAny>>,
    pub projections: Option<Py<PyAny>>,
    pub ambient_color: Option<Py<PyAny>>,
    pub ambient_intensity: Option<f64>,
    pub light_directions: Option<Py<PyAny>>,
    pub light_colors: Option<Py<PyAny>>,
    pub light_intensities: Option<Py<PyAny>>,
    pub background: Option<Py<PyAny>>,
    pub epsilon: Option<f64>,
    pub sigma: Option<f64>,
    pub gamma: Option<f64>,
}

/// Rows as an array, unless there are none.
fn rows<const N: usize>(py: Python<'_>, rows: Vec<[f32; N]>) -> PyResult<Option<Py<PyAny>>> {
    if rows.is_empty() { Ok(None) } else { arrays::array(py, rows)?.into_py_any(py).map(Some) }
}

fn mesh(py: Python<'_>, found: softras::MeshGradients, shapes: &Shapes) -> PyResult<MeshGradients> {
    let colors = match found.colors[..] {
        [color] if shapes.uniform => Some(PyArray1::from_slice(py, &color).into_py_any(py)?),
        _ => rows(py, found.colors)?,
    };
    let surface = match found.surface_texels {
        texels if texels.is_empty() => None,
        texels => {
            let flat = PyArray1::from_vec(py, texels.into_flattened());
            Some(flat.reshape([shapes.triangles, shapes.cells, 3])?.into_py_any(py)?)
        }
    };
    let features = match found.features {
        features if features.is_empty() => None,
        features => {
            let vertices = features.len() / shapes.channels;
            Some(PyArray1::from_vec(py, features).reshape([vertices, shapes.channels])?.into_py_any(py)?)
        }
    };
    let textures = found.texture_texels.into_iter().zip(&shapes.textures).map(|(texels, [height, width])| {
        PyArray1::from_vec(py, texels.into_flattened()).reshape([*height, *width, 3])?.into_py_any(py)
    });
    let alphas = found.texture_alphas.into_iter().zip(&shapes.textures).map(|(alpha, side)| match alpha {
        alpha if alpha.is_empty() => Ok(None),
        alpha => PyArray1::from_vec(py, alpha).reshape(*side)?.into_py_any(py).map(Some),
    });
    let textures = textures.collect::<PyResult<Vec<_>>>()?;
    let alphas = alphas.collect::<PyResult<Vec<_>>>()?;
    Ok(MeshGradients {
        positions: rows(py, found.positions)?,
        colors,
        features,
        surface,
        textures: Some(textures).filter(|all| !all.is_empty()),
        alphas: Some(alphas).filter(|all| all.iter().any(Option::is_some)),
        uvs: rows(py, found.uvs)?,
    })
}

impl Gradients {
    /// The library's gradients as arrays.
    pub fn new(
        py: Python<'_>,
        found: softras::Gradients,
        shapes: &[Shapes],
        wanted: &GradientRequest,
    ) -> PyResult<Self> {
        let one = |(found, shapes)| Py::new(py, mesh(py, found, shapes)?);
        let meshes = found.meshes.into_iter().zip(shapes).map(one).collect::<PyResult<_>>()?;
        let array = |rows: Vec<[f64; 3]>| arrays::array(py, rows)?.into_py_any(py);
        let (mut twists, mut projections) = (None, None);
        if wanted.camera {
            twists = Some(arrays::array(py, found.cameras.iter().map(|c| c.twist).collect())?.into_py_any(py)?);
            projections =
                Some(arrays::array(py, found.cameras.iter().map(|c| c.projection).collect())?.into_py_any(py)?);
        }
        let mut all = Self {
            meshes,
            twists,
            projections,
            ambient_color: None,
            ambient_intensity: None,
            light_directions: None,
            light_colors: None,
            light_intensities: None,
            background: None,
            epsilon: wanted.background.then_some(found.epsilon),
            sigma: wanted.scalars.then_some(found.sigma),
            gamma: wanted.scalars.then_some(found.gamma),
        };
        if wanted.background {
            all.background = Some(PyArray1::from_slice(py, &found.background_color).into_py_any(py)?);
        }
        if let Some(lights) = found.lights {
            all.ambient_color = Some(PyArray1::from_slice(py, &lights.ambient_color).into_py_any(py)?);
            all.ambient_intensity = Some(lights.ambient_intensity);
            all.light_directions = Some(array(lights.directional.iter().map(|light| light.0).collect())?);
            all.light_colors = Some(array(lights.directional.iter().map(|light| light.1).collect())?);
            let intensities = lights.directional.iter().map(|light| light.2).collect();
            all.light_intensities = Some(PyArray1::from_vec(py, intensities).into_py_any(py)?);
        }
        Ok(all)
    }
}

/// The names of what is there.
fn names(present: &[(&str, bool)]) -> String {
    present.iter().filter(|(_, present)| *present).map(|(name, _)| format!(", {name}")).collect()
}

#[pymethods]
impl MeshGradients {
    fn __repr__(&self) -> String {
        let names = names(&[
            ("positions", self.positions.is_some()),
            ("colors", self.colors.is_some()),
            ("features", self.features.is_some()),
            ("surface", self.surface.is_some()),
            ("textures", self.textures.is_some()),
            ("alphas", self.alphas.is_some()),
            ("uvs", self.uvs.is_some()),
        ]);
        format!("softras.MeshGradients({})", names.trim_start_matches(", "))
    }
}

#[pymethods]
impl Gradients {
    fn __repr__(&self) -> String {
        let names = names(&[
            ("cameras", self.twists.is_some()),
            ("lights", self.ambient_color.is_some()),
            ("background", self.background.is_some()),
            ("scalars", self.sigma.is_some()),
        ]);
        format!("softras.Gradients({} meshes{names})", self.meshes.len())
    }
}
