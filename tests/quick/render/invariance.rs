//! What must not change an image: its company in a batch, the order of triangles, the lanes, the room for lists, what
//! was rendered before, and the day; and what must mirror it: a mirror.

use crate::common::{
    compare::{compare, images, mirrored, same_bits, same_image_bits, view_of},
    gradient::{made_case, random_upstream},
    random::Random,
    renderer, renderer_with,
    scenes::{Case, Kind, blob, random_appearance, random_case, random_lights, random_settings, small, triangles},
    tier, tolerance,
};
use crate::host::{Planner, difference};
use glam::DVec3;
use softras::{
    Camera, DeviceKind, Frame, GradientRequest, Mesh, Projection, RendererOptions, Scene, Settings,
    embed::Capacity,
    scene::{Appearance, Outputs},
};
use softras_reference::render_culled;

#[track_caller]
fn render(renderer: &mut softras::Renderer, case: &Case) -> Frame {
    renderer.render(&case.scene, &case.cameras, &case.settings).unwrap_or_else(|e| panic!("{e}\n{case:?}"))
}

/// `a` against `b` up to the tolerance, but for pixels at a jump of the reference's model.
#[track_caller]
fn assert_close(a: &Frame, b: &Frame, case: &Case) {
    let reference = render_culled(&case.scene, &case.cameras, &case.settings).unwrap();
    for (name, a, b) in images(a, b) {
        let (Some(a), Some(b)) = (a, b) else { continue };
        let b: Vec<f64> = b.data.iter().map(|&x| f64::from(x)).collect();
        compare(name, a, &b, &reference.margin, &tolerance::SAME_SCENE).unwrap_or_else(|e| panic!("{e}\n{case:?}"));
    }
}

/// A blob in front of a camera on the plane x = 0, and both mirrored in that plane.
fn mirror_pair(seed: u64) -> [Case; 2] {
    let random = &mut Random::new(seed);
    let settings = Settings { width: 70, height: 50, outputs: Outputs::ALL, ..random_settings(random, Kind::Plain) };
    let mesh = blob(random);
    let appearance = match random_appearance(random, &mesh) {
        // Its cells do not turn with the winding.
        Appearance::Surface { .. } => Appearance::Uniform([0.3, 0.6, 0.9]),
        appearance => appearance,
    };
    let lights = random_lights(random);
    let projection = Projection::Perspective { fov_y: 0.6 };
    let camera = Camera::look_at(DVec3::new(0.0, 2.0, 4.0), DVec3::ZERO, DVec3::Y, projection).unwrap();
    // The winding turns with the mirror, or the normals would point inwards.
    let turn = |triangles: &[[u32; 3]]| triangles.iter().map(|&[a, b, c]| [a, c, b]).collect::<Vec<_>>();
    let positions = mesh.positions().iter().map(|&[x, y, z]| [-x, y, z]).collect();
    let other = Mesh::new(positions, turn(mesh.triangles())).unwrap();
    let mut turned = appearance.clone();
    if let Appearance::Textured { uv_triangles, .. } = &mut turned {
        *uv_triangles = turn(uv_triangles);
    }
    let mesh = mesh.with_appearance(appearance).unwrap();
    let other = other.with_appearance(turned).unwrap();
    let mut mirrored_lights = lights.clone();
    mirrored_lights.directional.iter_mut().for_each(|light| light.direction[0] *= -1.0);
    [(mesh, lights), (other, mirrored_lights)].map(|(mesh, lights)| Case {
        seed,
        kind: Kind::Plain,
        scene: Scene::new(mesh).with_lights(lights),
        cameras: vec![camera],
        settings: settings.clone(),
    })
}

