//! The table of modes: the [`FACTORS`] that kernels are compiled for, scenes with one choice of a factor ([`alone`]),
//! and the fewest scenes in which every pair of choices occurs ([`PAIRWISE`]).

use super::{
    random::Random,
    scenes::{Case, Kind, random_alpha, random_texture},
};
use glam::DVec3;
use softras::{
    GradientMode, Lights,
    scene::{
        Appearance, Background, ColorAggregation, Distance, Faces, FrontFace, Interpolation, Outputs, Parity, Shading,
        SilhouetteAggregation, SurfacePoint, Wrap,
    },
};

/// Changes a case of the paper's modes into one of a mode.
pub type Change = fn(&mut Case);

/// The factors of a mode, each with its choices: the settings that kernels are compiled for, one factor for each
/// specialization constant or group of them. The first choice changes nothing, but for textures. `OUTPUTS` has some of
/// its sixteen values; `SAVE` and the paper's gradient are in [`pairwise`]. Guaranteed support is not there: it is
/// tested by its bound (tests/quick/render/support.rs).
pub const FACTORS: [(&str, &[Change]); 10] = [
    ("COLOR_MODE", &[|_| {}, |c| c.settings.color = ColorAggregation::Hard]),
    (
        "SILHOUETTE_MODE",
        &[
            |_| {},
            |c| c.settings.silhouette = SilhouetteAggregation::Sum,
            |c| c.settings.silhouette = SilhouetteAggregation::Hard,
        ],
    ),
    ("DISTANCE", &[|_| {}, |c| c.settings.distance = Distance::Barycentric, |c| c.settings.distance = Distance::Hard]),
    ("COMPOSITE", &[|_| {}, |c| c.settings.background = Background::Composite]),
    (
        "FRONT_ONLY, CLOCKWISE_FRONT",
        &[
            |_| {},
            |c| c.settings.faces = Faces::Front,
            |c| (c.settings.faces, c.settings.front_face) = (Faces::Front, FrontFace::Clockwise),
        ],
    ),
    ("PERSPECTIVE_CORRECT", &[|_| {}, |c| c.settings.interpolation = Interpolation::Perspective]),
    (
        "NEAR_CLIP, DEPTH_RANGE, OFFICIAL, SURFACE_POINT",
        &[
            |_| {},
            |c| through_near(c, Parity::Model),
            |c| within(c, c.settings.near, depth_at(c, 0.6)),
            |c| through_near(c, Parity::Official),
            |c| c.settings.surface_point = SurfacePoint::Clip,
        ],
    ),
    (
        "SAMPLING, OPACITY",
        &[
            |c| {
                each_appearance(c, |random, triangles| Appearance::Surface {
                    resolution: 1,
                    texels: (0..triangles).map(|_| random.color()).collect(),
                });
            },
            |c| each_appearance(c, surface),
            |c| each_appearance(c, |random, count| textured(random, count, Wrap::Clamp)),
            cut_out,
        ],
    ),
    (
        "LIT, SMOOTH, GIVEN_NORMALS",
        &[
            |_| {},
            |c| c.scene.lights.shading = Shading::Smooth,
            |c| {
                c.scene.lights.shading = Shading::Smooth;
                give_normals(c);
            },
            |c| c.scene.lights = Lights::unlit(),
        ],
    ),
    (
        "OUTPUTS",
        &[
            |_| {},
            |c| c.settings.outputs = Outputs { color: true, silhouette: true, ..NOTHING },
            |c| c.settings.outputs = Outputs { silhouette: true, ..NOTHING },
            |c| c.settings.outputs = Outputs { depth: true, normal: true, ..NOTHING },
        ],
    ),
];

/// Each row has a choice of each of the [`FACTORS`], in their order, and of the gradient: 0 the exact one, 1 the
/// paper's. A test checks that every pair of choices is in some row, and so are the larger combinations that have code
/// of their own: front faces in official parity under a hard colour and under a composite background, and cut-outs in a
/// sum cut at near, in hard modes and in perspective. A greedy search found these rows. None has colour cells in
/// perspective and official parity: there rounding decides whether the lookup leaves the triangle's cells.
pub const PAIRWISE: [&str; 25] = [
    "12201132110",
    "01111033001",
    "11000113331",
    "00212103220",
    "12012043111",
    "00100033320",
    "10002121000",
    "02210020231",
    "11101140220",
    "00112012131",
    "02111001311",
    "11200002001",
    "02001010021",
    "01200041130",
    "11212120310",
    "10001012210",
    "02002000101",
    "02101122120",
    "10011030031",
    "10210142300",
    "02202011201",
    "01202031221",
    "12210023010",
    "01202040021",
    "02010002031",
];

