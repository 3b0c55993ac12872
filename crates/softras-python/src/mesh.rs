//! Meshes on numpy arrays, and mesh files.

use crate::arrays::{self, floats, rows, triangles};
use crate::exceptions::{Raise, bad_input};
use crate::settings::chosen;
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use softras::scene::{Appearance, Texture, Wrap};
use softras_io::{LoadOptions, SaveOptions};
use std::path::PathBuf;

/// A triangle mesh with its appearance.
#[pyclass(module = "softras", frozen, from_py_object)]
#[derive(Clone)]
pub struct Mesh {
    pub mesh: softras::Mesh,
    notes: Vec<String>,
}

/// The arguments that say how a mesh looks.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Look<'py> {
    colors: Option<Bound<'py, PyAny>>,
    surface: Option<Bound<'py, PyAny>>,
    uvs: Option<Bound<'py, PyAny>>,
    uv_triangles: Option<Bound<'py, PyAny>>,
    textures: Option<Bound<'py, PyAny>>,
    texture_of_triangle: Option<Bound<'py, PyAny>>,
    wrap: Option<Bound<'py, PyAny>>,
}

/// The parts of a textured appearance: UVs, their triangles, the textures, and which one each triangle shows.
type Textured = (Vec<[f32; 2]>, Vec<[u32; 3]>, Vec<Texture>, Vec<u32>);

impl From<softras::Mesh> for Mesh {
    fn from(mesh: softras::Mesh) -> Self {
        Self { mesh, notes: Vec::new() }
    }
}

/// One colour for the mesh or one for each vertex.
fn colors(value: &Bound<'_, PyAny>, means: &str) -> PyResult<Appearance> {
    let array = floats(value, "colors", means)?;
    match (array.shape(), array.as_slice()?) {
        ([3], &[r, g, b]) => Ok(Appearance::Uniform([r, g, b])),
        ([_, 3], flat) => Ok(Appearance::VertexColors(flat.as_chunks::<3>().0.to_vec())),
        (shape, _) => Err(bad_input(format!("colors has shape {shape:?}"), "give [3] or [vertices, 3]")),
    }
}

/// Surface colours `[T, R², 3]`, R cells along each edge of a triangle.
fn surface(value: &Bound<'_, PyAny>, means: &str) -> PyResult<Appearance> {
    let array = floats(value, "surface", means)?;
    let resolution = match array.shape() {
        [_, cells, 3] => (1..=1024u32).find(|r| (*r as usize).pow(2) == *cells),
        _ => None,
    };
    let Some(resolution) = resolution else {
        let fix = "give [triangles, R², 3] with R cells along an edge, 1 to 1024";
        return Err(bad_input(format!("surface has shape {:?}", array.shape()), fix));
    };
    Ok(Appearance::Surface { resolution, texels: array.as_slice()?.as_chunks::<3>().0.to_vec() })
}

/// A texture of `[height, width, 3]`, or 4 with alpha.
fn texture(value: &Bound<'_, PyAny>, means: &str) -> PyResult<Texture> {
    let array = floats(value, "texture", means)?;
    let side = |side: usize| u32::try_from(side).unwrap_or(u32::MAX);
    match *array.shape() {
        [height, width, 3] => {
            let texels = array.as_slice()?.as_chunks::<3>().0.to_vec();
            Texture::new(side(width), side(height), texels, Wrap::Repeat).raise()
        }
        [height, width, 4] => {
            let texels = array.as_slice()?.as_chunks::<4>().0;
            let (rgb, alpha) = texels.iter().map(|&[r, g, b, a]| ([r, g, b], a)).unzip();
            let made = Texture::new(side(width), side(height), rgb, Wrap::Repeat);
            made.and_then(|texture| texture.with_alpha(alpha)).raise()
        }
        _ => {
            let fix = "give [height, width, 3], or 4 with alpha";
            Err(bad_input(format!("a texture has shape {:?}", array.shape()), fix))
        }
    }
}

/// Textures from one array or several.
fn textures(value: &Bound<'_, PyAny>, means: &str) -> PyResult<Vec<Texture>> {
    let is_array = value.hasattr("ndim")? && value.getattr("ndim")?.extract::<usize>()? == 3;
    if is_array || value.hasattr("getbands")? {
        return Ok(vec![texture(value, means)?]);
    }
    value.try_iter()?.map(|one| texture(&one?, means)).collect()
}

