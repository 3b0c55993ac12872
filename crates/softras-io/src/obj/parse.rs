//! The parser of OBJ files: every statement is validated and read once. A wrong part is left out, and noted with its line.
//!
//! The crate tobj is not used because it cannot keep what [`load`](super::load) promises: it drops unused vertices and
//! renumbers the others, and its errors have no line numbers. Worse, it reads some files wrongly without an error: it takes
//! `f 1 2` for a line, invents the UV of a corner that has none, shifts vertex colours when only some vertices have one, and
//! overflows on a huge UV index.

use super::statement::{Statement, statements};
use crate::{
    color,
    fate::{self, Drawn, Fates, NotDrawn, Silent},
    fault, input,
    notes::Notes,
    polygon,
    source::Source,
    text,
};
use softras::Result;
use std::{collections::HashMap, path::Path, str::FromStr};

/// The largest magnitude of a texture coordinate; beyond it f32 has too few digits left for the position in an image.
pub const FARTHEST_UV: f32 = 1e4;
pub const FAR_UVS: &str = "texture coordinates that are no numbers up to ±10000 are replaced by 0";

/// The fate of each statement; `fo` is an old word for `f`.
pub const STATEMENTS: &Fates = &[
    ("v vt vn f fo usemtl mtllib", Drawn),
    ("l", NotDrawn("lines (`l`) are not drawn")),
    ("p", NotDrawn("points (`p`) are not drawn")),
    (
        "vp cstype deg bmat step curv curv2 surf parm trim hole scrv sp end con bsp bzp cdc cdp res",
        NotDrawn("free-form curves and surfaces are not drawn"),
    ),
    ("usemap maplib", NotDrawn("textures beside materials are not drawn")),
    ("call csh", NotDrawn("other files and commands are not run")),
    ("o g s mg lod bevel c_interp d_interp shadow_obj trace_obj ctech stech", Silent),
];

/// The content of an OBJ file.
#[derive(Default)]
pub(super) struct Obj {
    /// One per `v`, in file order.
    pub positions: Vec<[f64; 3]>,
    /// One per position, or none at all.
    pub colors: Vec<[f32; 3]>,
    /// One per `vt`, in file order.
    pub uvs: Vec<[f32; 2]>,
    /// The faces in file order.
    pub faces: Vec<Face>,
    /// The corners of all faces, as indices into `positions`.
    pub corners: Vec<u32>,
    /// The corners as indices into `uvs`, 0 for faces without UVs; empty when the file has no `vt`.
    pub uv_corners: Vec<u32>,
    /// One per `vn`, in file order, of any length; 0 for one that is not finite.
    pub normals: Vec<[f32; 3]>,
    /// The corners as indices into `normals`, [`NO_NORMAL`] for corners without; empty when the file has no `vn`.
    pub normal_corners: Vec<u32>,
    /// The names that `usemtl` gives, in order of first use, each with the line that first gives it.
    pub materials: Vec<(String, usize)>,
    /// The text of each `mtllib`, which names files, with its line.
    pub libraries: Vec<(String, usize)>,
}

/// The index of a corner that has no normal.
pub(super) const NO_NORMAL: u32 = u32::MAX;

/// A polygon of three or more corners.
pub(super) struct Face {
    /// Its line in the file.
    pub line: usize,
    /// Its material, an index into [`Obj::materials`].
    pub material: Option<usize>,
    /// Whether its corners have UVs: all have, or none has.
    pub has_uvs: bool,
    /// Its number of corners.
    pub arity: usize,
}

/// Numbers of `v` statements, of `v` statements with a colour, of `vt` and of `f` statements and of their corners in the
/// whole file.
#[derive(Clone, Copy, Default)]
struct Totals {
    vertices: usize,
    colored: usize,
    /// Counts of vertices of seven numbers: all of them, those with 1 as the fourth number, and those with 1 as the last.
    sevens: [usize; 3],
    uvs: usize,
    normals: usize,
    faces: usize,
    corners: usize,
}

/// Parses a whole file; what is not kept of it becomes notes.
///
/// # Errors
/// [`softras::Error::File`] for a text without vertices; [`softras::Error::OutOfMemory`].
pub(super) fn parse(source: &mut Source, text: &str) -> Result<Obj> {
    let path = source.path;
    let totals = count(text);
    let obj = Obj::sized(path, &totals)?;
    let notes = &mut source.notes;
    let mut parser = Parser { obj, totals, material: None, material_by_name: HashMap::new(), notes };
    statements(text).for_each(|statement| parser.statement(&statement));
    let mut obj = parser.obj;
    if obj.positions.is_empty() {
        let what = "not an OBJ file: it has no vertex and no face";
        return Err(fault(path, what, "give a mesh, with the ending of its format"));
    }
    color::settle(&mut obj.colors, None, source.options.srgb, &mut source.notes);
    Ok(obj)
}

