//! The input of the writers: a mesh, and what a file may say beside it.

use crate::{Curve, Loaded, SaveOptions, coincident::face_away};
use softras::{
    Mesh, Result,
    scene::{Appearance, Texture},
};
use std::{borrow::Cow, path::Path};

/// The note on colours that bytes do not hold.
const CUT_OFF: &str = "colours below 0 or above 1 are cut off";
/// How far from a whole number a byte may be before its rounding is noted.
const ROUNDED: f64 = 0.02;

/// A mesh as it is written, its textures encoded as picture files have them.
pub struct Written<'a> {
    pub mesh: Mesh,
    /// The normals of each triangle's corners, 0 for none; empty for a mesh without.
    pub normals: Cow<'a, [[[f32; 3]; 3]]>,
    /// One for each triangle; empty where all are 1.
    pub opacity: &'a [f32],
    /// Whether each triangle is seen from its front alone; empty where none is.
    pub single_sided: &'a [bool],
    pub unlit: bool,
    pub curve: Curve,
    pub origin: [f64; 3],
    /// Notes on what the format does not hold.
    pub notes: Vec<String>,
}

impl<'a> Written<'a> {
    /// A mesh alone.
    ///
    /// # Errors
    /// A lack of memory.
    pub fn new(mesh: &Mesh, options: &SaveOptions) -> Result<Self> {
        let (curve, notes) = (if options.srgb { Curve::Srgb } else { Curve::Raw }, Vec::new());
        let own = mesh.normals();
        let corners = |triangle: &[u32; 3]| triangle.map(|corner| own[corner as usize]);
        let normals = if own.is_empty() { Vec::new() } else { mesh.triangles().iter().map(corners).collect() };
        let mut written = Self {
            mesh: mesh.clone(),
            normals: normals.into(),
            opacity: &[],
            single_sided: &[],
            unlit: false,
            curve,
            origin: options.origin,
            notes,
        };
        if options.srgb {
            written.encode()?;
        }
        Ok(written)
    }

    /// All that was read of a file.
    ///
    /// # Errors
    /// A lack of memory.
    pub fn of(loaded: &'a Loaded) -> Result<Self> {
        let written = Self::new(&loaded.mesh, &SaveOptions { srgb: true, origin: loaded.origin })?;
        let normals = if loaded.normals.is_empty() { written.normals } else { loaded.normals.as_slice().into() };
        let (opacity, single_sided) = (&loaded.opacity, &loaded.single_sided);
        Ok(Self { normals, opacity, single_sided, unlit: loaded.unlit, ..written })
    }

    /// Encodes textures in sRGB and 256 steps: the inverse of reading them as linear light.
    fn encode(&mut self) -> Result<()> {
        let Appearance::Textured { uvs, uv_triangles, textures, texture_of_triangle } = self.mesh.appearance() else {
            return Ok(());
        };
        let (mut is_rounded, mut is_cut) = (false, false);
        let mut byte = |x: f32| {
            let byte = Curve::Srgb.encode(x.into()) * 255.0;
            is_rounded |= (byte - byte.round()).abs() > ROUNDED;
            is_cut |= !(0.0..=1.0).contains(&x);
            (byte.round() / 255.0) as f32
        };
        let mut one = |t: &Texture| t.with_texels(t.texels().iter().map(|texel| texel.map(&mut byte)).collect());
        let appearance = Appearance::Textured {
            uvs: uvs.clone(),
            uv_triangles: uv_triangles.clone(),
            textures: textures.iter().map(&mut one).collect::<Result<_>>()?,
            texture_of_triangle: texture_of_triangle.clone(),
        };
        let mesh = self.mesh.clone().with_appearance(appearance)?;
        self.mesh = mesh;
        if is_rounded {
            self.notes.push("textures are rounded to 256 steps from 0 to 1".into());
        }
        if is_cut {
            self.notes.push(CUT_OFF.into());
        }
        Ok(())
    }

    /// A colour in bytes.
    pub fn bytes(&mut self, color: [f32; 3]) -> [u8; 3] {
        color.map(|x| {
            let byte = self.curve.encode(x.into()) * 255.0;
            if (byte - byte.round()).abs() > ROUNDED {
                self.lose("colours are rounded to 256 steps from 0 to 1");
            }
            if !(0.0..=1.0).contains(&x) {
                self.lose(CUT_OFF);
            }
            byte.round() as u8
        })
    }

    /// Notes, once, what the format does not hold.
    pub fn lose(&mut self, what: &str) {
        if !self.notes.iter().any(|note| note == what) {
            self.notes.push(what.into());
        }
    }

    /// Notes what formats without materials of their own, as OBJ and PLY, do not say of light and sides.
    ///
    /// # Errors
    /// [`softras::Error::OutOfMemory`].
    pub fn lose_light_and_sides(&mut self, path: &Path) -> Result<()> {
        if self.unlit {
            self.lose("that light does not shade it is not kept: --unlit draws it so");
        }
        if self.single_sided.is_empty() {
            return Ok(());
        }
        // A reader finds again those that lie on others.
        let mut kept = Vec::new();
        face_away(path, &self.mesh, &mut kept)?;
        let is_kept = |(t, single): (usize, &bool)| !single || kept.get(t) == Some(&true);
        if !self.single_sided.iter().enumerate().all(is_kept) {
            self.lose("that triangles are seen from their front alone is not kept: --faces front draws them so");
        }
        Ok(())
    }

    /// The colour of a triangle that has one for itself, or for all; white for another one.
    pub fn color_of(&self, t: usize) -> [f32; 3] {
        match self.mesh.appearance() {
            Appearance::Uniform(color) => *color,
            Appearance::Surface { texels, .. } => texels[t],
            Appearance::VertexColors(_) | Appearance::Textured { .. } => [1.0; 3],
        }
    }

    /// The number of a triangle's texture.
    pub fn texture_of(&self, t: usize) -> Option<usize> {
        let Appearance::Textured { texture_of_triangle, .. } = self.mesh.appearance() else { return None };
        Some(texture_of_triangle.get(t).copied().unwrap_or_default() as usize)
    }

    pub fn opacity_of(&self, t: usize) -> f32 {
        self.opacity.get(t).copied().unwrap_or(1.0)
    }

    /// Notes that a triangle keeps all its normals or none.
    pub fn lose_single_normals(&mut self) {
        let lacks = |normals: &&[[f32; 3]; 3]| normals.contains(&[0.0; 3]) && **normals != [[0.0; 3]; 3];
        let count = self.normals.iter().filter(lacks).count();
        if count > 0 {
            self.lose(&format!("{count} triangles lose normals that not all of their corners have"));
        }
    }

    /// The normals of a triangle whose corners all have one.
    pub fn normals_of(&self, t: usize) -> Option<[[f32; 3]; 3]> {
        self.normals.get(t).copied().filter(|normals| !normals.contains(&[0.0; 3]))
    }
}