const WRAPS: [(&str, Wrap); 2] = [("repeat", Wrap::Repeat), ("clamp", Wrap::Clamp)];

/// The wrap of each texture, from one name for all or a list of names.
fn wraps(value: &Bound<'_, PyAny>, count: usize) -> PyResult<Vec<Wrap>> {
    let names = match value.extract::<String>() {
        Ok(name) => vec![name; count],
        Err(_) => value.extract::<Vec<String>>().map_err(|_| bad_input("wrap is no name", "give repeat or clamp"))?,
    };
    if names.len() != count {
        return Err(bad_input(
            format!("wrap has {} names for {count} textures", names.len()),
            "give one for each, or one",
        ));
    }
    names.iter().map(|name| chosen("wrap", name, &WRAPS)).collect()
}

impl Look<'_> {
    /// The appearance that the arguments describe; `None` where none is given. A textured mesh `own` supplies missing textures or UVs.
    fn appearance(&self, faces: &[[u32; 3]], own: Option<&softras::Mesh>, light: &str) -> PyResult<Option<Appearance>> {
        match (&self.colors, &self.surface, &self.textures, &self.uvs) {
            (None, None, None, None) => Ok(None),
            (Some(value), None, None, None) => colors(value, light).map(Some),
            (None, Some(value), None, None) => surface(value, light).map(Some),
            (None, None, _, _) => self.textured(faces, own, light).map(Some),
            _ => Err(bad_input(
                "a mesh has one appearance",
                "give colors, or surface, or textures with uvs, and not several of them",
            )),
        }
    }

    fn textured(&self, faces: &[[u32; 3]], own: Option<&softras::Mesh>, light: &str) -> PyResult<Appearance> {
        let own: Option<Textured> = match own.map(softras::Mesh::appearance) {
            Some(Appearance::Textured { uvs, uv_triangles, textures, texture_of_triangle }) => {
                Some((uvs.clone(), uv_triangles.clone(), textures.clone(), texture_of_triangle.clone()))
            }
            _ => None,
        };
        let (uvs, uv_triangles, images, of_triangle) =
            own.unwrap_or((Vec::new(), faces.to_vec(), Vec::new(), Vec::new()));
        let wrap_of_own = images.iter().map(Texture::wrap).collect();
        let images = match &self.textures {
            Some(given) => textures(given, if light == "light" { "texture" } else { light })?,
            None => images,
        };
        let of_each: Vec<Wrap> = match &self.wrap {
            Some(given) => wraps(given, images.len())?,
            None => wrap_of_own,
        };
        if images.is_empty() || (self.uvs.is_none() && uvs.is_empty()) {
            return Err(bad_input("textures without uvs, or uvs without textures", "give both"));
        }
        let wrapped = |(i, image): (usize, Texture)| image.with_wrap(of_each.get(i).copied().unwrap_or_default());
        Ok(Appearance::Textured {
            uvs: self.uvs.as_ref().map_or(Ok(uvs), |given| rows(given, "uvs"))?,
            uv_triangles: self
                .uv_triangles
                .as_ref()
                .map_or(Ok(uv_triangles), |given| triangles(given, "uv_triangles"))?,
            textures: images.into_iter().enumerate().map(wrapped).collect(),
            texture_of_triangle: match &self.texture_of_triangle {
                Some(given) => arrays::indices(given, "texture_of_triangle")?.0,
                None => of_triangle,
            },
        })
    }
}

