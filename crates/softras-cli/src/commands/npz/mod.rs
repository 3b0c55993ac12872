//! Archives of numpy arrays, `.npz` files, as `np.savez` and `np.savez_compressed` write them.

pub mod npy;

use softras::internals::output;
use softras::{Error, Result};
use std::borrow::Cow;
use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{BufReader, Cursor, Write};
use std::path::{Path, PathBuf};

pub use npy::{Array, Data, Values};

/// All arrays of a file by key, and the keys that were asked for.
#[derive(Debug)]
pub struct Archive {
    path: PathBuf,
    arrays: BTreeMap<String, std::result::Result<Array, String>>,
    asked: RefCell<BTreeSet<String>>,
}

impl Archive {
    /// Reads every array of the file. An array that cannot be read is an error only when it is asked for.
    pub fn open(path: &Path) -> Result<Self> {
        let io = |source| Error::Io { path: path.into(), source };
        let file = File::open(path).map_err(io)?;
        if file.metadata().map_err(io)?.is_dir() {
            return Err(io(std::io::ErrorKind::IsADirectory.into()));
        }
        let broken = |e: zip::result::ZipError| Error::File {
            path: path.into(),
            line: None,
            what: format!("not a readable .npz archive ({e})"),
            fix: "write it with numpy.savez or numpy.savez_compressed".into(),
        };
        let mut zip = zip::ZipArchive::new(BufReader::new(file)).map_err(broken)?;
        let mut arrays = BTreeMap::new();
        for i in 0..zip.len() {
            let Some(file) = zip.name_for_index(i).transpose().map_err(broken)?.map(Cow::into_owned) else { continue };
            let Some(name) = file.strip_suffix(".npy") else { continue };
            let array = zip.by_index(i).map_err(|e| format!("its data cannot be read ({e})")).and_then(npy::read);
            arrays.insert(name.to_string(), array);
        }
        Ok(Self { path: path.into(), arrays, asked: RefCell::default() })
    }

    /// An error that names this file and the key.
    pub fn fault(&self, key: &str, what: &str, fix: &str) -> Error {
        let what = format!("key `{key}`: {what}");
        Error::File { path: self.path.clone(), line: None, what, fix: fix.into() }
    }

    /// Whether the file has the key.
    pub fn has(&self, key: &str) -> bool {
        self.arrays.contains_key(key)
    }

    /// The array of a key, if the file has it.
    pub fn get(&self, key: &str) -> Result<Option<&Array>> {
        self.asked.borrow_mut().insert(key.into());
        match self.arrays.get(key) {
            None => Ok(None),
            Some(Ok(array)) => Ok(Some(array)),
            Some(Err(what)) => Err(self.fault(key, what, "write it with numpy.savez, as a plain array")),
        }
    }

    /// The array of a key that must be present; `expected` describes its shape.
    pub fn require(&self, key: &str, expected: &str) -> Result<&Array> {
        let keys = || self.arrays.keys().cloned().collect::<Vec<_>>().join(", ");
        self.get(key)?.ok_or_else(|| self.fault(key, &format!("missing (the file has: {})", keys()), expected))
    }

    /// The numbers of an array.
    pub fn numbers<'a>(&self, key: &str, array: &'a Array) -> Result<&'a [f64]> {
        match &array.values {
            Values::Numbers(numbers) => Ok(numbers),
            Values::Texts(_) => Err(self.fault(key, &format!("holds text ({})", array.dtype), "numbers are expected")),
        }
    }

    /// A single finite number: 0-d or with one element.
    pub fn number(&self, key: &str) -> Result<Option<f64>> {
        let Some(array) = self.get(key)? else { return Ok(None) };
        match self.numbers(key, array)? {
            [x] if x.is_finite() => Ok(Some(*x)),
            [x] => Err(self.fault(key, &format!("is {x}"), "a finite number is expected")),
            _ => Err(self.fault(key, &format!("has shape {:?}", array.shape), "a single number is expected")),
        }
    }

    /// A single text.
    pub fn text(&self, key: &str) -> Result<Option<&str>> {
        let Some(array) = self.get(key)? else { return Ok(None) };
        match &array.values {
            Values::Texts(texts) if texts.len() == 1 => Ok(Some(&texts[0])),
            _ => {
                let what = format!("is {} of shape {:?}", array.dtype, array.shape);
                Err(self.fault(key, &what, "a single text is expected"))
            }
        }
    }

    /// A text that must be one of the given choices.
    pub fn choice<T: Copy>(&self, key: &str, choices: &[(&str, T)]) -> Result<Option<T>> {
        let Some(text) = self.text(key)? else { return Ok(None) };
        match choices.iter().find(|(name, _)| *name == text) {
            Some((_, value)) => Ok(Some(*value)),
            None => {
                let names: Vec<_> = choices.iter().map(|(name, _)| *name).collect();
                Err(self.fault(key, &format!("is {text:?}"), &format!("use one of {}", names.join(", "))))
            }
        }
    }

    /// True or false: a bool, or the numbers 0 and 1.
    pub fn flag(&self, key: &str) -> Result<Option<bool>> {
        match self.number(key)? {
            None => Ok(None),
            Some(0.0) => Ok(Some(false)),
            Some(1.0) => Ok(Some(true)),
            Some(x) => Err(self.fault(key, &format!("is {x}"), "True or False is expected")),
        }
    }

    /// Three numbers, or one for all three.
    pub fn triple(&self, key: &str) -> Result<Option<[f64; 3]>> {
        let Some(array) = self.get(key)? else { return Ok(None) };
        match *self.numbers(key, array)? {
            [x] => Ok(Some([x; 3])),
            [x, y, z] => Ok(Some([x, y, z])),
            _ => Err(self.fault(key, &format!("has shape {:?}", array.shape), "three numbers are expected")),
        }
    }

    /// The keys that nobody asked for.
    pub fn unasked(&self) -> Vec<&str> {
        let asked = self.asked.borrow();
        self.arrays.keys().map(String::as_str).filter(|k| !asked.contains(*k)).collect()
    }
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
    let io = |e: zip::result::ZipError| Error::Io { path: path.into(), source: std::io::Error::other(e) };
    pack().map_err(io)?;
    output::write_file(path, zip.finish().map_err(io)?.get_ref())
}
