//! The vulkanalia example under synchronization validation: the fit converges, and no message is heard.
// The example hands raw handles across.
#![allow(unsafe_code, clippy::undocumented_unsafe_blocks, clippy::unwrap_used)]

#[path = "../src/main.rs"]
mod embed_vulkanalia;

#[test]
fn the_vulkanalia_example_fits_its_goal() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("vulkanalia.png");
    // SAFETY: no other thread of this process reads the environment yet.
    unsafe {
        let checks = "VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT:VALIDATION_CHECK_ENABLE_SYNCHRONIZATION_VALIDATION_QUEUE_SUBMIT";
        std::env::set_var("VK_LAYER_ENABLES", checks);
    }
    let report = embed_vulkanalia::run(&path, true).unwrap();
    assert_eq!(report.messages, Vec::<String>::new());
    let [before, after] = report.losses;
    assert!(after < 0.1 * before, "{before} {after}");
    assert!(std::fs::metadata(path).unwrap().len() > 1000);
}
