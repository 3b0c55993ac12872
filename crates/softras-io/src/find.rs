//! Finds the files that a mesh file names, within its folder.

use crate::output::folder_of;
use std::path::{Component, Path, PathBuf};

/// The file that `parent` names. If it is not there, the file of that name in the folder of `parent` or of the mesh, with a note:
/// a mesh file from another computer may name places on that computer's disk.
///
/// # Errors
/// A sentence, if no such file is found within the mesh's folder.
pub fn find(mesh: &Path, parent: &Path, name: &str, allow_outside: bool) -> Result<(PathBuf, Option<String>), String> {
    let path = locate(parent, name);
    let allowed = allow_outside || is_inside(mesh, &path);
    if allowed && path.is_file() {
        return Ok((path, None));
    }
    let last = name.rsplit(['/', '\\']).next().unwrap_or_default();
    for folder in [folder_of(parent), folder_of(mesh)] {
        if let Some(found) = named(folder, last).filter(|found| is_inside(mesh, found)) {
            let note = format!("{name:?} not found: {} is taken in its place", found.display());
            return Ok((found, Some(note)));
        }
    }
    let shown = path.display();
    if allowed {
        Err(format!("{shown} not found"))
    } else {
        Err(format!("{shown} lies outside the mesh's folder (--allow-outside reads it)"))
    }
}

/// The regular file of that name in a folder, in upper or lower case, and with letters beyond ASCII in any encoding.
fn named(folder: &Path, name: &str) -> Option<PathBuf> {
    let is_name = matches!(Path::new(name).components().next(), Some(Component::Normal(_)));
    let exact = folder.join(name);
    if !is_name || exact.is_file() {
        return is_name.then_some(exact);
    }
    let entries = || folder.read_dir().into_iter().flatten().filter_map(|entry| entry.ok().map(|entry| entry.path()));
    let own = |path: &PathBuf| path.file_name().map(|other| other.as_encoded_bytes().to_ascii_lowercase());
    let same = |path: &PathBuf| own(path).is_some_and(|other| other == name.to_ascii_lowercase().as_bytes());
    // The first of several by name, so that the order of the folder does not matter.
    let found = entries().filter(same).filter(|path| path.is_file()).min();
    let alike =
        |path: &PathBuf| own(path).is_some_and(|other| plain(&other) == plain(name.to_ascii_lowercase().as_bytes()));
    let several = || entries().filter(alike).filter(|path| path.is_file()).collect::<Vec<_>>();
    found.or_else(|| if name.is_ascii() { None } else { several().try_into().map(|[only]: [PathBuf; 1]| only).ok() })
}

/// A name with a mark in place of letters beyond ASCII, whatever their encoding, and of letters with an accent of their own.
fn plain(name: &[u8]) -> Vec<u8> {
    let mut plain = Vec::with_capacity(name.len());
    for &byte in name {
        if byte.is_ascii() {
            plain.push(byte);
        } else if plain.last() != Some(&0) {
            // U+0300 to U+036F follow the letter that they change.
            if matches!(byte, 0xcc | 0xcd) {
                plain.pop();
            }
            plain.push(0);
        }
    }
    plain
}

/// The path of a file that `parent` names, relative to the folder of `parent`.
fn locate(parent: &Path, name: &str) -> PathBuf {
    let folder = parent.parent().unwrap_or(Path::new(""));
    let path = folder.join(name);
    // Files from Windows separate folders by backslashes.
    if path.is_file() || !name.contains('\\') { path } else { folder.join(name.replace('\\', "/")) }
}

/// Whether a path stays in the folder of the mesh, which it may leave by `..`, as an absolute path or by a link: a mesh
/// from elsewhere must not make softras read other files.
fn is_inside(mesh: &Path, file: &Path) -> bool {
    let folder = folder_of(mesh);
    match (folder.canonicalize(), file.canonicalize()) {
        (Ok(folder), Ok(file)) => file.starts_with(folder),
        // The file does not exist, so only its path can be checked: it must go down from the mesh's folder.
        _ => file
            .strip_prefix(mesh.parent().unwrap_or(folder))
            .is_ok_and(|rest| rest.components().all(|c| matches!(c, Component::Normal(_)))),
    }
}
