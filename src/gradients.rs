//! The inputs and outputs of the backward pass: upstream gradients, what to differentiate by, and the gradients.

use crate::error::{Error, Result};
use crate::image::Image;
use crate::scene::{Outputs, first_not_finite};

/// The upstream gradient: the derivative dL/dimage of a loss L by the values of a frame's images, computed by the
/// caller. Each has the shape of the image itself; an image that the loss does not use is `None`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImageGradient {
    /// `[batch, height, width, 3]`.
    pub color: Option<Image>,
    /// `[batch, height, width, 1]`.
    pub silhouette: Option<Image>,
    /// `[batch, height, width, 1]`, loss per world unit of depth.
    pub depth: Option<Image>,
    /// `[batch, height, width, 3]`.
    pub normal: Option<Image>,
    /// `[batch, height, width, channels]`.
    pub features: Option<Image>,
}

impl ImageGradient {
    /// The gradient of a loss of the colour alone.
    pub fn color(image: Image) -> Self {
        Self { color: Some(image), ..Self::default() }
    }

    /// The gradient of a loss of the silhouette alone.
    pub fn silhouette(image: Image) -> Self {
        Self { silhouette: Some(image), ..Self::default() }
    }

    /// The images that have an upstream gradient.
    pub fn outputs(&self) -> Outputs {
        Outputs {
            color: self.color.is_some(),
            silhouette: self.silhouette.is_some(),
            depth: self.depth.is_some(),
            normal: self.normal.is_some(),
            features: self.features.is_some(),
        }
    }

    /// Checks that every upstream gradient is finite, has the frame's shape, and belongs to an image that was rendered. `channels`
    /// are the features of each vertex.
    ///
    /// # Errors
    /// [`Error::Backward`] naming the image.
    pub fn validate(
        &self,
        rendered: Outputs,
        batch: usize,
        height: usize,
        width: usize,
        channels: usize,
    ) -> Result<()> {
        let images = [
            ("color", &self.color, rendered.color, 3),
            ("silhouette", &self.silhouette, rendered.silhouette, 1),
            ("depth", &self.depth, rendered.depth, 1),
            ("normal", &self.normal, rendered.normal, 3),
            ("features", &self.features, rendered.features, channels),
        ];
        let bad = |what: String, fix: &str| Err(Error::Backward { what, fix: fix.into() });
        if images.iter().all(|(_, image, ..)| image.is_none()) {
            return bad("no image has an upstream gradient".into(), "give dL/dimage of at least one rendered image");
        }
        for (name, image, was_rendered, channels) in images {
            let Some(image) = image else { continue };
            if !was_rendered {
                return bad(format!("the frame has no {name} image"), "ask for it in Settings::outputs");
            }
            let shape = [image.batch, image.height, image.width, image.channels];
            let expected = [batch, height, width, channels];
            if shape != expected || !image.is_whole() {
                let what = format!("the {name} gradient has shape {shape:?}, the image {expected:?}");
                return bad(what, "give one value for each of the image's");
            }
            if let Some(i) = first_not_finite(&image.data) {
                let what = format!("the {name} gradient is {} at value {i}", image.data[i]);
                return bad(what, "every value must be a finite number");
            }
        }
        Ok(())
    }
}

/// The paths that the gradient of a fragment, a (pixel, triangle) pair, takes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum GradientMode {
    /// Everything: the derivative of the image as it is rendered.
    #[default]
    Exact,
    /// Eq. 4 of the paper alone, as in the official code: the clipped barycentrics are constants of the pixel, so that
    /// colour, depth and normal depend on the vertices only through the coverage D, the depth z and the corners' own
    /// values. Under [`crate::scene::Parity::Official`] fragments outside [near, far] get none from the silhouette that
    /// counts them. Unlike that code, this mode does not damp the silhouette's gradient where 1 - D < 1e-6.
    Paper,
}

/// The inputs to differentiate by. A gradient that is not asked for is not computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GradientRequest {
    /// Vertex positions.
    pub positions: bool,
    /// Vertex colours, or a mesh's one colour.
    pub colors: bool,
    /// The features of the vertices.
    pub features: bool,
    /// Texels of surface cells and of image textures, and the textures' alpha.
    pub texels: bool,
    /// Texture coordinates.
    pub uvs: bool,
    /// The view transform and the projection's parameters.
    pub camera: bool,
    /// Ambient and directional lights.
    pub lights: bool,
    /// The background's colour and its softmax score ε.
    pub background: bool,
    /// σ and γ.
    pub scalars: bool,
    /// The exact derivative, or that of the paper's eq. 4 alone.
    pub mode: GradientMode,
}

impl GradientRequest {
    /// Nothing: the base to switch single inputs on from.
    pub const NOTHING: Self = Self {
        positions: false,
        colors: false,
        features: false,
        texels: false,
        uvs: false,
        camera: false,
        lights: false,
        background: false,
        scalars: false,
        mode: GradientMode::Exact,
    };

    /// All inputs.
    pub const ALL: Self = Self {
        positions: true,
        colors: true,
        features: true,
        texels: true,
        uvs: true,
        camera: true,
        lights: true,
        background: true,
        scalars: true,
        mode: GradientMode::Exact,
    };
}

impl Default for GradientRequest {
    /// The exact gradient by vertex positions.
    fn default() -> Self {
        Self { positions: true, ..Self::NOTHING }
    }
}

