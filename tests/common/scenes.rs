//! Scenes from a seed.

use super::random::Random;
use glam::{DQuat, DVec3};
use softras::{
    Camera, Lights, Mesh, Projection, Scene, Settings,
    scene::{
        Appearance, Background, ColorAggregation, DirectionalLight, Distance, Faces, FrontFace, Interpolation, Outputs,
        Parity, Shading, SilhouetteAggregation, Texture, Wrap,
    },
    shapes,
};

/// All there is to render, and the seed that gave it.
#[derive(Clone)]
pub struct Case {
    pub seed: u64,
    pub kind: Kind,
    pub scene: Scene,
    pub cameras: Vec<Camera>,
    pub settings: Settings,
}

impl Case {
    pub fn subject(&self) -> softras_check::agreement::Subject<'_> {
        softras_check::agreement::Subject { scene: &self.scene, cameras: &self.cameras, settings: &self.settings }
    }
}

/// The text that a failing test prints: enough to run the case again.
impl std::fmt::Debug for Case {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let appearance = |mesh: &Mesh| match mesh.appearance() {
            Appearance::Uniform(_) => "uniform".into(),
            Appearance::VertexColors(_) => "vertex colours".into(),
            Appearance::Surface { resolution, .. } => format!("surface {resolution}"),
            Appearance::Textured { textures, .. } => format!("{} textures", textures.len()),
        };
        writeln!(f, "random_case({}, Kind::{:?}): {:?}", self.seed, self.kind, self.settings)?;
        for mesh in &self.scene.meshes {
            writeln!(f, "mesh of {} triangles, {}", mesh.triangles().len(), appearance(mesh))?;
        }
        writeln!(f, "{:?}\n{:?}", self.scene.lights, self.cameras)
    }
}

/// Which settings and depths a random case may have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The paper's modes, everything between near and far.
    Plain,
    /// Any mode.
    Modes,
    /// Triangles through the near plane, behind the camera and beyond the far plane, in the paper's modes.
    Clipped,
}

/// A scene of one or several meshes, one to three cameras and settings of the kind.
pub fn random_case(seed: u64, kind: Kind) -> Case {
    let random = &mut Random::new(seed);
    let settings = random_settings(random, kind);
    let projection = random_projection(random, &settings);
    let views = random.choose(&[1, 1, 2, 3]);
    let meshes = if views > 1 && random.chance(0.5) { views } else { 1 };
    let meshes = (0..meshes).map(|_| {
        let mesh = match projection {
            Projection::Screen => screen_soup(random, &settings, kind),
            _ if random.chance(0.5) => blob(random),
            _ => soup(random, kind),
        };
        let appearance = random_appearance(random, &mesh);
        mesh.with_appearance(appearance).unwrap()
    });
    let scene = Scene::batch(meshes.collect());
    let scene = scene.with_lights(random_lights(random));
    let cameras = (0..views).map(|_| random_camera(random, projection, kind)).collect();
    Case { seed, kind, scene, cameras, settings }
}

/// Distance of the cameras from the origin, around which the meshes lie within about 2.
const DISTANCE: f64 = 4.0;

pub fn random_settings(random: &mut Random, kind: Kind) -> Settings {
    let bit = |random: &mut Random| random.chance(0.5);
    let [color, silhouette, depth, normal] = [(); 4].map(|()| bit(random));
    let mut outputs = Outputs { color, silhouette, depth, normal, features: false };
    if outputs == (Outputs::NOTHING) {
        outputs = Outputs::ALL;
    }
    let (near, far) = match kind {
        Kind::Clipped => (random.range(2.5, 4.0), random.range(4.1, 5.0)),
        _ => (random.range(0.1, 1.0), random.log_range(10.0, 200.0)),
    };
    let plain = Settings {
        width: random.log_range(6.0, 130.0) as u32,
        height: random.log_range(6.0, 100.0) as u32,
        sigma: random.log_range(1e-6, 1e-2),
        // Cut triangles are large and (far - near) is small: log weights may change by 10³ a world unit, no more.
        gamma: random.log_range(1e-5, 1.0).max(if kind == Kind::Clipped { 1e-3 / (far - near) } else { 0.0 }),
        epsilon: random.choose(&[1e-3, 0.0, 0.9, -0.5]),
        tau: random.log_range(1e-6, 1e-1),
        near,
        far,
        outputs,
        background: random.choose(&[Background::Weighted, Background::Composite]),
        background_color: random.color().map(f64::from),
        ..Settings::default()
    };
    if kind != Kind::Modes {
        return plain;
    }
    Settings {
        color: random.choose(&[ColorAggregation::Softmax, ColorAggregation::Softmax, ColorAggregation::Hard]),
        silhouette: random.choose(&[
            SilhouetteAggregation::Product,
            SilhouetteAggregation::Sum,
            SilhouetteAggregation::Hard,
        ]),
        distance: random.choose(&[Distance::Euclidean, Distance::Barycentric, Distance::Hard]),
        faces: random.choose(&[Faces::Both, Faces::Front]),
        front_face: random.choose(&[FrontFace::CounterClockwise, FrontFace::Clockwise]),
        interpolation: random.choose(&[Interpolation::Affine, Interpolation::Perspective]),
        parity: random.choose(&[Parity::Model, Parity::Model, Parity::Official]),
        ..plain
    }
}

