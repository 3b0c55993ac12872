//! Archives of numpy arrays, `.npz` files, as `np.savez` and `np.savez_compressed` write them.

use crate::Budget;
use crate::npy::{self, Array, Data, Numbers};
use crate::text;
use crate::{failed, fault, input, output};
use softras::{Error, Result};
use std::borrow::Cow;
use std::cell::{OnceCell, RefCell};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Cursor, Write};
use std::path::{Path, PathBuf};

/// The most keys that an error names.
const MAX_NAMED: usize = 30;
/// Bytes that a value takes once it has been converted for the renderer, besides what it takes in the file.
const CONVERTED: u64 = 8;

/// The arrays of a file by key. An array is read when it is asked for.
#[derive(Debug)]
pub struct Archive {
    path: PathBuf,
    zip: RefCell<zip::ZipArchive<BufReader<File>>>,
    entries: BTreeMap<String, ArrayEntry>,
    budget: Budget,
}

/// An array of the file.
#[derive(Debug)]
struct ArrayEntry {
    /// Its number in the file.
    index: usize,
    array: OnceCell<Result<Array, String>>,
}

impl Archive {
    /// Opens a file and lists its keys. An array that cannot be read, or for which the budget has no memory, is an error
    /// only when it is asked for.
    pub fn open(path: &Path, budget: Budget) -> Result<Self> {
        let file = input::open(path)?;
        let bytes = file.metadata().map_or(0, |metadata| metadata.len());
        input::refuse_empty(path, bytes)?;
        budget.count_file(bytes);
        let fix = "write it with numpy.savez or numpy.savez_compressed";
        let broken = |e: zip::result::ZipError| fault(path, format!("not a readable .npz archive ({e})"), fix);
        let zip = zip::ZipArchive::new(BufReader::new(file)).map_err(broken)?;
        let mut entries = BTreeMap::new();
        for index in 0..zip.len() {
            let Some(file) = zip.name_for_index(index).transpose().map_err(broken)?.map(Cow::into_owned) else {
                continue;
            };
            let Some(name) = file.strip_suffix(".npy") else { continue };
            entries.insert(name.to_string(), ArrayEntry { index, array: OnceCell::new() });
        }
        Ok(Self { path: path.into(), zip: RefCell::new(zip), entries, budget })
    }

    /// An error that names this file and the key.
    pub fn fault(&self, key: &str, what: &str, fix: &str) -> Error {
        fault(&self.path, format!("key `{key}`: {what}"), fix)
    }

    /// The keys of all arrays.
    pub fn keys(&self) -> impl ExactSizeIterator<Item = &str> {
        self.entries.keys().map(String::as_str)
    }

    /// Whether the file has the key.
    pub fn has(&self, key: &str) -> bool {
        self.entries.contains_key(key)
    }

    /// The array of a key, if the file has it.
    pub fn get(&self, key: &str) -> Result<Option<&Array>> {
        let Some(entry) = self.entries.get(key) else { return Ok(None) };
        match entry.array.get_or_init(|| self.read(key, entry.index)) {
            Ok(array) => Ok(Some(array)),
            Err(what) => Err(self.fault(key, what, "write it with numpy.savez, as a plain array")),
        }
    }

    fn read(&self, key: &str, index: usize) -> Result<Array, String> {
        let mut zip = self.zip.borrow_mut();
        let data = zip.by_index(index).map_err(|e| format!("its data cannot be read ({e})"))?;
        let array = npy::read(data, |bytes| self.room(key, bytes))?;
        self.room(key, CONVERTED * array.len() as u64)?;
        Ok(array)
    }

    /// Claims memory for a key; the error is a sentence without the file's name.
    fn room(&self, key: &str, bytes: u64) -> Result<(), String> {
        self.budget.claim(&self.path, key, bytes).map_err(|error| match error {
            Error::File { what, fix, .. } => format!("{what}: {fix}"),
            other => other.to_string(),
        })
    }

    /// The array of a key that must be present; `expected` describes its shape.
    pub fn require(&self, key: &str, expected: &str) -> Result<&Array> {
        let keys = || listed(self.keys());
        self.get(key)?.ok_or_else(|| self.fault(key, &format!("missing (the file has: {})", keys()), expected))
    }

    /// The numbers of an array.
    pub fn numbers<'a>(&self, key: &str, array: &'a Array) -> Result<Numbers<'a>> {
        let text = || self.fault(key, &format!("holds text ({})", array.dtype()), "numbers are expected");
        array.numbers().ok_or_else(text)
    }
}

/// The first of some keys, as a message shows them.
fn listed<'a>(keys: impl ExactSizeIterator<Item = &'a str>) -> String {
    let more = keys.len().saturating_sub(MAX_NAMED);
    let mut names: Vec<String> = keys.take(MAX_NAMED).map(text::name).collect();
    if more > 0 {
        names.push(format!("and {more} more"));
    }
    names.join(", ")
}

/// Reads the array of a key.
///
/// # Errors
/// As [`Archive::open`] and [`Archive::require`].
pub fn read(path: &Path, key: &str) -> Result<Array> {
    Archive::open(path, Budget::new(None))?.require(key, "an array is expected").cloned()
}

/// Writes arrays as an uncompressed archive, in the order given.
pub fn write(path: &Path, arrays: &[(&str, Vec<usize>, Data<'_>)]) -> Result<()> {
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default()
        .compression_method(zip::CompressionMethod::Stored)
        .large_file(arrays.iter().any(|(_, shape, _)| shape.iter().product::<usize>() > 1 << 28));
    let mut pack = || -> zip::result::ZipResult<()> {
        for (key, shape, data) in arrays {
            zip.start_file(format!("{key}.npy"), options)?;
            zip.write_all(&npy::write(shape, *data))?;
        }
        Ok(())
    };
    pack().map_err(|error| failed(path, error))?;
    output::write_file(path, zip.finish().map_err(|error| failed(path, error))?.get_ref())
}
