//! Sets of pictures with their solids, in the format of the official data: `<class>_<set>_images.npz` (uint8, objects × 24 × 4
//! × 64 × 64) and `<class>_<set>_voxels.npz` (objects × 32³).

use crate::bits::Bits;
use crate::{SIZE, VIEWS, VOXELS, file_error, fit_error, io_error};
use softras::Result;
use softras_io::npy::{self, Array, Data};
use softras_io::{input, output};
use std::io::{BufReader, Cursor, Write};
use std::path::{Path, PathBuf};

/// Bytes of one picture: four planes, red, green, blue and alpha.
pub const PICTURE: usize = 4 * SIZE * SIZE;

/// An object: its pictures and its solid.
#[derive(Clone, Debug)]
pub struct Object {
    /// Its class, as an index into the set's.
    pub class: usize,
    /// 24 pictures.
    pub pictures: Vec<u8>,
    /// The voxels inside its mesh.
    pub solid: Bits,
}

impl Object {
    /// The four planes of a picture.
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

fn paths(folder: &Path, class: &str, set: &str) -> [PathBuf; 2] {
    ["images", "voxels"].map(|kind| folder.join(format!("{class}_{set}_{kind}.npz")))
}

/// Writes the objects of a class; both files or none.
pub fn write(folder: &Path, class: &str, set: &str, objects: &[Object]) -> Result<()> {
    std::fs::create_dir_all(folder).map_err(|e| io_error(folder, e))?;
    let pictures: Vec<u8> = objects.iter().flat_map(|object| &object.pictures).copied().collect();
    let voxels: Vec<u8> = objects.iter().flat_map(|object| object.solid.bytes()).collect();
    let [images_path, voxels_path] = paths(folder, class, set);
    let images = archive(&images_path, &[objects.len(), VIEWS, 4, SIZE, SIZE], &pictures)?;
    let voxels = archive(&voxels_path, &[objects.len(), VOXELS, VOXELS, VOXELS], &voxels)?;
    output::write_files(&[(&voxels_path, voxels), (&images_path, images)])?;
    eprintln!("{class}: {} objects for {set}", objects.len());
    Ok(())
}

/// An archive with one array, as `np.savez_compressed(file, array)` writes it.
fn archive(path: &Path, shape: &[usize], values: &[u8]) -> Result<Vec<u8>> {
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default()
        .compression_method(zip::CompressionMethod::Deflated)
        .large_file(values.len() > 1 << 30);
    zip.start_file("arr_0.npy", options).map_err(|e| io_error(path, e))?;
    zip.write_all(&npy::write(shape, Data::U8(values))).map_err(|e| io_error(path, e))?;
    Ok(zip.finish().map_err(|e| io_error(path, e))?.into_inner())
}

/// The first array of an archive, as the official code takes it.
fn first_array(path: &Path) -> Result<Array> {
    let broken = |what: String| file_error(path, what, "write it anew: the file is cut short or no .npz archive");
    let file = BufReader::new(input::open(path)?);
    let mut zip = zip::ZipArchive::new(file).map_err(|e| broken(e.to_string()))?;
    let entry = zip.by_index(0).map_err(|e| broken(e.to_string()))?;
    let room = |bytes: u64| input::room_for("an array", bytes).map_err(|error| error.to_string());
    npy::read(entry, room).map_err(broken)
}

/// The classes of which a folder has this set.
fn classes(folder: &Path, set: &str) -> Result<Vec<String>> {
    let end = format!("_{set}_images.npz");
    let mut classes = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(|e| io_error(folder, e))? {
        let name = entry.map_err(|e| io_error(folder, e))?.file_name();
        classes.extend(name.to_str().and_then(|name| name.strip_suffix(&end)).map(String::from));
    }
    if classes.is_empty() {
        return Err(file_error(folder, format!("no file is named *{end}"), "make a set with `data`"));
    }
    classes.sort();
    Ok(classes)
}

/// Reads a set of some classes; without any, of all that the folder has.
pub fn read(folder: &Path, set: &str, wanted: &[String]) -> Result<Set> {
    let classes = if wanted.is_empty() { classes(folder, set)? } else { wanted.to_vec() };
    let mut objects = Vec::new();
    for (class, name) in classes.iter().enumerate() {
        objects.extend(read_class(class, paths(folder, name, set))?);
    }
    if objects.is_empty() {
        return Err(fit_error(format!("the set {set} of {} has no objects", folder.display()), "make it with `data`"));
    }
    Ok(Set { classes, objects })
}

fn read_class(class: usize, [images, voxels]: [PathBuf; 2]) -> Result<Vec<Object>> {
    let (pictures, solids) = (first_array(&images)?, first_array(&voxels)?);
    let expected = [VIEWS, 4, SIZE, SIZE];
    let Some(bytes) = pictures.bytes().filter(|_| pictures.shape.get(1..) == Some(&expected[..])) else {
        let what = format!("{} of shape {:?}", pictures.dtype(), pictures.shape);
        return Err(file_error(&images, what, "uint8 of shape (objects, 24, 4, 64, 64) is expected"));
    };
    let count = pictures.shape[0];
    let Some(numbers) = solids.numbers().filter(|_| solids.shape == [count, VOXELS, VOXELS, VOXELS]) else {
        let what = format!("{} of shape {:?} for {count} objects", solids.dtype(), solids.shape);
        return Err(file_error(&voxels, what, "numbers of shape (objects, 32, 32, 32) are expected"));
    };
    let side = VOXELS.pow(3);
    let object = |(i, pictures): (usize, &[u8])| {
        let solid = Bits::new((i * side..(i + 1) * side).map(|k| numbers.at(k) > 0.5));
        Object { class, pictures: pictures.to_vec(), solid }
    };
    Ok(bytes.chunks_exact(VIEWS * PICTURE).enumerate().map(object).collect())
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn object(seed: u8) -> Object {
        let pictures = (0..VIEWS * PICTURE).map(|i| (i % 251) as u8 ^ seed).collect();
        Object { class: 0, pictures, solid: Bits::new((0..VOXELS.pow(3)).map(|i| i % 7 == usize::from(seed))) }
    }

    #[test]
    fn sets_are_read_as_they_were_written() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), "sofa", "train", &[object(1), object(2)]).unwrap();
        write(folder.path(), "bed", "train", &[object(3)]).unwrap();
        write(folder.path(), "table", "val", &[]).unwrap();
        let all = read(folder.path(), "train", &[]).unwrap();
        assert_eq!(all.classes, ["bed", "sofa"]);
        assert_eq!(all.objects.iter().map(|object| object.class).collect::<Vec<_>>(), [0, 1, 1]);
        for (read, seed) in all.objects.iter().zip([3, 1, 2]) {
            let expected = object(seed);
            assert!(read.pictures == expected.pictures && read.solid == expected.solid, "{seed}");
        }
        assert_eq!(read(folder.path(), "train", &["sofa".into()]).unwrap().objects.len(), 2);
        let refused = |set: &str, wanted: &[String]| read(folder.path(), set, wanted).unwrap_err().to_string();
        assert!(refused("train", &["ship".into()]).contains("ship_train_images.npz"));
        assert!(refused("test", &[]).contains("*_test_images.npz"));
        assert!(refused("val", &[]).contains("has no objects"));
    }

    #[test]
    fn files_that_are_no_set_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), "lamp", "val", &[object(1)]).unwrap();
        let images = folder.path().join("lamp_val_images.npz");
        let whole = std::fs::read(&images).unwrap();
        let refused = |bytes: &[u8]| {
            std::fs::write(&images, bytes).unwrap();
            read(folder.path(), "val", &[]).unwrap_err().to_string()
        };
        for length in [0, 100, whole.len() / 2, whole.len() - 1] {
            assert!(refused(&whole[..length]).contains("lamp_val_images.npz"), "{length}");
        }
        let zeros = |shape: &[usize]| archive(&images, shape, &vec![0; shape.iter().product()]).unwrap();
        let size = refused(&zeros(&[1, 24, 4, 32, 32]));
        assert!(size.contains("lamp_val_images.npz") && size.contains("(objects, 24, 4, 64, 64)"), "{size}");
        let count = refused(&zeros(&[2, 24, 4, 64, 64]));
        assert!(count.contains("lamp_val_voxels.npz") && count.contains("for 2 objects"), "{count}");
        std::fs::remove_file(folder.path().join("lamp_val_voxels.npz")).unwrap();
        assert!(refused(&whole).contains("lamp_val_voxels.npz"));
    }
}
