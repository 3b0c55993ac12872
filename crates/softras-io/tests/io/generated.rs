//! Files that are made at random, of every format and in many spellings, are read as what they were made of. The mesh then passes
//! through the writers of all formats, and comes back equal or with a note.

use crate::{load, mutate::cases};
use base64::{Engine, engine::general_purpose};
use serde_json::{Value, json};
use softras::scene::{Appearance, Texture, Wrap};
use softras_check::stress::Random;
use softras_io::{LoadOptions, Loaded};
use std::{fmt::Write, fs, path::Path};

/// A corner of a triangle: place, linear colour, UV, normal.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Corner {
    place: [f32; 3],
    color: [f32; 3],
    uv: [f32; 2],
    normal: [f32; 3],
}

/// A file, and the content that should be read of it.
#[derive(Default)]
struct Made {
    name: &'static str,
    bytes: Vec<u8>,
    triangles: Vec<[Corner; 3]>,
    /// Parts of the notes that are due; others are wrong.
    notes: Vec<&'static str>,
}

/// A sheet of squares along two axes, with a colour in bytes, a UV and a normal for each vertex.
struct Sheet {
    places: Vec<[f32; 3]>,
    squares: Vec<[usize; 4]>,
    bytes: Vec<[u8; 3]>,
    uvs: Vec<[f32; 2]>,
    normals: Vec<[f32; 3]>,
}

const SIDE: usize = 4;

fn sheet(random: &mut Random) -> Sheet {
    let (columns, rows) = (1 + random.below(2), 1 + random.below(2));
    let (axis, step) = (random.below(3), 1.0 + random.below(3) as f32);
    let at = |i: usize| {
        let (x, y) = ((i % (columns + 1)) as f32 * step, (i / (columns + 1)) as f32 - 1.0);
        let mut place = [x, y, 2.0];
        place.rotate_right(axis);
        place
    };
    let count = (columns + 1) * (rows + 1);
    let back = random.chance(0.5);
    let square = |i: usize| {
        let a = i / columns * (columns + 1) + i % columns;
        if back { [a, a + columns + 1, a + columns + 2, a + 1] } else { [a, a + 1, a + columns + 2, a + columns + 1] }
    };
    let squares = (0..columns * rows).map(square).collect();
    let mut bytes: Vec<[u8; 3]> = (0..count).map(|_| [(); 3].map(|()| random.below(256) as u8)).collect();
    bytes[0][0] = 200;
    // Centres of texels, some of them in other tiles.
    let uvs = (0..count).map(|_| [(); 2].map(|()| (random.below(5 * SIDE) as f32 - 8.0 + 0.5) / SIDE as f32)).collect();
    let normals = (0..count)
        .map(|_| random.choose(&[[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [0.6, 0.0, 0.8], [-1.0, 0.0, 0.0]]))
        .collect();
    Sheet { places: (0..count).map(at).collect(), squares, bytes, uvs, normals }
}

/// sRGB by its definition.
fn linear(byte: f64) -> f32 {
    let x = byte / 255.0;
    (if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }) as f32
}

impl Sheet {
    /// The corners of all squares as triangles around the first corner, with colours by vertex.
    fn triangles(&self, color: impl Fn(usize, usize) -> [f32; 3]) -> Vec<[Corner; 3]> {
        let corner = |square: usize, i: usize| Corner {
            place: self.places[i],
            color: color(square, i),
            uv: self.uvs[i],
            normal: self.normals[i],
        };
        let cut =
            |(s, [a, b, c, d]): (usize, &[usize; 4])| [[*a, *b, *c], [*a, *c, *d]].map(|t| t.map(|i| corner(s, i)));
        self.squares.iter().enumerate().flat_map(cut).collect()
    }

    fn colors(&self) -> Vec<[f32; 3]> {
        self.bytes.iter().map(|bytes| bytes.map(|byte| linear(byte.into()))).collect()
    }
}

/// The texels of the image `t.png`, which each test has beside its file.
fn texel(column: usize, row: usize) -> [u8; 3] {
    [(column * 60) as u8, (row * 60) as u8, ((column + row) % 3 * 100) as u8]
}

