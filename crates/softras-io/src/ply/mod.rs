//! Reads PLY files: vertices, polygons, colours, and UVs with their image.

mod rows;
mod write;

pub use write::files_of;

use crate::{
    fate::{self, Drawn, Fates, NotDrawn, Silent},
    fault,
    find::find,
    notes::Notes,
    obj::{FAR_UVS, FARTHEST_UV},
    polygon,
    source::Source,
    text,
    texture::{self, linear_from_srgb},
    textures::Room,
};
use rows::{Row, Table, VALUES, least_bytes};
use serde_ply::{PlyReader, ScalarType};
use softras::{
    Result,
    scene::{Appearance, Mesh, Texture, Wrap},
};
use std::{io::Cursor, mem};

/// What becomes of elements, and of their properties. Other elements are noted; other properties, which are data about the mesh, are not.
pub const PROPERTIES: &Fates = &[
    (
        "vertex.x vertex.y vertex.z vertex.nx vertex.ny vertex.nz vertex.red vertex.green vertex.blue vertex.diffuse_red \
         vertex.diffuse_green vertex.diffuse_blue vertex.r vertex.g vertex.b vertex.s vertex.t vertex.u vertex.v \
         vertex.texture_u vertex.texture_v face.vertex_indices face.vertex_index face.red face.green face.blue \
         face.texcoord face.texnumber tristrips.vertex_indices tristrips.vertex_index comment.TextureFile",
        Drawn,
    ),
    ("vertex.alpha vertex.a face.alpha", NotDrawn(ALPHA)),
    ("edge", NotDrawn("lines are not drawn")),
    ("material face.material_index", NotDrawn("colours of materials are not drawn")),
    ("multi_texture_vertex multi_texture_face", NotDrawn("textures of multi_texture_face are not drawn")),
    ("camera user face.quality face.flags", Silent),
    ("vertex.quality vertex.confidence vertex.intensity vertex.radius vertex.flags", Silent),
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
const FACE: [&[&str]; 7] =
    [&["red"], &["green"], &["blue"], &["texnumber"], &["alpha"], &["vertex_indices", "vertex_index"], &["texcoord"]];
/// The lists of faces among these.
const LISTS: usize = 5;

/// What the file holds.
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
    /// Whether the colours of vertices, and of faces, are floats.
    in_floats: [bool; 2],
}

/// A face that is drawn when all vertices are read.
struct Waiting {
    number: usize,
    corners: Vec<f64>,
    color: Option<[f32; 3]>,
    uvs: Option<Vec<f64>>,
    image: Option<u32>,
}

pub(super) fn read(source: &mut Source, mut bytes: Vec<u8>) -> Result<Mesh> {
    clean_header(&mut bytes);
    let mut ply = parse(source, &bytes).map_err(|what| fault(source.path, what, "export the file again"))?;
    drop(bytes);
    ply.settle_colors(source);
    let (positions, triangles) = (mem::take(&mut ply.positions), mem::take(&mut ply.triangles));
    source.keep_normals(&mem::take(&mut ply.normals), &triangles);
    let positions = source.placed(&positions, &triangles)?;
    let appearance = appearance(source, ply, &triangles);
    Mesh::new(positions, triangles)?.with_appearance(appearance)
}

/// Comments may be of any encoding, line ends those of old Macintoshes, and the last number may lack its line end, none of
/// which the crate takes.
fn clean_header(bytes: &mut Vec<u8>) {
    let end = b"end_header";
    let length = bytes.windows(end.len()).position(|window| window == end).map_or(bytes.len(), |at| at + end.len());
    let mac = !bytes[..length].contains(&b'\n');
    for byte in &mut bytes[..length] {
        match *byte {
            b'\r' if mac => *byte = b'\n',
            byte_beyond if !byte_beyond.is_ascii() => *byte = b'?',
            _ => {}
        }
    }
    if mac && bytes.get(length) == Some(&b'\r') {
        bytes[length] = b'\n';
    }
    bytes.push(b'\n');
}

