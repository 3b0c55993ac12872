//! Writes meshes as binary PLY files.

use crate::{obj::png, placed, several_cells, written::Written};
use softras::{
    Result,
    scene::{Appearance, Wrap},
};
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

/// The content of the files of a mesh, the PLY file last: colours in bytes, and textures as PNG files beside it.
///
/// # Errors
/// [`Error::Mesh`](softras::Error::Mesh) for surface textures of more than one cell, and texels outside [0, 1].
pub fn files_of(mesh: &mut Written, path: &Path) -> Result<Vec<(PathBuf, Vec<u8>)>> {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let (mut files, mut images) = (Vec::new(), String::new());
    if let Appearance::Textured { textures, .. } = mesh.mesh.appearance().clone() {
        for (i, texture) in textures.iter().enumerate() {
            let number = if textures.len() == 1 { String::new() } else { format!("_{i}") };
            let name = format!("{stem}_texture{number}.png");
            files.push((path.with_file_name(&name), png(texture)?));
            images += &format!("comment TextureFile {name}\n");
            if texture.wrap() == Wrap::Clamp {
                mesh.lose("PLY files do not say that a texture is clamped: it repeats");
            }
        }
    }
    if !mesh.opacity.is_empty() {
        mesh.lose("PLY files hold no opacity of triangles: all are opaque");
    }
    mesh.lose_light_and_sides(path)?;
    files.push((path.into(), ply(mesh, &images)?));
    Ok(files)
}

fn ply(written: &mut Written, images: &str) -> Result<Vec<u8>> {
    let mesh = written.mesh.clone();
    let (mut vertex_colors, mut face_colors, mut corner_uvs, mut has_several) = (Vec::new(), Vec::new(), None, false);
    match mesh.appearance() {
        Appearance::Uniform(color) => vertex_colors = vec![written.bytes(*color); mesh.positions().len()],
        Appearance::VertexColors(colors) => vertex_colors = colors.iter().map(|color| written.bytes(*color)).collect(),
        Appearance::Surface { resolution: 1, texels } => {
            face_colors = texels.iter().map(|color| written.bytes(*color)).collect();
        }
        Appearance::Surface { resolution, .. } => return Err(several_cells(*resolution, "PLY")),
        Appearance::Textured { uvs, uv_triangles, textures, .. } => {
            (corner_uvs, has_several) = (Some((uvs, uv_triangles)), textures.len() > 1);
        }
    }
    // A vertex for each of its normals; the bits of 0 where it has none.
    let normal =
        |t: usize, k: usize| written.normals.get(t).map_or([0; 3], |normals| normals[k].map(|x| (x + 0.0).to_bits()));
    let mut corners: BTreeMap<(u32, [u32; 3]), u32> = BTreeMap::new();
    let mut is_used = vec![false; mesh.positions().len()];
    for (t, triangle) in mesh.triangles().iter().enumerate() {
        for (k, &vertex) in triangle.iter().enumerate() {
            corners.insert((vertex, normal(t, k)), 0);
            is_used[vertex as usize] = true;
        }
    }
    if corners.len() > is_used.iter().filter(|is_used| **is_used).count() {
        written
            .notes
            .push("a vertex with several normals is written once for each: readers find the surface open there".into());
    }
    corners.extend((0..).zip(is_used).filter(|(_, is_used)| !is_used).map(|(vertex, _)| ((vertex, [0; 3]), 0)));
    corners.values_mut().zip(0..).for_each(|(index, i)| *index = i);

    let is_far = written.origin != [0.0; 3];
    let number = if is_far { "double" } else { "float" };
    let property = |is_there: bool, text: &'static str| if is_there { text } else { "" };
    let colors = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    let header = format!(
        "ply\nformat binary_little_endian 1.0\ncomment softras\n{images}element vertex {}\nproperty {number} x\nproperty {number} y\n\
         property {number} z\n{}{}element face {}\nproperty list uchar int vertex_indices\n{}{}{}end_header\n",
        corners.len(),
        property(!written.normals.is_empty(), "property float nx\nproperty float ny\nproperty float nz\n"),
        property(!vertex_colors.is_empty(), colors),
        mesh.triangles().len(),
        property(corner_uvs.is_some(), "property list uchar float texcoord\n"),
        property(has_several, "property int texnumber\n"),
        property(!face_colors.is_empty(), colors),
    );
    let mut file = header.into_bytes();
    for (vertex, normal) in corners.keys() {
        let position = mesh.positions()[*vertex as usize];
        if is_far {
            file.extend(placed(position, written.origin).iter().flat_map(|x| x.to_le_bytes()));
        } else {
            file.extend(position.iter().flat_map(|x| x.to_le_bytes()));
        }
        let normal = if written.normals.is_empty() { &[][..] } else { normal };
        file.extend(normal.iter().flat_map(|bits| bits.to_le_bytes()));
        file.extend(vertex_colors.get(*vertex as usize).into_iter().flatten());
    }
    for (t, triangle) in mesh.triangles().iter().enumerate() {
        file.push(3);
        file.extend([0, 1, 2].map(|k| corners[&(triangle[k], normal(t, k))]).iter().flat_map(|i| i.to_le_bytes()));
        if let Some((uvs, uv_triangles)) = corner_uvs {
            file.push(6);
            file.extend(uv_triangles[t].iter().flat_map(|&uv| uvs[uv as usize]).flat_map(f32::to_le_bytes));
        }
        let texture = written.texture_of(t).filter(|_| has_several).map(|i| i as i32);
        file.extend(texture.into_iter().flat_map(i32::to_le_bytes));
        file.extend(face_colors.get(t).into_iter().flatten());
    }
    Ok(file)
}
