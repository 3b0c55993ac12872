//! Sets of pictures from meshes: the procedural families, or folders of mesh files.

use super::data::{Object, PICTURE, Shard, write};
use super::families::{self, EXTENT};
use super::fill::Grid;
use super::solid::normalized;
use super::{SIZE, VIEWS, camera, fit_error};
use softras::scene::{ColorAggregation, DirectionalLight, Distance, SilhouetteAggregation};
use softras::{Error, Image, Lights, Mesh, Renderer, Result, Scene, Settings};
use softras_io::LoadOptions;
use std::path::{Path, PathBuf};

/// Samples of a pixel along each side.
const SAMPLES: usize = 3;
/// The sets and the first seed of the objects of each, so that no object is in two of them.
const SETS: [(&str, u64); 3] = [("train", 0), ("val", 1 << 40), ("test", 2 << 40)];
/// The file names that are taken for meshes.
const MESHES: [&str; 5] = ["obj", "ply", "stl", "gltf", "glb"];

/// Renders the 24 pictures of a mesh and fills its solid.
///
/// # Errors
/// As [`Renderer::render`].
pub fn object(renderer: &mut Renderer, class: usize, mesh: Mesh) -> Result<Object> {
    let solid = Grid::new(&mesh)?;
    let cameras = (0..VIEWS).map(camera).collect::<Result<Vec<_>>>()?;
    let light = |direction, intensity| DirectionalLight { direction, color: [1.0; 3], intensity };
    let lights = Lights {
        ambient_intensity: 0.5,
        directional: vec![light([0.0, 1.0, 0.0], 0.35), light([1.0, 0.4, 0.6], 0.25), light([-0.7, 0.3, -1.0], 0.15)],
        ..Lights::unlit()
    };
    let side = (SIZE * SAMPLES) as u32;
    let settings = Settings {
        width: side,
        height: side,
        color: ColorAggregation::Hard,
        silhouette: SilhouetteAggregation::Hard,
        distance: Distance::Hard,
        ..Settings::default()
    };
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

/// Makes a shard of the sets of the procedural families and writes it. `counts` are the objects of train, val and test for
/// each family; `progress` is told of every file.
///
/// # Errors
/// [`Error::Fit`] for an unknown family; [`Error::Io`]; as [`Renderer::render`].
pub fn families(
    renderer: &mut Renderer,
    folder: &Path,
    names: &[String],
    counts: [usize; 3],
    seed: u64,
    shard: Shard,
    mut progress: impl FnMut(&str),
) -> Result<()> {
    for name in names {
        for ((set, first), count) in SETS.into_iter().zip(counts) {
            let mut objects = Vec::new();
            for i in shard.of(count) {
                let Some(mesh) = families::object(name, (seed << 44) + first + i as u64) else {
                    let what = format!("there is no family {name:?}");
                    return fit_error(what, &format!("use some of {}", families::NAMES.join(", ")));
                };
                objects.push(object(renderer, 0, mesh?)?);
            }
            write(folder, name, set, shard, &objects)?;
            progress(&format!("{name}: {} objects for {set}", objects.len()));
        }
    }
    Ok(())
}

/// Makes a shard of the sets of one class from the mesh files of a folder and its subfolders, seven of ten for train, one
/// for val and two for test by their order; files that cannot be read are told of and left out.
///
/// # Errors
/// [`Error::Io`]; [`Error::File`] where there is no mesh file; as [`Renderer::render`].
pub fn folder(
    renderer: &mut Renderer,
    folder: &Path,
    class: &str,
    meshes: &Path,
    shard: Shard,
    mut progress: impl FnMut(&str),
) -> Result<()> {
    let mut files = Vec::new();
    mesh_files(meshes, &mut files)?;
    files.sort();
    if files.is_empty() {
        let fix = format!("give a folder with files named {}", MESHES.map(|end| format!("*.{end}")).join(", "));
        return super::file_error(meshes, "no mesh file lies in it", &fix);
    }
    let mut sets: [Vec<Object>; 3] = Default::default();
    for i in shard.of(files.len()) {
        let loaded = softras_io::load_with(&files[i], &LoadOptions { ..LoadOptions::default() });
        let made = loaded.and_then(|loaded| object(renderer, 0, normalized(loaded.mesh, EXTENT)?));
        match made {
            Ok(object) => sets[set_of(i)].push(object),
            Err(error) => progress(&format!("left out: {error}")),
        }
    }
    write_sets(folder, class, shard, &sets, &mut progress)
}

/// The set of an object that comes from a file, by its number: seven of ten train, one chooses checkpoints, two test.
pub fn set_of(number: usize) -> usize {
    match number % 10 {
        3 => 1,
        6 | 9 => 2,
        _ => 0,
    }
}

/// Writes the sets train, val and test of a class, or of a shard of it.
///
/// # Errors
/// [`Error::Io`].
pub fn write_sets(
    folder: &Path,
    class: &str,
    shard: Shard,
    sets: &[Vec<Object>; 3],
    progress: &mut impl FnMut(&str),
) -> Result<()> {
    for ((set, _), objects) in SETS.into_iter().zip(sets) {
        write(folder, class, set, shard, objects)?;
        progress(&format!("{class}: {} objects for {set}", objects.len()));
    }
    Ok(())
}

fn mesh_files(folder: &Path, files: &mut Vec<PathBuf>) -> Result<()> {
    let io = |source| Error::Io { path: folder.into(), source };
    for entry in std::fs::read_dir(folder).map_err(io)? {
        let entry = entry.map_err(io)?;
        let path = entry.path();
        // A link is followed to a file, and not to a folder, which might contain it.
        if entry.file_type().map_err(io)?.is_dir() {
            mesh_files(&path, files)?;
        } else if path.extension().and_then(|end| end.to_str()).is_some_and(|end| MESHES.contains(&end)) {
            files.push(path);
        }
    }
    Ok(())
}