pub fn random_projection(random: &mut Random, settings: &Settings) -> Projection {
    let (width, height) = (f64::from(settings.width), f64::from(settings.height));
    match random.below(5) {
        0 => Projection::Perspective { fov_y: random.range(0.3, 1.5) },
        1 => Projection::Orthographic { half_height: random.log_range(0.5, 4.0) },
        2 => Projection::Pinhole {
            fx: height * random.range(0.8, 2.0),
            fy: height * random.range(0.8, 2.0),
            cx: width * random.range(0.3, 0.7),
            cy: height * random.range(0.3, 0.7),
        },
        3 => {
            // Distortion is of pixels, so its terms are in powers of the image's side: some per cent at the border.
            let side: f64 = random.range(100.0, 600.0);
            let powers = [-2, -4, -1, -1, -6].map(|power| side.powi(power));
            let most = [0.1, 0.02, 0.01, 0.01, 0.005];
            let distortion = std::array::from_fn(|i| powers[i] * random.range(-most[i], most[i]));
            Projection::Official { distortion, original_size: side }
        }
        _ => Projection::Screen,
    }
}

/// From anywhere around, at a point near the origin, any side up.
pub fn random_camera(random: &mut Random, projection: Projection, kind: Kind) -> Camera {
    if projection == Projection::Screen {
        return Camera::screen();
    }
    let eye = random.direction() * if kind == Kind::Clipped { 2.5 } else { DISTANCE };
    let target = random.direction() * 0.3;
    let camera = Camera::look_at(eye, target, random.direction(), projection).unwrap();
    let Projection::Official { distortion, original_size } = projection else { return camera };
    // Intrinsics times extrinsics: the focal length in units of the image's side.
    let (focal, [x, y, z]) = (original_size * random.range(0.8, 1.5), *camera.view());
    let centred = |row: [f64; 4]| std::array::from_fn(|i| focal * row[i] + original_size / 2.0 * z[i]);
    Camera::official([centred(x), centred(y), z], distortion, original_size).unwrap()
}

pub fn random_lights(random: &mut Random) -> Lights {
    let shading = random.choose(&[Shading::Flat, Shading::Smooth]);
    match random.below(3) {
        0 => Lights { shading, ..Lights::unlit() },
        1 => Lights { shading, ..Lights::official() },
        _ => Lights {
            ambient_color: random.color().map(f64::from),
            ambient_intensity: random.range(0.0, 0.6),
            directional: (0..random.below(4))
                .map(|_| DirectionalLight {
                    direction: (random.direction() * random.log_range(0.01, 100.0)).to_array(),
                    color: random.color().map(f64::from),
                    intensity: random.range(0.0, 0.6),
                })
                .collect(),
            shading,
        },
    }
}

pub fn random_appearance(random: &mut Random, mesh: &Mesh) -> Appearance {
    let (vertices, triangles) = (mesh.positions().len(), mesh.triangles().len());
    match random.below(4) {
        0 => Appearance::Uniform(random.color()),
        1 => Appearance::VertexColors((0..vertices).map(|_| random.color()).collect()),
        2 => {
            let resolution = random.choose(&[1, 3, 5]);
            let cells = triangles * (resolution * resolution) as usize;
            Appearance::Surface { resolution, texels: (0..cells).map(|_| random.color()).collect() }
        }
        _ => {
            let textures: Vec<Texture> = (0..random.choose(&[1, 1, 3])).map(|_| random_texture(random)).collect();
            let uvs = (0..vertices + 5).map(|_| [(); 2].map(|()| random.range(-1.0, 2.0) as f32));
            let uvs: Vec<[f32; 2]> = uvs.collect();
            let mut corner = || [(); 3].map(|()| random.below(uvs.len()) as u32);
            let uv_triangles = (0..triangles).map(|_| corner()).collect();
            let count = textures.len();
            let texture_of_triangle = match count {
                1 => Vec::new(),
                _ => (0..triangles).map(|_| random.below(count) as u32).collect(),
            };
            Appearance::Textured { uvs, uv_triangles, textures, texture_of_triangle }
        }
    }
}

pub fn random_texture(random: &mut Random) -> Texture {
    let (width, height) = (random.log_range(1.0, 9.0) as u32, random.log_range(1.0, 9.0) as u32);
    let texels = (0..width * height).map(|_| random.color()).collect();
    Texture::new(width, height, texels, random.choose(&[Wrap::Repeat, Wrap::Clamp])).unwrap()
}

