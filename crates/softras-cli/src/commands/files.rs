//! Files that are there whole or not at all.

use softras::{Error, Result};
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// Checks, before any work is done for it, that a file could be written there.
///
/// # Errors
/// [`Error::Io`] when the folder does not exist or something else than a file is in the way.
pub fn judge_writable(path: &Path) -> Result<()> {
    let folder = folder_of(path);
    if !folder.is_dir() {
        let source = std::io::Error::new(std::io::ErrorKind::NotFound, "the folder to write into does not exist");
        return Err(Error::Io { path: folder.into(), source });
    }
    if path.exists() && !path.is_file() {
        let source = std::io::Error::new(std::io::ErrorKind::InvalidInput, "exists and is not a regular file");
        return Err(Error::Io { path: path.into(), source });
    }
    Ok(())
}

/// Writes the bytes beside the file and renames them into place, so that no reader sees half a file.
///
/// # Errors
/// [`Error::Io`]; the file is then as it was before.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    judge_writable(path)?;
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let beside: PathBuf = folder_of(path).join(format!(".{name}.{}.part", std::process::id()));
    let io = |source| Error::Io { path: path.into(), source };
    let written = fs::File::create(&beside)
        .and_then(|mut file| file.write_all(bytes).and_then(|()| file.sync_all()))
        .and_then(|()| fs::rename(&beside, path));
    written.map_err(|e| {
        // What is left of a failed attempt is of no use to anyone; that it cannot be removed changes nothing.
        let _ = fs::remove_file(&beside);
        io(e)
    })
}
