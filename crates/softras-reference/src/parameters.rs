//! Every number that an image can be differentiated by, in one flat vector.
//!
//! One layout holds the values that are rendered and the derivatives that are returned, so that a finite
//! difference changes one element.

use super::real::Real;
use super::tape::{self, Var};
use softras::scene::{Appearance, Camera, Projection, Scene, Settings};
use std::ops::Range;

/// Values, or derivatives, of all differentiable inputs of a frame.
///
/// Meshes, views, textures and lights count from 0 as in the scene; like a slice's, an index beyond them panics.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters {
    values: Vec<f64>,
    layout: Layout,
}

/// The gradient that the reference returns: one derivative per input.
pub type ReferenceGradients = Parameters;

/// The range of elements of each kind of input.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Layout {
    pub meshes: Vec<MeshSlots>,
    pub views: Vec<ViewSlots>,
    /// Ambient colour 3, ambient intensity 1, then per light direction 3, colour 3, intensity 1.
    pub lights: Range<usize>,
    /// Background 3, σ, γ, ε.
    pub settings: Range<usize>,
}

/// A mesh's elements; a range is empty where the mesh's appearance has no such input.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct MeshSlots {
    pub positions: Range<usize>,
    pub colors: Range<usize>,
    pub surface: Range<usize>,
    pub uvs: Range<usize>,
    pub textures: Vec<Range<usize>>,
    /// One range for each texture; empty for an opaque one.
    pub alphas: Vec<Range<usize>>,
}

/// A camera's elements.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ViewSlots {
    pub twist: Range<usize>,
    pub projection: Range<usize>,
}

/// Appends inputs to the vector and returns their ranges.
struct Builder(Vec<f64>);

impl Builder {
    fn put(&mut self, values: impl IntoIterator<Item = f64>) -> Range<usize> {
        let start = self.0.len();
        self.0.extend(values);
        start..self.0.len()
    }

    fn put_rows<const N: usize>(&mut self, rows: &[[f32; N]]) -> Range<usize> {
        self.put(rows.iter().flatten().map(|&x| f64::from(x)))
    }
}

impl Parameters {
    /// The values that a scene has.
    pub fn new(scene: &Scene, cameras: &[Camera], settings: &Settings) -> Self {
        let mut builder = Builder(Vec::new());
        let meshes = scene.meshes.iter().map(|mesh| {
            let mut slots = MeshSlots {
                positions: builder.put_rows(mesh.positions()),
                colors: 0..0,
                surface: 0..0,
                uvs: 0..0,
                textures: Vec::new(),
                alphas: Vec::new(),
            };
            match mesh.appearance() {
                Appearance::Uniform(color) => slots.colors = builder.put_rows(&[*color]),
                Appearance::VertexColors(colors) => slots.colors = builder.put_rows(colors),
                Appearance::Surface { texels, .. } => slots.surface = builder.put_rows(texels),
                Appearance::Textured { uvs, textures, .. } => {
                    slots.uvs = builder.put_rows(uvs);
                    slots.textures = textures.iter().map(|t| builder.put_rows(t.texels())).collect();
                    let alphas = textures.iter().map(|t| t.alpha().unwrap_or_default());
                    slots.alphas = alphas.map(|alpha| builder.put(alpha.iter().map(|&a| a.into()))).collect();
                }
            }
            slots
        });
        let meshes = meshes.collect();
        let views = cameras.iter().map(|camera| ViewSlots {
            twist: builder.put([0.0; 6]),
            projection: match *camera.projection() {
                Projection::Perspective { fov_y } => builder.put([fov_y]),
                Projection::Orthographic { half_height } => builder.put([half_height]),
                Projection::Pinhole { fx, fy, cx, cy } => builder.put([fx, fy, cx, cy]),
                Projection::Official { .. } | Projection::Screen => builder.put([]),
            },
        });
        let views = views.collect();
        let lights = &scene.lights;
        let directional = lights.directional.iter().flat_map(|l| {
            let ([x, y, z], [r, g, b]) = (l.direction, l.color);
            [x, y, z, r, g, b, l.intensity]
        });
        let ambient = lights.ambient_color.into_iter().chain([lights.ambient_intensity]);
        let lights = builder.put(ambient.chain(directional));
        let knobs = [settings.sigma, settings.gamma, settings.epsilon];
        let settings = builder.put(settings.background_color.into_iter().chain(knobs));
        Self { values: builder.0, layout: Layout { meshes, views, lights, settings } }
    }

    /// Parameters of this layout, every value 0.
    pub(super) fn zeros_like(&self) -> Self {
        Self { values: vec![0.0; self.values.len()], layout: self.layout.clone() }
    }