/// An alpha for each of `texels` texels: 0, 1 or between.
pub fn random_alpha(random: &mut Random, texels: usize) -> Vec<f32> {
    let one = |random: &mut Random| match random.below(4) {
        0 => 0.0,
        1 => 1.0,
        _ => random.range(0.05, 0.95) as f32,
    };
    (0..texels).map(|_| one(random)).collect()
}

/// Loose triangles of many sizes within about 2 of the origin, and to every ten of them one between three others.
pub fn soup(random: &mut Random, kind: Kind) -> Mesh {
    let count = random.log_range(1.0, 200.0) as usize;
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for _ in 0..count {
        let centre = random.direction() * random.range(0.0, 1.5);
        let size = random.log_range(0.003, if kind == Kind::Clipped { 3.0 } else { 0.8 });
        positions.extend((0..3).map(|_| (centre + size * random.direction()).as_vec3().to_array()));
        let next = positions.len() as u32;
        triangles.push([next - 3, next - 2, next - 1]);
        if next >= 9 && random.chance(0.1) {
            // Corners of three others. (Twice the same three, turned round, would have a vertex normal of 0 / 0.)
            let first = 3 * random.below(next as usize / 3 - 2) as u32;
            triangles.push([0, 3, 6].map(|i| first + i + random.below(3) as u32));
        }
    }
    Mesh::new(positions, triangles).unwrap()
}

/// A sphere pushed about, closed, of 80 to 1280 triangles.
pub fn blob(random: &mut Random) -> Mesh {
    let sphere = shapes::icosphere(random.choose(&[1, 2, 2, 3])).unwrap();
    let waves: Vec<(DVec3, f64)> =
        (0..4).map(|_| (random.direction() * random.range(1.0, 5.0), random.range(0.0, 0.2))).collect();
    let turn = DQuat::from_axis_angle(random.direction(), random.range(0.0, 3.0));
    let stretch = DVec3::new(random.range(0.3, 1.2), random.range(0.3, 1.2), random.range(0.3, 1.2));
    let moved = sphere.positions().iter().map(|&p| {
        let p = DVec3::from(p.map(f64::from));
        let radius = 1.0 + waves.iter().map(|(wave, height)| height * wave.dot(p).sin()).sum::<f64>();
        (turn * (p * radius * stretch)).as_vec3().to_array()
    });
    Mesh::new(moved.collect(), sphere.triangles().to_vec()).unwrap()
}

/// Loose triangles in screen coordinates at depths between near and far (or, clipped, about them).
pub fn screen_soup(random: &mut Random, settings: &Settings, kind: Kind) -> Mesh {
    let aspect = f64::from(settings.width) / f64::from(settings.height);
    let (near, far) = (settings.near, settings.far.min(settings.near + 10.0));
    let slack = (far - near) * if kind == Kind::Clipped { 0.3 } else { -0.05 };
    let count = random.log_range(1.0, 100.0) as usize;
    let mut positions = Vec::new();
    for _ in 0..count {
        let centre = [random.range(-aspect, aspect), random.range(-1.0, 1.0)];
        let size = random.log_range(0.005, 1.0);
        let depth = random.range(near - slack, far + slack);
        for _ in 0..3 {
            let offset = random.direction() * size;
            let z = (depth + offset.z).clamp(near - slack, far + slack);
            positions.push([(centre[0] + offset.x) as f32, (centre[1] + offset.y) as f32, z as f32]);
        }
    }
    Mesh::new(positions, (0..count as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect()).unwrap()
}

/// Triangles that share no vertex.
pub fn separate(corners: &[[[f32; 3]; 3]]) -> Mesh {
    let indices = (0..corners.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    Mesh::new(corners.concat(), indices).unwrap()
}

/// Triangles of these corners, coloured one way or another.
pub fn triangles(corners: &[[[f32; 3]; 3]]) -> Mesh {
    let mesh = separate(corners);
    let appearance = random_appearance(&mut Random::new(corners.len() as u64), &mesh);
    mesh.with_appearance(appearance).unwrap()
}

/// Every image, small.
pub fn small(width: u32, height: u32) -> Settings {
    Settings { width, height, outputs: Outputs::ALL, sigma: 1e-4, gamma: 1e-2, far: 20.0, ..Settings::default() }
}

/// This many triangles about the centre of pixel (7, 8) of a 16×16 image. About half of them cover it.
pub fn crowd(count: usize) -> Vec<[[f32; 3]; 3]> {
    let random = &mut Random::new(3);
    let place = |i: usize| {
        let (x, y) = (0.0525 + random.range(-0.02, 0.02) as f32, 0.0525 + random.range(-0.02, 0.02) as f32);
        let z = 2.0 + 10.0 * i as f32 / count as f32;
        [[x, y, z], [x + 0.03, y, z], [x, y + 0.03, z]]
    };
    (0..count).map(place).collect()
}
