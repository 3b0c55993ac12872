//! Sets of pictures from archives of Sweet Home 3D furniture, as Debian's package `sweethome3d-furniture` installs them.
//!
//! An archive is read as a stranger's: what is unpacked is bounded, and lies in a temporary folder that no path leads out of.

use crate::catalogue::{CLASSES, Piece, pieces};
use crate::{file_error, io_error, synthesis};
use softras::glam::{DMat3, DVec3};
use softras::{Mesh, Renderer, Result};
use softras_io::{LoadOptions, input};
use std::collections::HashSet;
use std::fs::{self, File};
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};
use zip::ZipArchive;

/// The catalogue in every archive.
const CATALOGUE: &str = "PluginFurnitureCatalog.properties";
/// The most bytes of a catalogue, of all files of an archive that are unpacked, and of a mesh with its textures in memory.
const MOST_CATALOGUE: u64 = 1 << 24;
const MOST_UNPACKED: u64 = 1 << 31;
const MOST_MEMORY: u64 = 1 << 30;
const FIX: &str = "install the package sweethome3d-furniture anew, or leave this archive out";

/// A piece whose files have been unpacked.
struct Unpacked {
    piece: Piece,
    model: PathBuf,
    /// The size and checksum of its model, by which two pieces are found to have the same one. `None` where the archive lacks it.
    print: Option<(u64, u32)>,
}

/// Unpacks the files around the models of an archive's pieces.
fn unpack(archive: &Path, to: &Path) -> Result<Vec<Unpacked>> {
    let broken = |what: String| file_error(archive, what, FIX);
    let zip = ZipArchive::new(BufReader::new(input::open(archive)?));
    let mut zip = zip.map_err(|e| broken(format!("not an archive ({e})")))?;
    let catalogue = zip.by_name(CATALOGUE).map_err(|e| broken(format!("{CATALOGUE} cannot be unpacked ({e})")))?;
    let mut text = Vec::new();
    // One byte more than is allowed tells what is too large, whatever the archive says of its sizes.
    catalogue.take(MOST_CATALOGUE + 1).read_to_end(&mut text).map_err(|e| broken(e.to_string()))?;
    if text.len() as u64 > MOST_CATALOGUE {
        return Err(broken(format!("{CATALOGUE} has more than {MOST_CATALOGUE} bytes")));
    }
    // Names that tell a class are plain English, whatever the encoding of the others is.
    let pieces = pieces(&String::from_utf8_lossy(&text));
    let around: HashSet<&Path> = pieces.iter().filter_map(|piece| Path::new(&piece.model).parent()).collect();
    let mut room = MOST_UNPACKED;
    for i in 0..zip.len() {
        let entry = zip.by_index(i).map_err(|e| broken(e.to_string()))?;
        let name = entry.name().map_err(|e| broken(e.to_string()))?.into_owned();
        if entry.is_dir() || !Path::new(&name).ancestors().skip(1).any(|folder| around.contains(folder)) {
            continue;
        }
        let Some(place) = entry.enclosed_name() else {
            return Err(broken(format!("the name of {name:?} leads out of the archive")));
        };
        let path = to.join(place);
        path.parent().map_or(Ok(()), fs::create_dir_all).map_err(|e| io_error(&path, e))?;
        let mut file = File::create_new(&path).map_err(|e| io_error(&path, e))?;
        let copied = std::io::copy(&mut entry.take(room + 1), &mut file);
        let bytes = copied.map_err(|e| broken(format!("{name} cannot be unpacked ({e})")))?;
        room = room.checked_sub(bytes).ok_or_else(|| broken(format!("more than {MOST_UNPACKED} bytes")))?;
    }
    let mut unpacked = |piece: Piece| {
        let print = zip.by_name(&piece.model).ok().map(|entry| (entry.size(), entry.crc32()));
        Unpacked { model: to.join(&piece.model), print, piece }
    };
    Ok(pieces.into_iter().map(&mut unpacked).collect())
}

impl Unpacked {
    /// Its mesh, upright and of the catalogue's proportions.
    fn mesh(&self) -> Result<Mesh> {
        let options = LoadOptions { memory: Some(MOST_MEMORY), ..LoadOptions::default() };
        let mut mesh = softras_io::load_with(&self.model, &options)?.mesh;
        // The rows of a matrix are the columns of its transpose.
        let turn = DMat3::from_cols_array(&self.piece.rotation).transpose();
        let turned: Vec<DVec3> = mesh.positions().iter().map(|p| turn * DVec3::from_array(p.map(f64::from))).collect();
        let (low, high) =
            turned.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(*p), h.max(*p)));
        let scale = DVec3::from_array(self.piece.size) / (high - low).max(DVec3::splat(1e-6));
        mesh.set_positions(turned.iter().map(|p| ((*p - low) * scale).as_vec3().to_array()).collect())?;
        Ok(mesh)
    }
}

/// Writes the sets of the four classes from the archives `*.sh3f` of a folder, the pieces by the order of their names; a model
/// that several pieces have is taken once.
pub fn furniture(renderer: &mut Renderer, folder: &Path, from: &Path) -> Result<()> {
    let scratch = tempfile::tempdir().map_err(|e| io_error(&std::env::temp_dir(), e))?;
    let mut all = Vec::new();
    for (i, archive) in archives(from)?.iter().enumerate() {
        all.extend(unpack(archive, &scratch.path().join(i.to_string()))?);
    }
    all.sort_by(|a, b| a.piece.id.cmp(&b.piece.id));
    let mut known = HashSet::new();
    // Pieces without a model stay, since each is reported later by its own name.
    all.retain(|one| one.print.is_none() || known.insert(one.print));
    for (class, (name, _)) in CLASSES.iter().enumerate() {
        let of_class = all.iter().filter(|one| one.piece.class == class);
        synthesis::class(renderer, folder, name, of_class.map(|one| (one.piece.id.clone(), one.mesh())))?;
    }
    Ok(())
}

fn archives(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut paths = Vec::new();
    for entry in fs::read_dir(folder).map_err(|e| io_error(folder, e))? {
        paths.push(entry.map_err(|e| io_error(folder, e))?.path());
    }
    paths.retain(|path| path.extension().is_some_and(|end| end == "sh3f"));
    paths.sort();
    if paths.is_empty() {
        let fix = "install the package sweethome3d-furniture, which has /usr/share/sweethome3d/furniture";
        return Err(file_error(folder, "no archive *.sh3f lies in it", fix));
    }
    Ok(paths)
}
