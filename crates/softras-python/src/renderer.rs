//! Renderers: a device that renders and differentiates.

use crate::arrays::shaped;
use crate::camera::Camera;
use crate::exceptions::{Raise, bad_input};
use crate::frame::Frame;
use crate::mesh::meshes;
use crate::opened::Opened;
use crate::settings;
use pyo3::exceptions::PyModuleNotFoundError;
use pyo3::prelude::*;
use softras::{DeviceInfo, Error, Loader, RendererOptions, Result, Scene, Settings};
use std::path::PathBuf;
use std::sync::Arc;

/// A Vulkan device that renders and differentiates.
#[pyclass(module = "softras", frozen)]
pub struct Renderer {
    pub shared: Arc<Opened>,
}

/// A scene, its cameras and settings, as the library takes them.
pub struct Inputs {
    pub scene: Scene,
    pub cameras: Vec<softras::Camera>,
    pub settings: Settings,
}

/// The cameras of one `Camera` or a list of them.
pub fn cameras(value: &Bound<'_, PyAny>) -> PyResult<Vec<softras::Camera>> {
    if let Ok(one) = value.cast::<Camera>() {
        return Ok(vec![one.get().camera]);
    }
    let all = value.extract::<Vec<Camera>>();
    let all = all.map_err(|_| bad_input("cameras are no cameras", "give a softras.Camera or a list of them"))?;
    Ok(all.into_iter().map(|one| one.camera).collect())
}

impl Inputs {
    pub fn new(
        meshes: &Bound<'_, PyAny>,
        cameras: &Bound<'_, PyAny>,
        settings: Option<&Bound<'_, PyAny>>,
        lights: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let scene = Scene::batch(self::meshes(meshes)?).with_lights(settings::lights(lights)?);
        Ok(Self { scene, cameras: self::cameras(cameras)?, settings: settings::settings(settings)? })
    }
}

/// Whether the system has a device to render on, or SOFTRAS_DRIVER says which driver to take.
fn has_device(found: &Result<Vec<DeviceInfo>>) -> bool {
    found.as_ref().is_ok_and(|all| all.iter().any(|one| one.suitable.is_ok() || one.file.is_some()))
}

/// The driver of the package softras-lavapipe, if it is installed.
fn packaged(py: Python<'_>) -> PyResult<Option<Loader>> {
    match py.import("softras_lavapipe") {
        Ok(module) => {
            let file: PathBuf = module.getattr("DRIVER")?.extract()?;
            py.detach(|| Loader::driver(file)).raise().map(Some)
        }
        Err(error) if error.is_instance_of::<PyModuleNotFoundError>(py) => Ok(None),
        Err(error) => Err(error),
    }
}

/// A missing device's error that also names the package, which exists for Linux on x86-64.
fn with_package(error: Error) -> Error {
    match error {
        Error::NoDevice { what, fix } if cfg!(all(target_os = "linux", target_arch = "x86_64")) => {
            Error::NoDevice { what, fix: format!("install the package softras-lavapipe (softras[cpu]), or {fix}") }
        }
        other => other,
    }
}

/// A device as `softras.Device` has it: index, name, kind, driver, its version and file, and why it cannot be used.
type Listed = (usize, String, String, String, String, Option<PathBuf>, Option<String>);

/// The devices that `Renderer` chooses from; see `softras.devices`.
#[pyfunction]
pub fn devices(py: Python<'_>) -> PyResult<Vec<Listed>> {
    let mut found = py.detach(softras::Renderer::devices);
    if matches!(found, Ok(_) | Err(Error::NoDevice { .. })) && !has_device(&found) {
        found = match packaged(py)? {
            Some(loader) => py.detach(|| loader.devices()),
            None => found.map_err(with_package),
        };
    }
    let listed = |one: DeviceInfo| {
        (one.index, one.name, one.kind.to_string(), one.driver, one.driver_version, one.file, one.suitable.err())
    };
    Ok(found.raise()?.into_iter().map(listed).collect())
}

