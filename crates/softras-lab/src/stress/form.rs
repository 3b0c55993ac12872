//! The combinations of modes that cases are drawn from. There are few, because each one needs kernels of its own.

use crate::random::Random;
use softras::scene::{
    Appearance, Background, ColorAggregation, DirectionalLight, Distance, Faces, Interpolation, Lights, Mesh, Outputs,
    Parity, Settings, Shading, SilhouetteAggregation, Support, SurfacePoint, Texture, Wrap,
};
use softras::{GradientMode, Result};

const USUAL: Outputs = Outputs { color: true, silhouette: true, depth: false, normal: false };
const SILHOUETTE: Outputs = Outputs::SILHOUETTE;

/// The kind of appearance of a form's meshes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Look {
    Uniform,
    Vertices,
    Surface,
    Images,
}

/// One combination of modes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Form {
    look: Look,
    lit: Option<Shading>,
    pub gradient: GradientMode,
    outputs: Outputs,
    color: ColorAggregation,
    silhouette: SilhouetteAggregation,
    distance: Distance,
    background: Background,
    faces: Faces,
    interpolation: Interpolation,
    parity: Parity,
    surface_point: SurfacePoint,
    pub support: Support,
}

const PAPER: Form = Form {
    look: Look::Vertices,
    lit: None,
    gradient: GradientMode::Exact,
    outputs: USUAL,
    color: ColorAggregation::Softmax,
    silhouette: SilhouetteAggregation::Product,
    distance: Distance::Euclidean,
    background: Background::Weighted,
    faces: Faces::Both,
    interpolation: Interpolation::Affine,
    parity: Parity::Model,
    surface_point: SurfacePoint::Nearest,
    support: Support::Probability,
};

/// The number of combinations.
pub const FORMS: usize = 10;

/// All combinations, from the most to the least used.
pub(super) const TABLE: [Form; FORMS] = [
    PAPER,
    Form {
        look: Look::Uniform,
        lit: Some(Shading::Flat),
        outputs: Outputs::ALL,
        background: Background::Composite,
        ..PAPER
    },
    Form { look: Look::Uniform, outputs: SILHOUETTE, ..PAPER },
    Form {
        look: Look::Images,
        surface_point: SurfacePoint::Clip,
        lit: Some(Shading::Smooth),
        outputs: Outputs::ALL,
        interpolation: Interpolation::Perspective,
        ..PAPER
    },
    Form { look: Look::Surface, color: ColorAggregation::Hard, faces: Faces::Front, outputs: Outputs::ALL, ..PAPER },
    Form { distance: Distance::Barycentric, silhouette: SilhouetteAggregation::Sum, outputs: Outputs::ALL, ..PAPER },
    Form { distance: Distance::Hard, silhouette: SilhouetteAggregation::Hard, ..PAPER },
    Form {
        look: Look::Surface,
        parity: Parity::Official,
        surface_point: SurfacePoint::Clip,
        gradient: GradientMode::Paper,
        ..PAPER
    },
    Form {
        background: Background::Composite,
        support: Support::Guaranteed,
        surface_point: SurfacePoint::Clip,
        outputs: Outputs::ALL,
        ..PAPER
    },
    Form { parity: Parity::Official, distance: Distance::Barycentric, gradient: GradientMode::Paper, ..PAPER },
];

impl Form {
    /// The settings with this form's modes.
    pub fn settings(&self, numbers: Settings) -> Settings {
        Settings {
            outputs: self.outputs,
            color: self.color,
            silhouette: self.silhouette,
            distance: self.distance,
            background: self.background,
            faces: self.faces,
            interpolation: self.interpolation,
            parity: self.parity,
            surface_point: self.surface_point,
            support: self.support,
            save: true,
            ..numbers
        }
    }

    /// Whether the reference's margin covers all discontinuities of the model. It does not cover, for example, a triangle
    /// that turns its back to the camera.
    pub fn is_smooth(&self) -> bool {
        self.faces == Faces::Both && self.distance == Distance::Euclidean && self.parity == Parity::Model
    }

    /// The mesh with its colours, each channel within [0, `brightest`], and UVs of at most `farthest`.
    pub fn appearance(&self, random: &mut Random, mesh: Mesh, brightest: f32, farthest: f64) -> Result<Mesh> {
        let (vertices, triangles) = (mesh.positions().len(), mesh.triangles().len());
        let mut color = |random: &mut Random| random.color().map(|c| c * brightest);
        let appearance = match self.look {
            Look::Uniform => Appearance::Uniform(color(random)),
            Look::Vertices => Appearance::VertexColors((0..vertices).map(|_| color(random)).collect()),
            Look::Surface => {
                let resolution = random.choose(&[1u32, 3, 5]);
                let cells = triangles * (resolution * resolution) as usize;
                Appearance::Surface { resolution, texels: (0..cells).map(|_| color(random)).collect() }
            }
            Look::Images => images(random, triangles, farthest, &mut color)?,
        };
        mesh.with_appearance(appearance)
    }

    /// Draws the lights of the form.
    pub fn lights(&self, random: &mut Random) -> Lights {
        let Some(shading) = self.lit else { return Lights::unlit() };
        let directional = (0..2).map(|_| DirectionalLight {
            direction: (random.direction() * random.log_range(1e-9, 1e9)).to_array(),
            color: random.color().map(f64::from),
            intensity: random.range(0.0, 0.6),
        });
        let directional = directional.collect();
        Lights { ambient_color: random.color().map(f64::from), ambient_intensity: 0.5, directional, shading }
    }
}

fn images(
    random: &mut Random,
    triangles: usize,
    farthest: f64,
    color: &mut impl FnMut(&mut Random) -> [f32; 3],
) -> Result<Appearance> {
    let (width, height) = (random.log_range(1.0, 9.0) as u32, random.log_range(1.0, 9.0) as u32);
    let texels = (0..width * height).map(|_| color(random)).collect();
    let textures = vec![Texture::new(width, height, texels, random.choose(&[Wrap::Repeat, Wrap::Clamp]))?];
    let uvs = (0..7).map(|_| [(); 2].map(|()| random.range(-farthest, farthest) as f32)).collect();
    let uv_triangles = (0..triangles).map(|_| [(); 3].map(|()| random.below(7) as u32)).collect();
    Ok(Appearance::Textured { uvs, uv_triangles, textures, texture_of_triangle: Vec::new() })
}
