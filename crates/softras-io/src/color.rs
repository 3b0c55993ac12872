//! Conversion between the renderer's numbers and the bytes of picture files.

use softras::{
    Mesh, Result,
    scene::{Appearance, Texture},
};

/// The curve by which numbers are encoded as bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Curve {
    /// Numbers are linear light, bytes sRGB (IEC 61966-2-1).
    Srgb,
    /// A byte is 255 times the number, as the official renderer reads and writes them.
    Raw,
}

impl Curve {
    /// The byte, as a number from 0 to 1, that shows a value.
    pub fn encode(self, value: f64) -> f64 {
        let x = value.clamp(0.0, 1.0);
        match self {
            Self::Raw => x,
            Self::Srgb if x <= 0.003_130_8 => 12.92 * x,
            Self::Srgb => 1.055 * x.powf(1.0 / 2.4) - 0.055,
        }
    }

    /// The value that a byte, as a number from 0 to 1, shows.
    pub fn decode(self, byte: f64) -> f64 {
        let x = byte.clamp(0.0, 1.0);
        match self {
            Self::Raw => x,
            Self::Srgb if x <= 0.040_45 => x / 12.92,
            Self::Srgb => ((x + 0.055) / 1.055).powf(2.4),
        }
    }
}

/// The mesh with its textures encoded as in picture files, in sRGB and 256 steps: the inverse of reading them as linear
/// light.
pub(crate) fn encoded(mesh: &Mesh) -> Result<Mesh> {
    let Appearance::Textured { uvs, uv_triangles, textures, texture_of_triangle } = mesh.appearance() else {
        return Ok(mesh.clone());
    };
    let byte = |x: f32| ((Curve::Srgb.encode(f64::from(x)) * 255.0).round() / 255.0) as f32;
    let one = |t: &Texture| t.with_texels(t.texels().iter().map(|texel| texel.map(byte)).collect());
    mesh.clone().with_appearance(Appearance::Textured {
        uvs: uvs.clone(),
        uv_triangles: uv_triangles.clone(),
        textures: textures.iter().map(one).collect::<Result<_>>()?,
        texture_of_triangle: texture_of_triangle.clone(),
    })
}
