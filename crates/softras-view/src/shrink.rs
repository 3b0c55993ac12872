//! Textures that fit a device.

use crate::bounds::Bounds;
use softras::{
    Error, Limits, Mesh, Result,
    scene::{Appearance, Texture},
};

/// Bytes of a texel on the device.
const TEXEL: u64 = 16;
/// The least and greatest radii of meshes whose usual camera draws depths that the renderer takes, 1e-6 to 1e9.
const RADII: [f64; 2] = [4e-7, 3e8];
/// Texels that the renderer keeps beside those of textures.
const OWN: u64 = 1;

/// The mesh with its largest textures halved until all of them fit into one buffer of a device, and a note if any was.
///
/// # Errors
/// As [`Mesh::with_appearance`]; [`Error::Mesh`] for a mesh that is too large or too small for any usual camera.
pub fn shrunk(mesh: Mesh, limits: &Limits) -> Result<(Mesh, Option<String>)> {
    let radius = Bounds::of(&mesh).radius;
    if !(RADII[0]..=RADII[1]).contains(&radius) {
        return Err(Error::Mesh {
            what: format!("about {:.1e} units wide", 2.0 * radius),
            place: "positions".into(),
            fix: "scale it: meshes of 1e-6 to 5e8 units are drawn".into(),
        });
    }
    within(mesh, (limits.max_storage_buffer_range / TEXEL).min(limits.max_texel_buffer_elements) - OWN)
}

/// The mesh with its largest textures halved until they have at most `most` texels together, and a note if any was.
fn within(mesh: Mesh, most: u64) -> Result<(Mesh, Option<String>)> {
    let Appearance::Textured { uvs, uv_triangles, textures, texture_of_triangle } = mesh.appearance() else {
        return Ok((mesh, None));
    };
    let count = |texture: &Texture| texture.texels().len() as u64;
    let mut textures = textures.clone();
    let mut note = None;
    while textures.iter().map(count).sum::<u64>() > most {
        let Some(largest) = textures.iter_mut().max_by_key(|texture| count(texture)).filter(|t| count(t) > 1) else {
            break;
        };
        let half = halved(largest)?;
        note.get_or_insert_with(|| {
            let [width, height] = [largest.width(), largest.height()];
            format!(
                "textures are drawn smaller, one of {width}×{height} at {}×{}: this device holds {most} texels",
                half.width(),
                half.height()
            )
        });
        *largest = half;
    }
    if note.is_none() {
        return Ok((mesh, None));
    }
    let (uvs, uv_triangles, texture_of_triangle) = (uvs.clone(), uv_triangles.clone(), texture_of_triangle.clone());
    Ok((mesh.with_appearance(Appearance::Textured { uvs, uv_triangles, textures, texture_of_triangle })?, note))
}

/// A texture of half the size, each texel the mean of four.
fn halved(texture: &Texture) -> Result<Texture> {
    let [width, height] = [texture.width(), texture.height()].map(|side| side as usize);
    let sides = [width, height].map(|side| side.div_ceil(2));
    let mean = |value: &dyn Fn(usize) -> f32, i: usize| {
        let (row, column) = (2 * (i / sides[0]), 2 * (i % sides[0]));
        let at = |r: usize, c: usize| value((row + r).min(height - 1) * width + (column + c).min(width - 1));
        (at(0, 0) + at(0, 1) + at(1, 0) + at(1, 1)) / 4.0
    };
    let texel = |i: usize| [0, 1, 2].map(|k| mean(&|at| texture.texels()[at][k], i));
    let texels = (0..sides[0] * sides[1]).map(texel).collect();
    let half = Texture::new(sides[0] as u32, sides[1] as u32, texels, texture.wrap())?;
    match texture.alpha() {
        Some(alpha) => half.with_alpha((0..sides[0] * sides[1]).map(|i| mean(&|at| alpha[at], i)).collect()),
        None => Ok(half),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use softras::{scene::Wrap, shapes};

    #[test]
    fn textures_are_halved_until_they_fit() {
        let texels = (0..15).map(|i| [i as f32, 1.0, 0.0]).collect();
        let texture = Texture::new(5, 3, texels, Wrap::Clamp).unwrap().with_alpha(vec![0.5; 15]).unwrap();
        let mesh = |texture: Texture| {
            let cube = shapes::icosphere(0).unwrap();
            let uv_triangles = vec![[0; 3]; cube.triangles().len()];
            let (uvs, textures, texture_of_triangle) = (vec![[0.0; 2]], vec![texture], Vec::new());
            cube.with_appearance(Appearance::Textured { uvs, uv_triangles, textures, texture_of_triangle }).unwrap()
        };
        assert_eq!(within(mesh(texture.clone()), 15).unwrap(), (mesh(texture.clone()), None));
        let (small, note) = within(mesh(texture), 14).unwrap();
        let Appearance::Textured { textures, .. } = small.appearance() else { unreachable!() };
        assert_eq!((textures[0].width(), textures[0].height(), textures[0].wrap()), (3, 2, Wrap::Clamp));
        assert_eq!((textures[0].texels()[0], textures[0].alpha().unwrap()[5]), ([3.0, 1.0, 0.0], 0.5));
        assert!(note.is_some_and(|note| note.contains("5×3 at 3×2")));
    }
}
