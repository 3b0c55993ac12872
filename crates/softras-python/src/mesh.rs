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
    wrap: String,
}

impl From<softras::Mesh> for Mesh {
    fn from(mesh: softras::Mesh) -> Self {
        Self { mesh, notes: Vec::new() }
    }
}

/// One colour for the mesh or one for each vertex.
fn colors(value: &Bound<'_, PyAny>) -> PyResult<Appearance> {
    let array = floats(value, "colors")?;
    match (array.shape(), array.as_slice()?) {
        ([3], &[r, g, b]) => Ok(Appearance::Uniform([r, g, b])),
        ([_, 3], flat) => Ok(Appearance::VertexColors(flat.as_chunks::<3>().0.to_vec())),
        (shape, _) => Err(bad_input(format!("colors has shape {shape:?}"), "give [3] or [vertices, 3]")),
    }
}

/// Cells of each triangle, `[T, R², 3]`.
fn surface(value: &Bound<'_, PyAny>) -> PyResult<Appearance> {
    let array = floats(value, "surface")?;
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

/// A texture of `[height, width, 3]`, or 4 with alpha; of bytes, or Pillow's, it is a picture in sRGB.
fn texture(value: &Bound<'_, PyAny>, wrap: Wrap) -> PyResult<Texture> {
    let value = &value.py().import("softras._rebuild")?.getattr("linear")?.call1((value,))?;
    let array = floats(value, "texture")?;
    let side = |side: usize| u32::try_from(side).unwrap_or(u32::MAX);
    match *array.shape() {
        [height, width, 3] => {
            let texels = array.as_slice()?.as_chunks::<3>().0.to_vec();
            Texture::new(side(width), side(height), texels, wrap).raise()
        }
        [height, width, 4] => {
            let texels = array.as_slice()?.as_chunks::<4>().0;
            let (rgb, alpha) = texels.iter().map(|&[r, g, b, a]| ([r, g, b], a)).unzip();
            Texture::new(side(width), side(height), rgb, wrap).and_then(|t| t.with_alpha(alpha)).raise()
        }
        _ => {
            let fix = "give [height, width, 3], or 4 with alpha";
            Err(bad_input(format!("a texture has shape {:?}", array.shape()), fix))
        }
    }
}

/// Textures from one array or several.
fn textures(value: &Bound<'_, PyAny>, wrap: Wrap) -> PyResult<Vec<Texture>> {
    let is_array = value.hasattr("ndim")? && value.getattr("ndim")?.extract::<usize>()? == 3;
    if is_array || value.hasattr("getbands")? {
        return Ok(vec![texture(value, wrap)?]);
    }
    value.try_iter()?.map(|one| texture(&one?, wrap)).collect()
}

impl Look<'_> {
    /// What the arguments describe; `None` where none is given.
    fn appearance(&self, faces: &[[u32; 3]]) -> PyResult<Option<Appearance>> {
        match (&self.colors, &self.surface, &self.textures) {
            (None, None, None) if self.uvs.is_none() => Ok(None),
            (Some(value), None, None) => colors(value).map(Some),
            (None, Some(value), None) => surface(value).map(Some),
            (None, None, Some(images)) => {
                let Some(uvs) = &self.uvs else {
                    return Err(bad_input("textures without uvs", "give uvs, [UVs, 2]"));
                };
                let of_triangle = self.texture_of_triangle.as_ref();
                let wrap = chosen("wrap", &self.wrap, &[("repeat", Wrap::Repeat), ("clamp", Wrap::Clamp)])?;
                let uv_triangles = self.uv_triangles.as_ref();
                Ok(Some(Appearance::Textured {
                    uvs: rows(uvs, "uvs")?,
                    uv_triangles: uv_triangles.map_or(Ok(faces.to_vec()), |t| triangles(t, "uv_triangles"))?,
                    textures: textures(images, wrap)?,
                    texture_of_triangle: of_triangle
                        .map_or(Ok(Vec::new()), |i| arrays::indices(i, "texture_of_triangle").map(|(i, _)| i))?,
                }))
            }
            _ => Err(bad_input(
                "a mesh has one appearance",
                "give colors, or surface, or textures with uvs, and not several of them",
            )),
        }
    }
}

