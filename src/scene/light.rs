//! Ambient and directional lights, as the official renderer has them.

use crate::error::{Error, Result, shown};

/// A light infinitely far away, which adds `intensity · color · max(0, n · direction)` at a point with unit normal n.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectionalLight {
    /// From the surface towards the light, world space; normalised on use.
    pub direction: [f64; 3],
    /// RGB.
    pub color: [f64; 3],
    /// Factor on the colour.
    pub intensity: f64,
}

/// Where normals, and so the light, are computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shading {
    /// One normal per triangle (the official "surface" light mode).
    #[default]
    Flat,
    /// One normal per vertex, the mesh's own ([`Mesh::with_normals`](crate::Mesh::with_normals)) or the area-weighted mean of
    /// its triangles' (the official "vertex" mode); the light is computed at the vertices and interpolated over the triangle.
    Smooth,
}

/// The lights of a scene. A point's colour is multiplied by the light at its normal: ambient plus all directional.
#[derive(Clone, Debug, PartialEq)]
pub struct Lights {
    /// RGB of the ambient light.
    pub ambient_color: [f64; 3],
    /// Factor on the ambient colour.
    pub ambient_intensity: f64,
    /// Any number of directional lights, at most [`Lights::MAX_DIRECTIONAL`].
    pub directional: Vec<DirectionalLight>,
    /// Flat or smooth; also chooses the normals of the normal image.
    pub shading: Shading,
}

impl Lights {
    /// The most directional lights a scene may have.
    pub const MAX_DIRECTIONAL: usize = 64;

    /// White ambient light of intensity 1 alone, under which colours stay as they are.
    pub fn unlit() -> Self {
        Self { ambient_color: [1.0; 3], ambient_intensity: 1.0, directional: Vec::new(), shading: Shading::Flat }
    }

    /// The official renderer's default: ambient 0.5 and a directional light of 0.5 from straight above.
    pub fn official() -> Self {
        Self {
            ambient_color: [1.0; 3],
            ambient_intensity: 0.5,
            directional: vec![DirectionalLight { direction: [0.0, 1.0, 0.0], color: [1.0; 3], intensity: 0.5 }],
            shading: Shading::Flat,
        }
    }

    /// Whether the light is exactly 1 everywhere, so that no normal is needed.
    pub fn is_unlit(&self) -> bool {
        self.directional.is_empty() && self.ambient_color.iter().all(|c| c * self.ambient_intensity == 1.0)
    }

    /// Checks every field.
    ///
    /// # Errors
    /// [`Error::Light`] for a value that is not finite, a direction of length 0, or too many lights.
    pub fn validate(&self) -> Result<()> {
        let bad = |field: String, value: String, fix: &str| Err(Error::Light { field, value, fix: fix.into() });
        if self.directional.len() > Self::MAX_DIRECTIONAL {
            let n = self.directional.len().to_string();
            return bad("directional.len()".into(), n, "at most 64 directional lights are supported");
        }
        let rgb = |c: &[f64; 3]| c.iter().all(|x| x.abs() <= 1e6);
        let within = |x: f64| x.abs() <= 1e6;
        let fix = "use values within ±1e6";
        if !rgb(&self.ambient_color) {
            return bad("ambient_color".into(), format!("{:?}", self.ambient_color), fix);
        }
        if !within(self.ambient_intensity) {
            return bad("ambient_intensity".into(), shown(self.ambient_intensity), fix);
        }
        for (i, light) in self.directional.iter().enumerate() {
            if !rgb(&light.color) {
                return bad(format!("directional[{i}].color"), format!("{:?}", light.color), fix);
            }
            if !within(light.intensity) {
                return bad(format!("directional[{i}].intensity"), shown(light.intensity), fix);
            }
            let length = glam::DVec3::from(light.direction).length();
            if !(1e-12..=1e12).contains(&length) {
                let value = format!("{:?}", light.direction);
                return bad(format!("directional[{i}].direction"), value, "use a direction of finite length above 0");
            }
        }
        Ok(())
    }
}

impl Default for Lights {
    fn default() -> Self {
        Self::unlit()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_light_that_is_one_everywhere_is_none() {
        let ambient = |color: [f64; 3], ambient_intensity: f64| Lights {
            ambient_color: color,
            ambient_intensity,
            ..Lights::default()
        };
        assert!(Lights::unlit().is_unlit() && ambient([0.5; 3], 2.0).is_unlit());
        assert!(!ambient([1.0, 1.0, 0.9], 1.0).is_unlit() && !ambient([0.5; 3], 1.5).is_unlit());
        let official = Lights::official();
        assert_eq!((official.ambient_intensity, official.directional[0].intensity), (0.5, 0.5));
        assert!(!official.is_unlit() && !Lights { directional: official.directional, ..Lights::unlit() }.is_unlit());
    }
}
