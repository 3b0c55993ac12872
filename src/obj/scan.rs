//! The pass before tobj: keeps line numbers and catches what tobj 4.0 takes wrongly without a word.
//!
//! tobj reads `f 1 2` as a line, makes up the UV of a corner that has none, shifts the vertex colours when only some
//! vertices have one, overflows on a huge UV index, reads the colours of `v 1 2 3 a b c` as none, fails at `\`, at a
//! comment behind numbers and at `vt u`, loses `usemtl` before `mtllib`, and gives no line numbers. Its vertices are
//! renumbered per group and material; [`Scan::text`] therefore holds neither.

use super::statement::{Statement, statements};
use crate::error::{Error, Result};
use std::{collections::HashMap, fmt::Write, path::Path};

/// What is known of a face before its numbers are read.
pub(super) struct Face {
    /// Its line in the file.
    pub line: usize,
    /// Its material, an index into [`Scan::materials`].
    pub material: Option<usize>,
    /// Whether its corners have UVs: all have, or none has.
    pub has_uvs: bool,
}

/// A judged file.
#[derive(Default)]
pub(super) struct Scan {
    /// Its `v`, `vt` and `f` statements, one a line, as tobj reads them rightly.
    pub text: String,
    /// The file's line of each line of `text`.
    pub lines: Vec<usize>,
    /// The faces in file order.
    pub faces: Vec<Face>,
    /// The materials by name, in order of first use, each with the line that first names it.
    pub materials: Vec<(String, usize)>,
    /// What each `mtllib` says, with its line.
    pub libraries: Vec<(String, usize)>,
    /// What there is of `v` and `vt`.
    pub totals: Counts,
}

/// Numbers of `v` statements, of `v` statements with a colour, and of `vt` statements.
#[derive(Clone, Copy, Default)]
pub(super) struct Counts {
    pub vertices: usize,
    pub colored: usize,
    pub uvs: usize,
}

/// A binary file has endless unknown words: the first few tell enough.
const MAX_NOTES: usize = 32;

/// What was met and is not kept, by its note, with the first line and the number of times.
#[derive(Default)]
struct Ignored(Vec<(String, usize, usize)>);

impl Ignored {
    fn add(&mut self, note: impl Into<String>, line: usize) {
        let note = note.into();
        if let Some(entry) = self.0.iter_mut().find(|entry| entry.0 == note) {
            entry.2 += 1;
        } else if self.0.len() < MAX_NOTES {
            self.0.push((note, line, 1));
        }
    }

    fn notes(self) -> impl Iterator<Item = String> {
        self.0.into_iter().map(|(note, line, times)| match times {
            1 => format!("line {line}: {note}"),
            _ => format!("line {line} and {} more: {note}", times - 1),
        })
    }
}