#[pymethods]
impl Mesh {
    /// `positions` [V, 3] in world units (x, y up, z; right-handed), `triangles` [T, 3] integers that count from 0,
    /// counter-clockwise seen from outside.
    ///
    /// One appearance: `colors` [3] or [V, 3]; `surface` [T, R², 3], the official surface cells; or `textures`, one array
    /// [height, width, 3 or 4 with alpha] or several, linear floats or a picture in sRGB (uint8, or Pillow's), with `uvs` [U, 2], `uv_triangles` [T, 3] (the triangles unless
    /// given), `texture_of_triangle` [T] and `wrap` ("repeat", "clamp"). White without any. Raises MeshError, InputError.
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

    /// What textures show outside the unit square: "repeat" or "clamp".
    #[getter]
    fn wrap(&self) -> &'static str {
        match self.mesh.appearance() {
            Appearance::Textured { textures, .. } if textures.iter().any(|t| t.wrap() == Wrap::Clamp) => "clamp",
            _ => "repeat",
        }
    }

    /// What the file contains and the mesh does not, each with its line.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }

    /// The lowest and highest corner of the box around the vertices in use; None without any.
    #[getter]
    fn bounds(&self) -> Option<([f32; 3], [f32; 3])> {
        self.mesh.bounds()
    }

    /// The same mesh with normals [V, 3] of any length, which smooth shading takes in place of the mean of the triangles'; 0
    /// stands for that mean, and None for no normals. They are constants: gradients do not go through them, and other
    /// positions drop them. OBJ files are written without. Raises MeshError.
    fn with_normals(&self, normals: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let normals = normals.map_or(Ok(Vec::new()), |normals| rows(normals, "normals"))?;
        Ok(Self { mesh: self.mesh.clone().with_normals(normals).raise()?, notes: self.notes.clone() })
    }

    /// The same mesh with other positions, [V, 3], and no normals of its own. Raises MeshError.
    fn with_positions(&self, positions: &Bound<'_, PyAny>) -> PyResult<Self> {
        let mut moved = self.clone();
        moved.mesh.set_positions(rows(positions, "positions")?).raise()?;
        Ok(moved)
    }

    /// The same mesh with another appearance; arguments as of the class. Raises MeshError, InputError.
    #[pyo3(
        name = "with_look",
        signature = (**look),
        text_signature = "($self, *, colors=None, surface=None, uvs=None, uv_triangles=None, textures=None, \
                          texture_of_triangle=None, wrap='repeat')"
    )]
    fn looking(&self, look: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let Some(given) = look else { return Ok(self.clone()) };
        let whole = given.py().import("softras._rebuild")?.getattr("look")?.call((), Some(given))?;
        let Some(appearance) = whole.extract::<Look<'_>>()?.appearance(self.mesh.triangles())? else {
            return Ok(self.clone());
        };
        let mesh = self.mesh.clone().with_appearance(appearance).raise()?;
        Ok(Self { mesh, notes: self.notes.clone() })
    }

    /// Writes a mesh file, .obj with its materials and textures, .ply or .glb, each file whole or not at all; returns their paths.
    /// `srgb` encodes textures from linear numbers; otherwise a texel is its number, and `load` reads an equal mesh of an .obj file.
    /// Raises IoError; MeshError for what the format cannot hold, as surface cells with R > 1; FileError for other endings.
    #[pyo3(signature = (path, *, srgb = false))]
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
        look.set_item("wrap", self.wrap())?;
        let rebuild = py.import("softras._rebuild")?.getattr("mesh")?;
        let parts = (self.positions(py)?, self.triangles(py)?, look, self.normals(py)?);
        Ok((rebuild.unbind(), parts.into_py_any(py)?))
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
/// `srgb` decodes textures to linear colours; otherwise a texel is its value / 255, as in the official code.
/// `allow_outside` allows materials and textures outside the file's folder, `strict` refuses a file of which something
/// is not kept, instead of telling it in `notes`. Raises IoError, FileError.
#[pyfunction]
#[pyo3(signature = (path, *, srgb = false, allow_outside = false, strict = false))]
pub fn load(py: Python<'_>, path: PathBuf, srgb: bool, allow_outside: bool, strict: bool) -> PyResult<Mesh> {
    let options = LoadOptions { srgb, allow_outside, strict, ..LoadOptions::default() };
    let loaded = py.detach(|| softras_io::load_with(&path, &options).and_then(softras_io::Loaded::at_place)).raise()?;
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
