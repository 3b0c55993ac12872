//! The one writer of files: each appears whole or not at all, under the name that the caller gave.
//!
//! A file is written under a random name beside its target, flushed to the disk and then renamed, so that a reader meets
//! the old content or the new one and an error leaves the old. Temporary files are created new: a link that lies under
//! their name is never followed. A link in place of the target itself is written through, and an existing file keeps its
//! permissions. Several files that belong together are all flushed before the first is renamed, and the last one is the
//! one that names the others, so that it never names a file that is missing. A later write to a folder removes the
//! temporary files that a killed process left there.

use softras::{Error, Result};
use std::{
    fs, io,
    io::Write,
    path::{Path, PathBuf},
    time::Duration,
};
use tempfile::NamedTempFile;

/// How the names of temporary files begin and end.
const PREFIX: &str = ".softras-";
const SUFFIX: &str = ".tmp";

/// The age at which a temporary file is litter: no write takes nearly as long.
const LITTER_AGE: Duration = Duration::from_secs(3600);

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
    remove_litter(folder_of(target));
    let mut builder = tempfile::Builder::new();
    // Short whatever the target's name: that may already be as long as the file system allows.
    builder.prefix(PREFIX).suffix(SUFFIX).rand_bytes(12);
    // The mode with which any program creates files; the process's umask takes bits away.
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

/// Removes the temporary files of processes that were killed: those that nobody has written to for an hour.
fn remove_litter(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let name = entry.file_name();
        let is_ours = name.to_str().is_some_and(|name| name.starts_with(PREFIX) && name.ends_with(SUFFIX));
        let modified = || entry.metadata().ok().filter(fs::Metadata::is_file)?.modified().ok();
        if is_ours && modified().and_then(|time| time.elapsed().ok()).is_some_and(|age| age > LITTER_AGE) {
            // It is no concern of this write whether that succeeds.
            _ = fs::remove_file(entry.path());
        }
    }
}

/// Makes a rename survive a power failure, where folders can be flushed: not on Windows, and not a folder that this user
/// may write into but not read.
fn flush_folder(target: &Path) -> io::Result<()> {
    if !cfg!(unix) {
        return Ok(());
    }
    fs::File::open(folder_of(target)).map_or(Ok(()), |folder| folder.sync_all())
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

/// The folder that a file lies in.
pub(crate) fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}
