//! Pictures of meshes for people.

use crate::arrays::color;
use crate::exceptions::{Raise, bad_input};
use crate::mesh::Mesh;
use crate::renderer::Renderer;
use crate::settings::{FACES, chosen};
use numpy::{PyArray1, PyArray4, PyArrayMethods, PyReadonlyArray3, PyReadonlyArray4, PyUntypedArrayMethods};
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use softras::{
    Settings,
    scene::{Faces, Shading},
};
use softras_io::{Floats, LoadOptions, Picture};
use softras_view::{CameraOptions, LightOptions, Look, Motion, Options, View};
use std::ffi::CString;
use std::path::PathBuf;

/// The arguments of a picture, all of which `softras.view` gives.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct ViewArguments<'py> {
    size: (u32, u32),
    azimuth: f64,
    elevation: f64,
    fov: f64,
    up: Option<[f64; 3]>,
    background: Option<Bound<'py, PyAny>>,
    sigma: Option<f64>,
    gamma: f64,
    samples: Option<u32>,
    shading: String,
    crease: Option<f64>,
    unlit: bool,
    faces: Option<String>,
    turntable: Option<usize>,
}

impl ViewArguments<'_> {
    fn options(&self) -> PyResult<Options> {
        let Self { azimuth, elevation, fov, up, .. } = *self;
        let shading = chosen("shading", &self.shading, &[("smooth", Shading::Smooth), ("flat", Shading::Flat)])?;
        let faces = self.faces.as_deref().map(|faces| chosen("faces", faces, &FACES)).transpose()?;
        let look = Look {
            size: self.size,
            sigma: self.sigma,
            background: self.background.as_ref().map(|value| color(value, "background")).transpose()?,
            model: Settings { gamma: self.gamma, faces: faces.unwrap_or_default(), ..Look::default().model },
            ..Look::default()
        };
        Ok(Options {
            camera: CameraOptions { azimuth, elevation, fov, up, ..CameraOptions::default() },
            look,
            samples: self.samples,
            both_sides: faces == Some(Faces::Both),
            motion: self.turntable.map_or(Motion::Still, Motion::Turntable),
            crease: self.crease,
            light: LightOptions { shading, unlit: self.unlit, ..LightOptions::default() },
            ..Options::default()
        })
    }
}

/// The subject of a picture: a mesh, or a mesh file with its normals and transparent materials.
#[derive(FromPyObject)]
pub enum Subject {
    Mesh(Py<Mesh>),
    File(PathBuf),
}

/// [frames, height, width, 4] bytes, sRGB with straight alpha: one frame, or those of a turntable.
#[pyfunction]
pub fn view<'py>(
    py: Python<'py>,
    subject: Subject,
    renderer: &Renderer,
    plan: ViewArguments<'py>,
) -> PyResult<Bound<'py, PyArray4<u8>>> {
    let made = match subject {
        Subject::Mesh(mesh) => View::of(&mesh.get().mesh),
        Subject::File(path) => {
            View::of_loaded(py.detach(|| softras_io::load_with(&path, &LoadOptions::default())).raise()?)
        }
    };
    let view = made.options(plan.options()?);
    let (frames, notes) = renderer.shared.call(py, |renderer| view.frames(renderer))?;
    for note in notes {
        PyErr::warn(py, &py.get_type::<PyUserWarning>(), &CString::new(note)?, 2)?;
    }
    let (width, height) = frames.first().map_or((0, 0), |frame| (frame.width, frame.height));
    let bytes: Vec<u8> = frames.iter().flat_map(|frame| frame.pixels.as_flattened()).copied().collect();
    PyArray1::from_vec(py, bytes).reshape([frames.len(), height, width, 4])
}

fn pictures(frames: &PyReadonlyArray4<'_, u8>) -> PyResult<Vec<Picture>> {
    let &[_, height, width, channels] = frames.shape() else { return Ok(Vec::new()) };
    if channels != 4 || height * width == 0 {
        return Err(bad_input(format!("frames have shape {:?}", frames.shape()), "give [frames, height, width, 4]"));
    }
    let bytes = frames.as_slice()?.chunks_exact(height * width * 4);
    Ok(bytes.map(|frame| Picture { width, height, pixels: frame.as_chunks::<4>().0.to_vec() }).collect())
}

/// Writes pictures [frames, height, width, 4]: one as .png, several as .gif with `delay` hundredths of a second between them.
#[pyfunction]
pub fn save_pictures(py: Python<'_>, path: PathBuf, frames: PyReadonlyArray4<'_, u8>, delay: u16) -> PyResult<()> {
    let frames = pictures(&frames)?;
    let is_gif = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("gif"));
    match (&frames[..], is_gif) {
        (frames, true) => {
            let frames: Vec<Picture> = frames.iter().map(|frame| frame.clone().flattened([255; 3])).collect();
            py.detach(|| softras_io::write_gif(&path, &frames, delay)).raise()
        }
        ([one], false) => py.detach(|| one.save(&path)).raise(),
        _ => Err(bad_input(format!("{}: {} frames", path.display(), frames.len()), "write several as .gif")),
    }
}

/// Writes an OpenEXR file of linear light with alpha, [height, width, 4].
#[pyfunction]
pub fn save_exr(py: Python<'_>, path: PathBuf, picture: PyReadonlyArray3<'_, f32>) -> PyResult<()> {
    let &[height, width, channels] = picture.shape() else { return Ok(()) };
    let floats = Floats { width, height, channels, data: picture.as_slice()?.to_vec() };
    py.detach(|| floats.save_exr(&path, "Y")).raise()
}

/// The bytes of a PNG file of a picture [height, width, 4].
#[pyfunction]
pub fn png<'py>(py: Python<'py>, picture: PyReadonlyArray3<'py, u8>) -> PyResult<Bound<'py, PyBytes>> {
    let &[height, width, _] = picture.shape() else { return Ok(PyBytes::new(py, &[])) };
    let pixels = picture.as_slice()?.as_chunks::<4>().0.to_vec();
    Ok(PyBytes::new(py, &Picture { width, height, pixels }.png().raise()?))
}
