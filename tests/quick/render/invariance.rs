//! An image must not depend on the other views of its batch, nor on the room for lists.

use crate::common::{
    compare::{images, same_image_bits, view_of},
    gradient::{made_case, random_upstream},
    random::Random,
    renderer, renderer_with,
    scenes::{Case, Kind, random_case, small, triangles},
    tier, tolerance,
};
use crate::host::{Planner, difference};
use softras::{
    Camera, Frame, GradientRequest, Mesh, RendererOptions, Scene, Settings,
    embed::Capacity,
    scene::{Appearance, Outputs},
};

#[track_caller]
fn render(renderer: &mut softras::Renderer, case: &Case) -> Frame {
    renderer.render(&case.scene, &case.cameras, &case.settings).unwrap_or_else(|e| panic!("{e}\n{case:?}"))
}

/// Whether every view alone is rendered by the same kernels as the batch. Kernels are specialised by the colouring of
/// the meshes and by whether some view is clipped; another specialisation may round the last bit otherwise.
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
    // Batches of one mesh and of several meshes, with several kinds of appearance and with one.
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
