//! Gradients that vertices take from the triangles' sums over pixels, without corner gradients: they are the same.

use super::repeat::{EYES, ball};
use crate::common::{
    gradient::{ALL_OUTPUTS, Group, backward, made_case, matching, norm, random_upstream, relative_error, upstream_of},
    random::Random,
    renderer,
    scenes::{Case, small},
    tier,
};
use crate::host::Planner;
use softras::embed::Capacity;
use softras::scene::{Appearance, Outputs, Texture, Wrap};
use softras::{
    Camera, GradientMode, GradientRequest, Image, ImageGradient, Lights, Mesh, Projection, Scene, Settings, shapes,
};

/// Gradients that need no corner gradients.
const ALONE: GradientRequest = GradientRequest { positions: true, colors: true, ..GradientRequest::NOTHING };

const COLOR_AND_DEPTH: Outputs = Outputs { normal: false, ..ALL_OUTPUTS };

fn unlit(mut case: Case) -> Case {
    case.scene.lights = Lights::unlit();
    case.settings.outputs = ALL_OUTPUTS;
    case
}

/// The upstream gradient with one of zeros by the normals, which needs corner gradients.
fn with_normals_of_zero(upstream: &ImageGradient) -> ImageGradient {
    let of = upstream.silhouette.as_ref().unwrap();
    let data = vec![0.0; 3 * of.data.len()];
    let normal = Image { channels: 3, data, ..of.clone() };
    ImageGradient { normal: Some(normal), ..upstream.clone() }
}

fn colored(mesh: Mesh, seed: u64) -> Mesh {
    let random = &mut Random::new(seed);
    let colors = mesh.positions().iter().map(|_| [0; 3].map(|_| random.range(0.1, 0.9) as f32)).collect();
    mesh.with_appearance(Appearance::VertexColors(colors)).unwrap()
}

/// A square of two triangles larger than a cell of backward, before a ball; the views see them from two sides.
fn large_triangles() -> Case {
    let square = Mesh::new(
        vec![[-1.5, -1.0, -0.6], [1.4, -1.1, -0.5], [1.5, 1.2, -0.7], [-1.4, 1.0, -0.4], [9.0, 9.0, 9.0]],
        vec![[0, 1, 2], [2, 3, 0]],
    )
    .unwrap();
    let mut case = unlit(ball(1, &EYES[..2], 150));
    case.scene = Scene::new(colored(square, 3));
    case.settings.height = 90;
    case
}

/// Cameras of every kind, meshes of their own for each view, boxes of one cell and of several.
fn cases() -> Vec<(&'static str, Case)> {
    let ball_of = |seed| colored(shapes::icosphere(1).unwrap(), seed);
    let views = unlit(ball(1, &EYES, 24));
    let mut meshes = unlit(ball(1, &EYES[..2], 24));
    meshes.scene.meshes = vec![ball_of(4), colored(shapes::cube().unwrap(), 5)];
    let projected = |projection: Projection| {
        let camera =
            Camera::look_at([0.3, 0.4, 3.0].into(), [0.0; 3].into(), [0.0, 1.0, 0.0].into(), projection).unwrap();
        let settings = Settings { sigma: 1e-3, gamma: 1e-2, far: 10.0, outputs: ALL_OUTPUTS, ..small(24, 20) };
        made_case(Scene::new(ball_of(6)), vec![camera], settings)
    };
    let on_screen = ball_of(7).positions().iter().map(|p| [0.6 * p[0], 0.6 * p[1], p[2] + 4.0]).collect();
    let on_screen = colored(Mesh::new(on_screen, ball_of(7).triangles().to_vec()).unwrap(), 7);
    let settings = Settings { sigma: 1e-3, gamma: 1e-2, far: 10.0, outputs: ALL_OUTPUTS, ..small(24, 24) };
    vec![
        ("three views", views),
        ("a mesh for each view", meshes),
        ("orthographic", projected(Projection::Orthographic { half_height: 1.3 })),
        ("on the screen", made_case(Scene::new(on_screen), vec![Camera::screen()], settings)),
        ("large triangles", large_triangles()),
    ]
}

#[test]
fn they_are_those_of_the_stage_between() {
    let mut renderer = renderer();
    for (name, case) in cases() {
        let each = [
            (COLOR_AND_DEPTH, GradientMode::Exact),
            (Outputs { color: false, depth: false, ..COLOR_AND_DEPTH }, GradientMode::Exact),
            (COLOR_AND_DEPTH, GradientMode::Paper),
        ];
        for (images, mode) in each.into_iter().take(tier(1, 3)) {
            let upstream = random_upstream(&case, images);
            let wanted = GradientRequest { mode, ..ALONE };
            let [alone, between] = [upstream.clone(), with_normals_of_zero(&upstream)]
                .map(|upstream| backward(&mut renderer, &case, &upstream, &wanted).unwrap());
            let mut seen = 0;
            for ((group, ours), (_, reference)) in matching(&alone, &between) {
                let error = relative_error(&Group { name: group, ours, reference: reference.clone() }, 0.0).unwrap();
                assert!(error < 1e-5, "{name}, {images:?}, {mode:?}: {group} is off by {error:e}");
                seen += usize::from(norm(&reference) > 0.0);
            }
            let of_a_mesh = if images.color { 2 } else { 1 };
            assert_eq!(seen, of_a_mesh * case.scene.meshes.len(), "{name}, {images:?}");
        }
    }
}