fn parse(source: &mut Source, bytes: &[u8]) -> Result<Ply, String> {
    let malformed = |error: serde_ply::DeserializeError| format!("malformed PLY: {error}");
    let mut reader = PlyReader::from_reader(Cursor::new(bytes)).map_err(malformed)?;
    let header = reader.header().clone();
    let named = header.comments.iter().chain(&header.obj_info).filter_map(|text| text.strip_prefix("TextureFile "));
    let mut ply = Ply { images: named.map(|name| name.trim().into()).collect(), ..Ply::default() };
    for element in &header.elem_defs {
        let least = least_bytes(element, header.format);
        if least.saturating_mul(element.count as u64) > bytes.len() as u64 {
            let (count, name) = (element.count, &element.name);
            return Err(format!(
                "cut off: it claims {count} rows of {:?} and holds {} bytes",
                text::name(name),
                bytes.len()
            ));
        }
        let mut table = Table::new(element, least);
        for property in element.properties.iter().filter(|_| element.count > 0) {
            match fate::of(PROPERTIES, &format!("{}.{}", element.name, property.name)) {
                // Alpha is noted when a row has one that is not opaque.
                Some(NotDrawn(note)) if note != ALPHA => source.notes.count(None, note),
                _ => {}
            }
        }
        match element.name.as_str() {
            "vertex" => {
                table.choose(&VERTEX, VERTEX.len());
                table.read(&mut reader, &mut ply.take_vertex(&table, source)?)?;
            }
            "face" => {
                table.choose(&FACE, LISTS);
                table.read(&mut reader, &mut ply.take_face(&table, source)?)?;
            }
            "tristrips" => {
                table.choose(&FACE, LISTS);
                table.read(&mut reader, &mut |row| ply.take_strips(row))?;
            }
            name => {
                match fate::of(PROPERTIES, name).filter(|_| element.count > 0) {
                    Some(NotDrawn(note)) => source.notes.count(None, note),
                    None if element.count > 0 => {
                        source.notes.add(None, format!("element \"{}\" is not read", text::name(name)))
                    }
                    _ => {}
                }
                table.read(&mut reader, &mut |_| Ok(()))?;
            }
        }
    }
    for Waiting { number, corners, color, uvs, image } in mem::take(&mut ply.waiting) {
        ply.add_face(&mut source.notes, number, &corners, color, uvs.as_deref(), image)?;
    }
    Ok(ply)
}

/// The number for 1 of a colour's type, where that is whole.
fn most(kind: Option<ScalarType>) -> Option<f32> {
    match kind? {
        ScalarType::U16 => Some(65535.0),
        ScalarType::F32 | ScalarType::F64 => None,
        // Bytes, also in a wider type.
        _ => Some(255.0),
    }
}

/// How a colour's numbers are read: bytes as those of pictures, others as they are.
fn shade(kind: Option<ScalarType>, srgb: bool) -> impl Fn(f64) -> f32 {
    let most = most(kind);
    move |x| match most {
        Some(most) if srgb => linear_from_srgb(x as f32 / most),
        Some(most) => x as f32 / most,
        None => x as f32,
    }
}

impl Ply {
    /// What is done with a row of vertices.
    fn take_vertex(
        &mut self,
        table: &Table,
        source: &mut Source,
    ) -> Result<impl FnMut(&Row) -> Result<(), String>, String> {
        if !table.has(0..3) {
            return Err("its vertices have no x, y and z".into());
        }
        let (colored, mapped, curved) = (table.has(3..6), table.has(6..8), table.has(8..11));
        let shade = shade(table.kind(3), source.options.srgb);
        self.in_floats[0] = most(table.kind(3)).is_none();
        let (has_alpha, opaque) = (table.has(11..12), most(table.kind(11)).unwrap_or(1.0).into());
        Ok(move |row: &Row| {
            let [x, y, z, r, g, b, u, v, nx, ny, nz, alpha] = row.values;
            self.positions.push([x, y, z]);
            if colored {
                self.colors.push([r, g, b].map(&shade));
            }
            if mapped {
                self.uvs.push(checked(&mut source.notes, [u, v]));
            }
            if curved {
                self.normals.push([nx, ny, nz].map(|x| x as f32));
            }
            if has_alpha && alpha < opaque {
                source.notes.count(None, ALPHA);
            }
            Ok(())
        })
    }

