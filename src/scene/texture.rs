//! An image texture, sampled bilinearly at UV coordinates.

use crate::error::{Error, Result};
use std::sync::Arc;

/// The largest value of a colour, see [`Mesh::BRIGHTEST`](crate::Mesh::BRIGHTEST).
pub(super) const BRIGHTEST: f32 = 1e12;

/// How a texture goes on at UV coordinates outside the unit square.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Wrap {
    /// The image repeats (the OBJ default).
    #[default]
    Repeat,
    /// The border texel continues.
    Clamp,
}

/// An RGB image of linear values, on request with an alpha: `texels[row][column]`, row 0 at the top (v = 1). Clones share
/// their texels, so a renderer recognises a texture that it has uploaded already by its address.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    width: u32,
    height: u32,
    texels: Arc<Vec<[f32; 3]>>,
    /// One for each texel; `None` where all are 1.
    alpha: Option<Arc<Vec<f32>>>,
    wrap: Wrap,
}

impl Texture {
    /// A texture from `width × height` RGB texels in row-major order, row 0 at the top.
    ///
    /// Texel (r, c) is centred at u = (c + ½) / width, v = 1 - (r + ½) / height, the convention of OBJ files.
    ///
    /// # Errors
    /// [`Error::Mesh`] when a side is 0, the count does not fit, or a texel is not finite or beyond
    /// ±[`Mesh::BRIGHTEST`](crate::Mesh::BRIGHTEST).
    pub fn new(width: u32, height: u32, texels: Vec<[f32; 3]>, wrap: Wrap) -> Result<Self> {
        let expected = u64::from(width) * u64::from(height);
        if expected == 0 || texels.len() as u64 != expected {
            return Err(Error::Mesh {
                what: format!("{} texels for {width}×{height}", texels.len()),
                place: "texture".into(),
                fix: "give width × height texels, at least one".into(),
            });
        }
        if let Some(i) = texels.iter().position(|t| !t.iter().all(|x| x.abs() <= BRIGHTEST)) {
            return Err(Error::Mesh {
                what: format!("texel {:?} is not within ±{BRIGHTEST:e}", texels[i]),
                place: format!("texture row {}, column {}", i / width as usize, i % width as usize),
                fix: "use finite values that are no larger".into(),
            });
        }
        Ok(Self { width, height, texels: Arc::new(texels), alpha: None, wrap })
    }

    /// Gives the texture an alpha α in [0, 1] for each texel, row-major, row 0 at the top: how much of the surface there
    /// is. It is sampled as the colours are and multiplies a fragment's probability: D' = α D takes the place of D in the
    /// colour's weights and in the silhouette 1 - Π(1 - D'). The hard modes count a fragment where α ≥ ½.
    ///
    /// This is for cut-outs (leaves, fences, decals), whose α is near 0 or 1. It is not for glass: the softmax orders by
    /// depth, so a near surface of fractional α outweighs what lies behind it all the same, and shows as its own colour.
    ///
    /// If no texture of a frame has an α below 1, the frame costs nothing more and has no gradient by α: a texture
    /// whose α is 1 everywhere is opaque.
    ///
    /// # Errors
    /// [`Error::Mesh`] when the count does not fit, or a value is not within [0, 1].
    pub fn with_alpha(mut self, alpha: Vec<f32>) -> Result<Self> {
        if alpha.len() != self.texels.len() {
            return Err(Error::Mesh {
                what: format!("{} values of alpha for {}×{}", alpha.len(), self.width, self.height),
                place: "texture".into(),
                fix: "give one for each texel".into(),
            });
        }
        if let Some(i) = alpha.iter().position(|a| !(0.0..=1.0).contains(a)) {
            let (row, column) = (i / self.width as usize, i % self.width as usize);
            return Err(Error::Mesh {
                what: format!("alpha {} is not within [0, 1]", alpha[i]),
                place: format!("texture row {row}, column {column}"),
                fix: "clamp it".into(),
            });
        }
        self.alpha = alpha.iter().any(|a| *a < 1.0).then(|| Arc::new(alpha));
        Ok(self)
    }

    /// A texture in other colours, with this one's size, alpha and wrap.
    ///
    /// # Errors
    /// As [`Texture::new`].
    pub fn with_texels(&self, texels: Vec<[f32; 3]>) -> Result<Self> {
        Ok(Self { alpha: self.alpha.clone(), ..Self::new(self.width, self.height, texels, self.wrap)? })
    }

    /// The texture with another wrap. It shares its texels.
    pub fn with_wrap(self, wrap: Wrap) -> Self {
        Self { wrap, ..self }
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

    /// The alpha of each texel, row-major, row 0 at the top; `None` for an opaque texture.
    pub fn alpha(&self) -> Option<&[f32]> {
        self.alpha.as_ref().map(|alpha| &alpha[..])
    }

    /// Whether both are clones of one texture and share its texels and alpha.
    pub(crate) fn shares_texels(&self, other: &Self) -> bool {
        let same_alpha = match (&self.alpha, &other.alpha) {
            (Some(own), Some(others)) => Arc::ptr_eq(own, others),
            (None, None) => true,
            _ => false,
        };
        Arc::ptr_eq(&self.texels, &other.texels) && same_alpha
    }

    /// How it goes on outside the unit square.
    pub fn wrap(&self) -> Wrap {
        self.wrap
    }
}
