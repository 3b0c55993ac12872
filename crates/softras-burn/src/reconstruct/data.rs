//! Sets of pictures with their solids, in the format of the official data: `<class>_<set>_images.npz` (uint8, objects × 24 × 4
//! × 64 × 64) and `<class>_<set>_voxels.npz` (objects × 32³).
//!
//! A set may be made in shards: `<class>_<set>_images_<i>_of_<n>.npz`. Those of a class are read as one set.

use super::fill::Grid;
use super::{SIZE, VIEWS, VOXELS, file_error, fit_error};
use softras::{Error, Result};
use softras_io::npy::{self, Array, Data};
use softras_io::{input, output};
use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};

/// Bytes of one picture: four planes, red, green, blue and alpha.
pub const PICTURE: usize = 4 * SIZE * SIZE;

/// One part of a set that is made in several.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Its number, from 0.
    pub index: usize,
    /// How many there are.
    pub count: usize,
}

impl Shard {
    /// The whole set.
    pub const WHOLE: Self = Self { index: 0, count: 1 };

    /// The numbers of the objects of this shard.
    pub fn of(self, objects: usize) -> impl Iterator<Item = usize> {
        (self.index..objects).step_by(self.count)
    }

    fn suffix(self) -> String {
        if self == Self::WHOLE { String::new() } else { format!("_{}_of_{}", self.index, self.count) }
    }
}

/// An object: its pictures and, where it is known, its solid.
#[derive(Clone, Debug)]
pub struct Object {
    /// Its class, as an index into the set's.
    pub class: usize,
    /// 24 pictures.
    pub pictures: Vec<u8>,
    /// The solid that its mesh fills.
    pub solid: Grid,
}

impl Object {
    /// The four planes of a picture.
    ///
    /// # Panics
    /// For a view that is not below [`VIEWS`].
    pub fn picture(&self, view: usize) -> &[u8] {
        &self.pictures[view * PICTURE..(view + 1) * PICTURE]
    }
}

/// Objects of some classes.
#[derive(Clone, Debug, Default)]
pub struct Set {
    /// The names of the classes.
    pub classes: Vec<String>,
    /// The objects, class after class.
    pub objects: Vec<Object>,
}

fn paths(folder: &Path, class: &str, set: &str, shard: Shard) -> [PathBuf; 2] {
    ["images", "voxels"].map(|kind| folder.join(format!("{class}_{set}_{kind}{}.npz", shard.suffix())))
}

/// Writes the objects of a class, or of a shard of it; both files or none.
///
/// # Errors
/// [`Error::Io`].
pub fn write(folder: &Path, class: &str, set: &str, shard: Shard, objects: &[Object]) -> Result<()> {
    std::fs::create_dir_all(folder).map_err(|source| Error::Io { path: folder.into(), source })?;
    let pictures: Vec<u8> = objects.iter().flat_map(|object| &object.pictures).copied().collect();
    let voxels: Vec<u8> = objects.iter().flat_map(|object| object.solid.bytes()).collect();
    let [images_path, voxels_path] = paths(folder, class, set, shard);
    let images = archive(&images_path, &[objects.len(), VIEWS, 4, SIZE, SIZE], &pictures)?;
    let voxels = archive(&voxels_path, &[objects.len(), VOXELS, VOXELS, VOXELS], &voxels)?;
    output::write_files(&[(&voxels_path, voxels), (&images_path, images)])
}

/// An archive with one array, as `np.savez_compressed(file, array)` writes it.
fn archive(path: &Path, shape: &[usize], values: &[u8]) -> Result<Vec<u8>> {
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default()
        .compression_method(zip::CompressionMethod::Deflated)
        .large_file(values.len() > 1 << 30);
    let mut pack = || -> zip::result::ZipResult<()> {
        zip.start_file("arr_0.npy", options)?;
        zip.write_all(&npy::write(shape, Data::U8(values)))?;
        Ok(())
    };
    let io = |e: zip::result::ZipError| Error::Io { path: path.into(), source: std::io::Error::other(e) };
    pack().map_err(io)?;
    Ok(zip.finish().map_err(io)?.into_inner())
}