#[test]
fn a_mirrored_scene_gives_the_mirrored_image() {
    let mut renderer = renderer();
    for seed in 0..tier(2, 6) {
        let [case, other] = mirror_pair(seed);
        let (frame, other) = (render(&mut renderer, &case), render(&mut renderer, &other));
        let reference = render_culled(&case.scene, &case.cameras, &case.settings).unwrap();
        for (name, image, other) in images(&frame, &other) {
            let mut back = mirrored(other.unwrap());
            if name == "normal" {
                back.data.chunks_exact_mut(3).for_each(|normal| normal[0] *= -1.0);
            }
            let back: Vec<f64> = back.data.iter().map(|&x| f64::from(x)).collect();
            let result = compare(name, image.unwrap(), &back, &reference.margin, &tolerance::SAME_SCENE);
            result.unwrap_or_else(|e| panic!("{e}\n{case:?}"));
        }
    }
}

#[test]
fn the_viewer_s_right_is_the_image_s_right() {
    // From +z the viewer's right is +x.
    let projection = Projection::Perspective { fov_y: 1.0 };
    let camera = Camera::look_at(DVec3::Z * 4.0, DVec3::ZERO, DVec3::Y, projection).unwrap();
    let triangle = vec![[0.5, 0.5, 0.0], [1.0, 0.5, 0.0], [0.5, 1.0, 0.0]];
    let scene = Scene::new(Mesh::new(triangle, vec![[0, 1, 2]]).unwrap());
    let settings = Settings { width: 32, height: 32, ..Settings::default() };
    let frame = renderer().render(&scene, &[camera], &settings).unwrap();
    let image = frame.silhouette().unwrap();
    for (row, column, expected) in [(11, 20, 1.0), (11, 11, 0.0), (20, 20, 0.0), (20, 11, 0.0)] {
        assert_eq!(image.pixel(0, row, column), [expected], "row {row}, column {column}");
    }
}

/// Whether every view alone is rendered by the very kernels that render the batch. They are specialised by what colours
/// some mesh and by whether some view is cut; another specialisation may round the last bit otherwise.
fn is_of_one_kind(case: &Case) -> bool {
    let kind = |mesh: &Mesh| match mesh.appearance() {
        Appearance::Uniform(_) | Appearance::VertexColors(_) => 0,
        Appearance::Surface { .. } => 1,
        Appearance::Textured { .. } => 2,
    };
    case.kind != Kind::Clipped && case.scene.meshes.iter().all(|mesh| kind(mesh) == kind(&case.scene.meshes[0]))
}

#[test]
fn a_batch_is_its_views() {
    let mut renderer = renderer();
    // Batches of one mesh and of several, of several kinds and of one.
    let (mut seen, each) = ([[0; 2]; 2], tier(1, 4));
    for seed in 0..150 {
        let case = random_case(seed, [Kind::Plain, Kind::Modes, Kind::Clipped][seed as usize % 3]);
        let exact = is_of_one_kind(&case);
        let count = &mut seen[usize::from(case.scene.meshes.len() > 1)][usize::from(exact)];
        if case.cameras.len() < 2 || *count == each {
            continue;
        }
        *count += 1;
        let batch = render(&mut renderer, &case);
        for (view, &camera) in case.cameras.iter().enumerate() {
            let mesh = case.scene.meshes[case.scene.mesh_of_view(view)].clone();
            let scene = Scene { meshes: vec![mesh], ..case.scene.clone() };
            let single = render(&mut renderer, &Case { scene, cameras: vec![camera], ..case.clone() });
            for (name, batch, single) in images(&batch, &single) {
                let (Some(batch), Some(single)) = (batch, single) else { continue };
                let batch = view_of(batch, view);
                let same = same_image_bits(name, &batch, single);
                let difference = batch.data.iter().zip(&single.data).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                let close = !exact && difference <= tolerance::OTHER_KERNEL;
                assert!(same.is_ok() || close, "view {view}: {same:?}, by at most {difference:e}\n{case:?}");
            }
        }
    }
    assert_eq!(seen, [[each; 2]; 2]);
}

