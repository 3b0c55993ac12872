//! Reads PLY files: vertices, polygons, colours, and UVs with their image.

mod rows;
mod write;

pub use write::files_of;

use crate::{
    fault,
    find::find,
    obj::FARTHEST_UV,
    polygon,
    source::Source,
    texture::{self, linear_from_srgb},
};
use image::ImageReader;
use rows::{Row, Table, VALUES, least_bytes};
use serde_ply::{PlyReader, ScalarType};
use softras::{
    Result,
    scene::{Appearance, Mesh, Texture, Wrap},
};
use std::{io::Cursor, mem};

/// The names of what is read of a vertex: position, colour, UV, normal. Where several are given, the first that a file has counts.
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
];
const FACE: [&[&str]; 5] = [&["red"], &["green"], &["blue"], &["vertex_indices", "vertex_index"], &["texcoord"]];

/// What the file holds.
#[derive(Default)]
struct Ply {
    positions: Vec<[f32; 3]>,
    colors: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    normals: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    /// One for each triangle, or none.
    face_colors: Vec<[f32; 3]>,
    /// The UVs of each triangle's corners, or none.
    corner_uvs: Vec<[[f32; 2]; 3]>,
    /// The image that a comment names.
    image: Option<String>,
    short_faces: usize,
    far_uvs: usize,
    not_simple: usize,
}

pub(super) fn read(source: &mut Source, mut bytes: Vec<u8>) -> Result<Mesh> {
    clean_header(&mut bytes);
    let mut ply = parse(source, &bytes).map_err(|what| fault(source.path, what, "export the file again"))?;
    drop(bytes);
    if ply.short_faces > 0 {
        source.notes.add(None, format!("faces of fewer than three corners are not drawn ({} in all)", ply.short_faces));
    }
    if ply.far_uvs > 0 {
        let note =
            format!("texture coordinates that are not within ±{FARTHEST_UV} are taken as 0 ({} in all)", ply.far_uvs);
        source.notes.add(None, note);
    }
    if ply.not_simple > 0 {
        let count = ply.not_simple;
        let note = format!("polygons that cross themselves or are flat are cut as well as they allow ({count} in all)");
        source.notes.add(None, note);
    }
    let (positions, triangles) = (mem::take(&mut ply.positions), mem::take(&mut ply.triangles));
    source.keep_normals(&mem::take(&mut ply.normals), &triangles);
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
    let named = header.comments.iter().chain(&header.obj_info).find_map(|text| text.strip_prefix("TextureFile "));
    let mut ply = Ply { image: named.map(|name| name.trim().into()), ..Ply::default() };
    for element in &header.elem_defs {
        let least = least_bytes(element, header.format);
        if least.saturating_mul(element.count as u64) > bytes.len() as u64 {
            let (count, name) = (element.count, &element.name);
            return Err(format!("cut off: it claims {count} rows of {name:?} and holds {} bytes", bytes.len()));
        }
        let mut table = Table::new(element, least);
        match element.name.as_str() {
            "vertex" => {
                table.choose(&VERTEX, VERTEX.len());
                table.read(&mut reader, &mut ply.take_vertex(&table, source.options.srgb)?)?;
            }
            "face" => {
                table.choose(&FACE, 3);
                table.read(&mut reader, &mut ply.take_face(&table, source.options.srgb)?)?;
            }
            name => {
                if element.count > 0 && !matches!(name, "material" | "camera" | "user" | "multi_texture_vertex") {
                    source.notes.add(None, format!("element {name:?} is not read"));
                }
                table.read(&mut reader, &mut |_| Ok(()))?;
            }
        }
    }
    Ok(ply)
}

/// How a colour's numbers are read: bytes as those of pictures, others as they are.
fn shade(kind: Option<ScalarType>, srgb: bool) -> impl Fn(f64) -> f32 {
    let most = match kind {
        Some(ScalarType::U8) => Some(255.0),
        Some(ScalarType::U16) => Some(65535.0),
        _ => None,
    };
    move |x| match most {
        Some(most) if srgb => linear_from_srgb(x as f32 / most),
        Some(most) => x as f32 / most,
        None => x as f32,
    }
}

