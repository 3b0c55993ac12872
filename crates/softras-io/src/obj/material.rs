//! Reads MTL files: the diffuse colour, the diffuse texture and the opacity of each material.
//!
//! The crate tobj is not used, because it panics at `Kd 0.5` (a legal grey) and does not report the line of a texture.

use super::statement::{self, Statement, statements};
use crate::{find::find, source::Source};
use softras::{
    Error,
    scene::{Mesh, Wrap},
};
use std::{
    collections::{HashMap, HashSet},
    path::{Path, PathBuf},
};

/// All `newmtl` blocks of all files, and the first of each name.
#[derive(Default)]
pub(super) struct Materials {
    all: Vec<Material>,
    by_name: HashMap<String, usize>,
    /// Some file could not be read.
    lacks_some: bool,
}

impl Materials {
    /// Adds one without a colour; false where the name has been given already.
    fn begin(&mut self, name: &str) -> bool {
        let is_new = !self.by_name.contains_key(name);
        if is_new {
            self.by_name.insert(name.into(), self.all.len());
        }
        self.all.push(Material::default());
        is_new
    }

    /// Whether every file was read.
    pub fn is_whole(&self) -> bool {
        !self.lacks_some
    }

    /// The first of that name.
    pub fn find(&self, name: &str) -> Option<&Material> {
        self.by_name.get(name).map(|&at| &self.all[at])
    }
}

/// A `newmtl` block.
#[derive(Default)]
pub(super) struct Material {
    /// `Kd`; white when there is none.
    pub color: Option<[f32; 3]>,
    pub map: Option<Map>,
    /// `map_d`.
    pub alpha_map: Option<Map>,
    /// `d`, and 1 less `Tr`, which counts where there is no `d`.
    dissolve: Option<f32>,
    solidity: Option<f32>,
}

impl Material {
    /// `d`, or 1 less `Tr`.
    pub fn opacity(&self) -> f32 {
        self.dissolve.or(self.solidity).unwrap_or(1.0)
    }
}

/// A `map_Kd` or `map_d` statement.
#[derive(Clone, PartialEq)]
pub(super) struct Map {
    /// The image as the file names it.
    pub name: String,
    pub wrap: Wrap,
    /// The MTL file and the line that name it.
    pub mtl: PathBuf,
    pub line: usize,
}

/// Reads the files that the OBJ file's `mtllib` statements name; what is wrong with them becomes notes.
pub(super) fn read_libraries(source: &mut Source, libraries: &[(String, usize)]) -> Materials {
    let mut materials = Materials::default();
    // A file that is named again adds nothing; reading it again would let a small file cause a lot of work.
    let mut known = HashSet::new();
    for (names, line) in libraries {
        // One name with spaces, or several names.
        let whole = names.trim_matches('"');
        let locate = |name: &str| find(source.path, source.path, name, source.options.allow_outside);
        let mut found = vec![(whole, locate(whole))];
        if found[0].1.is_err() && names.split_whitespace().nth(1).is_some() {
            found = names.split_whitespace().map(|name| (name, locate(name))).collect();
        }
        for (name, file) in found {
            let mtl = match file {
                Ok((mtl, note)) => {
                    if let Some(note) = note {
                        source.notes.add(Some(*line), format!("material file {note}"));
                    }
                    mtl
                }
                Err(_) if name.is_empty() => {
                    source.notes.add(Some(*line), "material file \"\" not found: its materials are white");
                    materials.lacks_some = true;
                    continue;
                }
                Err(what) => {
                    source.notes.add(Some(*line), format!("material file {what}: its materials are white"));
                    materials.lacks_some = true;
                    continue;
                }
            };
            if known.insert(mtl.canonicalize().unwrap_or_else(|_| mtl.clone())) {
                read_library(source, &mtl, &mut materials);
                source.files.push(mtl);
            }
        }
    }
    materials
}

