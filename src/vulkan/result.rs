//! Conversion of VkResult, and of misuse found by our own checks, to [`Error`].

use crate::Error;
use ash::vk;

/// Turns a failed Vulkan call into an error that names it.
pub(super) trait Named<T> {
    /// The value, or [`Error::Vulkan`] with the call and the VkResult's name.
    fn named(self, call: &'static str) -> Result<T, Error>;
}

impl<T> Named<T> for Result<T, vk::Result> {
    fn named(self, call: &'static str) -> Result<T, Error> {
        self.map_err(|result| vulkan(call, result))
    }
}

/// [`Error::Vulkan`], or [`Error::OutOfMemory`] and [`Error::DeviceLost`] for the results that say so. The result is named as the
/// specification names it, with the reason behind where a user can do something about it.
pub(super) fn vulkan(call: &'static str, result: vk::Result) -> Error {
    let name = match result {
        vk::Result::ERROR_OUT_OF_HOST_MEMORY | vk::Result::ERROR_OUT_OF_DEVICE_MEMORY => {
            return Error::OutOfMemory {
                what: call.to_string(),
                bytes: 0,
                fix: format!("VK_{result:?}: free memory or make the frame smaller"),
            };
        }
        vk::Result::ERROR_DEVICE_LOST => {
            return Error::DeviceLost { call, fix: "VK_ERROR_DEVICE_LOST: drop what was made and make it anew".into() };
        }
        vk::Result::ERROR_INCOMPATIBLE_DRIVER => "VK_ERROR_INCOMPATIBLE_DRIVER: no driver is installed".to_string(),
        other => format!("VK_{other:?}"),
    };
    Error::Vulkan { call, result: name }
}

/// The error for a misuse that our own checks found; `call` is the Vulkan call that would be invalid.
pub(super) fn misuse_of(call: &'static str, what: &str) -> Error {
    Error::Vulkan { call, result: what.to_string() }
}
