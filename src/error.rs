//! The crate's one error type: what is wrong, where, and how to fix it.

use std::path::PathBuf;

/// Every error of this crate. Each names what is wrong, where it is, and how to fix it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A mesh's data is inconsistent or not finite.
    #[error("mesh: {what} at {place}: {fix}")]
    Mesh {
        /// The fault ("position is not finite").
        what: String,
        /// Where it is ("vertex 17", "triangle 3, corner 1").
        place: String,
        /// How to fix it.
        fix: String,
    },
    /// A camera cannot be made from these numbers.
    #[error("camera: {field} = {value}: {fix}")]
    Camera {
        /// The field that is wrong.
        field: &'static str,
        /// The value it has.
        value: String,
        /// How to fix it.
        fix: String,
    },
    /// A light's field is out of range.
    #[error("light: {field} = {value}: {fix}")]
    Light {
        /// The field that is wrong.
        field: String,
        /// The value it has.
        value: String,
        /// How to fix it.
        fix: String,
    },
    /// A setting is out of range.
    #[error("settings: {field} = {value}: {fix}")]
    Settings {
        /// The field that is wrong.
        field: &'static str,
        /// The value it has.
        value: String,
        /// The range it must be in, and why.
        fix: String,
    },
    /// The numbers of meshes and cameras do not match, or parameters belong to another scene.
    #[error("scene: {what}: {fix}")]
    Scene {
        /// The fault.
        what: String,
        /// How to fix it.
        fix: String,
    },
    /// A file cannot be read or written.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// A file's content is malformed.
    #[error("{path}{at}: {what}: {fix}", path = path.display(), at = line.map_or(String::new(), |l| format!(":{l}")))]
    File {
        /// The file.
        path: PathBuf,
        /// The line, counted from 1, where the format has lines.
        line: Option<usize>,
        /// The fault.
        what: String,
        /// How to fix it.
        fix: String,
    },
    /// There is no Vulkan loader, no driver, or no device with what the kernels need.
    #[error("{what}: {fix}")]
    NoDevice {
        /// The device, driver or loader that is missing or unfit.
        what: String,
        /// How to fix it.
        fix: String,
    },
    /// The frame needs more than a limit of the device allows.
    #[error("{what} needs {needed} {unit}, the device's limit {limit_name} is {limit}: {fix}")]
    Limit {
        /// The thing that is too large.
        what: String,
        /// How much it needs.
        needed: u64,
        /// Bytes, elements or invocations.
        unit: &'static str,
        /// The limit's Vulkan name.
        limit_name: &'static str,
        /// The limit's value.
        limit: u64,
        /// How to fix it.
        fix: String,
    },
    /// An allocation of host or device memory failed.
    #[error("out of memory for {what}{size}: {fix}", size = if *bytes > 0 { format!(" ({bytes} bytes)") } else { String::new() })]
    OutOfMemory {
        /// The buffer that could not be allocated.
        what: String,
        /// Its size in bytes; 0 where it is not known.
        bytes: u64,
        /// How to fix it.
        fix: String,
    },
    /// The device computed an infinite value or a NaN although all inputs were finite.
    #[error("the device met a value that is not finite in stage {stage}: {fix}")]
    NotFinite {
        /// The pipeline stage that found it.
        stage: &'static str,
        /// How to fix it.
        fix: String,
    },
    /// A frame cannot be differentiated as asked: it was not saved for backward, or the upstream gradients do not fit
    /// it.
    #[error("backward: {what}: {fix}")]
    Backward {
        /// The thing that is missing or does not fit.
        what: String,
        /// How to fix it.
        fix: String,
    },
    /// The inputs of a fit are inconsistent or out of range.
    #[error("fit: {what}: {fix}")]
    Fit {
        /// The fault.
        what: String,
        /// How to fix it.
        fix: String,
    },
    /// Handles, buffers or plans of an embedding host are unusable or do not belong together.
    #[error("host: {what}: {fix}")]
    Host {
        /// The fault.
        what: String,
        /// How to fix it.
        fix: String,
    },
    /// The driver reset the device. Objects made on it can be dropped but not used: make them anew on a new device.
    #[error("{call}: the driver reset the device (a frame that ran too long, a driver fault): {fix}")]
    DeviceLost {
        /// The call that reported it.
        call: &'static str,
        /// How to continue.
        fix: String,
    },
    /// A Vulkan call failed.
    #[error("Vulkan: {call} failed: {result}")]
    Vulkan {
        /// The call.
        call: &'static str,
        /// The VkResult by name.
        result: String,
    },
}

/// A number for an error message, in few digits however large or small it is.
pub(crate) fn shown(x: f64) -> String {
    let plain = x == 0.0 || !x.is_finite() || (1e-5..1e16).contains(&x.abs());
    if plain { format!("{x}") } else { format!("{x:e}") }
}

/// A result with this crate's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;
