//! Reads PLY files: vertices, polygons, colours, and UVs with their image.

mod rows;
mod write;

pub use write::files_of;

use crate::{
    Wrong, color,
    fate::{self, Drawn, Fates, NotDrawn, Silent},
    fault,
    find::find,
    notes::Notes,
    obj::{FAR_UVS, FARTHEST_UV},
    paint::{self, Patch, Sheet},
    polygon,
    source::Source,
    text, texture,
    textures::Room,
    within,
};
use rows::{Body, NumberType, Row, Table, VALUES};
use softras::{
    Result,
    scene::{Appearance, Mesh, Texture, Wrap},
};
use std::mem;

/// The fates of elements, and of their properties, whose names are in upper or lower case. Other elements are noted, and so are other
/// properties whose names tell of colours or textures; the rest is data about the mesh.
pub const PROPERTIES: &Fates = &[
    (
        "vertex.x vertex.y vertex.z vertex.nx vertex.ny vertex.nz vertex.red vertex.green vertex.blue vertex.diffuse_red \
         vertex.diffuse_green vertex.diffuse_blue vertex.r vertex.g vertex.b vertex.s vertex.t vertex.u vertex.v \
         vertex.texture_u vertex.texture_v face.vertex_indices face.vertex_index face.red face.green face.blue \
         face.diffuse_red face.diffuse_green face.diffuse_blue face.r face.g face.b face.texcoord face.texnumber tristrips.vertex_indices tristrips.vertex_index comment.TextureFile",
        Drawn,
    ),
    ("vertex.alpha vertex.a face.alpha face.a", NotDrawn(ALPHA)),
    (
        "vertex.ambient_red vertex.ambient_green vertex.ambient_blue face.ambient_red face.ambient_green face.ambient_blue",
        NotDrawn("ambient colours are not drawn"),
    ),
    ("edge", NotDrawn("lines are not drawn")),
    ("range_grid", NotDrawn("range grids are not drawn")),
    ("material face.material_index", NotDrawn("colours of materials are not drawn")),
    ("multi_texture_vertex multi_texture_face", NotDrawn("textures of multi_texture_face are not drawn")),
    ("camera user face.quality face.flags", Silent),
    (
        "vertex.quality vertex.confidence vertex.intensity vertex.radius vertex.flags vertex.specular_red \
         vertex.specular_green vertex.specular_blue",
        Silent,
    ),
];
const ALPHA: &str = "the alpha of colours is not drawn";

/// The names of what is read of a vertex: position, colour, UV, normal, alpha. Where several are given, the first that a file has counts.
const VERTEX: [&[&str]; VALUES] = [
    &["x"],
    &["y"],
    &["z"],
    &["red", "diffuse_red", "r"],
    &["green", "diffuse_green", "g"],
    &["blue", "diffuse_blue", "b"],
    &["s", "u", "texture_u"],
    &["t", "v", "texture_v"],
    &["nx"],
    &["ny"],
    &["nz"],
    &["alpha", "a"],
];
const FACE: [&[&str]; 7] = [
    &["red", "diffuse_red", "r"],
    &["green", "diffuse_green", "g"],
    &["blue", "diffuse_blue", "b"],
    &["texnumber"],
    &["alpha", "a"],
    &["vertex_indices", "vertex_index"],
    &["texcoord"],
];
/// The lists of faces among these.
const LISTS: usize = 5;

/// The content of the file.
#[derive(Default)]
struct Ply {
    positions: Vec<[f64; 3]>,
    colors: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    normals: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    /// One for each triangle, or none.
    face_colors: Vec<[f32; 3]>,
    /// The UVs of each triangle's corners, or none.
    corner_uvs: Vec<[[f32; 2]; 3]>,
    /// For each triangle the number of its image, or none.
    image_of_triangle: Vec<u32>,
    /// The images that comments name.
    images: Vec<String>,
    /// Faces before the vertices that they name, and strips.
    waiting: Vec<Waiting>,
    /// The types of the colours of vertices, and of faces.
    kinds: [Option<NumberType>; 2],
    /// The type of alpha, its least and its greatest value, of vertices and of faces.
    alpha: [Option<(NumberType, f64, f64)>; 2],
}

/// A face that is drawn when all vertices are read.
struct Waiting {
    number: usize,
    corners: Vec<f64>,
    color: Option<[f32; 3]>,
    uvs: Option<Vec<f64>>,
    image: Option<u32>,
}

/// The number of the image of a face that has none.
const NO_IMAGE: u32 = u32::MAX;