    /// What is done with a row of faces.
    fn take_face(
        &mut self,
        table: &Table,
        source: &mut Source,
    ) -> Result<impl FnMut(&Row) -> Result<(), String>, String> {
        if !table.has(LISTS..LISTS + 1) {
            return Err("its faces have no list vertex_indices".into());
        }
        let (colored, numbered, mapped) = (table.has(0..3), table.has(3..4), table.has(LISTS + 1..LISTS + 2));
        let shade = shade(table.kind(0), source.options.srgb);
        self.in_floats[1] = most(table.kind(0)).is_none();
        let (has_alpha, opaque) = (table.has(4..5), most(table.kind(4)).unwrap_or(1.0).into());
        let mut number = 0;
        // A row may come before the vertices that it names, and is drawn when all are read.
        Ok(move |row: &Row| {
            number += 1;
            if has_alpha && row.values[4] < opaque {
                source.notes.count(None, ALPHA);
            }
            let color = colored.then(|| [row.values[0], row.values[1], row.values[2]].map(&shade));
            let corners = &row.lists[LISTS];
            let uvs = mapped.then(|| &row.lists[LISTS + 1][..]);
            let image = numbered.then_some(row.values[3] as u32);
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
    ) -> Result<(), String> {
        let count = self.positions.len();
        let corner = |&x: &f64| {
            let fits = x >= 0.0 && x.fract() == 0.0 && x < count as f64;
            fits.then_some(x as u32).ok_or(format!("face {number} names vertex {x}, there are {count}"))
        };
        let corners = corners.iter().map(corner).collect::<Result<Vec<u32>, String>>()?;
        if corners.len() < 3 {
            notes.count(None, "faces of fewer than three corners are not drawn");
            return Ok(());
        }
        let cut = polygon::of(&corners, &self.positions).map_err(|what| format!("face {number}: {what}"))?;
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
    fn take_strips(&mut self, row: &Row) -> Result<(), String> {
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

    /// Floats are as bright as the same shares in a picture; up to 255 they are bytes.
    fn settle_colors(&mut self, source: &mut Source) {
        for (colors, _) in
            [&mut self.colors, &mut self.face_colors].into_iter().zip(self.in_floats).filter(|(_, is)| *is)
        {
            let bright = colors.iter().filter(|color| color.iter().any(|x| *x > 1.0)).count();
            let is_bytes = bright * 2 > colors.len() && colors.as_flattened().iter().all(|x| (0.0..=255.0).contains(x));
            if is_bytes {
                source.notes.add(None, "colours up to 255 are divided by 255");
            }
            let share = |x: f32| if is_bytes { x / 255.0 } else { x };
            let one = |x: f32| if source.options.srgb { linear_from_srgb(share(x)) } else { share(x) };
            colors.iter_mut().for_each(|color| *color = color.map(one));
        }
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
        if !(ply.colors.is_empty() && ply.face_colors.is_empty()) {
            source.notes.add(None, "colours are not used: there is a texture");
        }
        let (uvs, uv_triangles) = if ply.corner_uvs.is_empty() {
            (ply.uvs, triangles.to_vec())
        } else {
            let corners = 0..triangles.len() as u32;
            (ply.corner_uvs.as_flattened().to_vec(), corners.map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect())
        };
        // An image that is missing or cannot be read is white.
        let white = Texture::new(1, 1, vec![[1.0; 3]], Wrap::Repeat).ok();
        let mut textures: Vec<Texture> =
            images.into_iter().filter_map(|image| image.or_else(|| white.clone())).collect();
        let mut texture_of_triangle = Vec::new();
        if ply.image_of_triangle.iter().any(|&image| image > 0) && textures.len() > 1 {
            let last = textures.len() as u32;
            textures.extend(white);
            texture_of_triangle = ply.image_of_triangle.iter().map(|&image| image.min(last)).collect();
        } else if textures.len() > 1 {
            source.notes.add(None, "only the first texture is drawn: faces have no texnumber");
            textures.truncate(1);
        }
        return Appearance::Textured { uvs, uv_triangles, textures, texture_of_triangle };
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