fn image() -> Vec<u8> {
    let image = image::RgbImage::from_fn(SIDE as u32, SIDE as u32, |x, y| image::Rgb(texel(x as usize, y as usize)));
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

/// The colour of the image at a UV that runs up, by the modes of its two axes: repeat, clamp, mirror.
fn shown([u, v]: [f32; 2], modes: [usize; 2]) -> [f32; 3] {
    let side = SIDE as i64;
    let at = |x: f32, mode: usize| {
        let i = (x * SIDE as f32).floor() as i64;
        (match mode {
            0 => i.rem_euclid(side),
            1 => i.clamp(0, side - 1),
            _ => (i.rem_euclid(2 * side)).min(2 * side - 1 - i.rem_euclid(2 * side)),
        }) as usize
    };
    texel(at(u, modes[0]), at(1.0 - v, modes[1])).map(|byte| linear(byte.into()))
}

/// The corners of what was read, in which a texture shows its nearest texel.
fn corners(loaded: &Loaded) -> Vec<[Corner; 3]> {
    let mesh = &loaded.mesh;
    let one = |t: usize, k: usize| {
        let vertex = mesh.triangles()[t][k] as usize;
        let (color, uv) = match mesh.appearance() {
            Appearance::Uniform(color) => (*color, [0.0; 2]),
            Appearance::VertexColors(colors) => (colors[vertex], [0.0; 2]),
            Appearance::Surface { texels, .. } => (texels[t], [0.0; 2]),
            Appearance::Textured { uvs, uv_triangles, textures, texture_of_triangle } => {
                let texture = &textures[texture_of_triangle.get(t).copied().unwrap_or_default() as usize];
                let uv = uvs[uv_triangles[t][k] as usize];
                (nearest(texture, uv), uv)
            }
        };
        let normal = loaded.normals.get(t).map_or([0.0; 3], |normals| normals[k]);
        Corner { place: [0, 1, 2].map(|k| mesh.positions()[vertex][k] + loaded.origin[k] as f32), color, uv, normal }
    };
    (0..mesh.triangles().len()).map(|t| [0, 1, 2].map(|k| one(t, k))).collect()
}

fn nearest(texture: &Texture, [u, v]: [f32; 2]) -> [f32; 3] {
    let at = |x: f32, side: u32| {
        let i = (f64::from(x) * f64::from(side) + 1e-4).floor() as i64;
        let side = i64::from(side);
        (if texture.wrap() == Wrap::Clamp { i.clamp(0, side - 1) } else { i.rem_euclid(side) }) as usize
    };
    texture.texels()[at(1.0 - v, texture.height()) * texture.width() as usize + at(u, texture.width())]
}

fn near<const N: usize>(a: [f32; N], b: [f32; N], most: f32) -> bool {
    (0..N).all(|k| (a[k] - b[k]).abs() <= most)
}

/// Triangles without UVs or normals that the file does not have.
fn without(mut triangles: Vec<[Corner; 3]>, no_uvs: bool, no_normals: bool) -> Vec<[Corner; 3]> {
    for corner in triangles.as_flattened_mut() {
        corner.uv = if no_uvs { [0.0; 2] } else { corner.uv };
        corner.normal = if no_normals { [0.0; 3] } else { corner.normal };
    }
    triangles
}

fn due<const N: usize>(notes: [(bool, &'static str); N]) -> Vec<&'static str> {
    notes.into_iter().filter(|(is_due, _)| *is_due).map(|(_, note)| note).collect()
}

/// Writes a number of a PLY type: as text, or with its last byte first or last.
fn put(bytes: &mut Vec<u8>, order: usize, kind: &str, x: f64) {
    let (size, is_float) = match kind {
        "char" | "uchar" => (1, false),
        "short" | "ushort" => (2, false),
        "int" | "uint" => (4, false),
        "float" => (4, true),
        _ => (8, true),
    };
    let mut raw = match (size, is_float) {
        (4, true) => (x as f32).to_le_bytes().to_vec(),
        (_, true) => x.to_le_bytes().to_vec(),
        _ => (x as i64).to_le_bytes()[..size].to_vec(),
    };
    match order {
        0 => return bytes.extend(format!("{x} ").bytes()),
        1 => {}
        _ => raw.reverse(),
    }
    bytes.extend(raw);
}

/// Types of colours, with the number for 255 and what is noted.
const COLORS: [(&str, f64, &str); 11] = [
    ("uchar", 255.0, ""),
    ("char", 255.0, ""),
    ("ushort", 255.0, "divided by 255"),
    ("ushort", 65535.0, ""),
    ("short", 255.0, ""),
    ("int", 255.0, ""),
    ("int", 65535.0, ""),
    ("uint", 65535.0, ""),
    ("float", 1.0, ""),
    ("double", 1.0, ""),
    ("float", 255.0, "divided by 255"),
];

fn ply(random: &mut Random) -> Made {
    let sheet = sheet(random);
    let order = random.below(3);
    let coordinate = random.choose(&["float", "double", "int", "short", "char"]);
    let (kind, most, note) = random.choose(&COLORS);
    let (by_face, has_color, has_normals) = (random.chance(0.3), random.chance(0.7), random.chance(0.5));
    let rgb = random.choose(&["red green blue", "Red Green Blue", "diffuse_red diffuse_green diffuse_blue", "r g b"]);
    let (has_image, by_corner) = (!has_color && random.chance(0.7), random.chance(0.5));
    let uv = random.choose(&["s t", "u v", "texture_u texture_v", "S T"]);
    let [length, index] =
        [["uchar", "int", "ushort", "uint"], ["int", "uchar", "ushort", "short"]].map(|all| random.choose(&all));
    let (more, has_nan) =
        (order == 0 && random.chance(0.3), matches!(coordinate, "float" | "double") && random.chance(0.3));
    // The columns of a vertex and of a face.
    let none = ("", "");
    let columns = |names: [(&str, &str); 4]| {
        let line = |(kind, names): (&str, &str)| {
            names.split_whitespace().map(|name| format!("property {kind} {name}\n")).collect::<String>()
        };
        names.map(line).concat()
    };
    let of_vertex = columns([
        ("uchar", "quality"),
        (coordinate, "x y z"),
        if has_color && !by_face { (kind, rgb) } else { none },
        if has_normals { ("float", "nx ny nz") } else { none },
    ]) + &columns([if has_image && !by_corner { ("double", uv) } else { none }, none, none, none]);
    let list = format!("list {length} {index}");
    let of_face = columns([
        (&list, "vertex_indices"),
        if has_color && by_face { (kind, rgb) } else { none },
        if has_image && by_corner { ("list uchar float", "texcoord") } else { none },
        none,
    ]);
    let (vertices, faces) = (sheet.places.len() + usize::from(has_nan), sheet.squares.len() + usize::from(has_nan));
    let format = ["ascii", "binary_little_endian", "binary_big_endian"][order];
    let image = if has_image { "comment TextureFile t.png\n" } else { "" };
    let head = format!(
        "ply\nformat {format} 1.0\ncomment caf\u{e9}\n{image}element vertex {vertices}\n{of_vertex}element face {faces}\n{of_face}end_header\n"
    );
    let line_end = random.choose(&["\n", "\r\n", "\r"]);
    // Comments of old programs are in Latin-1.
    let mut bytes: Vec<u8> = random.choose(&[&b""[..], b"\xef\xbb\xbf"]).to_vec();
    bytes.extend(head.replace('\n', line_end).chars().map(|c| c as u8));
    let end_row = |bytes: &mut Vec<u8>| {
        let text = if order == 0 { [if more { "7 8" } else { "" }, line_end].concat() } else { String::new() };
        bytes.extend(text.bytes());
    };
    let color = |bytes: &mut Vec<u8>, own: [u8; 3]| {
        own.iter().for_each(|&byte| {
            let x = f64::from(byte) * (most / 255.0);
            put(
                bytes,
                order,
                kind,
                if kind == "char" {
                    (byte as i8).into()
                } else if kind == "float" {
                    (x as f32).into()
                } else {
                    x
                },
            );
        });
    };
    for i in 0..vertices {
        let own = i.min(sheet.places.len() - 1);
        put(&mut bytes, order, "uchar", 7.0);
        sheet.places[own]
            .iter()
            .for_each(|x| put(&mut bytes, order, coordinate, if i == own { (*x).into() } else { f64::NAN }));
        if has_color && !by_face {
            color(&mut bytes, sheet.bytes[own]);
        }
        if has_normals {
            sheet.normals[own].iter().for_each(|x| put(&mut bytes, order, "float", (*x).into()));
        }
        if has_image && !by_corner {
            sheet.uvs[own].iter().for_each(|x| put(&mut bytes, order, "double", (*x).into()));
        }
        end_row(&mut bytes);
    }
    let bad = [0, vertices - 1, 1, 2];
    for (s, square) in sheet.squares.iter().chain(has_nan.then_some(&bad)).enumerate() {
        put(&mut bytes, order, length, 4.0);
        square.iter().for_each(|i| put(&mut bytes, order, index, *i as f64));
        if has_color && by_face {
            color(&mut bytes, sheet.bytes[s % sheet.bytes.len()]);
        }
        if has_image && by_corner {
            put(&mut bytes, order, "uchar", 8.0);
            let uvs = square.iter().flat_map(|&i| sheet.uvs[i.min(sheet.uvs.len() - 1)]);
            uvs.for_each(|x| put(&mut bytes, order, "float", x.into()));
        }
        end_row(&mut bytes);
    }
    bytes.extend(random.choose(&[&b""[..], b"\0\0\0", b"\n", b"\x1a"]));
    let colors = sheet.colors();
    let triangles = sheet.triangles(|square, i| match (has_color, by_face) {
        (true, true) => colors[square % colors.len()],
        (true, false) => colors[i],
        _ if has_image => shown(sheet.uvs[i], [0; 2]),
        _ => [1.0; 3],
    });
    let notes = due([(more, "more numbers"), (has_nan, "no finite point"), (has_color && !note.is_empty(), note)]);
    Made { name: "a.ply", bytes, triangles: without(triangles, !has_image, !has_normals), notes }
}

fn obj(random: &mut Random) -> Made {
    let sheet = sheet(random);
    let look = random.choose(&["plain", "floats", "bytes", "nan", "image", "glass"]);
    let (has_normals, has_w, backwards) = (random.chance(0.5), random.chance(0.2), random.chance(0.3));
    let count = sheet.places.len();
    let mut text = match look {
        "image" => "mtllib t.mtl\nusemtl t\n".to_string(),
        "glass" => "mtllib t.mtl\nusemtl glass\n".to_string(),
        _ => "# caf\u{e9}\n".to_string(),
    };
    for (i, [x, y, z]) in sheet.places.iter().enumerate() {
        let [r, g, b] = sheet.bytes[i].map(f64::from);
        let _ = match look {
            "floats" => writeln!(text, "v {x} {y} {z} {} {} {}", r / 255.0, g / 255.0, b / 255.0),
            "bytes" => writeln!(text, "v {x} {y} {z} {r} {g} {b}"),
            "nan" => writeln!(
                text,
                "v {x} {y} {z} {} {} {}",
                if i == 0 { f64::NAN } else { r / 255.0 },
                g / 255.0,
                b / 255.0
            ),
            _ if has_w => writeln!(text, "v {} {} {} 2", 2.0 * x, 2.0 * y, 2.0 * z),
            _ => writeln!(text, "v {x} {y} {z}"),
        };
    }
    sheet.uvs.iter().for_each(|[u, v]| writeln!(text, "vt {u} {v}").unwrap());
    sheet.normals.iter().filter(|_| has_normals).for_each(|[x, y, z]| writeln!(text, "vn {x} {y} {z}").unwrap());
    let corner = |i: usize| {
        let index = if backwards { i as i64 - count as i64 } else { i as i64 + 1 };
        match (look == "image", has_normals) {
            (true, true) => format!(" {index}/{index}/{index}"),
            (true, false) => format!(" {index}/{index}"),
            (false, true) => format!(" {index}//{index}"),
            (false, false) => format!(" {index}"),
        }
    };
    let is_cut = random.chance(0.5);
    for [a, b, c, d] in &sheet.squares {
        let faces = if is_cut { vec![vec![a, b, c], vec![a, c, d]] } else { vec![vec![a, b, c, d]] };
        faces
            .iter()
            .for_each(|face| writeln!(text, "f{}", face.iter().map(|&&i| corner(i)).collect::<String>()).unwrap());
    }
    text += random.choose(&["", "v nan 0 0\n", "\0\0", "\x1a"]);
    text = text.replace('\n', random.choose(&["\n", "\r\n", "\r"]));
    // A vertex without a colour among others that have one would be noted.
    text = if matches!(look, "floats" | "bytes" | "nan") { text.replace("v nan 0 0", "v nan 0 0 1 1 1") } else { text };
    let colors = sheet.colors();
    let triangles = sheet.triangles(|_, i| match look {
        "floats" | "bytes" => colors[i],
        "nan" => {
            if i == 0 {
                [1.0; 3]
            } else {
                colors[i]
            }
        }
        "image" => shown(sheet.uvs[i], [1, 1]),
        "glass" => [0.25, 0.5, 1.0],
        _ => [1.0; 3],
    });
    let is_plain = matches!(look, "plain" | "image" | "glass");
    let notes =
        due([(look == "bytes", "divided by 255"), (look == "nan", "are white"), (is_plain && has_w, "w divides")]);
    let bytes = text.chars().map(|c| c as u8).collect();
    Made { name: "a.obj", bytes, triangles: without(triangles, look != "image", !has_normals), notes }
}

fn stl(random: &mut Random) -> Made {
    let sheet = sheet(random);
    let has_nan = random.chance(0.3);
    let mut triangles = without(sheet.triangles(|_, _| [1.0; 3]), true, true);
    let mut bytes = Vec::new();
    let places = |t: &[Corner; 3]| t.map(|corner| corner.place.map(|x| x));
    let bad = has_nan.then_some([[0.0; 3], [1.0, f32::NAN, 0.0], [0.0; 3]]);
    let all: Vec<[[f32; 3]; 3]> = triangles.iter().map(places).chain(bad).collect();
    if random.chance(0.5) {
        let space = random.choose(&["\n", " ", "\r\n\t", "\r"]);
        let mut text = format!("solid my facet{space}");
        for corners in all {
            let vertices = corners.map(|[x, y, z]| format!("vertex {x} {y} {z}{space}")).concat();
            text += &format!("facet normal 0 0 0{space}outer loop{space}{vertices}endloop{space}endfacet{space}");
        }
        text += "endsolid my facet";
        bytes = (if random.chance(0.3) { text.to_uppercase() } else { text }).into_bytes();
        bytes.extend(random.choose(&[&b""[..], b"\n", b"\0\0"]));
    } else {
        // A colour of the whole, or words of five bits in two orders.
        let look = random.below(4);
        bytes.extend(if look == 1 || look == 3 { &b"COLOR=\x33\x66\xff\xff"[..] } else { b"solid" });
        bytes.resize(80, b' ');
        bytes.extend((all.len() as u32).to_le_bytes());
        for (t, corners) in all.iter().enumerate() {
            let numbers = [[0.0; 3]].iter().chain(corners).flatten().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>();
            bytes.extend(numbers);
            let five = (t * 5 % 31 + 1) as u16;
            bytes.extend(
                match look {
                    2 => 0x8000 | five << 10,
                    3 => five,
                    _ => 0,
                }
                .to_le_bytes(),
            );
            let red = [linear(f64::from(five) / 31.0 * 255.0), 0.0, 0.0];
            let color = match look {
                1 => [51.0, 102.0, 255.0].map(linear),
                2 | 3 => red,
                _ => [1.0; 3],
            };
            triangles.iter_mut().skip(t).take(1).flatten().for_each(|corner| corner.color = color);
        }
    }
    Made { name: "a.stl", bytes, triangles, notes: due([(has_nan, "no finite point")]) }
}

/// The content of a .glb or .gltf file that is being put together.
struct Gltf {
    binary: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Gltf {
    fn add(
        &mut self,
        (kind, size, normalized): (u32, usize, bool),
        per: usize,
        values: impl Iterator<Item = f64>,
    ) -> usize {
        let (values, stride) = (values.collect::<Vec<_>>(), (per * size).next_multiple_of(4));
        let start = self.binary.len();
        for row in values.chunks(per) {
            let from = self.binary.len();
            row.iter().for_each(|x| match kind {
                5126 => self.binary.extend((*x as f32).to_le_bytes()),
                _ => self.binary.extend(&(x.round() as i64).to_le_bytes()[..size]),
            });
            self.binary.resize(if per == 1 { self.binary.len() } else { from + stride }, 0);
        }
        let mut view = json!({ "buffer": 0, "byteOffset": start, "byteLength": self.binary.len() - start });
        if per > 1 {
            view["byteStride"] = stride.into();
        }
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        self.views.push(view);
        let name = ["", "SCALAR", "VEC2", "VEC3", "VEC4"][per];
        let accessor = json!({ "bufferView": self.views.len() - 1, "componentType": kind, "type": name, "count": values.len() / per,
            "normalized": normalized });
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }
}

const FLOAT: (u32, usize, bool) = (5126, 4, false);

fn gltf(random: &mut Random) -> Made {
    let sheet = sheet(random);
    let mut file = Gltf { binary: Vec::new(), views: Vec::new(), accessors: Vec::new() };
    let flat = |all: &[[f32; 3]]| all.as_flattened().iter().map(|x| f64::from(*x)).collect::<Vec<_>>();
    let mut attributes = json!({ "POSITION": file.add(FLOAT, 3, flat(&sheet.places).into_iter()) });
    let (has_normals, has_image, has_color) = (random.chance(0.5), random.chance(0.5), random.chance(0.5));
    let has_color = has_color && !has_image;
    if has_normals {
        attributes["NORMAL"] = file.add(FLOAT, 3, flat(&sheet.normals).into_iter()).into();
    }
    // The type of colours, and the number for 1. Whole numbers are divided by it, also where the file does not say so.
    let (kind, most) = random.choose(&[
        (FLOAT, 1.0),
        ((5121, 1, true), 255.0),
        ((5121, 1, false), 255.0),
        ((5123, 2, true), 65535.0),
        (FLOAT, 255.0),
    ]);
    if has_color {
        let alpha = random.chance(0.5).then_some(most);
        let colors = sheet
            .bytes
            .iter()
            .flat_map(|color| color.map(|byte| f64::from(byte) / 255.0 * most).into_iter().chain(alpha));
        attributes["COLOR_0"] = file.add(kind, 3 + usize::from(alpha.is_some()), colors).into();
    }
    let modes = [random.below(3), random.below(3)];
    let mut root = json!({ "asset": { "version": "2.0" }, "scenes": [{ "nodes": [0] }], "materials": [{}] });
    if has_image {
        // v runs down.
        attributes["TEXCOORD_0"] =
            file.add(FLOAT, 2, sheet.uvs.iter().flat_map(|[u, v]| [f64::from(*u), 1.0 - f64::from(*v)])).into();
        let number = |mode: usize| [10497, 33071, 33648][mode];
        root["samplers"] = json!([{ "wrapS": number(modes[0]), "wrapT": number(modes[1]) }]);
        root["images"] = json!([{ "uri": "t.png" }]);
        root["textures"] = json!([{ "source": 0, "sampler": 0 }]);
        root["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({ "index": 0 });
    }
    let is_unlit = random.chance(0.3);
    if is_unlit {
        root["materials"][0]["extensions"] = json!({ "KHR_materials_unlit": {} });
    }
    root["materials"][0]["doubleSided"] = random.chance(0.5).into();
    let mut triangles = sheet.triangles(|_, i| match (has_image, has_color) {
        (true, _) => shown(sheet.uvs[i], modes),
        (_, true) => sheet.bytes[i].map(|byte| f32::from(byte) / 255.0),
        _ => [1.0; 3],
    });
    let mut primitive = json!({ "attributes": attributes, "material": 0 });
    let whole = random.choose(&[(5121, 1, false), (5123, 2, false), (5125, 4, false)]);
    let cut = |[a, b, c, d]: &[usize; 4]| [*a, *b, *c, *a, *c, *d].map(|i| i as f64);
    let corners: Vec<f64> = match (sheet.squares.len(), random.below(3)) {
        (1, 0) => {
            primitive["mode"] = 6.into();
            sheet.squares[0].map(|i| i as f64).to_vec()
        }
        (1, 1) => {
            // Two of a strip share the other diagonal.
            primitive["mode"] = 5.into();
            let [[a, b, c], [_, _, d]] = [triangles[0], triangles[1]];
            triangles = vec![[a, b, d], [d, b, c]];
            let [a, b, c, d] = sheet.squares[0].map(|i| i as f64);
            vec![a, b, d, c]
        }
        _ => sheet.squares.iter().flat_map(cut).collect(),
    };
    primitive["indices"] = file.add(whole, 1, corners.into_iter()).into();
    root["meshes"] = json!([{ "primitives": [primitive] }]);
    root["nodes"] = json!([{ "mesh": 0 }]);
    if random.chance(0.3) {
        root["nodes"][0]["scale"] = json!([-1, 1, 1]);
        for triangle in &mut triangles {
            triangle.swap(1, 2);
            triangle
                .iter_mut()
                .for_each(|corner| (corner.place[0], corner.normal[0]) = (-corner.place[0], -corner.normal[0]));
        }
    }
    root["bufferViews"] = file.views.into();
    root["accessors"] = file.accessors.into();
    let is_text = random.chance(0.4);
    let padding = random.choose(&[b' ', 0, b'\n']);
    let (name, bytes) = if is_text {
        let engine = random.choose(&[&general_purpose::STANDARD, &general_purpose::STANDARD_NO_PAD]);
        root["buffers"] = json!([{ "byteLength": file.binary.len(), "uri": format!("data:application/octet-stream;base64,{}", engine.encode(&file.binary)) }]);
        let mark = random.choose(&["", "\u{feff}"]);
        ("a.gltf", [mark.as_bytes(), root.to_string().as_bytes(), &[padding; 3]].concat())
    } else {
        root["buffers"] = json!([{ "byteLength": file.binary.len() }]);
        let mut text = root.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4) + 4, padding);
        let other = random.choose(&[&b""[..], b"\x04\0\0\0XTRA1234"]);
        let length = |bytes: &[u8]| (bytes.len() as u32).to_le_bytes();
        let chunks =
            [&length(&text), &b"JSON"[..], &text, other, &length(&file.binary), b"BIN\0", &file.binary].concat();
        let total = (12 + chunks.len() as u32).to_le_bytes();
        ("a.glb", [b"glTF", &2u32.to_le_bytes()[..], &total, &chunks].concat())
    };
    let notes = due([(has_color && (kind, most) == (FLOAT, 255.0), "divided by 255")]);
    // Edges that the renderer does not know change the UVs.
    let no_uvs = !has_image || modes[0] != modes[1] || modes[0] == 2;
    Made { name, bytes, triangles: without(triangles, no_uvs, !has_normals), notes }
}

/// Makes a file of each format in turn.
fn made(seed: u64) -> Made {
    let random = &mut Random::new(seed);
    [ply, obj, stl, gltf][seed as usize % 4](random)
}

/// A folder with the files that generated ones name.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("t.png"), image()).unwrap();
    let mtl = "newmtl t\nmap_Kd -clamp on t.png\nnewmtl glass\nKd 0.25 0.5 1\nd 0.5\n";
    fs::write(folder.path().join("t.mtl"), mtl).unwrap();
    folder
}

fn read(path: &Path) -> Loaded {
    load(path, &LoadOptions::default()).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn generated_files_are_read_as_what_they_were_made_of() {
    let folder = folder();
    for seed in 0..cases(400) {
        let Made { name, bytes, triangles, notes } = made(seed);
        let path = folder.path().join(name);
        fs::write(&path, &bytes).unwrap();
        let loaded = read(&path);
        let told = loaded.notes.join("; ");
        assert!(
            loaded.notes.len() == notes.len() && notes.iter().all(|note| told.contains(note)),
            "seed {seed}: {told:?}, due: {notes:?}"
        );
        let found = corners(&loaded);
        assert_eq!(found.len(), triangles.len(), "seed {seed}");
        for (a, b) in found.as_flattened().iter().zip(triangles.as_flattened()) {
            let same_uv = b.uv == [0.0; 2] || near(a.uv, b.uv, 1e-6);
            let same = a.place == b.place && near(a.color, b.color, 1e-5) && same_uv && near(a.normal, b.normal, 1e-6);
            assert!(same, "seed {seed}: {a:?}, due: {b:?}");
        }
    }
}

/// The content of a file, whatever the order of its triangles: corners with normals of length 1, and opacity.
fn said(loaded: &Loaded) -> Vec<([Corner; 3], f32)> {
    let unit =
        |corner: Corner| Corner { normal: glam::Vec3::from(corner.normal).normalize_or_zero().to_array(), ..corner };
    let opacity = |t: usize| loaded.opacity.get(t).copied().unwrap_or(1.0);
    let mut all: Vec<_> =
        corners(loaded).into_iter().enumerate().map(|(t, corners)| (corners.map(unit), opacity(t))).collect();
    all.sort_by_key(|(corners, _)| corners.map(|corner| corner.place.map(|x| (x * 8.0) as i64)));
    all
}

/// Each corner's place and UV, in the file's order.
fn spots(loaded: &Loaded) -> Vec<([f32; 3], [f32; 2])> {
    corners(loaded).as_flattened().iter().map(|corner| (corner.place, corner.uv)).collect()
}

/// The corners that another reader, tobj, finds in an OBJ file. It begins a model at each material.
fn read_by_tobj(path: &Path) -> Vec<([f32; 3], [f32; 2])> {
    let (models, _) = tobj::load_obj(path, &tobj::LoadOptions::default()).unwrap();
    let corner = |mesh: &tobj::Mesh, k: usize| {
        let (place, uv) = (3 * mesh.indices[k] as usize, mesh.texcoord_indices.get(k).map(|&i| 2 * i as usize));
        ([0, 1, 2].map(|k| mesh.positions[place + k]), uv.map_or([0.0; 2], |uv| [0, 1].map(|k| mesh.texcoords[uv + k])))
    };
    models.iter().flat_map(|model| (0..model.mesh.indices.len()).map(|k| corner(&model.mesh, k))).collect()
}

#[test]
fn generated_files_pass_through_each_format() {
    let folder = folder();
    for seed in 0..cases(400).div_ceil(3) {
        let Made { name, bytes, .. } = made(seed);
        let path = folder.path().join(name);
        fs::write(&path, &bytes).unwrap();
        let loaded = read(&path);
        for ending in ["obj", "ply", "glb"] {
            let (files, notes) = loaded.encode(folder.path().join(format!("out.{ending}"))).unwrap();
            softras_io::output::write_files(&files).unwrap();
            let again = read(&files.last().unwrap().0);
            let place = format!("seed {seed}, {name} as .{ending}: {notes:?}, {:?}", again.notes);
            let lost = |what: &str| notes.iter().any(|note| note.contains(what));
            let known = ["light", "front alone", "repeats", "opacity", "256 steps"];
            assert!(
                again.notes.is_empty() && notes.iter().all(|note| known.iter().any(|part| note.contains(part))),
                "{place}"
            );
            assert!(again.unlit == loaded.unlit || lost("light"), "{place}");
            assert!(again.single_sided == loaded.single_sided || lost("front alone"), "{place}");
            let (before, after) = (said(&loaded), said(&again));
            assert_eq!(before.len(), after.len(), "{place}");
            if ending == "obj" {
                assert_eq!(read_by_tobj(&files.last().unwrap().0), spots(&again), "{place}");
            }
            for ((a, opaque), (b, again)) in before.iter().zip(&after) {
                assert!(opaque == again || lost("opacity"), "{place}");
                for (a, b) in a.iter().zip(b) {
                    // A byte of sRGB is coarsest near white.
                    let most = if lost("256 steps") || ending == "ply" { 0.005 } else { 1e-5 };
                    let same_color = lost("repeats") || near(a.color, b.color, most);
                    let same = a.place == b.place && near(a.uv, b.uv, 1e-6) && near(a.normal, b.normal, 1e-6);
                    assert!(same && same_color, "{place}: {a:?} became {b:?}");
                }
            }
        }
    }
}