/// A face may name vertices that come later, and one vertex colour makes all vertices coloured, so the totals are needed
/// before the first statement is read.
fn count(text: &str) -> Totals {
    let mut totals = Totals::default();
    for statement in statements(text) {
        match statement.keyword() {
            "v" => {
                totals.vertices += 1;
                totals.count_colors(&statement);
            }
            "vt" => totals.uvs += 1,
            "vn" => totals.normals += 1,
            "f" | "fo" => {
                totals.faces += 1;
                totals.corners += statement.words().count();
            }
            _ => {}
        }
    }
    totals
}

/// The number of words of a vertex, and the first seven.
fn vertex_words<'a>(statement: &'a Statement) -> (usize, [&'a str; 7]) {
    let (mut count, mut words) = (0, [""; 7]);
    for word in statement.words() {
        if let Some(place) = words.get_mut(count) {
            *place = word;
        }
        count += 1;
    }
    (count, words)
}

impl Totals {
    fn count_colors(&mut self, statement: &Statement) {
        let (count, words) = vertex_words(statement);
        let number = |at: usize| words[at].parse::<f32>().unwrap_or_default();
        self.colored += usize::from(count == 6 || count == 7);
        if count == 7 {
            let is_one = |at: usize| usize::from(number(at) == 1.0);
            self.sevens = [self.sevens[0] + 1, self.sevens[1] + is_one(3), self.sevens[2] + is_one(6)];
        }
    }

    /// Whether vertices of seven numbers are x y z w r g b, and not x y z r g b a: all w, but not all a, are 1.
    fn has_weights(&self) -> bool {
        let [all, weights, alphas] = self.sevens;
        weights == all && alphas < all
    }
}

impl Obj {
    /// Nothing yet, with room for all that the file has.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`](softras::Error::OutOfMemory).
    fn sized(path: &Path, totals: &Totals) -> Result<Self> {
        let (normals, uvs) = (totals.normals > 0, totals.uvs > 0);
        Ok(Self {
            positions: input::vector(path, totals.vertices)?,
            colors: input::vector(path, if totals.colored > 0 { totals.vertices } else { 0 })?,
            uvs: input::vector(path, totals.uvs)?,
            faces: input::vector(path, totals.faces)?,
            corners: input::vector(path, totals.corners)?,
            uv_corners: input::vector(path, if uvs { totals.corners } else { 0 })?,
            normals: input::vector(path, totals.normals)?,
            normal_corners: input::vector(path, if normals { totals.corners } else { 0 })?,
            ..Self::default()
        })
    }
}

struct Parser<'a> {
    obj: Obj,
    totals: Totals,
    /// The material of the faces that follow.
    material: Option<usize>,
    material_by_name: HashMap<String, usize>,
    notes: &'a mut Notes,
}

