//! Writes meshes as binary PLY files.

use crate::{color::Curve, obj::png, placed, several_cells};
use softras::{
    Error, Mesh, Result,
    scene::{Appearance, Texture},
};
use std::path::{Path, PathBuf};

/// The content of the files of a mesh, the PLY file last: colours in bytes, and a texture as a PNG file beside it.
///
/// # Errors
/// [`Error::Mesh`] for surface textures of more than one cell, several textures, and texels outside [0, 1].
pub fn files_of(mesh: &Mesh, path: &Path, curve: Curve, origin: [f64; 3]) -> Result<Vec<(PathBuf, Vec<u8>)>> {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let (mut files, mut image) = (Vec::new(), String::new());
    if let Appearance::Textured { textures, .. } = mesh.appearance() {
        let name = format!("{stem}_texture.png");
        files.push((path.with_file_name(&name), png(only(textures)?)?));
        image = format!("comment TextureFile {name}\n");
    }
    files.push((path.into(), ply(mesh, &image, curve, origin)?));
    Ok(files)
}

fn only(textures: &[Texture]) -> Result<&Texture> {
    match textures {
        [one] => Ok(one),
        _ => Err(Error::Mesh {
            what: format!("{} textures", textures.len()),
            place: "appearance".into(),
            fix: "PLY files hold one image: write .obj or .glb".into(),
        }),
    }
}

fn ply(mesh: &Mesh, image: &str, curve: Curve, origin: [f64; 3]) -> Result<Vec<u8>> {
    let byte = |x: f32| (curve.encode(f64::from(x)) * 255.0).round() as u8;
    let bytes = |color: &[f32; 3]| color.map(byte);
    let (mut vertex_colors, mut face_colors, mut corner_uvs) = (Vec::new(), Vec::new(), None);
    match mesh.appearance() {
        Appearance::Uniform(color) => vertex_colors = vec![bytes(color); mesh.positions().len()],
        Appearance::VertexColors(colors) => vertex_colors = colors.iter().map(bytes).collect(),
        Appearance::Surface { resolution: 1, texels } => face_colors = texels.iter().map(bytes).collect(),
        Appearance::Surface { resolution, .. } => return Err(several_cells(*resolution, "PLY")),
        Appearance::Textured { uvs, uv_triangles, .. } => corner_uvs = Some((uvs, uv_triangles)),
    }
    let normals = mesh.normals();
    let is_far = origin != [0.0; 3];
    let number = if is_far { "double" } else { "float" };
    let property = |is_there: bool, text: &'static str| if is_there { text } else { "" };
    let colors = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    let header = format!(
        "ply\nformat binary_little_endian 1.0\ncomment softras\n{image}element vertex {}\nproperty {number} x\nproperty {number} y\n\
         property {number} z\n{}{}element face {}\nproperty list uchar int vertex_indices\n{}{}end_header\n",
        mesh.positions().len(),
        property(!normals.is_empty(), "property float nx\nproperty float ny\nproperty float nz\n"),
        property(!vertex_colors.is_empty(), colors),
        mesh.triangles().len(),
        property(corner_uvs.is_some(), "property list uchar float texcoord\n"),
        property(!face_colors.is_empty(), colors),
    );
    let mut file = header.into_bytes();
    for (i, position) in mesh.positions().iter().enumerate() {
        if is_far {
            file.extend(placed(*position, origin).iter().flat_map(|x| x.to_le_bytes()));
        } else {
            file.extend(position.iter().flat_map(|x| x.to_le_bytes()));
        }
        file.extend(normals.get(i).into_iter().flatten().flat_map(|x| x.to_le_bytes()));
        file.extend(vertex_colors.get(i).into_iter().flatten());
    }
    for (t, triangle) in mesh.triangles().iter().enumerate() {
        file.push(3);
        file.extend(triangle.iter().flat_map(|i| i.to_le_bytes()));
        if let Some((uvs, uv_triangles)) = corner_uvs {
            file.push(6);
            file.extend(uv_triangles[t].iter().flat_map(|&uv| uvs[uv as usize]).flat_map(f32::to_le_bytes));
        }
        file.extend(face_colors.get(t).into_iter().flatten());
    }
    Ok(file)
}
