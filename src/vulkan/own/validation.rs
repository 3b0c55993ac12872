//! Collects what the validation layer says.

use ash::{ext::debug_utils, vk};
use std::ffi::{CStr, CString, c_char, c_void};
use std::io::Write;
use std::sync::{Arc, Mutex, PoisonError};

/// Messages that are no faults: id, a part of the text (one id may stand for several extensions), and the reason.
const ACCEPTED: [(&str, &str, &str); 4] = [
    ("BestPractices-vkCreateInstance-specialuse-extension-debugging", "", "validation takes extensions for debugging"),
    ("BestPractices-specialuse-extension", "VK_EXT_debug_utils", "the same in the words of newer layers"),
    (
        "BestPractices-vkCreateDevice-physical-device-features-not-retrieved",
        "",
        "the layers of 1.4.309 always say it: KhronosGroup/Vulkan-ValidationLayers, issue 9900",
    ),
    ("BestPractices-Error-Result", "", "a call that fails is an error that we return"),
];

pub(super) const LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// The checks to enable besides those of valid usage. The last one belongs to the first in older layers; newer layers
/// need it to see what memory a kernel accesses.
const SETTINGS: [&CStr; 3] = [c"validate_sync", c"validate_best_practices", c"syncval_shader_accesses_heuristic"];
const FEATURES: [vk::ValidationFeatureEnableEXT; 2] =
    [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION, vk::ValidationFeatureEnableEXT::BEST_PRACTICES];

/// How the layer is told what to check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Checks {
    /// By VK_EXT_layer_settings.
    Settings,
    /// By its predecessor VK_EXT_validation_features, which newer layers call deprecated.
    Features,
}

impl Checks {
    /// The newer way that a layer with these extensions has; `None` for a layer with neither.
    pub(super) fn offered(extensions: &[CString]) -> Option<Self> {
        let ways = [Self::Settings, Self::Features];
        ways.into_iter().find(|way| extensions.iter().any(|name| name.as_c_str() == way.extension()))
    }

    /// The extension to enable.
    pub(super) fn extension(self) -> &'static CStr {
        match self {
            Self::Settings => ash::ext::layer_settings::NAME,
            Self::Features => ash::ext::validation_features::NAME,
        }
    }

    /// Chains them to an instance's info, and gives it to `create`.
    pub(super) fn chained<T>(
        self,
        info: vk::InstanceCreateInfo<'_>,
        create: impl FnOnce(&vk::InstanceCreateInfo<'_>) -> T,
    ) -> T {
        let yes = vk::TRUE;
        let settings = SETTINGS.map(|name| vk::LayerSettingEXT {
            p_layer_name: LAYER.as_ptr(),
            p_setting_name: name.as_ptr(),
            ty: vk::LayerSettingTypeEXT::BOOL32,
            value_count: 1,
            p_values: (&raw const yes).cast(),
            ..Default::default()
        });
        let mut settings = vk::LayerSettingsCreateInfoEXT::default().settings(&settings);
        let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&FEATURES);
        create(&match self {
            Self::Settings => info.push_next(&mut settings),
            Self::Features => info.push_next(&mut features),
        })
    }
}

/// Whether a message of this id is no fault. Older layers begin the id with `UNASSIGNED-`.
fn accepted(id: &str, text: &str) -> bool {
    let id = id.strip_prefix("UNASSIGNED-").unwrap_or(id);
    ACCEPTED.iter().any(|(accepted, about, _)| id == *accepted && text.contains(about))
}

/// The messages of the validation layer. Cheap to clone; lives on after its [`Context`](super::Context), so that what
/// destroying a device reports can still be read.
#[derive(Clone, Debug, Default)]
pub struct ValidationLog(Arc<Mutex<Vec<String>>>);

impl ValidationLog {
    /// All warnings and errors so far, oldest first. Empty is only good news if validation was on.
    pub fn messages(&self) -> Vec<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The structure to chain to an instance and to make a messenger of.
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
    let string = |text: *const c_char| {
        // SAFETY: what the layer passes is null or nul-terminated text for the length of the call.
        if text.is_null() { String::new() } else { unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned() }
    };
    // SAFETY: the layer passes a valid structure for the length of the call.
    let (id, text) = unsafe { (string((*data).p_message_id_name), string((*data).p_message)) };
    if accepted(&id, &text) {
        return vk::FALSE;
    }
    let word = if severity.contains(vk::DebugUtilsMessageSeverityFlagsEXT::ERROR) { "error" } else { "warning" };
    // Newer layers leave the id out of the text.
    let message = if text.contains(&id) { text } else { format!("[{id}] {text}") };
    let message = format!("validation {word}: {message}");
    _ = writeln!(std::io::stderr(), "{message}");
    // SAFETY: user_data leads into the Arc of a ValidationLog, which outlives messenger and instance.
    let log = unsafe { &*user_data.cast::<Mutex<Vec<String>>>() };
    log.lock().unwrap_or_else(PoisonError::into_inner).push(message);
    vk::FALSE
}

#[cfg(test)]
mod tests {
    use super::{Checks, accepted};

    #[test]
    fn messages_are_accepted_by_their_whole_id_and_for_their_extension() {
        let specialuse = "BestPractices-vkCreateInstance-specialuse-extension-debugging";
        assert!(accepted(&format!("UNASSIGNED-{specialuse}"), "of Debian 12"));
        assert!(accepted("BestPractices-specialuse-extension", "extension VK_EXT_debug_utils, but"));
        assert!(!accepted("BestPractices-specialuse-extension", "extension VK_EXT_transform_feedback, but"));
        assert!(!accepted("BestPractices-deprecated-extension", "extension VK_EXT_debug_utils, but"));
        assert!(!accepted("SYNC-HAZARD-WRITE-AFTER-WRITE", specialuse));
        assert!(!accepted("", "VK_EXT_debug_utils"));
    }

    #[test]
    fn checks_are_asked_for_in_the_newest_way_that_the_layer_has() {
        let (old, new) = (c"VK_EXT_validation_features".to_owned(), c"VK_EXT_layer_settings".to_owned());
        assert_eq!(Checks::offered(&[old.clone(), new]), Some(Checks::Settings));
        assert_eq!(Checks::offered(&[old]), Some(Checks::Features));
        assert_eq!(Checks::offered(&[c"VK_EXT_debug_utils".to_owned()]), None);
    }
}