#[test]
fn the_order_of_triangles_does_not_matter() {
    let mut renderer = renderer();
    for seed in 0..tier(2, 6) {
        let mut case = random_case(seed, Kind::Plain);
        // Colours that go with the vertices go with any order of triangles.
        for mesh in &mut case.scene.meshes {
            let random = &mut Random::new(seed);
            let colors = mesh.positions().iter().map(|_| random.color()).collect();
            *mesh = mesh.clone().with_appearance(Appearance::VertexColors(colors)).unwrap();
        }
        let mut shuffled = case.clone();
        for mesh in &mut shuffled.scene.meshes {
            let mut triangles = mesh.triangles().to_vec();
            Random::new(seed + 99).shuffle(&mut triangles);
            *mesh = Mesh::new(mesh.positions().to_vec(), triangles)
                .unwrap()
                .with_appearance(mesh.appearance().clone())
                .unwrap();
        }
        assert_close(&render(&mut renderer, &case), &render(&mut renderer, &shuffled), &case);
    }
}

#[test]
fn lanes_do_not_change_a_bit() {
    // Four read records together on any driver here, sixteen where subgroups are as large. NVIDIA's compiler gives up on the 32
    // pixels of a single lane.
    let is_software = renderer().device_info().kind == DeviceKind::Software;
    let mut renderers: Vec<_> = tier(&[1, 8, 32][..], &[1, 4, 8, 16, 32])
        .iter()
        .filter(|lanes| is_software || **lanes > 1)
        .map(|&lanes| renderer_with(RendererOptions { lanes: Some(lanes), ..RendererOptions::default() }))
        .collect();
    for &(seed, kind) in tier(&[(1, Kind::Plain)][..], &[(1, Kind::Plain), (2, Kind::Modes), (3, Kind::Clipped)]) {
        let case = random_case(seed, kind);
        let frames: Vec<Frame> = renderers.iter_mut().map(|renderer| render(renderer, &case)).collect();
        for frame in &frames[1..] {
            same_bits(&frames[0], frame).unwrap_or_else(|e| panic!("{e}\n{case:?}"));
        }
    }
}

#[test]
fn twenty_repeats_are_the_same_bits() {
    let case = random_case(12, Kind::Plain);
    let mut renderer_a = renderer();
    let first = render(&mut renderer_a, &case);
    for repeat in 0..20 {
        same_bits(&first, &render(&mut renderer_a, &case)).unwrap_or_else(|e| panic!("repeat {repeat}: {e}"));
    }
    same_bits(&first, &render(&mut renderer(), &case)).expect("another renderer");
}

#[test]
fn what_was_rendered_before_leaves_no_trace() {
    let mut used = renderer();
    let small = random_case(5, Kind::Plain);
    let fresh = render(&mut used, &small);
    for seed in 20..tier(22, 26) {
        render(&mut used, &random_case(seed, [Kind::Plain, Kind::Clipped][seed as usize % 2]));
        same_bits(&fresh, &render(&mut used, &small)).unwrap_or_else(|e| panic!("after seed {seed}: {e}"));
    }
}

/// A scene whose lists outgrow the room they begin with comes out whole. Room is estimated for triangles that cover the image
/// once together; each of these covers all of it.
#[test]
fn lists_grow_until_all_fits() {
    let random = &mut Random::new(9);
    let corners: Vec<_> = (0..400)
        .map(|_| {
            let z = random.range(2.0, 9.0) as f32;
            [[-9.0, -3.0, z], [9.0, -3.0, z], [random.range(-1.0, 1.0) as f32, 9.0, z]]
        })
        .collect();
    let settings = Settings { save: true, ..small(200, 90) };
    let case = made_case(Scene::new(triangles(&corners)), vec![Camera::screen()], settings);
    let mut kept = renderer_with(RendererOptions::default());
    let frames = [0; 3].map(|_| render(&mut kept, &case));
    let tiles = 25 * 23;
    assert_eq!(kept.frame_counts().unwrap().list_entries, 400 * tiles);
    let upstream = random_upstream(&case, Outputs::ALL);
    let capacity = Capacity { coarse: 1 << 14, list: 1 << 18, cells: 1 << 12 };
    let planner = Planner::new();
    let whole = planner.render(&case, &upstream, GradientRequest::default(), capacity);
    planner.assert_silent();
    for frame in frames {
        for ((name, due), (_, found)) in whole.images.iter().zip(frame.images()) {
            assert_eq!(difference(&found.data, due), None, "{name}");
        }
    }
}
