//! Sets of pictures from meshes: the procedural families, or folders of mesh files.

use crate::data::{Object, PICTURE, write};
use crate::families::{self, EXTENT};
use crate::fill::solid;
use crate::solid::normalized;
use crate::{SIZE, VIEWS, camera, file_error, fit_error, hard, io_error};
use softras::scene::DirectionalLight;
use softras::{Image, Lights, Mesh, Renderer, Result, Scene, Settings};
use softras_io::LoadOptions;
use std::path::{Path, PathBuf};

/// Samples of a pixel along each side.
const SAMPLES: usize = 3;
/// The sets and the first seed of the objects of each, so that no object is in two of them.
const SETS: [(&str, u64); 3] = [("train", 0), ("val", 1 << 40), ("test", 2 << 40)];
/// The file names that are taken for meshes.
const MESHES: [&str; 5] = ["obj", "ply", "stl", "gltf", "glb"];

/// Renders the 24 pictures of a mesh and fills its solid.
pub fn object(renderer: &mut Renderer, class: usize, mesh: Mesh) -> Result<Object> {
    let solid = solid(&mesh)?;
    let cameras = (0..VIEWS).map(camera).collect::<Result<Vec<_>>>()?;
    let light = |direction, intensity| DirectionalLight { direction, color: [1.0; 3], intensity };
    let lights = Lights {
        ambient_intensity: 0.5,
        directional: vec![light([0.0, 1.0, 0.0], 0.35), light([1.0, 0.4, 0.6], 0.25), light([-0.7, 0.3, -1.0], 0.15)],
        ..Lights::unlit()
    };
    let side = (SIZE * SAMPLES) as u32;
    let settings = hard(Settings { width: side, height: side, ..Settings::default() });
    let frame = renderer.render(&Scene::new(mesh).with_lights(lights), &cameras, &settings)?;
    let (color, silhouette) = (frame.color()?, frame.silhouette()?);
    let pictures = (0..VIEWS).flat_map(|view| picture(color, silhouette, view)).collect();
    Ok(Object { class, pictures, solid })
}

/// The four planes of a view: the means of each pixel's samples, colours over black.
fn picture(color: &Image, silhouette: &Image, view: usize) -> Vec<u8> {
    let mut planes = vec![0; PICTURE];
    for (i, value) in planes.iter_mut().enumerate() {
        let (plane, row, column) = (i / (SIZE * SIZE), i / SIZE % SIZE, i % SIZE);
        let mut sum = 0.0;
        for k in 0..SAMPLES * SAMPLES {
            let (r, c) = (row * SAMPLES + k / SAMPLES, column * SAMPLES + k % SAMPLES);
            let alpha = silhouette.pixel(view, r, c)[0];
            sum += if plane == 3 { alpha } else { alpha * color.pixel(view, r, c)[plane].clamp(0.0, 1.0) };
        }
        *value = (255.0 * sum / (SAMPLES * SAMPLES) as f32).round() as u8;
    }
    planes
}

/// Writes the sets of the procedural families. `counts` are the objects of train, val and test for each family.
pub fn families(renderer: &mut Renderer, folder: &Path, names: &[String], counts: [usize; 3], seed: u64) -> Result<()> {
    for name in names {
        for ((set, first), count) in SETS.into_iter().zip(counts) {
            let mut objects = Vec::new();
            for i in 0..count {
                let Some(mesh) = families::object(name, (seed << 44) + first + i as u64) else {
                    let what = format!("there is no family {name:?}");
                    return Err(fit_error(what, &format!("use some of {}", families::NAMES.join(", "))));
                };
                objects.push(object(renderer, 0, mesh?)?);
            }
            write(folder, name, set, &objects)?;
        }
    }
    Ok(())
}

/// Writes the sets of one class from meshes with their names: of ten, seven for train, one for val and two for test. Meshes
/// that cannot be read are left out with a message.
pub fn class(
    renderer: &mut Renderer,
    folder: &Path,
    name: &str,
    meshes: impl Iterator<Item = (String, Result<Mesh>)>,
) -> Result<()> {
    let mut sets: [Vec<Object>; 3] = Default::default();
    for (i, (mesh_name, mesh)) in meshes.enumerate() {
        let set = match i % 10 {
            3 => 1,
            6 | 9 => 2,
            _ => 0,
        };
        match mesh.and_then(|mesh| object(renderer, 0, normalized(mesh, EXTENT)?)) {
            Ok(object) => sets[set].push(object),
            Err(error) => eprintln!("left out: {mesh_name} ({error})"),
        }
    }
    SETS.into_iter().zip(&sets).try_for_each(|((set, _), objects)| write(folder, name, set, objects))
}

/// Writes the sets of one class from the mesh files of a folder and its subfolders, by their order.
pub fn folder(renderer: &mut Renderer, folder: &Path, name: &str, meshes: &Path) -> Result<()> {
    let mut files = Vec::new();
    mesh_files(meshes, &mut files)?;
    files.sort();
    if files.is_empty() {
        let fix = format!("give a folder with files named {}", MESHES.map(|end| format!("*.{end}")).join(", "));
        return Err(file_error(meshes, "no mesh file lies in it", &fix));
    }
    // Where a mesh lies in its file does not matter: it is moved to the middle.
    let load = |file: &PathBuf| softras_io::load_with(file, &LoadOptions::default()).map(|loaded| loaded.mesh);
    class(renderer, folder, name, files.iter().map(|file| (file.display().to_string(), load(file))))
}

fn mesh_files(folder: &Path, files: &mut Vec<PathBuf>) -> Result<()> {
    for entry in std::fs::read_dir(folder).map_err(|e| io_error(folder, e))? {
        let entry = entry.map_err(|e| io_error(folder, e))?;
        let path = entry.path();
        // A link is followed to a file, and not to a folder, which might contain it.
        if entry.file_type().map_err(|e| io_error(folder, e))?.is_dir() {
            mesh_files(&path, files)?;
        } else if path.extension().and_then(|end| end.to_str()).is_some_and(|end| MESHES.contains(&end)) {
            files.push(path);
        }
    }
    Ok(())
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
pub mod tests {
    use super::*;
    use crate::data::Set;

    /// Two objects of two families each.
    pub fn small() -> Set {
        let names = ["sofa", "table"];
        let mut renderer = Renderer::new().unwrap();
        let mut of = |class: usize, seed| {
            object(&mut renderer, class, families::object(names[class], seed).unwrap().unwrap()).unwrap()
        };
        let objects = [(0, 7), (0, 8), (1, 7), (1, 8)].map(|(class, seed)| of(class, seed)).to_vec();
        Set { classes: names.map(String::from).to_vec(), objects }
    }
}
