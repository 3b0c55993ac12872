//! Gradients that stay the same every time, in bounded memory, of many views and meshes; and what backward refuses.

use crate::common::{
    compare::same_bits,
    gradient::{
        ALL_OUTPUTS, Group, Made, all_finite, backward, check, made, made_case, matching, modes, norm, of_view,
        random_upstream, relative_error, same_gradient_bits, same_made_bits, small_case, upstream_of,
    },
    modes::cut_out,
    random::Random,
    renderer, renderer_with,
    scenes::{Case, Kind, random_appearance, separate},
    tier,
    tolerance::GRADIENT,
};
use crate::modes::mode_base;
use glam::DVec3;
use softras::{
    Camera, DeviceKind, Error, GradientMode, GradientRequest, Gradients, Image, ImageGradient, Lights, Mesh,
    Projection, RendererOptions, Scene, Settings,
    scene::{Appearance, Outputs, Texture, Wrap},
    shapes,
};

const MODES: [GradientMode; 2] = [GradientMode::Exact, GradientMode::Paper];

fn settings(size: u32) -> Settings {
    Settings {
        width: size,
        height: size,
        sigma: 1e-3,
        gamma: 1e-2,
        epsilon: 0.5,
        far: 10.0,
        outputs: ALL_OUTPUTS,
        save: true,
        ..Settings::default()
    }
}

pub fn camera(eye: [f64; 3]) -> Camera {
    let projection = Projection::Perspective { fov_y: 0.8 };
    Camera::look_at(DVec3::from_array(eye), DVec3::ZERO, DVec3::Y, projection).unwrap()
}

/// A lit mesh whose colours are of the `kind`th sort before some cameras.
pub fn ball(kind: u64, eyes: &[[f64; 3]], size: u32) -> Case {
    let mesh = shapes::icosphere(1).unwrap();
    let appearance = random_appearance(&mut Random::new(kind), &mesh);
    let scene = Scene::new(mesh.with_appearance(appearance).unwrap()).with_lights(Lights::official());
    made_case(scene, eyes.iter().map(|&eye| camera(eye)).collect(), settings(size))
}

pub const EYES: [[f64; 3]; 3] = [[0.4, 0.7, 3.1], [-2.9, 0.3, 0.8], [1.1, -2.3, 1.6]];

/// Seeds of one colour, vertex colours, surface cells and images.
pub const SORTS: [u64; 4] = [0, 1, 10, 5];

#[test]
fn every_sort_of_appearance_is_among_them() {
    let sorts = SORTS.map(|sort| match ball(sort, &EYES[..1], 8).scene.meshes[0].appearance() {
        Appearance::Uniform(_) => 0,
        Appearance::VertexColors(_) => 1,
        Appearance::Surface { .. } => 2,
        Appearance::Textured { .. } => 3,
    });
    assert_eq!(sorts, [0, 1, 2, 3]);
}

#[test]
fn many_runs_are_the_same_bits() {
    let mut renderer = renderer();
    let each = SORTS.into_iter().flat_map(|sort| MODES.map(|mode| (sort, mode)));
    for (sort, mode) in each.step_by(tier(3, 1)) {
        let case = ball(sort, &EYES[..1], 24);
        let upstream = random_upstream(&case, ALL_OUTPUTS);
        let wanted = GradientRequest { mode, ..GradientRequest::ALL };
        let first = made(&mut renderer, &case, &upstream, &wanted).unwrap();
        for run in 0..tier(20, 100) {
            let again = made(&mut renderer, &case, &upstream, &wanted).unwrap();
            same_made_bits(&first, &again).unwrap_or_else(|error| panic!("run {run}, {mode:?}: {error}\n{case:?}"));
        }
    }
}

#[test]
fn other_frames_in_between_leave_no_trace() {
    let mut renderer = renderer();
    let case = ball(1, &EYES[..2], 32);
    let upstream = random_upstream(&case, ALL_OUTPUTS);
    let first = made(&mut renderer, &case, &upstream, &GradientRequest::ALL).unwrap();
    for seed in 0..tier(2, 6) {
        let other = small_case(seed, [Kind::Modes, Kind::Clipped][seed as usize % 2]);
        let other_upstream = random_upstream(&other, other.settings.outputs);
        made(&mut renderer, &other, &other_upstream, &GradientRequest::ALL).unwrap();
        let again = made(&mut renderer, &case, &upstream, &GradientRequest::ALL).unwrap();
        same_made_bits(&first, &again).unwrap_or_else(|error| panic!("after {other:?}: {error}"));
    }
}

