//! The scenes, each small and for one part of the model.

use glam::DVec3;
use softras::scene::{
    Appearance, Background, ColorAggregation, DirectionalLight, Distance, Faces, Interpolation, Outputs, Shading,
    SilhouetteAggregation, SurfacePoint, Texture, Wrap,
};
use softras::shapes::{cube, icosphere, torus};
use softras::{Camera, GradientMode, Lights, Mesh, Projection, Result, Scene, Settings};

/// One scene, rendered and differentiated.
pub struct CheckCase {
    /// The name in the table.
    pub name: &'static str,
    /// The part of the model that it tests.
    pub about: &'static str,
    /// Meshes and lights.
    pub scene: Scene,
    /// The cameras.
    pub cameras: Vec<Camera>,
    /// The settings.
    pub settings: Settings,
    /// The mode of the gradient.
    pub mode: GradientMode,
    /// The tolerance of a gradient, |device - f64| / |f64|.
    pub gradient_tolerance: f64,
}

const FOV: Projection = Projection::Perspective { fov_y: 0.6 };

/// All scenes. Each new set of modes has most kernels compiled anew, which takes a second where nothing is cached: so a scene has
/// several modes wherever none of them hides another one.
///
/// # Errors
/// None that depend on the device.
pub fn cases() -> Result<Vec<CheckCase>> {
    Ok([softmax_cases()?, mode_cases()?, appearance_cases()?].into_iter().flatten().collect())
}

fn case(name: &'static str, about: &'static str, mesh: Mesh, settings: Settings) -> Result<CheckCase> {
    let cameras = vec![camera(4.0, FOV)?];
    Ok(CheckCase {
        name,
        about,
        scene: Scene::new(mesh),
        cameras,
        settings,
        mode: GradientMode::Exact,
        gradient_tolerance: 1e-3,
    })
}

/// A camera a little above the scene, so that no edge is parallel to the rows of pixels.
fn camera(distance: f64, projection: Projection) -> Result<Camera> {
    let eye = distance * DVec3::new(0.47, 0.31, 0.83).normalize();
    Camera::look_at(eye, DVec3::new(0.03, -0.02, 0.01), DVec3::Y, projection)
}

/// Settings so soft that every pixel is influenced by many triangles.
fn soft() -> Settings {
    Settings {
        width: 40,
        height: 36,
        sigma: 1e-3,
        gamma: 1e-2,
        epsilon: 0.6,
        far: 10.0,
        background_color: [0.2, 0.3, 0.4],
        ..Settings::default()
    }
}

fn ring() -> Result<Mesh> {
    torus(0.7, 0.3, 16, 8)
}

fn softmax_cases() -> Result<Vec<CheckCase>> {
    let mut batch = case("batch", "two meshes, two cameras", ring()?, soft())?;
    batch.scene = Scene::batch(vec![ring()?, icosphere(1)?]);
    batch.cameras = vec![camera(3.5, FOV)?, camera(4.2, FOV)?];
    let clip = Settings { surface_point: SurfacePoint::Clip, ..soft() };
    let paper = case("paper", "the paper's clipped barycentrics and eq. 4", ring()?, clip)?;
    let sharp = Settings { sigma: 1e-7, gamma: 1e-6, background: Background::Composite, ..soft() };
    let sharp = case("sharp", "tiny sigma and gamma, colour that fades with the silhouette", ring()?, sharp)?;
    Ok(vec![
        case("softmax", "the paper's model", ring()?, soft())?,
        batch,
        CheckCase { mode: GradientMode::Paper, ..paper },
        // The soft edge is a hundredth of a pixel wide there, so float32 has about two digits for a position on it.
        CheckCase { gradient_tolerance: 1e-2, ..sharp },
    ])
}

fn mode_cases() -> Result<Vec<CheckCase>> {
    let hard = Settings { color: ColorAggregation::Hard, distance: Distance::Barycentric, ..soft() };
    let hard = case("hard", "the nearest triangle's colour, barycentric distance", ring()?, hard)?;
    let sum = Settings { silhouette: SilhouetteAggregation::Sum, faces: Faces::Front, ..soft() };
    let about = "summed silhouette, front faces, flat light, cells of colour on every triangle, a calibrated and an orthographic camera";
    let mut sum = case("sum", about, cells()?, sum)?;
    sum.scene.lights = lights(Shading::Flat);
    let calibrated = Projection::Pinhole { fx: 55.0, fy: 58.0, cx: 19.0, cy: 18.5 };
    sum.cameras = vec![camera(4.0, calibrated)?, camera(4.0, Projection::Orthographic { half_height: 1.2 })?];
    Ok(vec![hard, sum])
}

fn appearance_cases() -> Result<Vec<CheckCase>> {
    let near = Settings { near: 0.9, sigma: 1e-4, gamma: 1e-3, ..soft() };
    let mut near = case("near", "triangles that the near plane cuts", ring()?, near)?;
    near.cameras = vec![camera(1.2, Projection::Perspective { fov_y: 1.2 })?];
    let perspective = Settings { interpolation: Interpolation::Perspective, ..soft() };
    let textured = case("textured", "image texture, correct in perspective", textured()?, perspective)?;
    let all = Settings { outputs: Outputs::ALL, background: Background::Composite, ..soft() };
    let mut smooth = case("smooth", "smooth light, depth and normals", icosphere(1)?, all)?;
    smooth.scene.lights = lights(Shading::Smooth);
    Ok(vec![near, textured, smooth])
}

fn lights(shading: Shading) -> Lights {
    let light = |direction, color, intensity| DirectionalLight { direction, color, intensity };
    let directional = vec![light([0.4, 0.6, 0.7], [0.9, 0.8, 0.6], 0.7), light([-0.8, 0.1, 0.3], [0.3, 0.5, 0.9], 0.4)];
    Lights { ambient_color: [0.9, 0.8, 0.7], ambient_intensity: 0.3, directional, shading }
}

/// A torus with a smooth image texture; every vertex has one UV.
fn textured() -> Result<Mesh> {
    const SIDE: u32 = 16;
    let wave = |i: u32, turns: f64| 0.5 + 0.4 * (f64::from(i) / f64::from(SIDE) * turns * std::f64::consts::TAU).sin();
    let texel = |i: u32| [wave(i % SIDE, 1.0), wave(i / SIDE, 2.0), wave(i % SIDE + i / SIDE, 1.0)].map(|x| x as f32);
    let texture = Texture::new(SIDE, SIDE, (0..SIDE * SIDE).map(texel).collect(), Wrap::Repeat)?;
    let mesh = ring()?;
    let uv = |p: &[f32; 3]| [1.3 * p[0] + 0.4 * p[2], 1.1 * p[1] - 0.5 * p[2]];
    let appearance = Appearance::Textured {
        uvs: mesh.positions().iter().map(uv).collect(),
        uv_triangles: mesh.triangles().to_vec(),
        textures: vec![texture],
        texture_of_triangle: Vec::new(),
    };
    mesh.with_appearance(appearance)
}

/// A cube with nine cells of their own colours on every triangle.
fn cells() -> Result<Mesh> {
    let mesh = cube()?;
    let level = |i: u32, step: u32| ((i * step) % 17) as f32 / 16.0;
    let texels = (0..9 * mesh.triangles().len() as u32).map(|i| [level(i, 5), level(i, 7), level(i, 11)]).collect();
    mesh.with_appearance(Appearance::Surface { resolution: 3, texels })
}