#[pymethods]
impl Mesh {
    /// `positions` [V, 3] in world units (x, y up, z; right-handed), `triangles` [T, 3] integers that count from 0,
    /// counter-clockwise seen from outside.
    ///
    /// One appearance: `colors` [3] or [V, 3]; `surface` [T, R², 3], the official surface cells; or `textures`, one array
    /// [height, width, 3 or 4 with alpha] or several, or Pillow's pictures, with `uvs` [U, 2], `uv_triangles` [T, 3] (the triangles unless
    /// given), `texture_of_triangle` [T] and `wrap`, "repeat" or "clamp", or a list with one for each texture. White without any.
    /// Colours of floats are linear light, of which 1 is white; those of uint8 and uint16 are sRGB and are decoded. Raises MeshError,
    /// InputError.
    #[new]
    #[pyo3(
        signature = (positions, triangles, *, **look),
        text_signature = "(positions, triangles, *, colors=None, surface=None, uvs=None, uv_triangles=None, textures=None, \
                          texture_of_triangle=None, wrap='repeat')"
    )]
    fn new(
        positions: &Bound<'_, PyAny>,
        triangles: &Bound<'_, PyAny>,
        look: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let faces = arrays::triangles(triangles, "triangles")?;
        let mesh = softras::Mesh::new(rows(positions, "positions")?, faces).raise()?;
        Self::from(mesh).looking(look)
    }

    /// [V, 3] float32, a copy.
    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        arrays::array(py, self.mesh.positions().to_vec())
    }

    /// [T, 3] uint32, a copy.
    #[getter]
    fn triangles<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        arrays::array(py, self.mesh.triangles().to_vec())
    }

    /// [3] or [V, 3] float32; None for other appearances.
    #[getter]
    fn colors(&self, py: Python<'_>) -> PyResult<Option<Py<PyAny>>> {
        match self.mesh.appearance() {
            Appearance::Uniform(color) => PyArray1::from_slice(py, color).into_py_any(py).map(Some),
            Appearance::VertexColors(colors) => arrays::array(py, colors.clone())?.into_py_any(py).map(Some),
            _ => Ok(None),
        }
    }

    /// [T, R², 3] float32; None for other appearances.
    #[getter]
    fn surface<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray3<f32>>>> {
        let Appearance::Surface { resolution, texels } = self.mesh.appearance() else { return Ok(None) };
        let shape = [self.mesh.triangles().len(), (*resolution as usize).pow(2), 3];
        PyArray1::from_slice(py, texels.as_flattened()).reshape(shape).map(Some)
    }

    /// [U, 2] float32; None without textures.
    #[getter]
    fn uvs<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f32>>>> {
        let Appearance::Textured { uvs, .. } = self.mesh.appearance() else { return Ok(None) };
        arrays::array(py, uvs.clone()).map(Some)
    }

    /// [T, 3] uint32; None without textures.
    #[getter]
    fn uv_triangles<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<u32>>>> {
        let Appearance::Textured { uv_triangles, .. } = self.mesh.appearance() else { return Ok(None) };
        arrays::array(py, uv_triangles.clone()).map(Some)
    }

    /// [height, width, 3 or 4] float32 each, row 0 at the top; None without textures.
    #[getter]
    fn textures<'py>(&self, py: Python<'py>) -> PyResult<Option<Vec<Bound<'py, PyArray3<f32>>>>> {
        let Appearance::Textured { textures, .. } = self.mesh.appearance() else { return Ok(None) };
        let one = |texture: &Texture| {
            let (height, width) = (texture.height() as usize, texture.width() as usize);
            match texture.alpha() {
                None => PyArray1::from_slice(py, texture.texels().as_flattened()).reshape([height, width, 3]),
                Some(alpha) => {
                    let texels = texture.texels().iter().zip(alpha).flat_map(|(&[r, g, b], &a)| [r, g, b, a]);
                    PyArray1::from_vec(py, texels.collect()).reshape([height, width, 4])
                }
            }
        };
        textures.iter().map(one).collect::<PyResult<_>>().map(Some)
    }

    /// [T] uint32, empty for one texture; None without textures.
    #[getter]
    fn texture_of_triangle<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<u32>>> {
        let Appearance::Textured { texture_of_triangle, .. } = self.mesh.appearance() else { return None };
        Some(PyArray1::from_slice(py, texture_of_triangle))
    }

    /// The vertices' own normals, [V, 3] float32 unit vectors, 0 where the triangles decide; None where they do everywhere.
    #[getter]
    fn normals<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f32>>>> {
        let normals = self.mesh.normals();
        (!normals.is_empty()).then(|| arrays::array(py, normals.to_vec())).transpose()
    }

    /// The mode of textures outside the unit square, "repeat" or "clamp": a list with one for each texture where they differ.
    #[getter]
    fn wrap(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let name = |texture: &Texture| if texture.wrap() == Wrap::Clamp { "clamp" } else { "repeat" };
        let Appearance::Textured { textures, .. } = self.mesh.appearance() else { return "repeat".into_py_any(py) };
        let names: Vec<_> = textures.iter().map(name).collect();
        if names.iter().all(|name| *name == names[0]) { names[0].into_py_any(py) } else { names.into_py_any(py) }
    }

    /// Notes on parts of the file that are not in the mesh, each with its line.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }

    /// The lowest and highest corner of the box around the vertices in use; None without any.
    #[getter]
    fn bounds(&self) -> Option<([f32; 3], [f32; 3])> {
        self.mesh.bounds()
    }

    /// This mesh with normals [V, 3] of any length, which smooth shading takes in place of the mean of the triangles'; 0
    /// stands for that mean, and None for no normals. They are constants: gradients do not go through them, and other
    /// positions drop them. Raises MeshError.
    fn with_normals(&self, normals: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let normals = normals.map_or(Ok(Vec::new()), |normals| rows(normals, "normals"))?;
        Ok(Self { mesh: self.mesh.clone().with_normals(normals).raise()?, notes: self.notes.clone() })
    }

    /// [V, N] float32; None without any.
    #[getter]
    fn features<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f32>>>> {
        let shape = [self.mesh.positions().len(), self.mesh.feature_channels() as usize];
        let flat = || PyArray1::from_slice(py, self.mesh.features()).reshape(shape);
        (shape[1] > 0).then(flat).transpose()
    }

    /// This mesh with features [V, N], up to 32 for each vertex and from -1e12 to 1e12, which the output "features" renders as
    /// colours are, but without light; None for no features. Raises MeshError, InputError.
    fn with_features(&self, features: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let (channels, values) = match features {
            Some(given) => {
                let array = floats(given, "features", "number")?;
                match *array.shape() {
                    [_, channels] => (channels, array.as_slice()?.to_vec()),
                    _ => {
                        let what = format!("features has shape {:?}", array.shape());
                        return Err(bad_input(what, "give [vertices, features]"));
                    }
                }
            }
            None => (0, Vec::new()),
        };
        let channels = u32::try_from(channels).unwrap_or(u32::MAX);
        Ok(Self { mesh: self.mesh.clone().with_features(channels, values).raise()?, notes: self.notes.clone() })
    }

    /// This mesh with other positions, [V, 3], and no normals of its own. Raises MeshError.
    fn with_positions(&self, positions: &Bound<'_, PyAny>) -> PyResult<Self> {
        let mut moved = self.clone();
        moved.mesh.set_positions(rows(positions, "positions")?).raise()?;
        Ok(moved)
    }

    /// This mesh with another appearance; arguments as of the class. Raises MeshError, InputError.
    #[pyo3(
        name = "with_look",
        signature = (**look),
        text_signature = "($self, *, colors=None, surface=None, uvs=None, uv_triangles=None, textures=None, \
                          texture_of_triangle=None, wrap='repeat')"
    )]
    fn looking(&self, look: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        self.dressed(look, None, "light")
    }

    /// As `with_look`; what textures or UVs lack is the mesh's own.
    #[pyo3(signature = (**look))]
    fn _with_part_of_look(&self, look: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        self.dressed(look, Some(&self.mesh), "light")
    }

    /// The mesh that was pickled, whose colours may be brighter than those of arrays.
    #[staticmethod]
    #[pyo3(signature = (positions, triangles, look, normals, notes, features = None))]
    fn _restored(
        positions: &Bound<'_, PyAny>,
        triangles: &Bound<'_, PyAny>,
        look: &Bound<'_, PyDict>,
        normals: Option<&Bound<'_, PyAny>>,
        notes: Vec<String>,
        features: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let faces = arrays::triangles(triangles, "triangles")?;
        let mesh = softras::Mesh::new(rows(positions, "positions")?, faces).raise()?;
        Self { mesh, notes }.dressed(Some(look), None, "number")?.with_normals(normals)?.with_features(features)
    }

    /// Writes a mesh file, .obj with its materials and textures, .ply or .glb, each file whole or not at all; returns their paths.
    /// Colours are encoded from linear light to sRGB, as picture files have them and `load` expects; with srgb=False a number is
    /// written as it is. Raises IoError; MeshError for what the format cannot hold, as surface cells with R > 1; FileError for other
    /// endings.
    #[pyo3(signature = (path, *, srgb = true))]
    fn save(&self, path: PathBuf, srgb: bool) -> PyResult<Vec<PathBuf>> {
        softras_io::save_with(&self.mesh, &path, &SaveOptions { srgb, ..SaveOptions::default() }).raise()
    }

    fn __repr__(&self) -> String {
        let look = match self.mesh.appearance() {
            Appearance::Uniform(color) => format!("one colour {color:?}"),
            Appearance::VertexColors(_) => "vertex colours".into(),
            Appearance::Surface { resolution, .. } => format!("surface cells {resolution}×{resolution}"),
            Appearance::Textured { textures, .. } => {
                let sizes: Vec<_> = textures.iter().map(|t| format!("{}×{}", t.width(), t.height())).collect();
                format!("textures {}", sizes.join(", "))
            }
        };
        let (vertices, triangles) = (self.mesh.positions().len(), self.mesh.triangles().len());
        format!("softras.Mesh({vertices} vertices, {triangles} triangles, {look})")
    }

    fn __reduce__(&self, py: Python<'_>) -> PyResult<(Py<PyAny>, Py<PyAny>)> {
        let look = PyDict::new(py);
        look.set_item("colors", self.colors(py)?)?;
        look.set_item("surface", self.surface(py)?)?;
        look.set_item("uvs", self.uvs(py)?)?;
        look.set_item("uv_triangles", self.uv_triangles(py)?)?;
        look.set_item("textures", self.textures(py)?)?;
        look.set_item("texture_of_triangle", self.texture_of_triangle(py))?;
        look.set_item("wrap", self.wrap(py)?)?;
        let rebuild = py.get_type::<Self>().getattr("_restored")?;
        let given = (self.normals(py)?, self.notes(), self.features(py)?);
        let parts = (self.positions(py)?, self.triangles(py)?, look, given.0, given.1, given.2);
        Ok((rebuild.unbind(), parts.into_py_any(py)?))
    }
}

