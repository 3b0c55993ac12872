//! An image texture, sampled bilinearly at UV coordinates.

use super::mesh::Mesh;
use crate::error::{Error, Result};
use std::sync::Arc;

/// What a texture shows at UV coordinates outside the unit square.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Wrap {
    /// The image repeats (the OBJ default).
    #[default]
    Repeat,
    /// The border texel continues.
    Clamp,
}

/// An RGB image of linear values: `texels[row][column]`, row 0 at the top (v = 1). Clones share their texels, so a
/// renderer recognises a texture that it has uploaded already by its address.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    width: u32,
    height: u32,
    texels: Arc<Vec<[f32; 3]>>,
    wrap: Wrap,
}

impl Texture {
    /// A texture from `width × height` RGB texels in row-major order, row 0 at the top.
    ///
    /// Texel (r, c) is centred at u = (c + ½) / width, v = 1 - (r + ½) / height, the convention of OBJ files.
    ///
    /// # Errors
    /// [`Error::Mesh`] when a side is 0, the count does not fit, or a texel is not finite or beyond
    /// ±[`Mesh::BRIGHTEST`].
    pub fn new(width: u32, height: u32, texels: Vec<[f32; 3]>, wrap: Wrap) -> Result<Self> {
        let expected = u64::from(width) * u64::from(height);
        if expected == 0 || texels.len() as u64 != expected {
            return Err(Error::Mesh {
                what: format!("{} texels for {width}×{height}", texels.len()),
                place: "texture".into(),
                fix: "give width × height texels, at least one".into(),
            });
        }
        if let Some(i) = texels.iter().position(|t| !t.iter().all(|x| x.abs() <= Mesh::BRIGHTEST)) {
            return Err(Error::Mesh {
                what: format!("texel {:?} is not within ±{:e}", texels[i], Mesh::BRIGHTEST),
                place: format!("texture row {}, column {}", i / width as usize, i % width as usize),
                fix: "use finite values that are no larger".into(),
            });
        }
        Ok(Self { width, height, texels: Arc::new(texels), wrap })
    }

    /// Width in texels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height in texels.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// The texels, row-major, row 0 at the top.
    pub fn texels(&self) -> &[[f32; 3]] {
        &self.texels
    }

    /// Whether both are clones of one texture and share its texels.
    pub(crate) fn shares_texels(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.texels, &other.texels)
    }

    /// What it shows outside the unit square.
    pub fn wrap(&self) -> Wrap {
        self.wrap
    }
}
