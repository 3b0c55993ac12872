//! A renderer keeps state from frame to frame, on which the next frame must not depend.

use crate::common::{
    compare::same_bits,
    gradient::{ALL_OUTPUTS, Made, made, made_case, same_made_bits},
    random::Random,
    renderer, renderer_with,
    scenes::{Case, random_alpha, random_appearance, random_texture},
    tier,
};
use crate::gradient::repeat::camera;
use crate::host::shim::{self, adapter};
use softras::{
    DeviceKind, GradientRequest, ImageGradient, Lights, Mesh, Renderer, RendererOptions, Scene, Settings,
    scene::{Appearance, Background, Shading},
    shapes,
};
use softras_check::agreement::random_upstream;

/// The state that a loop changes from step to step.
#[derive(Clone)]
struct State {
    case: Case,
    wanted: GradientRequest,
}

fn start(random: &mut Random) -> State {
    let settings = Settings {
        width: 20,
        height: 13,
        sigma: 1e-3,
        gamma: 1e-2,
        far: 10.0,
        outputs: ALL_OUTPUTS,
        save: true,
        ..Settings::default()
    };
    let cameras = vec![camera([0.4, 0.7, 3.1]), camera([-2.9, 0.3, 0.8])];
    let scene = Scene::batch(vec![mesh(random), mesh(random)]);
    State { case: made_case(scene, cameras, settings), wanted: GradientRequest::ALL }
}

fn mesh(random: &mut Random) -> Mesh {
    let mesh = shapes::icosphere(random.below(2) as u32).unwrap();
    let appearance = random_appearance(random, &mesh);
    mesh.with_appearance(appearance).unwrap()
}

/// The mesh with some values, not counts, of its appearance changed.
fn recolored(random: &mut Random, mesh: &Mesh) -> Mesh {
    let mut appearance = mesh.appearance().clone();
    match &mut appearance {
        Appearance::Uniform(color) => *color = random.color(),
        Appearance::VertexColors(colors) => *colors.last_mut().unwrap() = random.color(),
        Appearance::Surface { texels, .. } => *texels.last_mut().unwrap() = random.color(),
        Appearance::Textured { uvs, uv_triangles, textures, texture_of_triangle } => match random.below(7) {
            0 => uvs[0] = [random.range(-1.0, 2.0) as f32, 0.25],
            1 => uv_triangles[0].rotate_left(1),
            2 => *textures.last_mut().unwrap() = random_texture(random),
            5 | 6 => {
                // An alpha that was not there, another one, or none where one was.
                let count = textures[0].texels().len();
                let alpha = if random.chance(0.3) { vec![1.0; count] } else { random_alpha(random, count) };
                textures[0] = textures[0].clone().with_alpha(alpha).unwrap();
            }
            3 if textures.len() > 1 => texture_of_triangle[0] = (texture_of_triangle[0] + 1) % textures.len() as u32,
            _ => {
                let old = &textures[0];
                let mut texels = old.texels().to_vec();
                *texels.last_mut().unwrap() = random.color();
                textures[0] = old.with_texels(texels).unwrap();
            }
        },
    }
    let plain = Mesh::new(mesh.positions().to_vec(), mesh.triangles().to_vec()).unwrap();
    plain.with_appearance(appearance).unwrap()
}

/// Counts of kinds of change; the last is none.
const CHANGES: usize = 15;

fn change(state: &mut State, kind: usize, random: &mut Random) {
    let which = random.below(state.case.scene.meshes.len());
    let mesh_of = &mut state.case.scene.meshes[which];
    match kind {
        0 => {
            let mut positions = mesh_of.positions().to_vec();
            positions.last_mut().unwrap()[2] += 0.01;
            mesh_of.set_positions(positions).unwrap();
        }
        1..=3 => *mesh_of = recolored(random, mesh_of),
        4 => *state.case.cameras.last_mut().unwrap() = camera([1.1, -2.3, random.range(1.0, 2.0)]),
        5 => {
            // Another way around the same triangles, with other corners' colours.
            let mut triangles = mesh_of.triangles().to_vec();
            triangles[0].swap(0, 1);
            let appearance = mesh_of.appearance().clone();
            *mesh_of = Mesh::new(mesh_of.positions().to_vec(), triangles).unwrap().with_appearance(appearance).unwrap();
        }
        6 => *mesh_of = mesh(random),
        7 => state.case.settings.sigma = random.log_range(1e-4, 1e-2),
        8 => state.case.settings.background_color = random.color().map(f64::from),
        9 => {
            state.case.settings.background = random.choose(&[Background::Weighted, Background::Composite]);
            state.case.settings.width = random.choose(&[20, 33]);
        }
        10 => {
            let shading = random.choose(&[Shading::Flat, Shading::Smooth]);
            state.case.scene.lights = if random.chance(0.5) { Lights::official() } else { Lights::unlit() };
            state.case.scene.lights.shading = shading;
        }
        11 => state.case.scene.lights.ambient_intensity = random.range(0.1, 1.0),
        12 => {
            state.case.settings.outputs.depth ^= true;
            state.wanted.texels ^= true;
        }
        13 => {
            let normal = (random.direction() * random.choose(&[0.0, 2.0])).as_vec3().to_array();
            let count = if random.chance(0.3) { 0 } else { mesh_of.positions().len() };
            let mut normals = mesh_of.normals().to_vec();
            normals.resize(count, normal);
            normals.first_mut().into_iter().for_each(|first| *first = normal);
            *mesh_of = mesh_of.clone().with_normals(normals).unwrap();
        }
        _ => {}
    }
}

