//! All files are read through this module: only regular files, of a bounded size, into memory that could be allocated.
//!
//! Opening a pipe waits for its other end, reading a device may never end, and an allocation that fails ends the process.
//! So the kind of a file is tested before it is opened, and memory is reserved, with an error if there is none, before it is used.

use crate::refuse;
use softras::{Error, Result};
use std::{
    fs,
    io::{Read, Seek},
    path::Path,
};

/// Opens a regular file.
///
/// # Errors
/// [`Error::Io`] when it cannot be opened; [`Error::File`] for a folder, a pipe or a device, and for what a download leaves in the
/// place of a file: a Git LFS pointer or a web page.
pub fn open(path: &Path) -> Result<fs::File> {
    let io = |source| Error::Io { path: path.into(), source };
    if !fs::metadata(path).map_err(io)?.is_file() {
        return refuse(path, "not a regular file", "give the path of a file");
    }
    let mut file = fs::File::open(path).map_err(io)?;
    let mut head = Vec::new();
    (&mut file).take(512).read_to_end(&mut head).and_then(|_| file.rewind()).map_err(io)?;
    let head = String::from_utf8_lossy(&head).to_ascii_lowercase();
    let head = head.trim_start_matches('\u{feff}').trim_start();
    if head.starts_with("version http") && head.contains("oid sha256:") {
        return refuse(path, "a Git LFS pointer, not the file", "run `git lfs pull` in its repository");
    }
    if head.starts_with('<') && (head.contains("<!doctype html") || head.contains("<html")) {
        return refuse(path, "a web page, not the file", "download the file itself (on GitHub: the button Raw)");
    }
    Ok(file)
}

/// Reads a whole file of at most `most` bytes.
///
/// # Errors
/// As [`open`]; [`Error::File`] for a larger file; [`Error::Io`] without memory for it.
pub fn read(path: &Path, most: u64) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    // One byte more than is allowed tells a file that is too large, even one whose length the system does not know.
    // Reading reserves memory in such a way that a lack of it is an error.
    let read = open(path)?.take(most.saturating_add(1)).read_to_end(&mut bytes);
    read.map_err(|source| Error::Io { path: path.into(), source })?;
    match bytes.len() as u64 > most {
        true => refuse(path, format!("more than {most} bytes"), "give a smaller file"),
        false => Ok(bytes),
    }
}

/// Refuses a file of no bytes, of which a reader of any format would only say that it is malformed.
///
/// # Errors
/// [`Error::File`].
pub fn refuse_empty(path: &Path, bytes: u64) -> Result<()> {
    if bytes > 0 { Ok(()) } else { refuse(path, "the file is empty", "write it or copy it again") }
}

/// A vector with room for `count` values. A lack of memory for the content of a file is then an error and does not end the
/// process.
///
/// # Errors
/// [`Error::OutOfMemory`].
pub(crate) fn vector<T>(path: &Path, count: usize) -> Result<Vec<T>> {
    let mut vector = Vec::new();
    match vector.try_reserve_exact(count) {
        Ok(()) => Ok(vector),
        Err(_) => Err(Error::OutOfMemory {
            what: path.display().to_string(),
            bytes: (count * size_of::<T>()) as u64,
            fix: "give a smaller mesh, or allow the process more memory".into(),
        }),
    }
}

/// Makes sure that `bytes` bytes can be allocated at once, before code that ends the process if they cannot.
///
/// # Errors
/// [`Error::OutOfMemory`].
pub fn room_for(what: &str, bytes: u64) -> Result<()> {
    let room = usize::try_from(bytes).is_ok_and(|bytes| Vec::<u8>::new().try_reserve_exact(bytes).is_ok());
    let fix = "give smaller files, or allow the process more memory";
    if room { Ok(()) } else { Err(Error::OutOfMemory { what: what.into(), bytes, fix: fix.into() }) }
}