pub(super) fn read(source: &mut Source, bytes: &[u8]) -> Result<Mesh> {
    let mut ply = parse(source, bytes).map_err(|(what, fix)| fault(source.path, what, fix))?;
    let (positions, triangles) = (mem::take(&mut ply.positions), mem::take(&mut ply.triangles));
    source.keep_normals(&mem::take(&mut ply.normals), &triangles);
    let positions = source.placed(&positions, &triangles)?;
    let appearance = appearance(source, ply, &triangles);
    source.mesh(positions, triangles, appearance, |_| None)
}

fn parse(source: &mut Source, bytes: &[u8]) -> Result<Ply, Wrong> {
    let (header, rest) = rows::header(bytes)?;
    let mut body = Body::new(&header, rest);
    let mut ply = Ply { images: header.images, ..Ply::default() };
    for element in header.elements.iter().filter(|element| element.rows > 0) {
        let (names, lists): (&[&[&str]], _) = match element.name.as_str() {
            "vertex" => (&VERTEX, VERTEX.len()),
            "face" | "tristrips" => (&FACE, LISTS),
            _ => (&[], 0),
        };
        let table = Table::new(element, names, lists);
        match (element.name.as_str(), fate::of(PROPERTIES, &element.name)) {
            ("vertex", _) => body.read(&table, &mut ply.take_vertex(&table, source)?)?,
            ("face", _) => body.read(&table, &mut ply.take_face(&table, source)?)?,
            ("tristrips", _) => body.read(&table, &mut |row| ply.take_strips(row))?,
            (name, fate) => {
                match fate {
                    Some(NotDrawn(note)) => source.notes.count(None, note),
                    Some(_) => {}
                    None => source.notes.add(None, format!("element \"{}\" is not read", text::name(name))),
                }
                body.read(&table, &mut |_| Ok(()))?;
            }
        }
        note_unread(source, &element.name, &table);
    }
    if body.longer > 0 {
        source
            .notes
            .add(None, format!("{} rows have more numbers than the header names: the rest is not read", body.longer));
    }
    if body.strange > 0 {
        source.notes.add(None, format!("{} words are not numbers: such points are not drawn", body.strange));
    }
    if body.left() > 0 {
        source.notes.add(None, format!("{} bytes after the last row are not read", body.left()));
    }
    for Waiting { number, corners, color, uvs, image } in mem::take(&mut ply.waiting) {
        ply.add_face(&mut source.notes, number, &corners, color, uvs.as_deref(), image)?;
    }
    for (colors, kind) in [&mut ply.colors, &mut ply.face_colors].into_iter().zip(ply.kinds) {
        color::settle(colors, kind.and_then(NumberType::most), source.options.srgb, &mut source.notes);
    }
    for (kind, least, greatest) in ply.alpha.into_iter().flatten() {
        let opaque =
            kind.most().map_or(if greatest > 1.0 { 255.0 } else { 1.0 }, |most| color::top(most, greatest as f32));
        if least < opaque.into() {
            source.notes.count(None, ALPHA);
        }
    }
    Ok(ply)
}

/// Notes the columns that change the picture and are not read.
fn note_unread(source: &mut Source, element: &str, table: &Table) {
    const LOOKS: [&str; 7] = ["red", "green", "blue", "color", "colour", "rgb", "tex"];
    for name in table.unread() {
        match fate::of(PROPERTIES, &format!("{element}.{name}")) {
            Some(NotDrawn(note)) => source.notes.count(None, note),
            None if LOOKS.iter().any(|part| name.contains(part)) => {
                source.notes.add(None, format!("property \"{}\" is not read", text::name(name)));
            }
            _ => {}
        }
    }
}

impl Ply {
    /// The function that takes a row of vertices.
    fn take_vertex(
        &mut self,
        table: &Table,
        source: &mut Source,
    ) -> Result<impl FnMut(&Row) -> Result<(), Wrong>, Wrong> {
        if !table.has(0..3) {
            return Err(("its vertices have no x, y and z".into(), "name three properties of vertices x, y and z"));
        }
        let (colored, mapped, curved) = (table.has(3..6), table.has(6..8), table.has(8..11));
        self.kinds[0] = table.kind(3);
        let alpha = table.kind(11);
        Ok(move |row: &Row| {
            let [x, y, z, r, g, b, u, v, nx, ny, nz, a] = row.values;
            self.positions.push([x, y, z]);
            if colored {
                self.colors.push(raw(&mut source.notes, [r, g, b]));
            }
            if mapped {
                self.uvs.push(checked(&mut source.notes, [u, v]));
            }
            if curved {
                self.normals.push([nx, ny, nz].map(|x| x as f32));
            }
            widen(&mut self.alpha[0], alpha, a);
            Ok(())
        })
    }