/// Any number of lanes: images of the same bits, and gradients that are the same but for the order of their sums.
#[track_caller]
fn assert_lanes_agree(case: &Case, lanes: &[u32]) {
    let upstream = random_upstream(case, ALL_OUTPUTS);
    let mut first: Option<Made> = None;
    for &lanes in lanes {
        let mut renderer = renderer_with(RendererOptions { lanes: Some(lanes), ..RendererOptions::default() });
        for &mode in modes() {
            check(&mut renderer, case, &upstream, mode, &GRADIENT)
                .unwrap_or_else(|error| panic!("{lanes} lanes: {error}\n{case:?}"));
        }
        let (frame, gradients) = made(&mut renderer, case, &upstream, &GradientRequest::ALL).unwrap();
        for _ in 0..tier(3, 10) {
            let again = renderer.backward(&frame, &upstream, &GradientRequest::ALL).unwrap();
            same_gradient_bits(&gradients, &again).unwrap();
        }
        let first = first.get_or_insert_with(|| (frame.clone(), gradients.clone()));
        same_bits(&first.0, &frame).unwrap_or_else(|error| panic!("{lanes} lanes: {error}\n{case:?}"));
        for ((name, ours), (_, reference)) in matching(&gradients, &first.1) {
            let error = relative_error(&Group { name, ours, reference }, 0.0).unwrap();
            assert!(error < 1e-5, "{lanes} lanes: {name} differs by {error:e}");
        }
    }
}

/// Lanes that share records by shuffles, that share them through memory, and that share nothing. Every number of lanes is a set
/// of kernels of its own to compile: all of them for cut-outs, two for the others.
#[test]
fn numbers_of_lanes_agree() {
    let mut cut_outs = mode_base(11);
    cut_out(&mut cut_outs);
    // NVIDIA's compiler gives up on the 32 pixels of a single lane.
    let is_software = renderer().device_info().kind == DeviceKind::Software;
    let all = [8, if is_software { 1 } else { 4 }, 4, 16, 32];
    assert_lanes_agree(&cut_outs, tier(&all[..2], &all));
    for &sort in tier(&SORTS[..1], &SORTS) {
        assert_lanes_agree(&ball(sort, &EYES[..1], 32), &[8, 32]);
    }
}

/// One mesh and many views: its gradient is the sum of the views', each camera's is its own.
#[test]
fn batch_of_one_mesh_sums_over_views() {
    let mut renderer = renderer();
    for &sort in tier(&SORTS[..1], &SORTS) {
        let case = ball(sort, &EYES, 24);
        let upstream = random_upstream(&case, ALL_OUTPUTS);
        for &mode in modes() {
            check(&mut renderer, &case, &upstream, mode, &GRADIENT.without_exceptions())
                .unwrap_or_else(|error| panic!("{error}\n{case:?}"));
        }
        let all = backward(&mut renderer, &case, &upstream, &GradientRequest::ALL).unwrap();
        let mut sum = vec![0.0; 3 * all.meshes[0].positions.len()];
        for view in 0..3 {
            let alone = Case { cameras: vec![case.cameras[view]], ..case.clone() };
            let own = backward(&mut renderer, &alone, &of_view(&upstream, view), &GradientRequest::ALL).unwrap();
            let positions = own.meshes[0].positions.as_flattened();
            sum.iter_mut().zip(positions).for_each(|(sum, &x)| *sum += f64::from(x));
            let off = own.cameras[0].twist.iter().zip(all.cameras[view].twist).map(|(a, b)| a - b).collect::<Vec<_>>();
            assert!(norm(&off) <= 1e-5 * norm(&own.cameras[0].twist), "{:?} {:?}", own.cameras, all.cameras);
        }
        let ours = all.meshes[0].positions.as_flattened().iter().map(|&x| f64::from(x)).collect();
        let error = relative_error(&Group { name: "positions", ours, reference: sum }, 0.0).unwrap();
        assert!(error < 1e-5, "the views' sum differs by {error:e}");
    }
}