impl Mesh {
    fn dressed(&self, look: Option<&Bound<'_, PyDict>>, own: Option<&softras::Mesh>, light: &str) -> PyResult<Self> {
        let Some(given) = look else { return Ok(self.clone()) };
        let whole = given.py().import("softras._arrays")?.getattr("look")?.call((), Some(given))?;
        let Some(appearance) = whole.extract::<Look<'_>>()?.appearance(self.mesh.triangles(), own, light)? else {
            return Ok(self.clone());
        };
        let mesh = self.mesh.clone().with_appearance(appearance).raise()?;
        Ok(Self { mesh, notes: self.notes.clone() })
    }
}

/// The meshes of one `Mesh` or a list of them.
pub fn meshes(value: &Bound<'_, PyAny>) -> PyResult<Vec<softras::Mesh>> {
    if let Ok(one) = value.cast::<Mesh>() {
        return Ok(vec![one.get().mesh.clone()]);
    }
    let wrong = || bad_input("meshes are no meshes", "give a softras.Mesh or a list of them");
    let one = |mesh: PyResult<Bound<'_, PyAny>>| match mesh?.cast::<Mesh>() {
        Ok(mesh) => Ok(mesh.get().mesh.clone()),
        Err(_) => Err(wrong()),
    };
    value.try_iter().map_err(|_| wrong())?.map(one).collect()
}