/// What is wrong and how to fix it.
type Verdict<T = ()> = std::result::Result<T, (String, &'static str)>;

/// Judges every statement.
///
/// # Errors
/// [`Error::File`] with the line of the first statement that is wrong.
pub(super) fn scan(path: &Path, text: &str, notes: &mut Vec<String>) -> Result<Scan> {
    let totals = count(text);
    let mut scanner = Scanner { scan: Scan { totals, ..Scan::default() }, ..Scanner::default() };
    for statement in statements(text) {
        scanner.statement(&statement).map_err(|(what, fix)| Error::File {
            path: path.into(),
            line: Some(statement.line),
            what,
            fix: fix.into(),
        })?;
    }
    notes.extend(scanner.ignored.notes());
    let scan = scanner.scan;
    if scan.faces.is_empty() {
        return Err(Error::File {
            path: path.into(),
            line: None,
            what: format!("no faces ({} vertices)", totals.vertices),
            fix: "softras draws triangles: give a mesh with `f` statements".into(),
        });
    }
    Ok(scan)
}

/// Faces may name vertices that come later, and one colour asks for all, so the totals are needed first.
fn count(text: &str) -> Counts {
    let mut counts = Counts::default();
    for statement in statements(text) {
        match statement.keyword() {
            "v" => {
                counts.vertices += 1;
                counts.colored += usize::from(statement.words().count() == 6);
            }
            "vt" => counts.uvs += 1,
            _ => {}
        }
    }
    counts
}

#[derive(Default)]
struct Scanner {
    scan: Scan,
    seen: Counts,
    material: Option<usize>,
    material_by_name: HashMap<String, usize>,
    ignored: Ignored,
}

impl Scanner {
    fn statement(&mut self, statement: &Statement) -> Verdict {
        let line = statement.line;
        match statement.keyword() {
            "v" => self.vertex(statement)?,
            "vt" => self.uv(statement)?,
            "f" => self.face(statement)?,
            "usemtl" => self.use_material(statement.rest(), line),
            "mtllib" => self.scan.libraries.push((statement.rest().into(), line)),
            "vn" => self.ignored.add("normals are computed from the geometry, not read", line),
            "l" => self.ignored.add("lines (`l`) are not drawn", line),
            "p" => self.ignored.add("points (`p`) are not drawn", line),
            // Names, smoothing and display hints: nothing that a picture would show.
            "o" | "g" | "s" | "mg" | "lod" | "bevel" | "c_interp" | "d_interp" => {}
            "vp" | "cstype" | "deg" | "bmat" | "step" | "curv" | "curv2" | "surf" | "parm" | "trim" | "hole"
            | "scrv" | "sp" | "end" | "con" => {
                self.ignored.add("free-form curves and surfaces are not drawn", line);
            }
            word => {
                let word: String = word.chars().take(32).collect();
                self.ignored.add(format!("unknown statement {word:?} ignored"), line);
            }
        }
        Ok(())
    }

    /// Adds a line for tobj.
    fn keep(&mut self, keyword: &str, words: &[&str], line: usize) {
        self.scan.text.push_str(keyword);
        for word in words {
            // Writing to a String cannot fail.
            let _ = write!(self.scan.text, " {word}");
        }
        self.scan.text.push('\n');
        self.scan.lines.push(line);
    }

    fn vertex(&mut self, statement: &Statement) -> Verdict {
        let mut words: Vec<&str> = statement.words().collect();
        let colored = self.scan.totals.colored > 0;
        match words.len() {
            3 if colored => {
                self.ignored.add("vertex without a colour among others that have one: white", statement.line);
                words.extend(["1", "1", "1"]);
            }
            3 => {}
            4 if colored => {
                return Err((
                    "vertex with w among vertices with colours".into(),
                    "divide x, y, z by w and leave w out",
                ));
            }
            4 if words[3].parse() == Ok(1.0f32) => {}
            4 => self.ignored.add("the fourth coordinate w divides x, y and z", statement.line),
            6 => {
                if let Some(word) = words[3..].iter().find(|word| !is_finite(word)) {
                    return Err((
                        format!("vertex colour {word:?} is not a finite number"),
                        "give r, g and b from 0 to 1",
                    ));
                }
            }
            n => return Err((format!("vertex of {n} numbers"), "give x y z, x y z w or x y z r g b")),
        }
        self.keep("v", &words, statement.line);
        self.seen.vertices += 1;
        Ok(())
    }

    fn uv(&mut self, statement: &Statement) -> Verdict {
        let mut words: Vec<&str> = statement.words().collect();
        if let [_, _, w] = words[..]
            && w.parse() != Ok(0.0f32)
        {
            self.ignored.add("the third texture coordinate is not used", statement.line);
        }
        match words.len() {
            1 => words.push("0"),
            2 | 3 => words.truncate(2),
            n => return Err((format!("texture coordinate of {n} numbers"), "give u v")),
        }
        self.keep("vt", &words, statement.line);
        self.seen.uvs += 1;
        Ok(())
    }

    fn face(&mut self, statement: &Statement) -> Verdict {
        let mut corners = Vec::new();
        for word in statement.words() {
            corners.push(self.corner(word)?);
        }
        if corners.len() < 3 {
            return Err((format!("face of {} corners", corners.len()), "a face needs three or more"));
        }
        let has_uvs = corners[0].contains('/');
        if corners.iter().any(|corner| corner.contains('/') != has_uvs) {
            return Err(("some corners have a texture coordinate, some not".into(), "give all v/vt or all v"));
        }
        self.keep("f", &corners, statement.line);
        self.scan.faces.push(Face { line: statement.line, material: self.material, has_uvs });
        Ok(())
    }

    /// Judges `v`, `v/vt`, `v//vn` or `v/vt/vn` and returns it without the normal.
    fn corner<'a>(&self, word: &'a str) -> Verdict<&'a str> {
        let mut parts = word.split('/');
        let (vertex, uv, normal) = (parts.next().unwrap_or_default(), parts.next(), parts.next());
        if parts.next().is_some() {
            return Err((format!("corner {word:?} has more than three indices"), "give v, v/vt, v//vn or v/vt/vn"));
        }
        judge_index("vertex", vertex, self.seen.vertices, self.scan.totals.vertices)?;
        if let Some(normal) = normal.filter(|n| !n.is_empty())
            && normal.parse::<i64>().is_err()
        {
            return Err((format!("normal index {normal:?} is not a whole number"), "give v, v/vt, v//vn or v/vt/vn"));
        }
        let Some(uv) = uv.filter(|uv| !uv.is_empty()) else { return Ok(vertex) };
        judge_index("texture coordinate", uv, self.seen.uvs, self.scan.totals.uvs)?;
        Ok(&word[..vertex.len() + 1 + uv.len()])
    }

    fn use_material(&mut self, name: &str, line: usize) {
        if name.is_empty() {
            self.ignored.add("`usemtl` without a name: white from here on", line);
            self.material = None;
            return;
        }
        let next = self.scan.materials.len();
        let index = *self.material_by_name.entry(name.into()).or_insert(next);
        if index == next {
            self.scan.materials.push((name.into(), line));
        }
        self.material = Some(index);
    }
}

fn is_finite(word: &str) -> bool {
    word.parse::<f32>().is_ok_and(f32::is_finite)
}

/// An index counts from 1, or from -1 backwards over what the file has so far.
fn judge_index(what: &str, word: &str, so_far: usize, total: usize) -> Verdict {
    let Ok(index) = word.parse::<i64>() else {
        return Err((format!("{what} index {word:?} is not a whole number"), "give v, v/vt, v//vn or v/vt/vn"));
    };
    let count = if index < 0 { so_far } else { total };
    match index {
        0 => Err((format!("{what} index 0"), "indices count from 1, or from -1 backwards")),
        _ if index.unsigned_abs() > count as u64 => {
            let lack = if index < 0 { " before it" } else { "" };
            Err((format!("{what} index {index} but there are {count}{lack}"), "fix the index or add what it names"))
        }
        _ => Ok(()),
    }
}