fn upstream(state: &State, seed: u64) -> ImageGradient {
    random_upstream(state.case.subject(), seed, state.case.settings.outputs, None)
}

fn step(renderer: &mut Renderer, state: &State, seed: u64) -> Made {
    made(renderer, &state.case, &upstream(state, seed), &state.wanted).unwrap()
}

/// Makes random changes one after the other. Every third frame is compared with another renderer's, which saw none of
/// the changes. Every third is enough, because a change that a renderer misses stays missed.
fn steps_are_as_fresh(seed: u64, steps: usize, options: &RendererOptions) {
    let random = &mut Random::new(seed);
    let mut state = start(random);
    let mut kept = renderer_with(options.clone());
    step(&mut kept, &state, seed);
    for i in 0..steps {
        let mut kinds = vec![i % CHANGES];
        while random.chance(0.3) {
            kinds.push(random.below(CHANGES));
        }
        kinds.iter().for_each(|&kind| change(&mut state, kind, random));
        if random.chance(0.3) {
            // A look in between, which keeps nothing for backward.
            let look = Settings { save: false, ..state.case.settings.clone() };
            kept.render(&state.case.scene, &state.case.cameras, &look).unwrap();
        }
        let found = step(&mut kept, &state, seed);
        if i % 3 != 1 && i + 1 < steps {
            continue;
        }
        same_made_bits(&found, &step(&mut renderer(), &state, seed))
            .unwrap_or_else(|e| panic!("seed {seed}, step {i}, changes {kinds:?}: {e}"));
    }
}

#[test]
fn a_frame_after_any_change_is_a_fresh_renderers() {
    steps_are_as_fresh(1, CHANGES, &RendererOptions::default());
}

#[test]
fn so_it_is_where_memory_is_not_shared() {
    let _turn = shim::lock();
    adapter::hide_cached_memory();
    let options = RendererOptions { loader: Some(shim::loader()), ..RendererOptions::default() };
    steps_are_as_fresh(3, tier(5, CHANGES), &options);
}

/// Normals that take the place of others, without another change of the frame.
#[test]
fn a_frame_after_other_normals_is_a_fresh_renderers() {
    let random = &mut Random::new(7);
    let mut state = start(random);
    state.case.scene.lights = Lights { shading: Shading::Smooth, ..Lights::official() };
    let mut kept = renderer_with(RendererOptions::default());
    let mut last: Option<Made> = None;
    for _ in 0..3 {
        for mesh in &mut state.case.scene.meshes {
            let normals = mesh.positions().iter().map(|_| random.direction().as_vec3().to_array()).collect();
            *mesh = mesh.clone().with_normals(normals).unwrap();
        }
        let (found, due) = (step(&mut kept, &state, 7), step(&mut renderer(), &state, 7));
        same_made_bits(&found, &due).unwrap();
        assert!(last.is_none_or(|last| same_bits(&last.0, &found.0).is_err()), "the normals do not show");
        last = Some(found);
    }
}

/// A camera that comes so near that triangles cross the near plane, or goes so far that they lie beyond the far one, needs other kernels.
#[test]
fn a_camera_that_comes_near_and_goes_far_is_as_for_a_fresh_renderer() {
    let random = &mut Random::new(5);
    let mut state = start(random);
    let fresh = || renderer_with(RendererOptions::default());
    let mut kept = fresh();
    for eye in [[0.4, 0.7, 3.1], [0.2, 0.4, 1.6], [0.4, 0.7, 3.1], [0.9, 1.5, 9.6], [0.4, 0.7, 3.1]] {
        state.case.cameras[0] = camera(eye);
        let (found, due) = (step(&mut kept, &state, 7), step(&mut fresh(), &state, 7));
        same_made_bits(&found, &due).unwrap_or_else(|error| panic!("{eye:?}: {error}"));
    }
}

