//! Reads MTL files: the diffuse colour, the diffuse texture and the opacity of each material.
//!
//! The crate tobj is not used, because it panics at `Kd 0.5` (a legal grey) and does not report the line of a texture.

use super::statement::{Statement, before_comment, statements};
use crate::{
    color,
    fate::{self, Approximated, Drawn, Fate, Fates, NotDrawn, Silent},
    find::find,
    notes::Notes,
    source::Source,
    text,
};
use softras::{
    Error,
    scene::{Mesh, Wrap},
};
use std::{
    collections::{HashMap, HashSet},
    path::{Path, PathBuf},
};

/// The fate of each statement.
pub const STATEMENTS: &Fates = &[
    ("newmtl Kd d Tr map_Kd map_d", Drawn),
    ("Ke", Approximated("emitted light is drawn as a colour that is shaded")),
    ("map_Ke", NotDrawn("textures of emitted light are not drawn")),
    ("map_Bump map_bump bump", NotDrawn("bump maps are not drawn")),
    ("norm map_Kn", NotDrawn("normal maps are not drawn")),
    ("disp map_disp", NotDrawn("displacements are not drawn")),
    ("decal", NotDrawn("decals are not drawn")),
    (
        "Ka Ks Ns Ni Tf Km illum sharpness refl map_Ka map_Ks map_Ns map_refl map_aat Pr Pm Ps Pc Pcr aniso \
         anisor map_Pr map_Pm map_Ps map_RMA map_ORM",
        Silent,
    ),
];

/// The fate of a statement; keywords of maps are written in upper or lower case.
fn fate_of(keyword: &str) -> Option<Fate> {
    let same = |(name, _): &(&str, Fate)| name.contains("map") && name.eq_ignore_ascii_case(keyword);
    fate::of(STATEMENTS, keyword).or_else(|| fate::names(STATEMENTS).find(same).map(|(_, fate)| fate))
}

/// All `newmtl` blocks of all files, and the first of each name.
#[derive(Default)]
pub(super) struct Materials {
    all: Vec<MtlMaterial>,
    by_name: HashMap<String, usize>,
    /// Whether some file could not be read.
    lacks_some: bool,
}

impl Materials {
    /// Adds one without a colour; false where the name has been given already.
    fn begin(&mut self, name: &str) -> bool {
        let is_new = !self.by_name.contains_key(name);
        if is_new {
            self.by_name.insert(name.into(), self.all.len());
        }
        self.all.push(MtlMaterial { name: name.into(), ..MtlMaterial::default() });
        is_new
    }

    /// Whether every file was read.
    pub fn is_whole(&self) -> bool {
        !self.lacks_some
    }

    /// The first of that name.
    pub fn find(&self, name: &str) -> Option<&MtlMaterial> {
        let at = self.by_name.get(name).or_else(|| self.by_name.get(before_comment(name)));
        at.map(|&at| &self.all[at])
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// The only one, if there is but one.
    pub fn only(&self) -> Option<&MtlMaterial> {
        if let [only] = &self.all[..] { Some(only) } else { None }
    }

    /// Decides what `Tr` means. MeshLab writes 1 for opaque, and so must a file in which every material has it: else nothing is visible.
    fn settle_tr(&mut self, notes: &mut Notes, mtl: &Path, first: usize, is_meshlab: bool) {
        let own = &mut self.all[first..];
        let is_clear = |material: &MtlMaterial| material.dissolve.is_none() && material.solidity == Some(0.0);
        let all_clear = !own.is_empty() && own.iter().all(is_clear);
        if is_meshlab || all_clear {
            own.iter_mut().for_each(|material| material.solidity = material.solidity.map(|x| 1.0 - x));
        }
        if all_clear && !is_meshlab {
            notes.add_in(
                mtl,
                None,
                "`Tr 1` in every material is taken as opaque, as MeshLab writes it (write `d 0` for invisible)",
            );
        }
    }
}

/// A `newmtl` block.
#[derive(Default)]
pub(super) struct MtlMaterial {
    pub name: String,
    /// `Kd`; white when there is none.
    pub color: Option<[f32; 3]>,
    pub map: Option<MapStatement>,
    /// `map_d`.
    pub alpha_map: Option<MapStatement>,
    /// `Ke`.
    pub glow: [f32; 3],
    /// `d`, and 1 less `Tr`, which counts where there is no `d`.
    dissolve: Option<f32>,
    solidity: Option<f32>,
}

impl MtlMaterial {
    /// `d`, or 1 less `Tr`.
    pub fn opacity(&self) -> f32 {
        self.dissolve.or(self.solidity).unwrap_or(1.0)
    }
}

/// A `map_Kd` or `map_d` statement.
#[derive(Clone, PartialEq)]
pub(super) struct MapStatement {
    /// The image as the file names it.
    pub name: String,
    pub wrap: Wrap,
    /// The UVs of the image are those of the file times `-s`, plus `-o`.
    pub scale: [f32; 2],
    pub offset: [f32; 2],
    /// The MTL file and the line that name it.
    pub mtl: PathBuf,
    pub line: usize,
}

/// Reads the files that the OBJ file's `mtllib` statements name; what is wrong with them becomes notes.
/// `plain` is the colour of faces without a material.
pub(super) fn read_libraries(source: &mut Source, libraries: &[(String, usize)], plain: &str) -> Materials {
    let mut materials = Materials::default();
    // A file that is named again adds nothing; reading it again would let a small file cause a lot of work.
    let mut known = HashSet::new();
    for (names, line) in libraries {
        // One name with spaces, or several names.
        let words = before_comment(names);
        let whole = names.trim_matches('"');
        let locate = |name: &str| find(source.path, source.path, name, source.options.allow_outside);
        let mut found = vec![(whole, locate(whole))];
        if found[0].1.is_err() && words != names {
            found = vec![(words, locate(words))];
        }
        if found[0].1.is_err() && words.split_whitespace().nth(1).is_some() {
            found = words.split_whitespace().map(|name| (name, locate(name))).collect();
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
                    source.notes.add(Some(*line), format!("material file \"\" not found: its materials are {plain}"));
                    materials.lacks_some = true;
                    continue;
                }
                Err(what) => {
                    source.notes.add(Some(*line), format!("material file {what}: its materials are {plain}"));
                    materials.lacks_some = true;
                    continue;
                }
            };
            if known.insert(mtl.canonicalize().unwrap_or_else(|_| mtl.clone())) {
                read_library(source, &mtl, &mut materials, plain);
                source.files.push(mtl);
            }
        }
    }
    materials
}