    /// The function that takes a row of faces.
    fn take_face(
        &mut self,
        table: &Table,
        source: &mut Source,
    ) -> Result<impl FnMut(&Row) -> Result<(), Wrong>, Wrong> {
        if !table.has(LISTS..LISTS + 1) {
            let fix = "name the list of each face's vertices vertex_indices";
            return Err(("its faces have no list vertex_indices".into(), fix));
        }
        let (colored, numbered, mapped) = (table.has(0..3), table.has(3..4), table.has(LISTS + 1..LISTS + 2));
        self.kinds[1] = table.kind(0);
        let alpha = table.kind(4);
        let mut number = 0;
        // A row may come before the vertices that it names, and is drawn when all are read.
        Ok(move |row: &Row| {
            number += 1;
            widen(&mut self.alpha[1], alpha, row.values[4]);
            let [r, g, b, ..] = row.values;
            let color = colored.then(|| raw(&mut source.notes, [r, g, b]));
            let corners = &row.lists[LISTS];
            let uvs = mapped.then(|| &row.lists[LISTS + 1][..]);
            // Programs write -1 for a face without an image.
            let image = numbered.then(|| if row.values[3] >= 0.0 { row.values[3] as u32 } else { NO_IMAGE });
            if self.positions.is_empty() {
                let (corners, uvs) = (corners.clone(), uvs.map(<[f64]>::to_vec));
                self.waiting.push(Waiting { number, corners, color, uvs, image });
                return Ok(());
            }
            self.add_face(&mut source.notes, number, corners, color, uvs, image)
        })
    }

    fn add_face(
        &mut self,
        notes: &mut Notes,
        number: usize,
        corners: &[f64],
        color: Option<[f32; 3]>,
        uvs: Option<&[f64]>,
        image: Option<u32>,
    ) -> Result<(), Wrong> {
        let count = self.positions.len() as f64;
        let corner = |&x: &f64| (x >= 0.0 && x.fract() == 0.0 && x < count).then_some(x as u32);
        let Some(corners) = corners.iter().map(corner).collect::<Option<Vec<u32>>>() else {
            notes.count(None, polygon::STRAYS);
            return Ok(());
        };
        if corners.len() < 3 {
            notes.count(None, "faces of fewer than three corners are not drawn");
            return Ok(());
        }
        let cut = polygon::of(&corners, &self.positions).map_err(|what| (what, polygon::FIX));
        let cut = cut.map_err(within(format!("face {number}")))?;
        if !cut.is_simple {
            notes.count(None, polygon::NOT_SIMPLE);
        }
        let fitting = uvs.filter(|uvs| uvs.len() == 2 * corners.len());
        for triangle in cut.triangles {
            self.triangles.push(triangle.map(|c| corners[c]));
            self.face_colors.extend(color);
            self.image_of_triangle.extend(image);
            if uvs.is_some() {
                let uv = triangle.map(|c| fitting.map_or([0.0; 2], |uvs| checked(notes, [uvs[2 * c], uvs[2 * c + 1]])));
                self.corner_uvs.push(uv);
            }
        }
        Ok(())
    }

    /// A list of strips of triangles, each ended by -1.
    fn take_strips(&mut self, row: &Row) -> Result<(), Wrong> {
        for strip in row.lists[LISTS].split(|&x| x < 0.0) {
            for (i, corners) in strip.windows(3).enumerate() {
                let [a, b, c] = if i % 2 == 0 { [0, 1, 2] } else { [1, 0, 2] }.map(|k| corners[k]);
                // Strips turn by triangles without an area.
                if a != b && b != c && c != a {
                    let corners = vec![a, b, c];
                    self.waiting.push(Waiting { number: i + 1, corners, color: None, uvs: None, image: None });
                }
            }
        }
        Ok(())
    }
}

/// A colour as it is in the file.
fn raw(notes: &mut Notes, color: [f64; 3]) -> [f32; 3] {
    let color = color.map(|x| x as f32);
    if !color::is_color(&color) {
        notes.count(None, color::BAD);
    }
    color
}

/// Takes a value of alpha, of such a type, into the range of all.
fn widen(range: &mut Option<(NumberType, f64, f64)>, kind: Option<NumberType>, x: f64) {
    if let Some(kind) = kind {
        let (_, least, greatest) = range.unwrap_or((kind, x, x));
        *range = Some((kind, least.min(x), greatest.max(x)));
    }
}

