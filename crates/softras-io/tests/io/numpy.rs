//! Archives as numpy writes them, made here without softras' own code, and arrays of archives.

use softras_io::{npy, npz};
use std::io::Write;
use std::path::Path;

/// An archive in the making.
pub struct Npz {
    arrays: Vec<(String, Vec<u8>)>,
    deflated: bool,
}

impl Npz {
    /// As `numpy.savez`.
    pub fn stored() -> Self {
        Self { arrays: Vec::new(), deflated: false }
    }

    /// As `numpy.savez_compressed`.
    pub fn deflated() -> Self {
        Self { arrays: Vec::new(), deflated: true }
    }

    /// Adds an array from its type, shape and bytes.
    pub fn raw(mut self, key: &str, descr: &str, shape: &[usize], data: &[u8]) -> Self {
        let sides: String = shape.iter().map(|n| format!("{n},")).collect();
        let mut header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({sides}), }}");
        header.push_str(&" ".repeat(63 - (header.len() + 10) % 64));
        header.push('\n');
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(data);
        self.arrays.push((key.to_string(), bytes));
        self
    }

    pub fn f32(self, key: &str, shape: &[usize], values: &[f32]) -> Self {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.raw(key, "<f4", shape, &bytes)
    }

    pub fn f64(self, key: &str, shape: &[usize], values: &[f64]) -> Self {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.raw(key, "<f8", shape, &bytes)
    }

    pub fn i64(self, key: &str, shape: &[usize], values: &[i64]) -> Self {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.raw(key, "<i8", shape, &bytes)
    }

    pub fn bytes(&self) -> Vec<u8> {
        let method = if self.deflated { zip::CompressionMethod::Deflated } else { zip::CompressionMethod::Stored };
        let options = zip::write::SimpleFileOptions::default().compression_method(method);
        let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
        for (key, bytes) in &self.arrays {
            zip.start_file(format!("{key}.npy"), options).unwrap();
            zip.write_all(bytes).unwrap();
        }
        zip.finish().unwrap().into_inner()
    }

    pub fn write(&self, path: &Path) {
        std::fs::write(path, self.bytes()).unwrap();
    }
}

/// The shape and values of an array of an archive.
pub fn read(path: &Path, key: &str) -> (Vec<usize>, Vec<f64>) {
    let array = npz::read(path, key).unwrap();
    (array.shape.clone(), array.numbers().unwrap().iter().collect())
}

/// The shape and the numbers of a file with one array.
pub fn read_one(path: &Path) -> (Vec<usize>, Vec<f64>) {
    let array = npy::read(&std::fs::read(path).unwrap()[..], |_| Ok(())).unwrap();
    (array.shape.clone(), array.numbers().unwrap().iter().collect())
}
