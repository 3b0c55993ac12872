//! A folder of this process for the files that a target reads, in memory where the system has /dev/shm.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// The file of that name with that content.
pub fn file(name: &str, content: &[u8]) -> PathBuf {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let memory = Path::new("/dev/shm");
        let parent = if memory.is_dir() { memory.to_path_buf() } else { std::env::temp_dir() };
        let folder = parent.join(format!("softras-fuzz-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder for the inputs");
        folder
    });
    let path = folder.join(name);
    std::fs::write(&path, content).expect("a file for the input");
    path
}