/// A UV, or 0 for one that is out of range.
fn checked(notes: &mut Notes, uv: [f64; 2]) -> [f32; 2] {
    let uv = uv.map(|x| x as f32);
    if uv.iter().all(|x| x.abs() <= FARTHEST_UV) {
        return uv;
    }
    notes.count(None, FAR_UVS);
    [0.0; 2]
}

/// An image at UVs is preferred to colours of vertices and these to those of faces; what is not used is noted.
fn appearance(source: &mut Source, ply: Ply, triangles: &[[u32; 3]]) -> Appearance {
    let has_uvs = !(ply.uvs.is_empty() && ply.corner_uvs.is_empty());
    let (mut room, mut images) = (source.room(), Vec::new());
    for name in ply.images.iter().filter(|_| has_uvs) {
        let image = texture(source, name, room);
        room.take(image.as_ref().map_or(0, |image| image.texels().len()));
        images.push(image);
    }
    if images.iter().any(Option::is_some) {
        return textured(source, ply, triangles, images);
    }
    if !ply.colors.is_empty() {
        if !ply.face_colors.is_empty() {
            source.notes.add(None, "colours of faces are not used: the vertices have colours");
        }
        return Appearance::VertexColors(ply.colors);
    }
    if !ply.face_colors.is_empty() {
        return Appearance::Surface { resolution: 1, texels: ply.face_colors };
    }
    Appearance::Uniform([1.0; 3])
}

/// The appearance of a mesh with images, of which one that cannot be read is white. Faces without an image have their colours.
fn textured(source: &mut Source, ply: Ply, triangles: &[[u32; 3]], images: Vec<Option<Texture>>) -> Appearance {
    let (uvs, uv_triangles) = if ply.corner_uvs.is_empty() {
        (ply.uvs, triangles.to_vec())
    } else {
        let corners = 0..triangles.len() as u32;
        (ply.corner_uvs.as_flattened().to_vec(), corners.map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect())
    };
    let white = Texture::new(1, 1, vec![[1.0; 3]], Wrap::Repeat).ok();
    let mut textures: Vec<Texture> = images.into_iter().filter_map(|image| image.or_else(|| white.clone())).collect();
    let mut texture_of_triangle = ply.image_of_triangle;
    if texture_of_triangle.is_empty() {
        if textures.len() > 1 {
            source.notes.add(None, "only the first texture is drawn: faces have no texnumber");
            textures.truncate(1);
        }
        texture_of_triangle = vec![0; triangles.len()];
    }
    let count = textures.len() as u32;
    texture_of_triangle.iter_mut().for_each(|image| *image = count.min(*image));
    let bare: Vec<usize> = (0..triangles.len()).filter(|&t| texture_of_triangle[t] == count).collect();
    let colored = !(ply.colors.is_empty() && ply.face_colors.is_empty());
    if colored && bare.len() < triangles.len() {
        source.notes.add(None, "colours are not used where there is a texture");
    }
    let mut sheet = Sheet { uvs, uv_triangles, textures, texture_of_triangle };
    let of_corner = |v: u32| ply.colors.get(v as usize).copied();
    let patch = |&t: &usize| {
        let own = ply.face_colors.get(t).copied().unwrap_or([1.0; 3]);
        Patch { colors: triangles[t].map(|v| of_corner(v).unwrap_or(own)), image: None }
    };
    let patches: Vec<Patch> = if colored { bare.iter().map(patch).collect() } else { Vec::new() };
    if !patches.is_empty()
        && let Ok(made) = paint::patches(&patches, u64::MAX)
    {
        sheet.add(bare, made);
    } else if !bare.is_empty() {
        sheet.textures.extend(white);
    }
    sheet.appearance()
}

/// The image of that name in the mesh's folder.
fn texture(source: &mut Source, name: &str, room: Room) -> Option<Texture> {
    let (path, note) = find(source.path, source.path, name, source.options.allow_outside)
        .map_err(|what| source.notes.add(None, format!("texture {what}")))
        .ok()?;
    if let Some(note) = note {
        source.notes.add(None, format!("texture {note}"));
    }
    let decoded = texture::read(source, &path, source.options.srgb, room);
    let note = |what: String| format!("texture {}: {what}", path.display());
    decoded.map_err(|what| source.notes.add(None, note(what))).ok()?.texture(Wrap::Repeat).ok()
}
