//! The one writer of files: each appears whole or not at all, under the name that the caller gave.
//!
//! A file is written under a random name beside its target, flushed to the disk and then renamed, so that a reader meets
//! the old content or the new one and an error leaves the old. Temporary files are created new: a link that lies under
//! their name is never followed. A link in place of the target itself is written through, and an existing file keeps its
//! permissions. Several files that belong together are all flushed before the first is renamed, and the last one is the
//! one that names the others, so that it never names a file that is missing.

use crate::error::{Error, Result};
use std::{
    fs, io,
    io::Write,
    path::{Path, PathBuf},
};
use tempfile::NamedTempFile;

/// Symbolic links that are followed to a target, as many as Linux follows.
const MAX_LINKS: usize = 40;

/// Checks, before any work is done for it, that a file could be written there.
///
/// # Errors
/// [`Error::Io`] when the folder does not exist or the path is something else than a file.
pub fn check_writable(path: &Path) -> Result<()> {
    target_of(path).map(|_| ())
}

/// Writes one file.
///
/// # Errors
/// [`Error::Io`]; the file is then as it was before.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<()> {
    write_files(&[(path, bytes)])
}

/// Writes files that belong together; the one that names the others must be the last.
///
/// # Errors
/// [`Error::Io`] with the path that failed. Unless a rename itself failed, all files are then as they were before.
pub fn write_files<P: AsRef<Path>, B: AsRef<[u8]>>(files: &[(P, B)]) -> Result<()> {
    let mut staged = Vec::with_capacity(files.len());
    for (path, bytes) in files {
        let path = path.as_ref();
        let target = target_of(path)?;
        let file = stage(&target, bytes.as_ref()).map_err(|source| Error::Io { path: path.into(), source })?;
        staged.push((path, target, file));
    }
    for (path, target, file) in staged {
        let renamed = file.persist(&target).map_err(|error| error.error).and_then(|_| flush_folder(&target));
        renamed.map_err(|source| Error::Io { path: path.into(), source })?;
    }
    Ok(())
}

/// A flushed temporary file beside the target, with the permissions that the target shall have; removed when dropped.
fn stage(target: &Path, bytes: &[u8]) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    // Short whatever the target's name: that may already be as long as the file system allows.
    builder.prefix(".softras-").suffix(".tmp").rand_bytes(12);
    // What any program creates files with; the process's umask takes bits away.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder.tempfile_in(folder_of(target))?;
    file.write_all(bytes)?;
    match fs::metadata(target) {
        Ok(existing) => file.as_file().set_permissions(existing.permissions())?,
        Err(error) if error.kind() == io::ErrorKind::NotFound => {}
        Err(error) => return Err(error),
    }
    file.as_file().sync_all()?;
    Ok(file)
}

/// Makes a rename survive a power failure, where folders can be flushed.
fn flush_folder(target: &Path) -> io::Result<()> {
    if cfg!(unix) { fs::File::open(folder_of(target))?.sync_all() } else { Ok(()) }
}

/// The file that a path means: itself, or what the links under its name lead to, be it there or not.
fn target_of(path: &Path) -> Result<PathBuf> {
    let refuse = |path: &Path, kind, what: &str| {
        let source = io::Error::new(kind, what);
        Err(Error::Io { path: path.into(), source })
    };
    let mut target = path.to_path_buf();
    for _ in 0..MAX_LINKS {
        let folder = folder_of(&target);
        if !folder.is_dir() {
            return refuse(folder, io::ErrorKind::NotFound, "the folder to write into does not exist");
        }
        match fs::symlink_metadata(&target) {
            Ok(metadata) if metadata.is_symlink() => {
                let link = fs::read_link(&target).map_err(|source| Error::Io { path: path.into(), source })?;
                target = folder.join(link);
            }
            Ok(metadata) if !metadata.is_file() => {
                return refuse(path, io::ErrorKind::InvalidInput, "exists and is not a regular file");
            }
            Ok(_) => return Ok(target),
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(target),
            Err(source) => return Err(Error::Io { path: path.into(), source }),
        }
    }
    refuse(path, io::ErrorKind::InvalidInput, "too many symbolic links")
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}
