//! The combinations of modes that cases are drawn from. There are few, because each one needs kernels of its own.

use crate::random::Random;
use softras::scene::{
    Appearance, Background, ColorAggregation, DirectionalLight, Distance, Faces, Interpolation, Lights, Mesh, Outputs,
    Parity, Settings, Shading, SilhouetteAggregation, Support, SurfacePoint, Texture, Wrap,
};
use softras::{GradientMode, Result};
use std::sync::LazyLock;

/// The kind of appearance of a form's meshes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Look {
    Uniform,
    Vertices,
    Surface,
    Images,
}

/// One combination of modes.
#[derive(Clone, Debug)]
pub(super) struct Form {
    look: Look,
    lit: Option<Shading>,
    pub gradient: GradientMode,
    /// The modes; numbers are each case's own.
    pub modes: Settings,
}

/// The number of combinations.
pub const FORMS: usize = 10;

/// All combinations, from the most to the least used.
pub(super) static TABLE: LazyLock<[Form; FORMS]> = LazyLock::new(|| {
    let paper = || Settings { save: true, ..Settings::default() };
    let all = || Settings { outputs: Outputs::ALL, ..paper() };
    let official = || Settings { parity: Parity::Official, ..paper() };
    let form = |look, modes| Form { look, lit: None, gradient: GradientMode::Exact, modes };
    let clip = SurfacePoint::Clip;
    let composite = Settings { background: Background::Composite, ..all() };
    let perspective = Settings { surface_point: clip, interpolation: Interpolation::Perspective, ..all() };
    let hard = Settings { color: ColorAggregation::Hard, faces: Faces::Front, ..all() };
    let sum = Settings { distance: Distance::Barycentric, silhouette: SilhouetteAggregation::Sum, ..all() };
    let cut = Settings { distance: Distance::Hard, silhouette: SilhouetteAggregation::Hard, ..paper() };
    let guaranteed = Settings { support: Support::Guaranteed, surface_point: clip, ..composite.clone() };
    let barycentric = Settings { distance: Distance::Barycentric, ..official() };
    [
        form(Look::Vertices, paper()),
        Form { lit: Some(Shading::Flat), ..form(Look::Uniform, composite) },
        form(Look::Uniform, Settings { outputs: Outputs::SILHOUETTE, ..paper() }),
        Form { lit: Some(Shading::Smooth), ..form(Look::Images, perspective) },
        form(Look::Surface, hard),
        form(Look::Vertices, sum),
        form(Look::Vertices, cut),
        Form { gradient: GradientMode::Paper, ..form(Look::Surface, Settings { surface_point: clip, ..official() }) },
        form(Look::Vertices, guaranteed),
        Form { gradient: GradientMode::Paper, ..form(Look::Vertices, barycentric) },
    ]
});

impl Form {
    /// Whether the reference's margin covers all discontinuities of the model. It does not cover, for example, a triangle
    /// that turns its back to the camera.
    pub fn is_smooth(&self) -> bool {
        let modes = &self.modes;
        modes.faces == Faces::Both && modes.distance == Distance::Euclidean && modes.parity == Parity::Model
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