/// Reads a mesh file: .obj with materials and textures, .ply, .stl, .gltf or .glb.
///
/// Colours in sRGB are decoded to linear light; with srgb=False a texel is its value / 255, as in the official code.
/// `allow_outside` allows materials and textures outside the file's folder, `strict` refuses a file of which something
/// is not kept, instead of telling it in `notes`. Raises IoError, FileError.
#[pyfunction]
#[pyo3(signature = (path, *, srgb = true, allow_outside = false, strict = false))]
pub fn load(py: Python<'_>, path: PathBuf, srgb: bool, allow_outside: bool, strict: bool) -> PyResult<Mesh> {
    let options = LoadOptions { srgb, allow_outside, strict, ..LoadOptions::default() };
    let read = || softras_view::alone(softras_io::load_with(&path, &options)?.at_place()?, strict);
    let loaded = py.detach(read).raise()?;
    Ok(Mesh { mesh: loaded.mesh, notes: loaded.notes })
}

/// A built-in mesh by its name and numbers; `softras.shapes` gives them names.
#[pyfunction]
pub fn shape(py: Python<'_>, name: &str, numbers: Vec<f64>) -> PyResult<Mesh> {
    use softras::shapes::{cube, fish, icosphere, torus};
    let made = py.detach(|| match (name, &numbers[..]) {
        ("cube", _) => cube(),
        ("fish", _) => fish(),
        ("torus", &[ring, tube, around, across]) => torus(ring, tube, around as u32, across as u32),
        (_, numbers) => icosphere(numbers.first().map_or(3, |n| *n as u32)),
    });
    made.raise().map(Mesh::from)
}