/// A ball with random texture coordinates and a texture.
fn textured() -> Case {
    let mut case = unlit(ball(1, &EYES[..2], 24));
    let (random, mesh) = (&mut Random::new(9), shapes::icosphere(1).unwrap());
    let texels = (0..35).map(|_| [0; 3].map(|_| random.range(0.1, 0.9) as f32)).collect();
    let appearance = Appearance::Textured {
        uvs: mesh.positions().iter().map(|_| [0; 2].map(|_| random.range(0.0, 1.0) as f32)).collect(),
        uv_triangles: mesh.triangles().to_vec(),
        textures: vec![Texture::new(7, 5, texels, Wrap::Clamp).unwrap()],
        texture_of_triangle: Vec::new(),
    };
    case.scene = Scene::new(mesh.with_appearance(appearance).unwrap());
    case
}

/// Their bits do not depend on which other gradients are wanted.
#[test]
fn they_have_the_same_bits_with_any_others() {
    let mut renderer = renderer();
    let lit = Case { scene: Scene { lights: Lights::official(), ..textured().scene }, ..textured() };
    for (name, case) in cases().into_iter().chain([("textured", textured()), ("lit", lit)]) {
        let upstream = random_upstream(&case, COLOR_AND_DEPTH);
        let mut of = |wanted| backward(&mut renderer, &case, &upstream, &wanted).unwrap().meshes;
        let alone = of(ALONE);
        for wanted in [
            GradientRequest { texels: true, uvs: true, ..ALONE },
            GradientRequest { camera: true, ..ALONE },
            GradientRequest { lights: true, ..ALONE },
            GradientRequest { scalars: true, background: true, ..ALONE },
        ] {
            for (found, alone) in of(wanted).iter().zip(&alone) {
                assert_eq!((&found.positions, &found.colors), (&alone.positions, &alone.colors), "{name}, {wanted:?}");
            }
        }
    }
}

#[test]
fn they_do_not_depend_on_the_room_for_cells() {
    let case = large_triangles();
    let upstream = random_upstream(&case, COLOR_AND_DEPTH);
    let planner = Planner::new();
    let of = |cells| planner.render(&case, &upstream, ALONE, Capacity { coarse: 1 << 12, list: 1 << 14, cells });
    let whole = of(1 << 10);
    for &cells in tier(&[3, 1 << 16][..], &[1, 3, 1 << 16]) {
        assert_eq!(whole.difference(&of(cells)), None, "room for {cells}");
    }
    planner.assert_silent();
}

/// This many triangles, each over all of the image, that share a corner outside it, the nearest of them last.
fn fan(triangles: u32) -> Case {
    let mut case = large_triangles();
    (case.settings.width, case.settings.height) = (512, 512);
    let mut positions = vec![[-3.0, -3.0, -1.0]];
    for i in 0..triangles {
        let z = -1.0 + (i + 1) as f32 / triangles as f32;
        positions.extend([[9.0, -3.0, z], [-3.0, 9.0, z]]);
    }
    let corners = (0..triangles).map(|i| [0, 2 * i + 1, 2 * i + 2]).collect();
    case.scene = Scene::new(colored(Mesh::new(positions, corners).unwrap(), 8));
    case.cameras.truncate(1);
    case
}

/// Loops on lavapipe end after 65,535 passes without an error. A vertex of as many corners as they can walk needs no
/// corner gradients, one of more corners does, and neither loses the nearest triangle, which is the last.
#[test]
fn a_vertex_of_many_large_triangles_loses_none() {
    let mut renderer = renderer();
    for triangles in [508, 520] {
        let case = fan(triangles);
        let upstream = ImageGradient {
            normal: None,
            ..upstream_of(&case, |_, row, column| [0.3, -0.2, 0.5].map(|w| w + (row * 7 + column * 3) as f32 % 5.0))
        };
        let [alone, between] = [upstream.clone(), with_normals_of_zero(&upstream)]
            .map(|upstream| backward(&mut renderer, &case, &upstream, &ALONE).unwrap());
        for ((group, ours), (_, reference)) in matching(&alone, &between) {
            let error = relative_error(&Group { name: group, ours, reference: reference.clone() }, 0.0).unwrap();
            assert!(norm(&reference) > 0.0 && error < 1e-5, "{triangles} triangles: {group} is off by {error:e}");
        }
    }
}
