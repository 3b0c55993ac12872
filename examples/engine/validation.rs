//! The validation layer of the example engine: what it checks, and what it says.

use super::Outcome;
use ash::vk;
use std::ffi::{CStr, c_char, c_void};
use std::sync::{Arc, Mutex};

pub type Log = Mutex<Vec<String>>;

const LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// The checks to enable besides those of valid usage. The last one belongs to the first in older layers; newer layers
/// need it to see what memory a kernel accesses.
const SETTINGS: [&CStr; 3] = [c"validate_sync", c"validate_best_practices", c"syncval_shader_accesses_heuristic"];
const FEATURES: [vk::ValidationFeatureEnableEXT; 2] =
    [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION, vk::ValidationFeatureEnableEXT::BEST_PRACTICES];

/// Messages that are no faults: id, a part of the text (one id may stand for several extensions), and the reason.
const ACCEPTED: [(&str, &str, &str); 7] = [
    ("BestPractices-vkCreateInstance-specialuse-extension-debugging", "", "validation takes extensions for debugging"),
    ("BestPractices-specialuse-extension", "VK_EXT_debug_utils", "the same in the words of newer layers"),
    (
        "BestPractices-vkCreateDevice-physical-device-features-not-retrieved",
        "",
        "the layers of 1.4.309 always say it: KhronosGroup/Vulkan-ValidationLayers, issue 9900",
    ),
    ("BestPractices-vkAllocateMemory-small-allocation", "", "memory that is shared is one buffer's alone"),
    ("BestPractices-vkBindMemory-small-dedicated-allocation", "", "the same"),
    ("BestPractices-vkBindBufferMemory-small-dedicated-allocation", "", "the same in the words of newer layers"),
    ("BestPractices-Error-Result", "", "a call that fails is an error of who calls, and tests make calls fail"),
];

/// Makes an instance under the layer. VK_EXT_layer_settings tells the layer what to check, or its predecessor if the
/// layer does not have it.
///
/// # Safety
/// As of vkCreateInstance; the log outlives the instance.
pub unsafe fn instance(entry: &ash::Entry, info: vk::InstanceCreateInfo<'_>, log: &Arc<Log>) -> Outcome<ash::Instance> {
    let offered = unsafe { entry.enumerate_instance_extension_properties(Some(LAYER)) }?;
    let by_settings = offered.iter().any(|e| e.extension_name_as_c_str() == Ok(ash::ext::layer_settings::NAME));
    let way = if by_settings { ash::ext::layer_settings::NAME } else { ash::ext::validation_features::NAME };
    let layers = [LAYER.as_ptr()];
    let extensions = [ash::ext::debug_utils::NAME.as_ptr(), way.as_ptr()];

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
    let mut messenger = messenger_info(log);
    let info = info.enabled_layer_names(&layers).enabled_extension_names(&extensions).push_next(&mut messenger);
    let info = if by_settings { info.push_next(&mut settings) } else { info.push_next(&mut features) };
    Ok(unsafe { entry.create_instance(&info, None) }?)
}

/// A messenger that writes into the log.
pub fn messenger_info(log: &Arc<Log>) -> vk::DebugUtilsMessengerCreateInfoEXT<'static> {
    use vk::DebugUtilsMessageSeverityFlagsEXT as Severity;
    vk::DebugUtilsMessengerCreateInfoEXT::default()
        .message_severity(Severity::WARNING | Severity::ERROR)
        .message_type(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE)
        .pfn_user_callback(Some(note))
        .user_data(Arc::as_ptr(log).cast_mut().cast())
}

unsafe extern "system" fn note(
    _severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _kind: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    log: *mut c_void,
) -> vk::Bool32 {
    let string = |text: *const c_char| {
        if text.is_null() { String::new() } else { unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned() }
    };
    let (id, text) = unsafe { (string((*data).p_message_id_name), string((*data).p_message)) };
    let id = id.strip_prefix("UNASSIGNED-").unwrap_or(&id);
    if ACCEPTED.iter().any(|(accepted, about, _)| id == *accepted && text.contains(about)) {
        return vk::FALSE;
    }
    // Newer layers leave the id out of the text.
    let text = if text.contains(id) { text } else { format!("[{id}] {text}") };
    eprintln!("{text}");
    if let Ok(mut log) = unsafe { &*log.cast::<Log>() }.lock() {
        log.push(text);
    }
    vk::FALSE
}
