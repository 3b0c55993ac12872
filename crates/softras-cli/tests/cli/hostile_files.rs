//! Tests malformed and mutated files with the command and its reader of arrays: each is read or refused with an error that
//! says why, without a panic and in little memory, whatever it claims. The names in `tests/corpus` tell which are refused.

use super::peak_of;
use super::mutate::{cases, corpus, mutate};
use super::numpy::Npz;
use super::softras;
use softras_io::npy;
use softras_lab::stress::Random;
use std::{fs, panic};

/// More than any of the corpus' small files may take, whatever it claims to be.
const MOST: usize = 8 << 20;
/// Reading an array takes at most so many bytes for each byte of its file, besides [`SLACK`].
const MULTIPLE: usize = 4;
/// What it takes besides: a header, an error message.
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

/// Through the command with the f64 reference, so that no device is opened.
#[test]
fn mutated_archives_are_read_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("scene.npz");
    let vertices = [-0.5, -0.5, 3.0, 0.6, -0.4, 3.5, 0.1, 0.7, 4.0];
    let archive = Npz::stored().f32("face_vertices", &[1, 1, 3, 3], &vertices);
    archive.f32("textures", &[1, 1, 1, 3], &[0.2, 0.4, 0.6]).f32("opt_image_size", &[], &[8.0]).write(&scene);
    let original = fs::read(&scene).unwrap();
    let run = |bytes: &[u8]| {
        fs::write(&scene, bytes).unwrap();
        softras(folder.path(), &["eval", "scene.npz", "-o", "image.npz", "--device", "reference"])
    };
    let whole = run(&original);
    assert_eq!(whole.status.code(), Some(0), "{}", String::from_utf8_lossy(&whole.stderr));
    let mut refused = 0;
    for seed in 0..cases(60).min(5000) {
        let random = &mut Random::new(seed);
        let mut bytes = original.clone();
        mutate(random, &mut bytes);
        let output = run(&bytes);
        let errors = String::from_utf8_lossy(&output.stderr);
        let told = output.status.code() == Some(1) && errors.contains("error: ");
        assert!(output.status.code() == Some(0) || told, "seed {seed}: {:?} {errors}", output.status);
        assert!(!errors.contains("panicked"), "seed {seed}: {errors}");
        refused += u32::from(told);
    }
    assert!(refused > 0);
}

/// Through `softras fit`, which refuses them before it renders anything.
#[test]
fn malformed_cameras_are_refused() {
    for file in corpus("cameras") {
        let folder = tempfile::tempdir().unwrap();
        fs::copy(&file, folder.path().join("cameras.json")).unwrap();
        image::RgbaImage::new(4, 4).save(folder.path().join("a.png")).unwrap();
        let output = softras(folder.path(), &["fit", "--views", ".", "-o", "never.obj"]);
        let errors = String::from_utf8_lossy(&output.stderr);
        let shown = file.display();
        assert_eq!(output.status.code(), Some(1), "{shown}: {errors}");
        assert!(errors.contains("error: ") && !errors.contains("panicked"), "{shown}: {errors}");
        assert!(!folder.path().join("never.obj").exists(), "{shown}");
    }
}
