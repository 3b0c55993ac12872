//! Tests malformed and mutated arrays and archives: each is read or refused with an error that says why, without a panic and
//! in little memory, whatever it claims. The names in `tests/corpus` tell which arrays are refused.

use super::mutate::{cases, corpus, mutate};
use super::numpy::Npz;
use super::peak_of;
use softras_check::stress::Random;
use softras_io::npz::Archive;
use softras_io::{Budget, npy};
use std::{fs, panic};

/// More than any of the corpus' small files may take, whatever it claims to be.
const MOST: usize = 8 << 20;
/// Reading an array takes at most this many bytes for each byte of its file, besides [`SLACK`].
const MULTIPLE: usize = 4;
/// Memory for other things: a header, an error message.
const SLACK: usize = 512 << 10;

#[test]
fn malformed_arrays_are_read_or_refused_as_their_names_say() {
    for file in corpus("npy") {
        let name = file.file_stem().unwrap().to_str().unwrap();
        let bytes = fs::read(&file).unwrap();
        let (outcome, peak) = peak_of(|| npy::read(&bytes[..], |_| Ok(())));
        assert_eq!(outcome.is_err(), name.starts_with("refused_"), "{name}");
        assert!(peak < MOST, "{name} takes {peak} bytes");
    }
}

/// Values stay in the type of the file, and memory that nobody admits is not taken.
#[test]
fn arrays_take_as_much_memory_as_their_file() {
    let count = 16 << 20;
    let header = format!("{{'descr': '|u1', 'fortran_order': False, 'shape': ({count},), }}");
    let mut bytes = [&b"\x93NUMPY\x01\x00"[..], &(header.len() as u16).to_le_bytes(), header.as_bytes()].concat();
    bytes.resize(bytes.len() + count, 7);
    let (array, peak) = peak_of(|| npy::read(&bytes[..], |_| Ok(())).unwrap());
    // A vector that grows has its old and its new memory for a moment.
    assert!(peak < 4 * count, "{peak} bytes for {count}");
    assert_eq!(array.numbers().unwrap().at(count - 1), 7.0);
    let (refused, peak) = peak_of(|| npy::read(&bytes[..], |bytes| Err(format!("{bytes} are too many"))));
    assert!(refused.is_err() && peak < SLACK, "{peak} bytes");
}

/// In the reader itself: an array has as many values as its shape says, or there is an error message.
#[test]
fn mutated_arrays_are_read_or_refused() {
    let files: Vec<Vec<u8>> = corpus("npy").iter().map(|path| fs::read(path).unwrap()).collect();
    let (mut read, mut refused) = (0, 0);
    for seed in 0..cases(20_000) {
        let random = &mut Random::new(seed);
        let mut bytes = files[random.below(files.len())].clone();
        (0..random.choose(&[1, 1, 2, 5])).for_each(|_| mutate(random, &mut bytes));
        let (outcome, peak) = peak_of(|| panic::catch_unwind(|| npy::read(&bytes[..], |_| Ok(()))));
        assert!(peak <= SLACK + MULTIPLE * bytes.len(), "seed {seed}: {peak} bytes for {}", bytes.len());
        match outcome.unwrap_or_else(|_| panic!("seed {seed}: a panic")) {
            Ok(array) => {
                let count = array.numbers().map_or_else(|| array.texts().unwrap().count(), |n| n.iter().count());
                assert_eq!(count, array.shape.iter().product::<usize>(), "seed {seed}");
                read += 1;
            }
            Err(what) => {
                assert!(!what.is_empty());
                refused += 1;
            }
        }
    }
    println!("{read} arrays read, {refused} refused");
    assert!(read > 0 && refused > 0);
}

/// An archive is opened, and each of its arrays is read, or there is an error that names the file.
#[test]
fn mutated_archives_are_read_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.npz");
    let original = Npz::stored().f32("corners", &[1, 1, 3, 3], &[0.5; 9]).i64("size", &[], &[8]).bytes();
    let read = |bytes: &[u8]| -> softras::Result<usize> {
        fs::write(&path, bytes).unwrap();
        let archive = Archive::open(&path, Budget::new(None))?;
        let keys: Vec<String> = archive.keys().map(str::to_owned).collect();
        keys.iter().map(|key| archive.get(key).map(|array| array.unwrap().len())).sum()
    };
    assert_eq!(read(&original).unwrap(), 10);
    let (mut whole, mut refused) = (0, 0);
    for seed in 0..cases(2000) {
        let random = &mut Random::new(seed);
        let mut bytes = original.clone();
        mutate(random, &mut bytes);
        match panic::catch_unwind(|| read(&bytes)).unwrap_or_else(|_| panic!("seed {seed}: a panic")) {
            Ok(_) => whole += 1,
            Err(error) => {
                assert!(error.to_string().contains("scene.npz"), "seed {seed}: {error}");
                refused += 1;
            }
        }
    }
    assert!(whole > 0 && refused > 0, "{whole} and {refused}");
}

/// Names of keys are shown without what a terminal would obey, and not at any length.
#[test]
fn names_of_keys_are_shown_harmless() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.npz");
    let (orders, long) = ("\u{1b}[31mred\u{9b}\u{202e}\r\n", "k".repeat(60_000));
    Npz::stored().i64(orders, &[], &[1]).i64(&long, &[], &[1]).write(&path);
    let told = Archive::open(&path, Budget::new(None)).unwrap().require("x", "a number").unwrap_err().to_string();
    let is_order = |c: char| c.is_control() || c == '\u{202e}';
    assert!(!told.contains(is_order) && told.contains("\\u001b[31mred") && told.len() < 500, "{told:?}");
}