impl Ply {
    /// What is done with a row of vertices.
    fn take_vertex(&mut self, table: &Table, srgb: bool) -> Result<impl FnMut(&Row) -> Result<(), String>, String> {
        if !table.has(0..3) {
            return Err("its vertices have no x, y and z".into());
        }
        let (colored, mapped, curved) = (table.has(3..6), table.has(6..8), table.has(8..11));
        let shade = shade(table.kind(3), srgb);
        Ok(move |row: &Row| {
            let [x, y, z, r, g, b, u, v, normal @ ..] = row.values;
            self.positions.push([x as f32, y as f32, z as f32]);
            if colored {
                self.colors.push([r, g, b].map(&shade));
            }
            if mapped {
                let uv = self.checked([u, v]);
                self.uvs.push(uv);
            }
            if curved {
                self.normals.push(normal.map(|x| x as f32));
            }
            Ok(())
        })
    }

    /// What is done with a row of faces.
    fn take_face(&mut self, table: &Table, srgb: bool) -> Result<impl FnMut(&Row) -> Result<(), String>, String> {
        if !table.has(3..4) {
            return Err("its faces have no list vertex_indices".into());
        }
        let (colored, mapped) = (table.has(0..3), table.has(4..5));
        let shade = shade(table.kind(0), srgb);
        let mut number = 0;
        Ok(move |row: &Row| {
            number += 1;
            let count = self.positions.len();
            let corner = |&x: &f64| {
                let fits = x >= 0.0 && x.fract() == 0.0 && x < count as f64;
                fits.then_some(x as u32).ok_or(format!("face {number} names vertex {x}, there are {count}"))
            };
            let corners = row.lists[3].iter().map(corner).collect::<Result<Vec<u32>, String>>()?;
            if corners.len() < 3 {
                self.short_faces += 1;
                return Ok(());
            }
            let polygon: Vec<_> = corners.iter().map(|&v| self.positions[v as usize].map(f64::from)).collect();
            let cut = polygon::triangulate(&polygon).map_err(|what| format!("face {number}: {what}"))?;
            self.not_simple += usize::from(!cut.is_simple);
            let uvs = Some(&row.lists[4]).filter(|uvs| uvs.len() == 2 * corners.len());
            for triangle in cut.triangles {
                self.triangles.push(triangle.map(|c| corners[c]));
                if colored {
                    self.face_colors.push([row.values[0], row.values[1], row.values[2]].map(&shade));
                }
                if mapped {
                    let uv = triangle.map(|c| uvs.map_or([0.0; 2], |uvs| self.checked([uvs[2 * c], uvs[2 * c + 1]])));
                    self.corner_uvs.push(uv);
                }
            }
            Ok(())
        })
    }

    /// A UV, or 0 for one that is out of range.
    fn checked(&mut self, uv: [f64; 2]) -> [f32; 2] {
        let uv = uv.map(|x| x as f32);
        let fits = uv.iter().all(|x| x.abs() <= FARTHEST_UV);
        self.far_uvs += usize::from(!fits);
        if fits { uv } else { [0.0; 2] }
    }
}

/// An image at UVs is preferred to colours of vertices and these to those of faces; what is not used is noted.
fn appearance(source: &mut Source, ply: Ply, triangles: &[[u32; 3]]) -> Appearance {
    let has_uvs = !(ply.uvs.is_empty() && ply.corner_uvs.is_empty());
    let texture = ply.image.as_deref().filter(|_| has_uvs).and_then(|name| texture(source, name));
    if let Some(texture) = texture {
        if !(ply.colors.is_empty() && ply.face_colors.is_empty()) {
            source.notes.add(None, "colours are not used: there is a texture");
        }
        let (uvs, uv_triangles) = if ply.corner_uvs.is_empty() {
            (ply.uvs, triangles.to_vec())
        } else {
            let corners = 0..triangles.len() as u32;
            (ply.corner_uvs.as_flattened().to_vec(), corners.map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect())
        };
        return Appearance::Textured { uvs, uv_triangles, textures: vec![texture], texture_of_triangle: Vec::new() };
    }
    if has_uvs {
        source.notes.add(None, "texture coordinates are not kept: there is no texture");
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
fn texture(source: &mut Source, name: &str) -> Option<Texture> {
    let (path, note) = find(source.path, source.path, name, source.options.allow_outside)
        .map_err(|what| source.notes.add(None, format!("texture {what}")))
        .ok()?;
    if let Some(note) = note {
        source.notes.add(None, format!("texture {note}"));
    }
    let reader = ImageReader::open(&path).map_err(|error| error.to_string());
    match reader.and_then(|reader| texture::decode(reader, source.options.srgb, source.room())) {
        Ok(decoded) => {
            source.files.push(path);
            decoded.texture(Wrap::Repeat).ok()
        }
        Err(what) => {
            source.notes.add(None, format!("texture {}: {what}", path.display()));
            None
        }
    }
}
