//! Writes meshes as PLY, STL and glTF, by hand, for the tests of the readers.

use base64::{Engine, engine::general_purpose::STANDARD};
use serde_json::Value;
use softras::{
    Mesh,
    scene::{Appearance, Texture},
};
use std::fmt::Write;

pub fn little(values: impl IntoIterator<Item = f32>) -> Vec<u8> {
    values.into_iter().flat_map(f32::to_le_bytes).collect()
}

/// An encoding of PLY files.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Ply {
    Text,
    Little,
    Big,
}

/// A PLY file with float colours, or with the UVs of corners and an image, as the mesh has them.
pub fn ply(mesh: &Mesh, encoding: Ply, image: Option<&str>) -> Vec<u8> {
    let format = match encoding {
        Ply::Text => "ascii",
        Ply::Little => "binary_little_endian",
        Ply::Big => "binary_big_endian",
    };
    let mut head = format!("ply\nformat {format} 1.0\ncomment by hand\n");
    image.into_iter().for_each(|name| writeln!(head, "comment TextureFile {name}").unwrap());
    writeln!(head, "element vertex {}", mesh.positions().len()).unwrap();
    head += "property float x\nproperty float y\nproperty float z\nproperty uchar quality\n";
    let colors = if let Appearance::VertexColors(colors) = mesh.appearance() { Some(colors) } else { None };
    if colors.is_some() {
        head += "property float red\nproperty float green\nproperty float blue\n";
    }
    writeln!(head, "element face {}\nproperty list uchar int vertex_indices", mesh.triangles().len()).unwrap();
    let mapped = if let Appearance::Textured { uvs, uv_triangles, .. } = mesh.appearance() {
        head += "property list uchar float texcoord\n";
        Some((uvs, uv_triangles))
    } else {
        None
    };
    head += "element strange 1\nproperty list uchar short numbers\nend_header\n";
    let mut bytes = head.into_bytes();
    let mut put = |word: String, little: &[u8]| match encoding {
        Ply::Text => bytes.extend(format!("{word} ").bytes()),
        Ply::Little => bytes.extend(little),
        Ply::Big => bytes.extend(little.iter().rev()),
    };
    for (i, position) in mesh.positions().iter().enumerate() {
        position.iter().for_each(|x| put(x.to_string(), &x.to_le_bytes()));
        put("7".into(), &[7]);
        colors.iter().flat_map(|colors| colors[i]).for_each(|x| put(x.to_string(), &x.to_le_bytes()));
    }
    for (t, triangle) in mesh.triangles().iter().enumerate() {
        put("3".into(), &[3]);
        triangle.iter().for_each(|&i| put(i.to_string(), &(i as i32).to_le_bytes()));
        if let Some((uvs, uv_triangles)) = mapped {
            put("6".into(), &[6]);
            let corners = uv_triangles[t].into_iter().flat_map(|i| uvs[i as usize]);
            corners.for_each(|x| put(x.to_string(), &x.to_le_bytes()));
        }
    }
    put("1".into(), &[1]);
    put("5".into(), &5i16.to_le_bytes());
    bytes
}

fn corners(mesh: &Mesh) -> impl Iterator<Item = [[f32; 3]; 3]> {
    mesh.triangles().iter().map(|triangle| triangle.map(|i| mesh.positions()[i as usize]))
}

/// A binary STL file whose header begins with `solid`, as many do.
pub fn stl(mesh: &Mesh) -> Vec<u8> {
    let mut bytes = b"solid of some program".to_vec();
    bytes.resize(80, b' ');
    bytes.extend((mesh.triangles().len() as u32).to_le_bytes());
    for triangle in corners(mesh) {
        bytes.extend(little([0.0, 0.0, 1.0].into_iter().chain(triangle.into_iter().flatten())));
        bytes.extend([0, 0]);
    }
    bytes
}

/// An STL file of text, the triangles in two solids.
pub fn stl_text(mesh: &Mesh) -> Vec<u8> {
    let mut text = "solid\n".to_string();
    for (i, triangle) in corners(mesh).enumerate() {
        if i == 1 {
            text += "ENDSOLID\n\nsolid the second\n";
        }
        text += "  facet normal 0 0 1\n    outer loop\n";
        triangle.iter().for_each(|[x, y, z]| writeln!(text, "      VERTEX {x:e} {y:e} {z:e}").unwrap());
        text += "    endloop\n  endfacet\n";
    }
    (text + "endsolid the second\n").into_bytes()
}

/// The JSON and the binary part of the glTF file that a mesh is written as, without a scene, so that all nodes are drawn.
pub fn gltf(mesh: &Mesh) -> (Value, Vec<u8>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mesh.glb");
    crate::save(mesh, &path).unwrap();
    let bytes = std::fs::read(path).unwrap();
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let mut root: Value = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
    ["scene", "scenes"].iter().for_each(|name| drop(root.as_object_mut().unwrap().remove(*name)));
    (root, bytes[28 + length..].to_vec())
}

/// A binary glTF file of both parts.
pub fn glb(root: &Value, binary: &[u8]) -> Vec<u8> {
    let mut text = root.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let length = 12 + 8 + text.len() + 8 + binary.len();
    let mut bytes = b"glTF".to_vec();
    [2, length as u32, text.len() as u32].iter().for_each(|n| bytes.extend(n.to_le_bytes()));
    bytes.extend(b"JSON");
    bytes.extend(text);
    bytes.extend((binary.len() as u32).to_le_bytes());
    bytes.extend(b"BIN\0");
    bytes.extend(binary);
    bytes
}

/// A glTF file with its binary part within the text.
pub fn embedded(mut root: Value, binary: &[u8]) -> Vec<u8> {
    root["buffers"][0]["uri"] = format!("data:application/octet-stream;base64,{}", STANDARD.encode(binary)).into();
    root.to_string().into_bytes()
}

/// A texture of bytes as a PNG file.
pub fn png(texture: &Texture) -> Vec<u8> {
    let bytes = texture.texels().as_flattened().iter().map(|x| (x * 255.0).round() as u8).collect();
    let image = image::RgbImage::from_raw(texture.width(), texture.height(), bytes).unwrap();
    let mut file = std::io::Cursor::new(Vec::new());
    image.write_to(&mut file, image::ImageFormat::Png).unwrap();
    file.into_inner()
}
