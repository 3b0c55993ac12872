//! Tests malformed and mutated files with the command and its reader of arrays: each is read or refused with an error that
//! says why, without a panic and in little memory, whatever it claims. The names in `tests/corpus` tell which are refused.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../../../tests/common/mutate.rs"]
mod mutate;

use mutate::{cases, mutate};
use peak_alloc::PeakAlloc;
use softras_lab::npy;
use softras_lab::stress::Random;
use std::{
    fs, panic,
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
};

/// Counts what is allocated.
#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// More than any of the corpus' small files may take, whatever it claims to be.
const MOST: usize = 8 << 20;
/// Reading an array takes at most so many bytes for each byte of its file, besides [`SLACK`].
const MULTIPLE: usize = 4;
/// What other tests of this process allocate meanwhile.
const SLACK: usize = 512 << 10;

/// The files of a kind, in order.
fn files(kind: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus").join(kind);
    let mut files: Vec<_> = fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    assert!(files.len() >= 10, "{}", folder.display());
    files
}

/// What comes of work, and the most memory that was allocated meanwhile beyond what was before. One at a time.
fn peak_of<T>(work: impl FnOnce() -> T) -> (T, usize) {
    static ALONE: Mutex<()> = Mutex::new(());
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let before = MEMORY.current_usage();
    MEMORY.reset_peak_usage();
    let outcome = work();
    (outcome, MEMORY.peak_usage().saturating_sub(before))
}

#[test]
fn malformed_arrays_are_read_or_refused_as_their_names_say() {
    for file in files("npy") {
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
    let files: Vec<Vec<u8>> = files("npy").iter().map(|path| fs::read(path).unwrap()).collect();
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
    use npyz::WriterBuilder;
    use std::process::Command;
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("scene.npz");
    let mut archive = npyz::npz::NpzWriter::create(&scene).unwrap();
    let vertices: [f32; 9] = [-0.5, -0.5, 3.0, 0.6, -0.4, 3.5, 0.1, 0.7, 4.0];
    let mut put = |name: &str, shape: &[u64], values: &[f32]| {
        let array = archive.array(name, Default::default()).unwrap();
        let mut array = array.default_dtype().shape(shape).begin_nd().unwrap();
        array.extend(values.iter().copied()).unwrap();
        array.finish().unwrap();
    };
    put("face_vertices", &[1, 1, 3, 3], &vertices);
    put("textures", &[1, 1, 1, 3], &[0.2, 0.4, 0.6]);
    put("opt_image_size", &[], &[8.0]);
    drop(archive);
    let original = fs::read(&scene).unwrap();
    let run = |bytes: &[u8]| {
        fs::write(&scene, bytes).unwrap();
        let arguments = ["eval", "scene.npz", "-o", "image.npz", "--device", "reference"];
        Command::new(env!("CARGO_BIN_EXE_softras")).current_dir(folder.path()).args(arguments).output().unwrap()
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
    for file in files("cameras") {
        let folder = tempfile::tempdir().unwrap();
        fs::copy(&file, folder.path().join("cameras.json")).unwrap();
        image::RgbaImage::new(4, 4).save(folder.path().join("a.png")).unwrap();
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_softras"))
            .args(["fit", "--views", folder.path().to_str().unwrap(), "-o", "never.obj"])
            .current_dir(folder.path())
            .output()
            .unwrap();
        let errors = String::from_utf8_lossy(&output.stderr);
        let shown = file.display();
        assert_eq!(output.status.code(), Some(1), "{shown}: {errors}");
        assert!(errors.contains("error: ") && !errors.contains("panicked"), "{shown}: {errors}");
        assert!(!folder.path().join("never.obj").exists(), "{shown}");
    }
}