/// The first array of an archive, as the official code takes it.
fn first_array(path: &Path) -> Result<Array> {
    let broken = "write it anew: the file is cut short or no .npz archive";
    let file = std::io::BufReader::new(input::open(path)?);
    let mut zip = zip::ZipArchive::new(file).or_else(|e| file_error(path, e.to_string(), broken))?;
    if zip.is_empty() {
        return file_error(path, "the archive is empty", "one array is expected");
    }
    let entry = zip.by_index(0).or_else(|e| file_error(path, e.to_string(), broken))?;
    let room = |bytes: u64| input::room_for("an array", bytes).map_err(|error| error.to_string());
    npy::read(entry, room).or_else(|what| file_error(path, what, broken))
}

/// The files of a class's shards, each with its pictures and its voxels.
fn shards(folder: &Path, class: &str, set: &str) -> Result<Vec<[PathBuf; 2]>> {
    let whole = paths(folder, class, set, Shard::WHOLE);
    if whole[0].exists() {
        return Ok(vec![whole]);
    }
    let start = format!("{class}_{set}_images_0_of_");
    let counts = names(folder)?.into_iter().filter_map(|name| {
        name.strip_prefix(&start)?.strip_suffix(".npz")?.parse::<usize>().ok().filter(|n| (1..=10_000).contains(n))
    });
    match counts.min() {
        Some(count) => Ok((0..count).map(|index| paths(folder, class, set, Shard { index, count })).collect()),
        None => {
            file_error(&whole[0], "there is no such file, and no shard of it", "make it with `data`, or name others")
        }
    }
}

fn names(folder: &Path) -> Result<Vec<String>> {
    let io = |source| Error::Io { path: folder.into(), source };
    let entries = std::fs::read_dir(folder).map_err(io)?;
    let mut names = Vec::new();
    for entry in entries {
        names.extend(entry.map_err(io)?.file_name().into_string().ok());
    }
    names.sort();
    Ok(names)
}

/// The classes of which a folder has this set.
///
/// # Errors
/// [`Error::Io`]; [`Error::File`] where there is none.
pub fn classes(folder: &Path, set: &str) -> Result<Vec<String>> {
    let middle = format!("_{set}_images");
    let mut classes: Vec<String> = names(folder)?
        .iter()
        .filter(|name| name.ends_with(".npz"))
        .filter_map(|name| name.split_once(&middle).map(|(class, _)| class.to_string()))
        .collect();
    classes.dedup();
    if classes.is_empty() {
        return file_error(folder, format!("no file is named *{middle}.npz"), "make a set with `data`");
    }
    Ok(classes)
}

/// Reads a set of some classes; without any, of all that the folder has.
///
/// # Errors
/// [`Error::Io`]; [`Error::File`] for a file that is missing, cut short or of another shape.
pub fn read(folder: &Path, set: &str, wanted: &[String]) -> Result<Set> {
    let classes = if wanted.is_empty() { classes(folder, set)? } else { wanted.to_vec() };
    let mut objects = Vec::new();
    for (class, name) in classes.iter().enumerate() {
        for [images, voxels] in shards(folder, name, set)? {
            read_shard(class, &images, &voxels, &mut objects)?;
        }
    }
    if objects.is_empty() {
        return fit_error(format!("the set {set} of {} has no objects", folder.display()), "make it with `data`");
    }
    Ok(Set { classes, objects })
}

fn read_shard(class: usize, images: &Path, voxels: &Path, objects: &mut Vec<Object>) -> Result<()> {
    let (pictures, solids) = (first_array(images)?, first_array(voxels)?);
    let expected = [VIEWS, 4, SIZE, SIZE];
    let Some(bytes) = pictures.bytes().filter(|_| pictures.shape.get(1..) == Some(&expected[..])) else {
        let what = format!("{} of shape {:?}", pictures.dtype(), pictures.shape);
        return file_error(images, what, "uint8 of shape (objects, 24, 4, 64, 64) is expected");
    };
    let count = pictures.shape[0];
    let Some(numbers) = solids.numbers().filter(|_| solids.shape == [count, VOXELS, VOXELS, VOXELS]) else {
        let what = format!("{} of shape {:?} for {count} objects", solids.dtype(), solids.shape);
        return file_error(voxels, what, "numbers of shape (objects, 32, 32, 32) are expected");
    };
    let side = VOXELS.pow(3);
    for i in 0..count {
        let values: Vec<bool> = (i * side..(i + 1) * side).map(|k| numbers.at(k) > 0.5).collect();
        let Some(solid) = Grid::from_values(values.into_iter()) else { continue };
        let pictures = bytes[i * VIEWS * PICTURE..(i + 1) * VIEWS * PICTURE].to_vec();
        objects.push(Object { class, pictures, solid });
    }
    Ok(())
}
