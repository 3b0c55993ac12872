//! The crate's one error type: what is wrong, where, and how to fix it.

use std::path::PathBuf;

/// Everything that can go wrong, each variant naming the thing, the place and the fix.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A mesh's data is inconsistent or not finite.
    #[error("mesh: {what} at {place}: {fix}")]
    Mesh {
        /// What is wrong ("position is not finite").
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
    /// A scene and its cameras do not fit together.
    #[error("scene: {what}: {fix}")]
    Scene {
        /// What is wrong.
        what: String,
        /// How to fix it.
        fix: String,
    },
    /// A file cannot be read or written.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// A file's content is malformed.
    #[error("{path}{at}: {what}: {fix}", path = path.display(), at = line.map_or(String::new(), |l| format!(":{l}")))]
    File {
        /// The file.
        path: PathBuf,
        /// The line, counted from 1, where the format has lines.
        line: Option<usize>,
        /// What is wrong.
        what: String,
        /// How to fix it.
        fix: String,
    },
    /// No Vulkan loader, driver or suitable device.
    #[error("no usable Vulkan device: {what}: {fix}")]
    NoDevice {
        /// What was looked for and not found.
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
    /// Memory ran out.
    #[error("out of memory for {what} ({bytes} bytes): {fix}")]
    OutOfMemory {
        /// The buffer that could not be had.
        what: String,
        /// Its size.
        bytes: u64,
        /// How to fix it.
        fix: String,
    },
    /// The device met a value that is not finite, born in its own arithmetic.
    #[error("the device met a value that is not finite in stage {stage}: {fix}")]
    NotFinite {
        /// The stage that saw it.
        stage: &'static str,
        /// How to fix it.
        fix: String,
    },
    /// A gradient was asked of a frame that did not keep what it takes.
    #[error("backward: {what}: {fix}")]
    Backward {
        /// What is missing.
        what: String,
        /// How to fix it.
        fix: String,
    },
    /// A fit cannot be set up from what it was given.
    #[error("fit: {what}: {fix}")]
    Fit {
        /// What is wrong.
        what: String,
        /// How to fix it.
        fix: String,
    },
    /// An embedding host's handles, buffers or plans do not fit together.
    #[error("host: {what}: {fix}")]
    Host {
        /// What does not fit.
        what: String,
        /// How to fix it.
        fix: String,
    },
    /// The driver reset the device; nothing made on it can be used any more, but all of it can be dropped.
    #[error("{call}: the driver reset the device (a frame that ran too long, a driver fault): {fix}")]
    DeviceLost {
        /// The call that reported it.
        call: &'static str,
        /// How to go on.
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

/// A result with this crate's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;