/// The case in each mode of [`PAIRWISE`], with its row and gradient.
pub fn pairwise(base: &Case) -> impl Iterator<Item = (String, Case, GradientMode)> {
    PAIRWISE.into_iter().map(|row| {
        let mut case = base.clone();
        let mut choices = row.bytes().map(|digit| usize::from(digit - b'0'));
        for ((_, changes), choice) in FACTORS.iter().zip(&mut choices) {
            changes[choice](&mut case);
        }
        (row.to_string(), case, [GradientMode::Exact, GradientMode::Paper][choices.next().expect("a gradient")])
    })
}

/// The case itself, and with each choice of one factor alone, with its name.
pub fn alone(base: &Case) -> impl Iterator<Item = (String, Case)> {
    let of_factor = |(name, changes): (&'static str, &'static [Change])| {
        changes.iter().enumerate().skip(1).map(move |(choice, change)| (format!("choice {choice} of {name}"), *change))
    };
    let changes = FACTORS.into_iter().flat_map(of_factor);
    std::iter::once(("the case itself".to_string(), (|_| {}) as Change)).chain(changes).map(|(name, change)| {
        let mut case = base.clone();
        change(&mut case);
        (name, case)
    })
}

/// Normals of any direction and length, some of them left to the triangles, and of several meshes not all.
pub fn give_normals(case: &mut Case) {
    let random = &mut Random::new(case.seed);
    for mesh in case.scene.meshes.iter_mut().step_by(2) {
        let normals = mesh.positions().iter().map(|_| random_normal(random)).collect();
        *mesh = mesh.clone().with_normals(normals).unwrap();
    }
}

/// One in four is left to the triangles.
fn random_normal(random: &mut Random) -> [f32; 3] {
    let length = if random.chance(0.25) { 0.0 } else { random.log_range(0.01, 100.0) };
    (random.direction() * length).as_vec3().to_array()
}

const NOTHING: Outputs = Outputs::NOTHING;

/// The depth at a share of the way from the nearest vertex of all views to the farthest.
fn depth_at(case: &Case, share: f64) -> f64 {
    let points = || case.scene.meshes.iter().flat_map(|mesh| mesh.positions()).map(|p| DVec3::from(p.map(f64::from)));
    let depths = || case.cameras.iter().flat_map(|camera| points().map(move |p| camera.to_view(p).z));
    let (low, high) = (depths().fold(f64::INFINITY, f64::min), depths().fold(f64::NEG_INFINITY, f64::max));
    low + share * (high - low)
}

/// Near within the scene: it cuts triangles, or, in official parity, leaves out fragments.
fn through_near(case: &mut Case, parity: Parity) {
    within(case, depth_at(case, 0.35), case.settings.far);
    case.settings.parity = parity;
}

/// Between planes that the scene crosses. γ is that of random clipped scenes: at least 1e-3 world units.
fn within(case: &mut Case, near: f64, far: f64) {
    (case.settings.near, case.settings.far, case.kind) = (near, far, Kind::Clipped);
    case.settings.gamma = case.settings.gamma.max(1e-3 / (far - near));
}

fn each_appearance(case: &mut Case, make: fn(&mut Random, usize) -> Appearance) {
    let random = &mut Random::new(case.seed ^ 0xa11);
    for mesh in &mut case.scene.meshes {
        let appearance = make(random, mesh.triangles().len());
        *mesh = mesh.clone().with_appearance(appearance).unwrap();
    }
}

/// Gives every mesh textures with an alpha.
pub fn cut_out(case: &mut Case) {
    each_appearance(case, |random, count| {
        let mut appearance = textured(random, count, Wrap::Repeat);
        if let Appearance::Textured { textures, .. } = &mut appearance {
            for texture in textures {
                let alpha = random_alpha(random, texture.texels().len());
                *texture = texture.clone().with_alpha(alpha).unwrap();
            }
        }
        appearance
    });
}

fn surface(random: &mut Random, triangles: usize) -> Appearance {
    Appearance::Surface { resolution: 3, texels: (0..9 * triangles).map(|_| random.color()).collect() }
}

/// Two textures, with UVs beyond [0, 1].
fn textured(random: &mut Random, triangles: usize, wrap: Wrap) -> Appearance {
    let textures = [(); 2].map(|()| {
        let random = random_texture(random);
        softras::scene::Texture::new(random.width(), random.height(), random.texels().to_vec(), wrap).unwrap()
    });
    let uvs: Vec<[f32; 2]> = (0..7).map(|_| [(); 2].map(|()| random.range(-1.0, 2.0) as f32)).collect();
    let uv_triangles = (0..triangles).map(|_| [(); 3].map(|()| random.below(uvs.len()) as u32)).collect();
    let texture_of_triangle = (0..triangles).map(|t| t as u32 % 2).collect();
    Appearance::Textured { uvs, uv_triangles, textures: textures.to_vec(), texture_of_triangle }
}