#[test]
fn only_what_changed_is_uploaded() {
    let _turn = shim::lock();
    let (mut buffers, mut copies) = (Vec::new(), false);
    for is_shared in [true, false] {
        if !is_shared {
            adapter::hide_cached_memory();
        }
        let random = &mut Random::new(5);
        let mut state = start(random);
        let mut renderer =
            renderer_with(RendererOptions { loader: Some(shim::loader()), ..RendererOptions::default() });
        let mut uploaded = |state: &State| {
            step(&mut renderer, state, 5);
            renderer.frame_counts().unwrap().uploaded_bytes
        };
        let all = uploaded(&state);
        let vertices: usize = state.case.scene.meshes.iter().map(|mesh| mesh.positions().len()).sum();
        assert!(all > 12 * vertices as u64, "{all} bytes");
        // Each view's flag that the background is kept, once commands made a frame.
        let kept = 2 * 64;
        assert_eq!(uploaded(&state), kept, "the very same scene");
        assert_eq!(uploaded(&state), 0, "the very same scene");
        // A clone is the same, and so is one with values of its own.
        assert_eq!(uploaded(&state.clone()), 0);
        change(&mut state, 0, random);
        assert_eq!(uploaded(&state), 12 * vertices as u64, "one vertex");
        change(&mut state, 4, random);
        let cameras = 2 * 11 * 16;
        assert_eq!(uploaded(&state), cameras, "one camera");
        change(&mut state, 7, random);
        assert_eq!(uploaded(&state), kept, "sigma is no buffer, but the commands are others");
        change(&mut state, 11, random);
        assert_eq!(uploaded(&state), 16, "the ambient light, with which the commands are others again");
        change(&mut state, 5, random);
        assert_eq!(uploaded(&state), all, "another topology");
        assert_eq!(uploaded(&state), 0);
        copies = renderer.device_info().kind == DeviceKind::Discrete;
        drop(renderer);
        buffers.push(shim::objects()["Buffer"][0] - buffers.iter().sum::<i64>());
    }
    // A discrete GPU copies in both.
    assert!(copies || buffers[1] > buffers[0], "nothing is copied: {buffers:?}");
}

/// Stages that nothing asks for are not dispatched, and a pass that is recorded anew is counted anew.
#[test]
fn dispatches_are_counted_as_recorded() {
    let random = &mut Random::new(6);
    let mut state = start(random);
    let mut renderer = renderer_with(RendererOptions::default());
    let mut counted = |state: &State| {
        step(&mut renderer, state, 5);
        let counts = renderer.frame_counts().unwrap();
        (counts.dispatches, counts.backward_dispatches)
    };
    let (forward, backward) = counted(&state);
    assert!(forward > 0 && backward > 0);
    assert_eq!(counted(&state), (forward, backward), "the very same frame");
    state.wanted = GradientRequest { colors: true, ..GradientRequest::NOTHING };
    let (same, fewer) = counted(&state);
    assert!(same == forward && fewer < backward, "{fewer} of {backward}");
}

/// Frames for looking at hold no memory for gradients, and gradients by little no more than they need.
#[test]
fn what_is_not_asked_for_has_no_buffer() {
    let random = &mut Random::new(6);
    let state = start(random);
    let bytes = |save: bool, wanted: Option<GradientRequest>| {
        let mut renderer = renderer_with(RendererOptions::default());
        let settings = Settings { save, ..state.case.settings.clone() };
        let frame = renderer.render(&state.case.scene, &state.case.cameras, &settings).unwrap();
        if let Some(wanted) = wanted {
            renderer.backward(&frame, &upstream(&state, 6), &wanted).unwrap();
        }
        renderer.device_bytes()
    };
    let pixels = 2 * 20 * 13;
    let (look, saved) = (bytes(false, None), bytes(true, None));
    assert!(saved >= look + 16 * pixels, "{look} {saved}");
    let of = |wanted: GradientRequest| bytes(true, Some(wanted));
    let (camera, colors) = (
        GradientRequest { camera: true, ..GradientRequest::NOTHING },
        GradientRequest { colors: true, ..GradientRequest::NOTHING },
    );
    let all = of(GradientRequest::ALL);
    assert!(saved < of(camera) && of(camera) < all, "{saved} {} {all}", of(camera));
    assert!(saved < of(colors) && of(colors) < all, "{saved} {} {all}", of(colors));
}
