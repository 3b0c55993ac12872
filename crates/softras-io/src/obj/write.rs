//! Writes meshes as OBJ, MTL and PNG files.

use crate::{color::Curve, picture, placed, several_cells, texture::srgb_from_linear};
use image::ExtendedColorType;
use softras::{
    Error, Mesh, Result,
    scene::{Appearance, Texture, Wrap},
};
use std::{
    fmt::Write,
    path::{Path, PathBuf},
};

/// The content of the files of a mesh, the OBJ file last.
///
/// # Errors
/// [`Error::Mesh`] for what these formats cannot hold.
pub fn files_of(mesh: &Mesh, path: &Path, curve: Curve, origin: [f64; 3]) -> Result<Vec<(PathBuf, Vec<u8>)>> {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let mut files = Vec::new();
    let materials = materials(mesh, &stem)?;
    for (name, texture) in &materials.images {
        files.push((path.with_file_name(name), png(texture)?));
    }
    let mut mtllib = None;
    if !materials.mtl.is_empty() {
        let name = format!("{stem}.mtl");
        files.push((path.with_file_name(&name), materials.mtl.into_bytes()));
        mtllib = Some(name);
    }
    files.push((path.into(), obj(mesh, mtllib.as_deref(), &materials.of_triangle, curve, origin).into_bytes()));
    Ok(files)
}

/// The MTL file, its images, and which material each triangle has (`m0`, `m1`, ..; empty without materials).
#[derive(Default)]
struct Materials<'a> {
    mtl: String,
    images: Vec<(String, &'a Texture)>,
    of_triangle: Vec<u32>,
}

impl Materials<'_> {
    fn add_color(&mut self, index: usize, [r, g, b]: [f32; 3]) {
        // Writing to a String cannot fail, here and below.
        let _ = writeln!(self.mtl, "newmtl m{index}\nKd {r} {g} {b}");
    }
}

fn materials<'a>(mesh: &'a Mesh, stem: &str) -> Result<Materials<'a>> {
    let mut materials = Materials::default();
    let triangles = mesh.triangles().len();
    match mesh.appearance() {
        Appearance::VertexColors(_) => {}
        Appearance::Uniform(color) if *color == [1.0; 3] => {}
        Appearance::Uniform(color) => {
            materials.add_color(0, *color);
            materials.of_triangle = vec![0; triangles];
        }
        Appearance::Surface { resolution: 1, texels } => {
            let mut index_of = std::collections::HashMap::new();
            for color in texels {
                let next = index_of.len();
                let index = *index_of.entry(color.map(f32::to_bits)).or_insert(next);
                if index == next {
                    materials.add_color(index, *color);
                }
                materials.of_triangle.push(index as u32);
            }
        }
        Appearance::Surface { resolution, .. } => return Err(several_cells(*resolution, "OBJ")),
        Appearance::Textured { textures, texture_of_triangle, .. } => {
            for (i, texture) in textures.iter().enumerate() {
                // Not `NAME.png`, which is what a picture of the mesh is called.
                let number = if textures.len() == 1 { String::new() } else { format!("_{i}") };
                let name = format!("{stem}_texture{number}.png");
                let clamp = if texture.wrap() == Wrap::Clamp { "-clamp on " } else { "" };
                // A name that starts with `-` would read as an option.
                let here = if name.starts_with('-') { "./" } else { "" };
                let _ = writeln!(materials.mtl, "newmtl m{i}\nmap_Kd {clamp}{here}{name}");
                materials.images.push((name, texture));
            }
            materials.of_triangle = texture_of_triangle.clone();
            // Empty when there is only one.
            materials.of_triangle.resize(triangles, 0);
        }
    }
    Ok(materials)
}

fn obj(mesh: &Mesh, mtllib: Option<&str>, material_of_triangle: &[u32], curve: Curve, origin: [f64; 3]) -> String {
    let mut text = String::from("# softras\n");
    if let Some(name) = mtllib {
        let _ = writeln!(text, "mtllib {name}");
    }
    for (i, p) in mesh.positions().iter().enumerate() {
        // A 32-bit number takes fewer digits than the same in 64 bits.
        let _ = if origin == [0.0; 3] {
            write!(text, "v {} {} {}", p[0], p[1], p[2])
        } else {
            let [x, y, z] = placed(*p, origin);
            write!(text, "v {x} {y} {z}")
        };
        if let Appearance::VertexColors(colors) = mesh.appearance() {
            let [r, g, b] = if curve == Curve::Srgb { colors[i].map(srgb_from_linear) } else { colors[i] };
            let _ = write!(text, " {r} {g} {b}");
        }
        text.push('\n');
    }
    let mut uv_triangles = None;
    if let Appearance::Textured { uvs, uv_triangles: triangles, .. } = mesh.appearance() {
        for [u, v] in uvs {
            let _ = writeln!(text, "vt {u} {v}");
        }
        uv_triangles = Some(triangles);
    }
    let mut current = None;
    for (t, triangle) in mesh.triangles().iter().enumerate() {
        let material = material_of_triangle.get(t);
        if material != current {
            let _ = writeln!(text, "usemtl m{}", material.copied().unwrap_or_default());
            current = material;
        }
        let [a, b, c] = triangle.map(|i| u64::from(i) + 1);
        let _ = match uv_triangles {
            Some(uvs) => {
                let [i, j, k] = uvs[t].map(|i| u64::from(i) + 1);
                writeln!(text, "f {a}/{i} {b}/{j} {c}/{k}")
            }
            None => writeln!(text, "f {a} {b} {c}"),
        };
    }
    text
}

/// A PNG file of a texture: 8 bits a channel if every value is a whole number of 255ths, else 16.
pub fn png(texture: &Texture) -> Result<Vec<u8>> {
    let values = texture.texels().as_flattened();
    if let Some(value) = values.iter().find(|value| !(0.0..=1.0).contains(*value)) {
        return Err(Error::Mesh {
            what: format!("texel value {value}"),
            place: "texture".into(),
            fix: "PNG files hold 0 to 1: clamp it first".into(),
        });
    }
    let is_8_bit = values.iter().all(|value| (value * 255.0).round() / 255.0 == *value);
    let alpha = texture.alpha().unwrap_or_default();
    let is_8_bit = is_8_bit && alpha.iter().all(|value| (value * 255.0).round() / 255.0 == *value);
    let pixels = texture.texels().iter().enumerate();
    let values = pixels.flat_map(|(i, texel)| texel.iter().chain(alpha.get(i)).copied());
    let (bytes, color): (Vec<u8>, _) = if is_8_bit {
        let color = if alpha.is_empty() { ExtendedColorType::Rgb8 } else { ExtendedColorType::Rgba8 };
        (values.map(|value| (value * 255.0).round() as u8).collect(), color)
    } else {
        let color = if alpha.is_empty() { ExtendedColorType::Rgb16 } else { ExtendedColorType::Rgba16 };
        (values.map(|value| (value * 65535.0).round() as u16).flat_map(u16::to_ne_bytes).collect(), color)
    };
    picture::png(&bytes, texture.width(), texture.height(), color).map_err(|error| Error::Mesh {
        what: error.to_string(),
        place: "texture".into(),
        fix: "the PNG encoder refuses this image: try a smaller one".into(),
    })
}
