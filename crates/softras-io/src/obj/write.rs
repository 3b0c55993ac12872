//! Writes meshes as OBJ, MTL and PNG files.

use crate::{color::Curve, picture, placed, several_cells, texture::srgb_from_linear, written::Written};
use image::ExtendedColorType;
use softras::{
    Error, Result,
    scene::{Appearance, Texture, Wrap},
};
use std::{
    collections::HashMap,
    fmt::Write,
    path::{Path, PathBuf},
};

/// The content of the files of a mesh, the OBJ file last.
///
/// # Errors
/// [`Error::Mesh`] for what these formats cannot hold.
pub fn files_of(mesh: &mut Written, path: &Path) -> Result<Vec<(PathBuf, Vec<u8>)>> {
    mesh.lose_single_normals();
    mesh.lose_light_and_sides(path)?;
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let materials = materials(mesh, &stem)?;
    let mut files = Vec::new();
    for (name, texture) in &materials.images {
        files.push((path.with_file_name(name), png(texture)?));
    }
    let mut mtllib = None;
    if !materials.mtl.is_empty() {
        let name = format!("{stem}.mtl");
        files.push((path.with_file_name(&name), materials.mtl.into_bytes()));
        mtllib = Some(name);
    }
    files.push((path.into(), obj(mesh, mtllib.as_deref(), &materials.of_triangle).into_bytes()));
    Ok(files)
}

/// The MTL file, its images, and which material each triangle has (`m0`, `m1`, ..; empty without materials).
#[derive(Default)]
struct WrittenMaterials<'a> {
    mtl: String,
    images: Vec<(String, &'a Texture)>,
    of_triangle: Vec<usize>,
}

fn materials<'a>(mesh: &'a Written, stem: &str) -> Result<WrittenMaterials<'a>> {
    let textures = match mesh.mesh.appearance() {
        Appearance::Surface { resolution, .. } if *resolution > 1 => return Err(several_cells(*resolution, "OBJ")),
        Appearance::Textured { textures, .. } => &textures[..],
        _ => &[],
    };
    // Not `NAME.png`, which is what a picture of the mesh is called.
    let number = |i: usize| if textures.len() == 1 { String::new() } else { format!("_{i}") };
    let name = |i: usize| format!("{stem}_texture{}.png", number(i));
    let mut materials = WrittenMaterials::default();
    let mut known = HashMap::new();
    for t in 0..mesh.mesh.triangles().len() {
        let (color, texture, opacity) = (mesh.color_of(t), mesh.texture_of(t), mesh.opacity_of(t));
        let next = known.len();
        let index = *known.entry((color.map(f32::to_bits), texture, opacity.to_bits())).or_insert(next);
        materials.of_triangle.push(index);
        if index < next {
            continue;
        }
        // Writing to a String cannot fail, here and below.
        let _ = writeln!(materials.mtl, "newmtl m{index}");
        let _ = match texture {
            None => writeln!(materials.mtl, "Kd {} {} {}", color[0], color[1], color[2]),
            Some(i) => {
                let clamp = if textures[i].wrap() == Wrap::Clamp { "-clamp on " } else { "" };
                // A name that starts with `-` would read as an option.
                let here = if stem.starts_with('-') { "./" } else { "" };
                writeln!(materials.mtl, "map_Kd {clamp}{here}{}", name(i))
            }
        };
        if opacity < 1.0 {
            let _ = writeln!(materials.mtl, "d {opacity}");
        }
    }
    materials.images = textures.iter().enumerate().map(|(i, texture)| (name(i), texture)).collect();
    let white = ([1.0f32.to_bits(); 3], None, 1.0f32.to_bits());
    if known.len() == 1 && known.contains_key(&white) {
        materials = WrittenMaterials::default();
    }
    Ok(materials)
}

fn obj(written: &Written, mtllib: Option<&str>, material_of_triangle: &[usize]) -> String {
    let mesh = &written.mesh;
    let mut text = String::from("# softras\n");
    if let Some(name) = mtllib {
        let _ = writeln!(text, "mtllib {name}");
    }
    for (i, p) in mesh.positions().iter().enumerate() {
        // A 32-bit number takes fewer digits than the same in 64 bits.
        let _ = if written.origin == [0.0; 3] {
            write!(text, "v {} {} {}", p[0], p[1], p[2])
        } else {
            let [x, y, z] = placed(*p, written.origin);
            write!(text, "v {x} {y} {z}")
        };
        if let Appearance::VertexColors(colors) = mesh.appearance() {
            let [r, g, b] = if written.curve == Curve::Srgb { colors[i].map(srgb_from_linear) } else { colors[i] };
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
    let (mut current, mut normals) = (None, HashMap::new());
    for (t, triangle) in mesh.triangles().iter().enumerate() {
        let own = written.normals_of(t).map(|own| {
            own.map(|normal| {
                let next = normals.len() + 1;
                let index = *normals.entry(normal.map(f32::to_bits)).or_insert(next);
                if index == next {
                    let _ = writeln!(text, "vn {} {} {}", normal[0], normal[1], normal[2]);
                }
                index
            })
        });
        let material = material_of_triangle.get(t);
        if material != current {
            let _ = writeln!(text, "usemtl m{}", material.copied().unwrap_or_default());
            current = material;
        }
        text.push('f');
        for k in 0..3 {
            let _ = write!(text, " {}", u64::from(triangle[k]) + 1);
            let uv = uv_triangles.map(|uvs| u64::from(uvs[t][k]) + 1);
            let _ = match (uv, own.map(|own| own[k])) {
                (None, None) => Ok(()),
                (Some(uv), None) => write!(text, "/{uv}"),
                (None, Some(normal)) => write!(text, "//{normal}"),
                (Some(uv), Some(normal)) => write!(text, "/{uv}/{normal}"),
            };
        }
        text.push('\n');
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