#[pymethods]
impl Renderer {
    /// Opens a device: its index or part of its name, else what SOFTRAS_DEVICE says, else the best one.
    ///
    /// `validation` runs under the Vulkan validation layers; `memory` is the most bytes that a frame's buffers may take.
    /// Where the system has no device, that of the package softras-lavapipe is opened. Raises NoDeviceError, which names the package
    /// to install; FileError for a driver's file of SOFTRAS_DRIVER.
    #[new]
    #[pyo3(signature = (device = None, *, validation = false, memory = None))]
    fn new(py: Python<'_>, device: Option<String>, validation: bool, memory: Option<u64>) -> PyResult<Self> {
        let options = RendererOptions { device, validation, memory, ..RendererOptions::default() };
        let open = |options: &RendererOptions| py.detach(|| softras::Renderer::with_options(options));
        let renderer = match open(&options) {
            Err(error @ Error::NoDevice { .. }) if !py.detach(|| has_device(&softras::Renderer::devices())) => {
                match packaged(py)? {
                    Some(loader) => open(&RendererOptions { loader: Some(loader), ..options }),
                    None => Err(with_package(error)),
                }
            }
            result => result,
        }
        .raise()?;
        let device = renderer.device_name().to_owned();
        let shared = Opened::new(renderer, device);
        Ok(Self { shared: Arc::new(shared) })
    }

    /// Renders one mesh from every camera, or a list of meshes from one camera each, in one submission.
    ///
    /// `save` keeps what `Frame.backward` needs, 16 bytes a pixel. Other threads of Python run meanwhile. Raises SceneError,
    /// LightError, SettingsError, InputError for what cannot be rendered; LimitError, OutOfMemoryError for what the device
    /// cannot hold; NotFiniteError where single precision cannot; ForkError in a forked process.
    #[pyo3(signature = (meshes, cameras, settings = None, lights = None, *, save = false))]
    fn render(
        &self,
        py: Python<'_>,
        meshes: &Bound<'_, PyAny>,
        cameras: &Bound<'_, PyAny>,
        settings: Option<&Bound<'_, PyAny>>,
        lights: Option<&Bound<'_, PyAny>>,
        save: bool,
    ) -> PyResult<Frame> {
        let Inputs { scene, cameras, settings } = Inputs::new(meshes, cameras, settings, lights)?;
        let settings = Settings { save, ..settings };
        let frame = self.shared.call(py, |renderer| renderer.render(&scene, &cameras, &settings))?;
        Frame::new(py, frame, self.shared.clone(), &scene, save)
    }

    /// The nearest triangle of each pixel: its number [views, height, width] int32, -1 for none; its barycentrics there
    /// [views, height, width, 3] and its depth [views, height, width], float32, 0 for none. See `softras.fragments`.
    #[pyo3(signature = (meshes, cameras, settings = None))]
    fn fragments(
        &self,
        py: Python<'_>,
        meshes: &Bound<'_, PyAny>,
        cameras: &Bound<'_, PyAny>,
        settings: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<(Py<PyAny>, Py<PyAny>, Py<PyAny>)> {
        let Inputs { scene, cameras, settings } = Inputs::new(meshes, cameras, settings, None)?;
        let found = self.shared.call(py, |renderer| renderer.fragments(&scene, &cameras, &settings))?;
        let sides = [found.batch, found.height, found.width];
        let all = found.data.iter();
        let triangles = all.clone().map(|one| one.map_or(-1, |one| one.triangle as i32)).collect();
        let depths = all.clone().map(|one| one.map_or(0.0, |one| one.depth)).collect();
        let barycentrics = all.flat_map(|one| one.map_or([0.0; 3], |one| one.barycentrics)).collect();
        Ok((
            shaped::<i32>(py, triangles, sides, 1)?,
            shaped::<f32>(py, barycentrics, sides, 3)?,
            shaped::<f32>(py, depths, sides, 1)?,
        ))
    }

    /// The device's name.
    #[getter]
    fn device(&self) -> &str {
        self.shared.device()
    }

    /// Bytes of device memory that the renderer holds.
    #[getter]
    fn device_bytes(&self, py: Python<'_>) -> PyResult<u64> {
        self.shared.call(py, |renderer| Ok(renderer.device_bytes()))
    }

    /// The messages of the validation layers so far.
    fn validation_messages(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.shared.call(py, |renderer| Ok(renderer.validation_messages()))
    }

    /// The number of the process that opened it.
    #[getter]
    fn process(&self) -> u32 {
        self.shared.process()
    }

    /// A copy of what holds a renderer shares it.
    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }

    fn __repr__(&self) -> String {
        format!("softras.Renderer({:?})", self.shared.device())
    }
}
