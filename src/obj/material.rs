//! Reads MTL files: the diffuse colour and the diffuse texture of each material.
//!
//! The crate tobj is not used, because it panics at `Kd 0.5` (a legal grey) and does not report the line of a texture.

use super::{
    Source,
    statement::{Statement, read_text, statements},
};
use crate::{
    error::{Error, Result},
    scene::Wrap,
};
use std::collections::{HashMap, HashSet};
use std::path::{Component, Path, PathBuf};

/// All `newmtl` blocks of all files, and the first of each name.
#[derive(Default)]
pub(super) struct Materials {
    all: Vec<Material>,
    by_name: HashMap<String, usize>,
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
}

/// A `map_Kd` statement.
#[derive(Clone, PartialEq)]
pub(super) struct Map {
    /// The image as the file names it.
    pub name: String,
    pub wrap: Wrap,
    /// The MTL file and the line that name it.
    pub mtl: PathBuf,
    pub line: usize,
}

/// Reads the files that the OBJ file's `mtllib` statements name; a missing one is a note.
///
/// # Errors
/// [`Error::File`] for a malformed statement or a file outside the OBJ file's folder.
pub(super) fn read_libraries(source: &mut Source, libraries: &[(String, usize)]) -> Result<Materials> {
    let obj = source.path;
    let mut materials = Materials::default();
    // A file that is named again adds nothing; reading it again would let a small file cause a lot of work.
    let mut known = HashSet::new();
    for (names, line) in libraries {
        // One name with spaces, or several names.
        let whole = [names.trim_matches('"')];
        let mut files: Vec<&str> = names.split_whitespace().collect();
        if files.len() < 2 || locate(obj, whole[0]).is_file() {
            files = whole.to_vec();
        }
        for file in files {
            let mtl = locate(obj, file);
            if file.is_empty() || !mtl.is_file() {
                source.notes.push(format!("line {line}: material file {file:?} not found: its materials are white"));
                continue;
            }
            check_inside(obj, &mtl, source.options.allow_outside).map_err(|(what, fix)| Error::File {
                path: obj.into(),
                line: Some(*line),
                what,
                fix,
            })?;
            if known.insert(mtl.canonicalize().unwrap_or_else(|_| mtl.clone())) {
                read_library(&mtl, &mut materials, &mut source.notes)?;
                source.files.push(mtl);
            }
        }
    }
    Ok(materials)
}

fn read_library(mtl: &Path, materials: &mut Materials, notes: &mut Vec<String>) -> Result<()> {
    let text = read_text(mtl)?;
    let shown = mtl.file_name().unwrap_or_default().to_string_lossy();
    for statement in statements(&text) {
        let line = statement.line;
        let refuse =
            |what: String, fix: &str| Err(Error::File { path: mtl.into(), line: Some(line), what, fix: fix.into() });
        let mut note = |text: &str| notes.push(format!("{shown}:{line}: {text}"));
        let keyword = statement.keyword();
        if keyword == "newmtl" {
            let name = statement.rest();
            if name.is_empty() {
                return refuse("material without a name".into(), "write `newmtl NAME`");
            }
            if !materials.begin(name) {
                note(&format!("material {name:?} is defined again: the first one counts"));
            }
            continue;
        }
        let is_map = keyword.eq_ignore_ascii_case("map_Kd");
        if !is_map && keyword != "Kd" {
            note_transparency(&statement, note);
            continue;
        }
        let Some(material) = materials.all.last_mut() else {
            return refuse(format!("{keyword} before any material"), "write `newmtl NAME` first");
        };
        if is_map {
            match read_map(mtl, &statement, note) {
                Ok(map) => material.map = Some(map),
                Err(what) => return refuse(what, "write `map_Kd FILE.png`"),
            }
        } else if matches!(statement.words().next(), Some("spectral" | "xyz")) {
            note("Kd by spectral curve or CIE XYZ is not read: white");
        } else {
            match read_color(&statement) {
                Some(color) => material.color = Some(color),
                None => {
                    return refuse(format!("malformed colour `Kd {}`", statement.rest()), "write `Kd r g b`, 0 to 1");
                }
            }
        }
    }
    Ok(())
}

/// Notes that a material is transparent. Other statements on light and reflection are outside the model and ignored.
fn note_transparency(statement: &Statement, mut note: impl FnMut(&str)) {
    let value = statement.words().next().and_then(|word| word.parse::<f32>().ok());
    match (statement.keyword(), value) {
        ("d", Some(value)) if value < 1.0 => note("transparency is not drawn"),
        ("Tr", Some(value)) if value > 0.0 => note("transparency is not drawn"),
        ("map_d", _) => note("transparency is not drawn"),
        _ => {}
    }
}

/// `r g b`, or `r` for a grey.
fn read_color(statement: &Statement) -> Option<[f32; 3]> {
    let values: Option<Vec<f32>> =
        statement.words().map(|word| word.parse().ok().filter(|value: &f32| value.is_finite())).collect();
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
fn read_map(mtl: &Path, statement: &Statement, mut note: impl FnMut(&str)) -> std::result::Result<Map, String> {
    let mut rest = statement.rest();
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
                note(&format!("option {option} of map_Kd is not honoured"));
            }
            "-mm" | "-o" | "-s" | "-t" => {
                let is_number = |text: &str| text.split_whitespace().next().is_some_and(|w| w.parse::<f32>().is_ok());
                for _ in 0..if option == "-mm" { 2 } else { 3 } {
                    if is_number(rest) {
                        take(&mut rest);
                    }
                }
                note(&format!("option {option} of map_Kd is not honoured"));
            }
            _ => return Err(format!("unknown option {option} of map_Kd")),
        }
    }
    match rest.trim_matches('"') {
        "" => Err("map_Kd without a file".into()),
        name => Ok(Map { name: name.into(), wrap, mtl: mtl.into(), line: statement.line }),
    }
}

/// The path of a file that `parent` names, relative to the folder of `parent`.
pub(super) fn locate(parent: &Path, name: &str) -> PathBuf {
    let folder = parent.parent().unwrap_or(Path::new(""));
    let path = folder.join(name);
    // Files from Windows separate folders by backslashes.
    if path.is_file() || !name.contains('\\') { path } else { folder.join(name.replace('\\', "/")) }
}

/// Refuses a path that leads out of the folder of `obj`, be it by `..`, by an absolute path or by a link: a mesh from
/// elsewhere must not make softras read other files.
pub(super) fn check_inside(obj: &Path, file: &Path, allow_outside: bool) -> std::result::Result<(), (String, String)> {
    let folder = obj.parent().unwrap_or(Path::new(""));
    let folder = if folder == Path::new("") { Path::new(".") } else { folder };
    let inside = match (folder.canonicalize(), file.canonicalize()) {
        (Ok(folder), Ok(file)) => file.starts_with(folder),
        // The file does not exist, so only its name can be checked.
        _ => file.strip_prefix(folder).is_ok_and(|rest| rest.components().all(|c| matches!(c, Component::Normal(_)))),
    };
    if inside || allow_outside {
        return Ok(());
    }
    let what = format!("{} lies outside the mesh's folder", file.display());
    Err((what, "move it into the folder, or allow files from outside (LoadOptions::allow_outside)".into()))
}
