//! Tests the malformed files of `tests/corpus`, which are also the seeds of the fuzz targets. Each is read or refused as its
//! name says (`read_..`, `refused_..`, `refused_line4_..`; `strict_..` for what is left out with a note and refused under
//! `LoadOptions::strict`), without a panic, in little memory, and with an error that names the file and, where the format has
//! lines, the line.

use crate::mutate::corpus;
use crate::peak_of;
use crate::{LoadOptions, RAW, load};
use softras::Error;
use std::{
    fs,
    path::{Path, PathBuf},
};

/// More than any of these small files may take, whatever it claims to be.
const MOST: usize = 8 << 20;

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n";

/// The outcome that a file's name promises: refused or not, and on which line.
fn promised(path: &Path, strict: bool) -> Option<Option<usize>> {
    let name = path.file_stem().unwrap().to_str().unwrap();
    let rest = name.strip_prefix("refused_").or(name.strip_prefix("strict_").filter(|_| strict))?;
    let line = rest.strip_prefix("line").map(|rest| rest.chars().take_while(char::is_ascii_digit).collect::<String>());
    Some(line.map(|digits| digits.parse().unwrap()))
}

/// The outcome of reading a file: its error's path and line.
type Outcome = Result<(), (PathBuf, Option<usize>)>;

fn outcome<T>(result: softras::Result<T>) -> Outcome {
    match result {
        Ok(_) => Ok(()),
        Err(Error::File { path, line, .. }) => Err((path, line)),
        Err(Error::Io { path, .. }) => Err((path, None)),
        Err(other) => panic!("an error of no file: {other}"),
    }
}

/// Reads all files of a kind, by themselves in a folder of their own, and holds what comes to what their names say.
fn check(kind: &str, named: &str, read: impl Fn(&Path, &LoadOptions) -> Outcome) {
    for file in corpus(kind) {
        let shown = file.display();
        let is_strict = file.file_stem().unwrap().to_str().unwrap().starts_with("strict_");
        for strict in [false, true].into_iter().take(1 + usize::from(is_strict)) {
            let parent = tempfile::tempdir().unwrap();
            let folder = parent.path().join(kind);
            fs::create_dir(&folder).unwrap();
            let copy = folder.join(file.file_name().unwrap());
            fs::copy(&file, &copy).unwrap();
            // A file outside the folder, which must not be read.
            fs::write(parent.path().join("outside.mtl"), "newmtl m\n").unwrap();
            let (outcome, peak) = peak_of(|| read(&copy, &LoadOptions { strict, ..RAW }));
            assert!(peak < MOST, "{shown} takes {peak} bytes");
            match (promised(&file, strict), outcome) {
                (None, Ok(())) => {}
                (Some(line), Err((path, told))) => {
                    let where_it_is = if named.is_empty() { copy } else { folder.join(named) };
                    assert_eq!((path, told), (where_it_is, line.or(told)), "{shown}");
                }
                (promised, outcome) => panic!("{shown}, strict {strict}: promised {promised:?}, came {outcome:?}"),
            }
        }
    }
}

#[test]
fn malformed_files_are_read_or_refused_as_their_names_say() {
    check("obj", "", |path, options| outcome(load(path, options)));
    check("mtl", "", |path, options| {
        let obj = path.with_file_name("mesh.obj");
        fs::write(&obj, format!("mtllib {}\n{TRIANGLE}", path.file_name().unwrap().to_str().unwrap())).unwrap();
        outcome(load(&obj, options))
    });
    check("image", "mesh.mtl", |path, options| {
        let obj = path.with_file_name("mesh.obj");
        let mtl = format!("newmtl m\nmap_Kd {}\n", path.file_name().unwrap().to_str().unwrap());
        fs::write(path.with_file_name("mesh.mtl"), mtl).unwrap();
        fs::write(&obj, format!("mtllib mesh.mtl\n{TRIANGLE}")).unwrap();
        outcome(load(&obj, options))
    });
    check("cameras", "", |path, _| {
        let folder = path.parent().unwrap();
        image::RgbaImage::new(4, 4).save(folder.join("a.png")).unwrap();
        let options = softras_io::ViewsOptions { cameras: Some(path.into()), ..Default::default() };
        let read = softras_io::Views::open_with(folder, &options, &softras_io::Budget::new(None));
        read.map(drop).map_err(|_| (path.into(), None))
    });
}
