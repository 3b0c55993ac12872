//! Collects what the validation layer says.

use ash::{ext::debug_utils, vk};
use std::ffi::{CStr, c_void};
use std::io::Write;
use std::sync::{Arc, Mutex, PoisonError};

/// Best practices that are not followed, each with the reason.
const ACCEPTED: [(&str, &str); 2] = [
    ("BestPractices-vkCreateInstance-specialuse-extension-debugging", "validation takes extensions for debugging"),
    ("BestPractices-Error-Result", "a call that fails is an error that we return"),
];

/// The messages of the validation layer. Cheap to clone; lives on after its [`Context`](super::Context), so that what
/// destroying a device reports can still be read.
#[derive(Clone, Debug, Default)]
pub struct ValidationLog(Arc<Mutex<Vec<String>>>);

impl ValidationLog {
    /// All warnings and errors so far, oldest first. Empty is only good news if validation was on.
    pub fn messages(&self) -> Vec<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// What to chain to an instance and to make a messenger of.
    ///
    /// The log must outlive every instance and messenger made with it: the pointer leads into the Arc.
    pub(super) fn create_info(&self) -> vk::DebugUtilsMessengerCreateInfoEXT<'static> {
        use vk::{DebugUtilsMessageSeverityFlagsEXT as Severity, DebugUtilsMessageTypeFlagsEXT as Type};
        vk::DebugUtilsMessengerCreateInfoEXT::default()
            .message_severity(Severity::WARNING | Severity::ERROR)
            .message_type(Type::VALIDATION | Type::PERFORMANCE)
            .pfn_user_callback(Some(callback))
            .user_data(Arc::as_ptr(&self.0).cast_mut().cast())
    }
}

/// A messenger that writes into a log, which it keeps alive.
pub(super) struct Messenger {
    functions: debug_utils::Instance,
    handle: vk::DebugUtilsMessengerEXT,
    _log: ValidationLog,
}

impl Messenger {
    /// # Safety
    /// The instance has VK_EXT_debug_utils enabled and is destroyed after the messenger.
    pub(super) unsafe fn new(
        entry: &ash::Entry,
        instance: &ash::Instance,
        log: ValidationLog,
    ) -> Result<Self, vk::Result> {
        let functions = debug_utils::Instance::new(entry, instance);
        // SAFETY: the extension is enabled (the caller's promise); the log that user_data points to is kept below.
        let handle = unsafe { functions.create_debug_utils_messenger(&log.create_info(), None) }?;
        Ok(Self { functions, handle, _log: log })
    }
}

impl Drop for Messenger {
    fn drop(&mut self) {
        // SAFETY: the instance still lives (the promise of `new`), and the handle is destroyed once.
        unsafe { self.functions.destroy_debug_utils_messenger(self.handle, None) };
    }
}

/// Keeps validation messages, prints all. Must not unwind into the layer.
unsafe extern "system" fn callback(
    severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _kind: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user_data: *mut c_void,
) -> vk::Bool32 {
    if data.is_null() || user_data.is_null() {
        return vk::FALSE;
    }
    // SAFETY: the layer passes a valid structure and nul-terminated text for the length of the call.
    let text = unsafe {
        let text = (*data).p_message;
        if text.is_null() { String::new() } else { CStr::from_ptr(text).to_string_lossy().into_owned() }
    };
    if ACCEPTED.iter().any(|(id, _)| text.contains(id)) {
        return vk::FALSE;
    }
    let word = if severity.contains(vk::DebugUtilsMessageSeverityFlagsEXT::ERROR) { "error" } else { "warning" };
    let message = format!("validation {word}: {text}");
    _ = writeln!(std::io::stderr(), "{message}");
    // SAFETY: user_data leads into the Arc of a ValidationLog, which outlives messenger and instance.
    let log = unsafe { &*user_data.cast::<Mutex<Vec<String>>>() };
    log.lock().unwrap_or_else(PoisonError::into_inner).push(message);
    vk::FALSE
}
