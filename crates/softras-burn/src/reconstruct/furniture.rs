//! Sets of pictures from archives of Sweet Home 3D furniture, as Debian's package `sweethome3d-furniture` installs them.
//!
//! An archive is read as a stranger's: what is unpacked is bounded, and lies in a temporary folder that no path leads out of.

use super::catalogue::{CLASSES, Piece, pieces};
use super::data::{Object, Shard};
use super::families::EXTENT;
use super::solid::normalized;
use super::synthesis::{object, set_of, write_sets};
use super::{file_error, file_fault};
use softras::glam::{DMat3, DVec3};
use softras::{Error, Mesh, Renderer, Result};
use softras_io::LoadOptions;
use softras_io::input;
use std::collections::HashSet;
use std::fs::File;
use std::io::{BufReader, Read, Write};
use std::path::{Path, PathBuf};
use zip::ZipArchive;

/// The catalogue in every archive.
const CATALOGUE: &str = "PluginFurnitureCatalog.properties";
/// The most bytes of a catalogue, of all files of a piece, and of its mesh and textures in memory.
const MOST_CATALOGUE: u64 = 1 << 24;
const MOST_UNPACKED: u64 = 1 << 28;
const MOST_MEMORY: u64 = 1 << 30;
const FIX: &str = "install the package sweethome3d-furniture anew, or leave this archive out";

/// An archive and what it holds.
struct Archive {
    path: PathBuf,
    zip: ZipArchive<BufReader<File>>,
}

impl Archive {
    fn open(path: &Path) -> Result<Self> {
        let zip = ZipArchive::new(BufReader::new(input::open(path)?));
        Ok(Self { path: path.into(), zip: zip.or_else(|e| file_error(path, format!("not an archive ({e})"), FIX))? })
    }

    /// Writes an entry, of which at most `most` bytes are allowed; how many it has.
    fn copy(&mut self, name: &str, most: u64, to: &mut impl Write) -> Result<u64> {
        let path = self.path.clone();
        let broken = |e: &dyn std::fmt::Display| file_fault(&path, format!("{name} cannot be unpacked ({e})"), FIX);
        let entry = self.zip.by_name(name).map_err(|e| broken(&e))?;
        // One byte more than is allowed tells an entry that is too large, whatever the archive says of its size.
        let bytes = std::io::copy(&mut entry.take(most.saturating_add(1)), to).map_err(|e| broken(&e))?;
        if bytes > most { Err(broken(&format!("more than {most} bytes"))) } else { Ok(bytes) }
    }

    fn pieces(&mut self) -> Result<Vec<Piece>> {
        let mut text = Vec::new();
        self.copy(CATALOGUE, MOST_CATALOGUE, &mut text)?;
        // Names that tell a class are plain English, whatever the encoding of the others is.
        Ok(pieces(&String::from_utf8_lossy(&text)))
    }

    /// The size and checksum of a piece's model: those of another are the same model.
    fn fingerprint(&mut self, piece: &Piece) -> Option<(u64, u32)> {
        self.zip.by_name(&piece.model).ok().map(|entry| (entry.size(), entry.crc32()))
    }