#[test]
fn batch_of_many_meshes_of_different_appearance() {
    let mut renderer = renderer();
    let mut case = ball(0, &[EYES[0], EYES[1], EYES[2], EYES[0]], 24);
    let meshes = [shapes::cube().unwrap(), shapes::icosphere(1).unwrap(), shapes::icosphere(0).unwrap()];
    let mut meshes = meshes.to_vec();
    // A mesh of no triangles and no vertices.
    meshes.push(Mesh::new(Vec::new(), Vec::new()).unwrap());
    let with_sort = |(i, mesh): (usize, Mesh)| {
        let appearance = random_appearance(&mut Random::new(SORTS[i]), &mesh);
        mesh.with_appearance(appearance).unwrap()
    };
    case.scene.meshes = meshes.into_iter().enumerate().map(with_sort).collect();
    let upstream = random_upstream(&case, ALL_OUTPUTS);
    for &mode in modes() {
        check(&mut renderer, &case, &upstream, mode, &GRADIENT.without_exceptions())
            .unwrap_or_else(|error| panic!("{error}\n{case:?}"));
    }
}

/// A box of many cells: the sums of cells are added in a fixed order.
#[test]
fn huge_triangle_over_the_whole_image() {
    let positions = vec![
        [-2.9, -1.7, 2.0],
        [3.1, -1.6, 2.4],
        [0.1, 3.3, 3.0],
        [-0.41, -0.37, 1.7],
        [0.47, -0.31, 1.9],
        [0.03, 0.53, 1.8],
    ];
    let mesh = Mesh::new(positions, vec![[0, 1, 2], [3, 4, 5]]).unwrap();
    let mesh = mesh.with_appearance(Appearance::VertexColors(vec![[0.9, 0.2, 0.4]; 6])).unwrap();
    assert_lanes_agree(&made_case(Scene::new(mesh), vec![Camera::screen()], settings(tier(96, 256))), &[8, 32]);
}

/// The memory that backward adds grows with pixels and with triangles, never with their product.
#[test]
fn memory_does_not_grow_with_pixels_times_triangles() {
    let added = |size: u32, triangles: u32| {
        let mut renderer = renderer_with(RendererOptions::default());
        let random = &mut Random::new(2);
        let mut corner =
            || [random.range(-1.0, 1.0) as f32, random.range(-1.0, 1.0) as f32, random.range(2.0, 8.0) as f32];
        let corners: Vec<_> = (0..triangles).map(|_| [(); 3].map(|()| corner())).collect();
        let case = made_case(Scene::new(separate(&corners)), vec![Camera::screen()], settings(size));
        let frame = renderer.render(&case.scene, &case.cameras, &case.settings).unwrap();
        let before = renderer.device_bytes();
        let upstream = upstream_of(&case, |_, _, _| [1.0; 3]);
        let gradients = renderer.backward(&frame, &upstream, &GradientRequest::ALL).unwrap();
        all_finite(&gradients).unwrap();
        (renderer.device_bytes() - before) as f64
    };
    let [small, wide, many, both] = [added(64, 200), added(128, 200), added(64, 800), added(128, 800)];
    let (pixels, triangles) = (wide - small, many - small);
    assert!(pixels > 0.0 && triangles > 0.0, "{small} {wide} {many} {both}");
    // Each 2048 pixels of a triangle's box have a partial sum. Together they take less than the 900 kB that one bit for
    // each of the pairs of 12288 more pixels and 600 more triangles would take.
    let product = both - small - pixels - triangles;
    assert!(product < 900e3, "{product} bytes go with both: {small}, {wide}, {many}, {both}");
    // There is no record for each pair: it would take at least 16 bytes for each of the 13 million pairs.
    assert!(both < 16e6, "{both}");
}

#[track_caller]
fn assert_refused(result: Result<Gradients, Error>, what: &str) {
    match result {
        Err(error @ Error::Backward { .. }) => {
            let said = error.to_string();
            assert!(said.contains(what), "{said:?} does not say {what:?}");
        }
        other => panic!("{other:?} instead of a refusal: {what}"),
    }
}