/// A statement that is wrong is left out with a note.
fn read_library(source: &mut Source, mtl: &Path, materials: &mut Materials, plain: &str) {
    let read = source.read_bytes(mtl).and_then(|bytes| text::whole(mtl, bytes));
    let notes = &mut source.notes;
    let text = match read {
        Ok(text) => text,
        Err(error) => {
            materials.lacks_some = true;
            let what = if let Error::File { what, .. } = error { what } else { error.to_string() };
            return notes.add_in(mtl, None, format!("{what}: its materials are {plain}"));
        }
    };
    let first = materials.all.len();
    let is_meshlab =
        text.lines().take(8).any(|line| line.starts_with('#') && line.to_ascii_lowercase().contains("meshlab"));
    for statement in statements(&text) {
        let mut note = |text: String| notes.add_in(mtl, Some(statement.line), text);
        let keyword = statement.keyword();
        if keyword == "newmtl" {
            let name = statement.name();
            if name.is_empty() {
                note("material without a name: write `newmtl NAME`".into());
            }
            if !materials.begin(name) {
                note(format!("material \"{}\" is defined again: the first one counts", text::name(name)));
            }
            continue;
        }
        let is_alpha = keyword.eq_ignore_ascii_case("map_d");
        let is_map = is_alpha || keyword.eq_ignore_ascii_case("map_Kd");
        match fate_of(keyword) {
            Some(Fate::NotDrawn(what)) => {
                if let Some(material) = materials.all.last() {
                    note(format!("{keyword} of \"{}\": {what}", text::name(&material.name)));
                }
                continue;
            }
            Some(Fate::Drawn | Fate::Approximated(_)) => {}
            Some(_) => continue,
            None => {
                note(format!("unknown statement {:?} ignored", keyword.chars().take(32).collect::<String>()));
                continue;
            }
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
        } else if keyword == "Ke" {
            let glow = read_color(&statement).unwrap_or_default();
            material.glow = glow;
            if glow != [0.0; 3] {
                note("emitted light (Ke) is drawn as colour, which lamps shade".into());
            }
        } else if keyword != "Kd" {
            match read_opacity(&statement) {
                Some(value) if keyword == "d" => material.dissolve = Some(value),
                Some(value) => material.solidity = Some(1.0 - value),
                None => note(format!("malformed `{keyword}`: opaque (write a number from 0 to 1)")),
            }
        } else if matches!(statement.words().next(), Some("spectral" | "xyz")) {
            note(format!("Kd by spectral curve or CIE XYZ is not read: {plain}"));
        } else {
            match read_color(&statement) {
                Some(color) if color::are_bytes(color.into_iter()) => {
                    note("Kd up to 255 is divided by 255 (write 0 to 1)".into());
                    material.color = Some(color.map(|x| x / 255.0));
                }
                Some(color) => {
                    if color.iter().any(|x| *x > color::BRIGHT) {
                        note("Kd is brighter than white (write 0 to 1)".into());
                    }
                    material.color = Some(color);
                }
                None => {
                    let shown: String = statement.rest().chars().take(80).collect();
                    note(format!("malformed colour `Kd {shown}`: {plain} (write `Kd r g b`, 0 to 1)"));
                }
            }
        }
    }
    materials.settle_tr(notes, mtl, first, is_meshlab);
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
fn read_map(mtl: &Path, statement: &Statement, mut note: impl FnMut(String)) -> Result<MapStatement, String> {
    let mut rest = statement.rest();
    let keyword = statement.keyword();
    let mut wrap = Wrap::Repeat;
    let (mut scale, mut offset) = ([1.0; 2], [0.0; 2]);
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
                let most = if option == "-mm" { 2 } else { 3 };
                let number = |text: &str| text.split_whitespace().next().and_then(|word| word.parse::<f32>().ok());
                let mut numbers = Vec::new();
                while let Some(x) = number(rest).filter(|x| x.is_finite() && numbers.len() < most) {
                    numbers.push(x);
                    take(&mut rest);
                }
                let given = |k: usize, usual: f32| numbers.get(k).copied().unwrap_or(usual);
                match option {
                    "-s" => scale = [given(0, 1.0), given(1, 1.0)],
                    "-o" => offset = [given(0, 0.0), given(1, 0.0)],
                    _ => note(format!("option {option} of {keyword} is not honoured")),
                }
            }
            _ => return Err(format!("unknown option {option} of {keyword}")),
        }
    }
    match rest.trim_matches('"') {
        "" => Err(format!("{keyword} without a file")),
        name => Ok(MapStatement { name: name.into(), wrap, scale, offset, mtl: mtl.into(), line: statement.line }),
    }
}