/// The gradient of the loss L by the arrays of one mesh, summed over all views of it. An array is empty where it was
/// not asked for or the mesh's appearance does not have it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshGradients {
    /// By each vertex's `[x, y, z]`: loss per world unit (per screen unit under [`crate::Projection::Screen`]).
    pub positions: Vec<[f32; 3]>,
    /// By each vertex's colour; one entry for a mesh of one colour.
    pub colors: Vec<[f32; 3]>,
    /// By each vertex's features, one vertex after the other.
    pub features: Vec<f32>,
    /// By each surface texel, in the appearance's order.
    pub surface_texels: Vec<[f32; 3]>,
    /// By each texture's texels, row 0 at the top.
    pub texture_texels: Vec<Vec<[f32; 3]>>,
    /// By each texture's alpha, row 0 at the top; empty for an opaque texture. The part that comes through the colours is
    /// (w/α) (v - V) with w/α limited to 256: without the limit a texel of alpha 0 before a surface would overflow.
    pub texture_alphas: Vec<Vec<f32>>,
    /// By each UV pair.
    pub uvs: Vec<[f32; 2]>,
}

/// The gradient of L by one view's camera.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CameraGradient {
    /// By ξ = (v, ω) where the view transform V becomes exp(ξ) V: view-space points move by ω × p + v. Loss per world
    /// unit, and per radian. Zero under [`crate::Projection::Screen`].
    pub twist: [f64; 6],
    /// By the projection's parameters in the order of its fields: fov_y (per radian); half_height; fx, fy, cx, cy (per
    /// pixel); empty (zeros) for the others.
    pub projection: [f64; 4],
}

/// The gradient of L by the lights.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LightGradients {
    /// By the ambient colour.
    pub ambient_color: [f64; 3],
    /// By the ambient intensity.
    pub ambient_intensity: f64,
    /// By each directional light: direction (as given, not normalised), colour, intensity.
    pub directional: Vec<([f64; 3], [f64; 3], f64)>,
}

/// The gradients that the backward pass computed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Gradients {
    /// One for each mesh of the scene.
    pub meshes: Vec<MeshGradients>,
    /// One for each camera; empty unless asked for.
    pub cameras: Vec<CameraGradient>,
    /// `None` unless asked for.
    pub lights: Option<LightGradients>,
    /// By the background colour; zero unless asked for.
    pub background_color: [f64; 3],
    /// By ε; zero unless asked for.
    pub epsilon: f64,
    /// By σ (per screen unit²); zero unless asked for.
    pub sigma: f64,
    /// By γ; zero unless asked for.
    pub gamma: f64,
}

impl Gradients {
    /// The name of the first field that holds a value that is not finite.
    pub(crate) fn not_finite(&self) -> Option<&'static str> {
        let rows = |rows: &[[f32; 3]]| first_not_finite(rows.as_flattened()).is_none();
        let doubles = |values: &[f64]| values.iter().all(|x| x.is_finite());
        for mesh in &self.meshes {
            let fields = [
                ("positions", rows(&mesh.positions)),
                ("colors", rows(&mesh.colors)),
                ("features", first_not_finite(&mesh.features).is_none()),
                ("surface_texels", rows(&mesh.surface_texels)),
                ("texture_texels", mesh.texture_texels.iter().all(|texels| rows(texels))),
                ("texture_alphas", mesh.texture_alphas.iter().all(|alpha| first_not_finite(alpha).is_none())),
                ("uvs", first_not_finite(mesh.uvs.as_flattened()).is_none()),
            ];
            if let Some((name, _)) = fields.into_iter().find(|(_, finite)| !finite) {
                return Some(name);
            }
        }
        let lights = self.lights.iter().all(|lights| {
            let mut directional = lights.directional.iter();
            doubles(&lights.ambient_color)
                && lights.ambient_intensity.is_finite()
                && directional.all(|(way, color, intensity)| doubles(way) && doubles(color) && intensity.is_finite())
        });
        let fields = [
            ("cameras", self.cameras.iter().all(|c| doubles(&c.twist) && doubles(&c.projection))),
            ("lights", lights),
            ("background_color", doubles(&self.background_color)),
            ("epsilon, sigma or gamma", doubles(&[self.epsilon, self.sigma, self.gamma])),
        ];
        fields.into_iter().find(|(_, finite)| !finite).map(|(name, _)| name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_finite_is_named() {
        let mesh = MeshGradients { positions: vec![[0.0; 3]; 2], uvs: vec![[0.5; 2]], ..MeshGradients::default() };
        let good = Gradients { meshes: vec![mesh], cameras: vec![CameraGradient::default()], ..Gradients::default() };
        assert_eq!(good.not_finite(), None);
        let mut bad = good.clone();
        bad.meshes[0].positions[1][2] = f32::NAN;
        assert_eq!(bad.not_finite(), Some("positions"));
        let mut bad = good.clone();
        bad.cameras[0].twist[4] = f64::INFINITY;
        assert_eq!(bad.not_finite(), Some("cameras"));
        let light = |way: f64, color: f64, intensity: f64, ambient: f64, ambient_intensity: f64| LightGradients {
            ambient_color: [0.0, ambient, 0.0],
            ambient_intensity,
            directional: vec![([0.0; 3], [0.0; 3], 0.0), ([way, 0.0, 0.0], [0.0, 0.0, color], intensity)],
        };
        for i in 0..5 {
            let at = |k: usize| if k == i { f64::NAN } else { 0.5 };
            let bad = Gradients { lights: Some(light(at(0), at(1), at(2), at(3), at(4))), ..good.clone() };
            assert_eq!(bad.not_finite(), Some("lights"), "{i}");
        }
        assert_eq!(Gradients { lights: Some(light(0.5, 0.5, 0.5, 0.5, 0.5)), ..good.clone() }.not_finite(), None);
        let bad = Gradients { gamma: f64::NAN, ..good };
        assert_eq!(bad.not_finite(), Some("epsilon, sigma or gamma"));
    }
}