    /// Whether both are laid out for the same scene.
    pub(super) fn fits(&self, other: &Self) -> bool {
        self.layout == other.layout
    }

    pub(super) fn layout(&self) -> &Layout {
        &self.layout
    }

    /// All values, in the order: meshes, views, lights, background, σ, γ, ε.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// All values, mutable, in the same order.
    pub fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// `[V, 3]` vertex positions of a mesh.
    pub fn positions(&self, mesh: usize) -> &[f64] {
        &self.values[self.layout.meshes[mesh].positions.clone()]
    }

    /// `[V, 3]` vertex colours, or `[1, 3]` the uniform colour; empty for other appearances.
    pub fn colors(&self, mesh: usize) -> &[f64] {
        &self.values[self.layout.meshes[mesh].colors.clone()]
    }

    /// `[T · R², 3]` surface texels; empty for other appearances.
    pub fn surface_texels(&self, mesh: usize) -> &[f64] {
        &self.values[self.layout.meshes[mesh].surface.clone()]
    }

    /// `[UVs, 2]`; empty for other appearances.
    pub fn uvs(&self, mesh: usize) -> &[f64] {
        &self.values[self.layout.meshes[mesh].uvs.clone()]
    }

    /// `[height, width, 3]` texels of a mesh's image texture.
    pub fn texture_texels(&self, mesh: usize, texture: usize) -> &[f64] {
        &self.values[self.layout.meshes[mesh].textures[texture].clone()]
    }

    /// `[height, width]` alpha of a mesh's image texture; empty for an opaque one.
    pub fn texture_alpha(&self, mesh: usize, texture: usize) -> &[f64] {
        &self.values[self.layout.meshes[mesh].alphas[texture].clone()]
    }

    /// ξ = (v, ω) of a view: its view transform V is replaced by exp(ξ) V, so p becomes p + ω × p + v to first order.
    pub fn twist(&self, view: usize) -> &[f64] {
        &self.values[self.layout.views[view].twist.clone()]
    }

    /// A view's `[fov_y]`, `[half_height]` or `[fx, fy, cx, cy]`; empty for other projections.
    pub fn projection(&self, view: usize) -> &[f64] {
        &self.values[self.layout.views[view].projection.clone()]
    }

    /// `[3]` ambient colour.
    pub fn ambient_color(&self) -> &[f64] {
        &self.light_values()[..3]
    }

    /// Ambient intensity.
    pub fn ambient_intensity(&self) -> f64 {
        self.light_values()[3]
    }

    /// `[3]` direction of a directional light.
    pub fn light_direction(&self, light: usize) -> &[f64] {
        &self.light_values()[4 + 7 * light..][..3]
    }

    /// `[3]` colour of a directional light.
    pub fn light_color(&self, light: usize) -> &[f64] {
        &self.light_values()[7 + 7 * light..][..3]
    }

    /// Intensity of a directional light.
    pub fn light_intensity(&self, light: usize) -> f64 {
        self.light_values()[10 + 7 * light]
    }

    fn light_values(&self) -> &[f64] {
        &self.values[self.layout.lights.clone()]
    }

    /// `[3]` background colour.
    pub fn background(&self) -> &[f64] {
        &self.values[self.layout.settings.clone()][..3]
    }

    /// σ.
    pub fn sigma(&self) -> f64 {
        self.values[self.layout.settings.start + 3]
    }

    /// γ.
    pub fn gamma(&self) -> f64 {
        self.values[self.layout.settings.start + 4]
    }

    /// ε.
    pub fn epsilon(&self) -> f64 {
        self.values[self.layout.settings.start + 5]
    }
}

/// Where the code that is generic over [`Real`] reads its inputs from.
pub trait Source {
    /// The number type that it computes with.
    type R: Real;

    /// The input at this index of the parameters.
    fn load(&self, slot: usize) -> Self::R;

    /// `N` inputs from this index on.
    fn row<const N: usize>(&self, start: usize) -> [Self::R; N] {
        std::array::from_fn(|k| self.load(start + k))
    }
}

/// Plain values.
#[derive(Clone, Copy)]
pub struct Values<'a>(pub &'a [f64]);

impl Source for Values<'_> {
    type R = f64;
    fn load(&self, slot: usize) -> f64 {
        self.0[slot]
    }
}

/// Leaves on this thread's tape.
#[derive(Clone, Copy)]
pub struct Leaves<'a>(pub &'a [f64]);

impl Source for Leaves<'_> {
    type R = Var;
    fn load(&self, slot: usize) -> Var {
        tape::leaf(self.0[slot], slot)
    }
}
