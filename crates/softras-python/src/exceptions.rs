//! The library's errors as exceptions of `softras.errors`, one class for each kind.

use pyo3::prelude::*;
use softras::Error;

/// The class of an error.
fn class(error: &Error) -> &'static str {
    match error {
        Error::Mesh { .. } => "MeshError",
        Error::Camera { .. } => "CameraError",
        Error::Light { .. } => "LightError",
        Error::Settings { .. } => "SettingsError",
        Error::Scene { .. } => "SceneError",
        Error::Io { .. } => "IoError",
        Error::File { .. } => "FileError",
        Error::NoDevice { .. } => "NoDeviceError",
        Error::Limit { .. } => "LimitError",
        Error::OutOfMemory { .. } => "OutOfMemoryError",
        Error::NotFinite { .. } => "NotFiniteError",
        Error::Backward { .. } => "BackwardError",
        Error::Fit { .. } => "FitError",
        Error::DeviceLost { .. } => "DeviceLostError",
        Error::Vulkan { .. } => "VulkanError",
        _ => "Error",
    }
}

/// An exception of a class of `softras.errors`.
pub fn exception(class: &str, text: impl Into<String>) -> PyErr {
    let made = |py: Python<'_>| -> PyResult<PyErr> {
        let instance = py.import("softras.errors")?.getattr(class)?.call1((text.into(),))?;
        Ok(PyErr::from_value(instance))
    };
    Python::attach(|py| made(py).unwrap_or_else(|error| error))
}

/// An exception that tells what is wrong with an argument, and how to fix it.
pub fn bad_input(what: impl std::fmt::Display, fix: &str) -> PyErr {
    exception("InputError", format!("{what}: {fix}"))
}

/// Results of the library as Python's.
pub trait Raise<T> {
    /// The value, or the exception of the error's kind with its text.
    fn raise(self) -> PyResult<T>;
}

impl<T> Raise<T> for softras::Result<T> {
    fn raise(self) -> PyResult<T> {
        self.map_err(|error| exception(class(&error), error.to_string()))
    }
}