/// A statement that is wrong is left out with a note.
fn read_library(source: &mut Source, mtl: &Path, materials: &mut Materials) {
    let read = source.read_bytes(mtl).and_then(|bytes| statement::text(mtl, bytes));
    let notes = &mut source.notes;
    let text = match read {
        Ok(text) => text,
        Err(error) => {
            materials.lacks_some = true;
            let what = if let Error::File { what, .. } = error { what } else { error.to_string() };
            return notes.add_in(mtl, None, format!("{what}: its materials are white"));
        }
    };
    for statement in statements(&text) {
        let mut note = |text: String| notes.add_in(mtl, Some(statement.line), text);
        let keyword = statement.keyword();
        if keyword == "newmtl" {
            let name = statement.rest();
            if name.is_empty() {
                note("material without a name: write `newmtl NAME`".into());
            }
            if !materials.begin(name) {
                note(format!("material {name:?} is defined again: the first one counts"));
            }
            continue;
        }
        let is_alpha = keyword.eq_ignore_ascii_case("map_d");
        let is_map = is_alpha || keyword.eq_ignore_ascii_case("map_Kd");
        // Other statements on light and reflection are outside the model and ignored.
        if !is_map && !matches!(keyword, "Kd" | "d" | "Tr") {
            continue;
        }
        let Some(material) = materials.all.last_mut() else {
            note(format!("{keyword} before any material is not used: write `newmtl NAME` first"));
            continue;
        };
        if is_map {
            match read_map(mtl, &statement, &mut note) {
                Ok(map) if is_alpha => material.alpha_map = Some(map),
                Ok(map) => material.map = Some(map),
                Err(what) => note(format!("{what}: not used (write `{keyword} FILE.png`)")),
            }
        } else if keyword != "Kd" {
            match read_opacity(&statement) {
                Some(value) if keyword == "d" => material.dissolve = Some(value),
                Some(value) => material.solidity = Some(1.0 - value),
                None => note(format!("malformed `{keyword}`: opaque (write a number from 0 to 1)")),
            }
        } else if matches!(statement.words().next(), Some("spectral" | "xyz")) {
            note("Kd by spectral curve or CIE XYZ is not read: white".into());
        } else {
            match read_color(&statement) {
                Some(color) => material.color = Some(color),
                None => {
                    let shown: String = statement.rest().chars().take(80).collect();
                    note(format!("malformed colour `Kd {shown}`: white (write `Kd r g b`, 0 to 1)"));
                }
            }
        }
    }
}

/// A number from 0 to 1, behind options (`-halo`).
fn read_opacity(statement: &Statement) -> Option<f32> {
    let value: f32 = statement.words().last()?.parse().ok()?;
    value.is_finite().then(|| value.clamp(0.0, 1.0))
}

/// `r g b`, or `r` for a grey.
fn read_color(statement: &Statement) -> Option<[f32; 3]> {
    let number = |word: &str| word.parse().ok().filter(|value: &f32| value.abs() <= Mesh::BRIGHTEST);
    let values: Option<Vec<f32>> = statement.words().map(number).collect();
    match values?[..] {
        [grey] => Some([grey; 3]),
        [r, g, b] => Some([r, g, b]),
        _ => None,
    }
}

/// Splits off the first word.
fn take<'a>(rest: &mut &'a str) -> &'a str {
    let (word, tail) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
    *rest = tail.trim_start();
    word
}

/// `[-option argument ..] file name`; the name may hold spaces.
fn read_map(mtl: &Path, statement: &Statement, mut note: impl FnMut(String)) -> Result<Map, String> {
    let mut rest = statement.rest();
    let keyword = statement.keyword();
    let mut wrap = Wrap::Repeat;
    while rest.starts_with('-') {
        let option = take(&mut rest);
        match option {
            "-clamp" => match take(&mut rest) {
                "on" => wrap = Wrap::Clamp,
                "off" => wrap = Wrap::Repeat,
                other => return Err(format!("`-clamp {other}`: neither on nor off")),
            },
            "-blendu" | "-blendv" | "-cc" | "-texres" | "-boost" | "-bm" | "-imfchan" | "-type" => {
                take(&mut rest);
                note(format!("option {option} of {keyword} is not honoured"));
            }
            "-mm" | "-o" | "-s" | "-t" => {
                let is_number = |text: &str| text.split_whitespace().next().is_some_and(|w| w.parse::<f32>().is_ok());
                for _ in 0..if option == "-mm" { 2 } else { 3 } {
                    if is_number(rest) {
                        take(&mut rest);
                    }
                }
                note(format!("option {option} of {keyword} is not honoured"));
            }
            _ => return Err(format!("unknown option {option} of map_Kd")),
        }
    }
    match rest.trim_matches('"') {
        "" => Err("map_Kd without a file".into()),
        name => Ok(Map { name: name.into(), wrap, mtl: mtl.into(), line: statement.line }),
    }
}