/// A buffer that gradients are summed into begins at zero in every pass, also where it is so large that it is cleared in parts.
#[test]
fn a_large_texture_gets_the_same_gradient_again() {
    let side = 151;
    let texture = Texture::new(side, side, vec![[0.5; 3]; (side * side) as usize], Wrap::Clamp).unwrap();
    let (uvs, corners) = ([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]], vec![[0, 1, 2], [0, 2, 3]]);
    let positions = uvs.map(|[u, v]: [f32; 2]| [2.0 * u - 1.0, 2.0 * v - 1.0, 2.0]).to_vec();
    let appearance = Appearance::Textured {
        uvs: uvs.to_vec(),
        uv_triangles: corners.clone(),
        textures: vec![texture],
        texture_of_triangle: Vec::new(),
    };
    let scene = Scene::new(Mesh::new(positions, corners).unwrap().with_appearance(appearance).unwrap());
    let mut renderer = renderer();
    let frame = renderer.render(&scene, &[Camera::screen()], &settings(32)).unwrap();
    let ones = frame.color().map(|image| Image { data: vec![1.0; image.data.len()], ..image.clone() }).unwrap();
    let wanted = GradientRequest { texels: true, ..GradientRequest::NOTHING };
    let mut gradient = || renderer.backward(&frame, &ImageGradient::color(ones.clone()), &wanted).unwrap();
    let (first, again) = (gradient(), gradient());
    assert_eq!(first, again);
    // Every row of pixels reaches two rows of texels, so that none of the parts stays as it was.
    let texels = &first.meshes[0].texture_texels[0];
    let touched = texels.chunks(side as usize).filter(|row| row.iter().flatten().any(|x| *x != 0.0)).count();
    assert!(touched >= 60, "{touched} rows of texels");
}

#[test]
fn wrong_uses_are_refused() {
    let mut renderer = renderer();
    let case = ball(1, &EYES[..1], 16);
    let upstream = upstream_of(&case, |_, _, _| [1.0; 3]);
    let wanted = GradientRequest::default();
    let not_saved = Settings { save: false, ..case.settings.clone() };
    let frame = renderer.render(&case.scene, &case.cameras, &not_saved).unwrap();
    assert_refused(renderer.backward(&frame, &upstream, &wanted), "Renderer::render_saved");

    let latest = renderer.render(&case.scene, &case.cameras, &case.settings).unwrap();
    renderer.backward(&latest, &upstream, &wanted).unwrap();
    let mut other = crate::common::renderer();
    assert_refused(other.backward(&latest, &upstream, &wanted), "another renderer");
    other.render(&case.scene, &case.cameras, &case.settings).unwrap();
    assert_refused(other.backward(&latest, &upstream, &wanted), "another renderer");

    // `robustness::errors` tests the other faults of upstream gradients.
    assert_refused(renderer.backward(&latest, &ImageGradient::default(), &wanted), "no image has an upstream gradient");
    // A refusal changes nothing.
    renderer.backward(&latest, &upstream, &wanted).unwrap();

    let color_only = Outputs { color: true, ..Outputs::NOTHING };
    let few = Settings { outputs: color_only, ..case.settings.clone() };
    let frame = renderer.render(&case.scene, &case.cameras, &few).unwrap();
    assert_refused(renderer.backward(&frame, &upstream, &wanted), "the frame has no silhouette image");
    let bad = Settings { sigma: -1.0, ..case.settings.clone() };
    renderer.render(&case.scene, &case.cameras, &bad).unwrap_err();
    let color_alone = ImageGradient { color: upstream.color, ..ImageGradient::default() };
    renderer.backward(&frame, &color_alone, &wanted).unwrap();
}

/// Values that an earlier pass left in pixels without triangles, here infinities, do not enter the sums.
#[test]
fn pixels_beyond_all_triangles_pass_nothing_on() {
    let wanted = GradientRequest { positions: true, colors: true, ..GradientRequest::NOTHING };
    let small = ball(1, &EYES[..1], 64);
    let upstream = random_upstream(&small, ALL_OUTPUTS);
    let expected = backward(&mut renderer(), &small, &upstream, &wanted).unwrap();
    let large = vec![[-9.0, -9.0, 2.0], [9.0, -9.0, 2.0], [0.0, 9.0, 2.0]];
    let all = Mesh::new(large, vec![[0, 1, 2]]).unwrap();
    let all = made_case(Scene::new(all), vec![Camera::screen()], settings(64));
    let mut renderer = renderer();
    let overflow = backward(&mut renderer, &all, &upstream_of(&all, |_, _, _| [f32::MAX; 3]), &wanted).unwrap_err();
    assert!(overflow.contains("overflowed"), "{overflow}");
    let after = backward(&mut renderer, &small, &upstream, &wanted).unwrap();
    same_gradient_bits(&expected, &after).unwrap();
}
