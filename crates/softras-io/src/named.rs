//! Meshes by a name: that of a file or, where there is no such file, of a built-in mesh.

use crate::texture::{linear_from_srgb, srgb_from_linear};
use crate::{LoadOptions, Loaded, by_ending, fault, load_with, output::folder_of, text};
use softras::{Result, scene::Appearance, shapes};
use std::{fs, io::ErrorKind, path::Path};

/// Names this similar (Jaro, 0 to 1) are offered in place of one that is not found: one letter more, less or swapped is.
const SIMILAR: f64 = 0.8;
/// The most files that are offered.
const MOST_FILES: usize = 3;

/// Reads a mesh file as [`load_with`] does. Where there is none, the path may be one of [`shapes::NAMES`]: that mesh is made, with the
/// colours that its file by `softras mesh` has.
///
/// # Errors
/// Those of [`load_with`] and [`built_in`].
pub fn load_named(path: impl AsRef<Path>, options: &LoadOptions) -> Result<Loaded> {
    let path = path.as_ref();
    let Some(name) = built_in(path)? else { return load_with(path, options) };
    let mesh = shapes::by_name(name)?;
    let decode = |x: f32| if options.srgb { linear_from_srgb(x) } else { x };
    let mut appearance = mesh.appearance().clone();
    match &mut appearance {
        Appearance::Textured { textures, .. } => {
            for texture in textures {
                *texture = texture.with_texels(texture.texels().iter().map(|texel| texel.map(decode)).collect())?;
            }
        }
        // They are linear, and sRGB in a file.
        Appearance::VertexColors(colors) => {
            colors.as_flattened_mut().iter_mut().for_each(|x| *x = decode(srgb_from_linear(*x)));
        }
        Appearance::Uniform(_) | Appearance::Surface { .. } => {}
    }
    let mut loaded = Loaded::from(mesh.with_appearance(appearance)?);
    let files = files_like(path, 1.0);
    if !files.is_empty() {
        loaded.notes.push(format!("{name} is the built-in mesh, not {}", files.join(" or ")));
    }
    Ok(loaded)
}

/// The built-in mesh that a path names, or `None` if a file lies there.
///
/// # Errors
/// [`softras::Error::File`] for a path that is neither. It lists the built-in meshes, and files and names that are similar.
pub fn built_in(path: impl AsRef<Path>) -> Result<Option<&'static str>> {
    let path = path.as_ref();
    let name = shapes::NAMES.into_iter().find(|name| path.as_os_str() == *name);
    match fs::metadata(path) {
        Err(error) if error.kind() == ErrorKind::NotFound => {}
        // A folder is no mesh, so it does not hide one.
        Ok(found) if found.is_dir() && name.is_some() => {}
        // The reader reads it, or tells why it cannot.
        _ => return Ok(None),
    }
    if name.is_some() {
        return Ok(name);
    }
    let own = stem(path);
    let names = shapes::NAMES.into_iter().filter(|name| strsim::jaro(name, &own) >= SIMILAR);
    let near: Vec<_> =
        files_like(path, SIMILAR).into_iter().chain(names.map(|name| format!("the built-in {name}"))).collect();
    let question = if near.is_empty() { String::new() } else { format!("did you mean {}? ", near.join(" or ")) };
    let folder = folder_of(path);
    let missing = if folder.is_dir() { String::new() } else { format!("there is no folder {}: ", folder.display()) };
    let fix = format!("{question}{missing}give the path of a mesh file, or one of {}", shapes::NAMES.join(", "));
    Err(fault(path, "neither a file nor a built-in mesh", fix))
}

/// The mesh files beside a path whose names without their endings are at least this similar to its own, the most similar first.
fn files_like(path: &Path, least: f64) -> Vec<String> {
    let own = stem(path);
    let entries = folder_of(path).read_dir().into_iter().flatten().flatten().map(|entry| entry.path());
    let mut found: Vec<_> = entries
        .filter(|file| by_ending(file).is_some() && file.is_file())
        .map(|file| (strsim::jaro(&stem(&file), &own), path.with_file_name(file.file_name().unwrap_or_default())))
        .filter(|(similarity, _)| *similarity >= least)
        .collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0).then_with(|| a.1.cmp(&b.1)));
    found.iter().take(MOST_FILES).map(|(_, file)| text::name(&file.to_string_lossy())).collect()
}

/// A file's name without its ending, in lower case.
fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().to_lowercase()
}