    /// The mesh of a piece, upright and of the catalogue's proportions.
    fn mesh(&mut self, piece: &Piece) -> Result<Mesh> {
        let folder = tempfile::tempdir().map_err(|source| Error::Io { path: std::env::temp_dir(), source })?;
        let around = piece.model.rsplit_once('/').map_or("", |(around, _)| around);
        let inside =
            |name: &String| name.strip_prefix(around).is_some_and(|rest| around.is_empty() || rest.starts_with('/'));
        let known = self.zip.file_names().filter_map(|name| Some(name.ok()?.into_owned()));
        let names: Vec<String> = known.filter(inside).collect();
        // Only what is unpacked here is read.
        if !names.contains(&piece.model) {
            return file_error(&self.path, format!("there is no {:?} in it", piece.model), FIX);
        }
        let mut room = MOST_UNPACKED;
        for name in names.iter().filter(|name| !name.ends_with('/')) {
            let Some(place) = self.zip.by_name(name).ok().and_then(|entry| entry.enclosed_name()) else {
                return file_error(&self.path, format!("the name of {name:?} leads out of the archive"), FIX);
            };
            let path = folder.path().join(place);
            let io = |source| Error::Io { path: path.clone(), source };
            path.parent().map_or(Ok(()), std::fs::create_dir_all).map_err(io)?;
            room -= self.copy(name, room, &mut File::create_new(&path).map_err(io)?)?;
        }
        let options = LoadOptions { memory: Some(MOST_MEMORY), ..LoadOptions::default() };
        upright(softras_io::load_with(&folder.path().join(&piece.model), &options)?.mesh, piece)
    }
}

/// The mesh turned and scaled as its catalogue says.
fn upright(mut mesh: Mesh, piece: &Piece) -> Result<Mesh> {
    // The rows of a matrix are the columns of its transpose.
    let turn = DMat3::from_cols_array(&piece.rotation).transpose();
    let turned: Vec<DVec3> = mesh.positions().iter().map(|p| turn * DVec3::from_array(p.map(f64::from))).collect();
    let (low, high) = turned.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(*p), h.max(*p)));
    let scale = DVec3::from_array(piece.size) / (high - low).max(DVec3::splat(1e-6));
    mesh.set_positions(turned.iter().map(|p| ((*p - low) * scale).as_vec3().to_array()).collect())?;
    normalized(mesh, EXTENT)
}

/// Makes a shard of the sets of the four classes from the archives `*.sh3f` of a folder, seven of ten pieces for train, one for
/// val and two for test by the order of their names; a model that several pieces have is taken once. Pieces that cannot be
/// read are told of and left out.
///
/// # Errors
/// [`Error::Io`]; [`Error::File`] where there is no archive, or one without a catalogue; as [`Renderer::render`].
pub fn furniture(
    renderer: &mut Renderer,
    folder: &Path,
    from: &Path,
    shard: Shard,
    mut progress: impl FnMut(&str),
) -> Result<()> {
    let mut archives = archives(from)?;
    let mut all = Vec::new();
    for (index, archive) in archives.iter_mut().enumerate() {
        all.extend(archive.pieces()?.into_iter().map(|piece| (piece, index)));
    }
    all.sort_by(|(a, _), (b, _)| a.id.cmp(&b.id));
    let mut known = HashSet::new();
    all.retain(|(piece, index)| {
        let print = archives[*index].fingerprint(piece);
        // What is missing is told of later, each by its own name.
        print.is_none() || known.insert(print)
    });
    for (class, (name, _)) in CLASSES.iter().enumerate() {
        let of_class: Vec<_> = all.iter().filter(|(piece, _)| piece.class == class).collect();
        let mut sets: [Vec<Object>; 3] = Default::default();
        for i in shard.of(of_class.len()) {
            let (piece, index) = of_class[i];
            match archives[*index].mesh(piece).and_then(|mesh| object(renderer, 0, mesh)) {
                Ok(object) => sets[set_of(i)].push(object),
                Err(error) => progress(&format!("left out: {} ({error})", piece.id)),
            }
        }
        write_sets(folder, name, shard, &sets, &mut progress)?;
    }
    Ok(())
}

fn archives(folder: &Path) -> Result<Vec<Archive>> {
    let io = |source| Error::Io { path: folder.into(), source };
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(io)? {
        paths.push(entry.map_err(io)?.path());
    }
    paths.retain(|path| path.extension().is_some_and(|end| end == "sh3f"));
    paths.sort();
    if paths.is_empty() {
        let fix = "install the package sweethome3d-furniture, which has /usr/share/sweethome3d/furniture";
        return file_error(folder, "no archive *.sh3f lies in it", fix);
    }
    paths.iter().map(|path| Archive::open(path)).collect()
}