impl Parser<'_> {
    fn statement(&mut self, statement: &Statement) {
        let line = statement.line;
        match statement.keyword() {
            "v" => self.vertex(statement),
            "vt" => self.uv(statement),
            "f" | "fo" => self.face(statement),
            "usemtl" => self.use_material(statement.rest(), line),
            "mtllib" => self.obj.libraries.push((statement.rest().into(), line)),
            "vn" => self.normal(statement),
            word => match fate::of(STATEMENTS, word) {
                Some(NotDrawn(note)) => self.notes.count(line, note),
                Some(_) => {}
                None => {
                    let word: String = word.chars().take(32).collect();
                    self.notes.count(line, &format!("unknown statement {word:?} ignored"));
                }
            },
        }
    }

    /// `v x y z`, with w, r g b, r g b a or w r g b behind.
    fn vertex(&mut self, statement: &Statement) {
        let (count, [x, y, z, rest @ ..]) = vertex_words(statement);
        let (w, color) = match (count, rest) {
            (..=3, _) => (None, None),
            (4, [w, ..]) => (Some(w), None),
            (6, [r, g, b, _]) => (None, Some([r, g, b])),
            (7, [w, r, g, b]) if self.totals.has_weights() => (Some(w), Some([r, g, b])),
            (7, [r, g, b, a]) => {
                if a.parse() != Ok(1.0f32) {
                    self.notes.count(statement.line, "the alpha of vertex colours is not drawn");
                }
                (None, Some([r, g, b]))
            }
            _ => {
                self.notes.count(statement.line, "vertices of 5 or more than 7 numbers: x, y and z alone are read");
                (None, None)
            }
        };
        self.position([x, y, z], w, statement.line);
        match color {
            Some(color) => {
                let color = color.map(number);
                if !color::is_color(&color) {
                    self.notes.count(statement.line, color::BAD);
                }
                self.obj.colors.push(color);
            }
            None if self.totals.colored > 0 => {
                self.notes.count(statement.line, "vertex without a colour among others that have one: white");
                self.obj.colors.push([f32::NAN; 3]);
            }
            None => {}
        }
    }

    /// A point, which may be infinite or none: then its faces are left out.
    fn position(&mut self, xyz: [&str; 3], w: Option<&str>, line: usize) {
        if xyz.into_iter().chain(w).any(|word| text::number::<f64>(word).is_none()) {
            self.notes.count(line, "a vertex has a coordinate that is not a number");
        }
        let mut position = xyz.map(number::<f64>);
        if let Some(w) = w.map(number::<f64>) {
            if w != 1.0 && w != 0.0 {
                self.notes.count(line, "the fourth coordinate w divides x, y and z");
            }
            position = position.map(|x| x / w);
        }
        self.obj.positions.push(position);
    }

    /// `vt u`, `vt u v` or `vt u v w`.
    fn uv(&mut self, statement: &Statement) {
        let words: Vec<&str> = statement.words().collect();
        let uv = match words[..] {
            [] => [f32::NAN; 2],
            [u] => [number(u), 0.0],
            [u, v, ref rest @ ..] => {
                if rest.iter().any(|word| word.parse() != Ok(0.0f32)) {
                    self.notes.count(statement.line, "the third texture coordinate is not used");
                }
                [u, v].map(number)
            }
        };
        let is_good = uv.iter().all(|x| x.abs() <= FARTHEST_UV);
        if !is_good {
            self.notes.count(statement.line, FAR_UVS);
        }
        self.obj.uvs.push(if is_good { uv } else { [0.0; 2] });
    }

    /// `vn x y z`.
    fn normal(&mut self, statement: &Statement) {
        let normal = <[f32; 3]>::try_from(statement.words().map(number).collect::<Vec<f32>>());
        let normal = normal.ok().filter(|normal| normal.iter().all(|x| x.is_finite()));
        if normal.is_none() {
            self.notes.count(statement.line, "normals that are not three finite numbers are not used");
        }
        self.obj.normals.push(normal.unwrap_or_default());
    }

    fn face(&mut self, statement: &Statement) {
        let (mut arity, mut with_uv, mut strays) = (0, 0, false);
        let start = self.obj.corners.len();
        for word in statement.words() {
            let corner = self.corner(word, statement.line);
            strays |= corner.is_none();
            let (vertex, uv, normal) = corner.unwrap_or_default();
            self.obj.corners.push(vertex);
            if self.totals.normals > 0 {
                self.obj.normal_corners.push(normal);
            }
            if self.totals.uvs > 0 {
                self.obj.uv_corners.push(uv.unwrap_or(0));
            }
            arity += 1;
            with_uv += usize::from(uv.is_some());
        }
        if strays || arity < 3 {
            let what = if strays { polygon::STRAYS } else { "faces of fewer than three corners are not drawn" };
            self.notes.count(statement.line, what);
            self.obj.corners.truncate(start);
            self.obj.uv_corners.truncate(start);
            self.obj.normal_corners.truncate(start);
            return;
        }
        let has_uvs = with_uv == arity;
        if !has_uvs && with_uv > 0 {
            self.notes.count(statement.line, "faces with texture coordinates at only some corners lose them");
            self.obj.uv_corners[start..].fill(0);
        }
        self.obj.faces.push(Face { line: statement.line, material: self.material, has_uvs, arity });
    }

    /// The indices of `v`, `v/vt`, `v//vn` or `v/vt/vn`, of which the file may lack the last two; `None` if it lacks the vertex.
    fn corner(&mut self, word: &str, line: usize) -> Option<(u32, Option<u32>, u32)> {
        let mut parts = word.split('/');
        let (vertex, uv, normal) = (parts.next()?, parts.next(), parts.next());
        let vertex = index(vertex, self.obj.positions.len(), self.totals.vertices)?;
        let uv = uv.filter(|uv| !uv.is_empty()).map(|uv| index(uv, self.obj.uvs.len(), self.totals.uvs));
        let normal = normal.filter(|normal| !normal.is_empty());
        let normal = normal.map(|normal| index(normal, self.obj.normals.len(), self.totals.normals));
        for (found, what) in [(uv, "texture coordinates"), (normal, "normals")] {
            if found == Some(None) {
                self.notes.count(line, &format!("faces name {what} that the file lacks: left out"));
            }
        }
        parts.next().is_none().then_some((vertex, uv.flatten(), normal.flatten().unwrap_or(NO_NORMAL)))
    }

    fn use_material(&mut self, name: &str, line: usize) {
        if name.is_empty() {
            self.notes.count(line, "`usemtl` without a name: no material from here on");
            self.material = None;
            return;
        }
        let next = self.obj.materials.len();
        let index = *self.material_by_name.entry(name.into()).or_insert(next);
        if index == next {
            self.obj.materials.push((name.into(), line));
        }
        self.material = Some(index);
    }
}

/// A word as a number, which may be infinite or none.
fn number<T: FromStr + From<f32>>(word: &str) -> T {
    text::number(word).unwrap_or_else(|| T::from(f32::NAN))
}

/// Reads an index, which counts from 1, or from -1 backwards over what the file has so far; the result counts from 0. `None` for
/// what the file does not have.
fn index(word: &str, so_far: usize, total: usize) -> Option<u32> {
    let index = word.parse::<i64>().ok()?;
    let at =
        if index < 0 { (so_far as u64).checked_sub(index.unsigned_abs())? } else { (index as u64).checked_sub(1)? };
    // Files are smaller than 4 GiB, so there are fewer vertices than a u32 can count.
    (at < total as u64).then_some(at as u32)
}
