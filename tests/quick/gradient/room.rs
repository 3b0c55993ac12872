//! Room for lists is a matter of time alone: without it images and gradients have the same bits.

use super::repeat::{EYES, SORTS, ball};
use crate::common::{
    compare::same_bits,
    gradient::{ALL_OUTPUTS, made_case, random_upstream, same_gradient_bits},
    modes::{cut_out, in_every_mode},
    random::Random,
    renderer_with,
    scenes::{Case, small, triangles},
    tier,
    tolerance::GRADIENT,
};
use softras::embed::Capacity;
use softras::{Camera, Frame, Gradients, ImageGradient, Lights, Mesh, RendererOptions, Scene, Settings, Wanted};

/// A frame and its gradients by a renderer of its own, whose first frame has this capacity; and the entries of all lists.
fn first_of(case: &Case, upstream: &ImageGradient, capacity: Capacity) -> (Frame, Gradients, u64) {
    let mut renderer = renderer_with(RendererOptions { capacity: Some(capacity), ..RendererOptions::default() });
    let frame = renderer.render(&case.scene, &case.cameras, &case.settings).unwrap();
    let entries = renderer.frame_counts().unwrap().list_entries;
    let gradients = renderer.backward(&frame, upstream, &Wanted::ALL).unwrap();
    (frame, gradients, entries)
}

const ENOUGH: Capacity = Capacity { coarse: 1 << 16, list: 1 << 20, cells: 1 << 12 };

#[track_caller]
fn assert_same(what: &str, a: &(Frame, Gradients, u64), b: &(Frame, Gradients, u64)) {
    same_bits(&a.0, &b.0).unwrap_or_else(|error| panic!("{what}: {error}"));
    same_gradient_bits(&a.1, &b.1).unwrap_or_else(|error| panic!("{what}: {error}"));
}

/// A lit ball before two cameras, so blurred that boxes are larger than a cell and lists longer than two words.
fn blurred_ball() -> Case {
    let mut case = ball(SORTS[2], &EYES[..2], 130);
    (case.settings.height, case.settings.sigma) = (70, 1.2e-2);
    case
}

/// The modes in which the kernels that walk have code of their own; the quick tier takes the first.
const WALKED_MODES: [&str; 12] = [
    "the paper's",
    "composite",
    "hard colour",
    "sum",
    "barycentric official",
    "cut at near",
    "beyond far",
    "textures, repeated",
    "silhouette alone",
    "official front faces",
    "cut-outs",
    "silhouette of cut-outs alone",
];

#[test]
fn no_mode_depends_on_the_room_for_lists() {
    // Nothing at all; or the bins' lists alone, and half of what the tiles' need.
    let shorts =
        |list: u32| [Capacity { coarse: 1, list: 1, cells: 1 }, Capacity { list: list / 2, cells: 40, ..ENOUGH }];
    let walked: Vec<_> = WALKED_MODES.into_iter().step_by(tier(12, 1)).collect();
    let mut seen = 0;
    for (name, case) in in_every_mode(&blurred_ball()).filter(|(name, _)| walked.contains(name)) {
        let upstream = random_upstream(&case, case.settings.outputs, &GRADIENT);
        let whole = first_of(&case, &upstream, ENOUGH);
        let list = whole.2 as u32;
        assert!(list > 900 && list < ENOUGH.list, "{name}: {list}");
        let short = shorts(list)[seen % 2];
        assert_same(&format!("{name}, {short:?}"), &whole, &first_of(&case, &upstream, short));
        seen += 1;
    }
    assert_eq!(seen, walked.len());
}

/// Tiles with a triangle too thin for forward_soft, and tiles without, are walked by one kernel each.
#[test]
fn thin_triangles_do_not_depend_on_the_room_for_lists() {
    let mut case = blurred_ball();
    case.settings.sigma = 1e-4;
    let needle = |x: f32| [[x, -0.9, 0.2], [x + 1e-7, 0.9, 0.3], [x, 0.9, 0.3]];
    let mut positions = case.scene.meshes[0].positions().to_vec();
    let mut corners = case.scene.meshes[0].triangles().to_vec();
    for needle in [-0.6, 0.1, 0.5].map(needle) {
        let first = positions.len() as u32;
        positions.extend(needle);
        corners.push([first, first + 1, first + 2]);
    }
    let mesh = Mesh::new(positions, corners).unwrap();
    case.scene = Scene::new(mesh).with_lights(Lights::official());
    let upstream = random_upstream(&case, ALL_OUTPUTS, &GRADIENT);
    let whole = first_of(&case, &upstream, ENOUGH);
    for short in [Capacity { coarse: 1, list: 1, cells: 1 }, Capacity { list: 700, ..ENOUGH }] {
        assert_same(&format!("{short:?}"), &whole, &first_of(&case, &upstream, short));
    }
}

/// A list that one loop of lavapipe's walks, whose search in the bin's bitmap takes more than one.
#[test]
fn turns_do_not_change_bits() {
    let random = &mut Random::new(3);
    let mut corners: Vec<[[f32; 3]; 3]> = (0..48_000)
        .map(|i| {
            let (x, y) = (0.0525 + random.range(-0.02, 0.02) as f32, 0.0525 + random.range(-0.02, 0.02) as f32);
            let z = 2.0 + 10.0 * i as f32 / 48_000.0;
            [[x, y, z], [x + 0.03, y, z], [x, y + 0.03, z]]
        })
        .collect();
    for &(thin, faded) in tier(&[(false, false)][..], &[(false, false), (true, false), (false, true)]) {
        if thin {
            corners[7] = [[0.05, 0.0, 3.0], [0.05 + 1e-7, 0.1, 3.0], [0.05, 0.1, 3.0]];
        }
        let settings = Settings { sigma: 1e-5, gamma: 1e-2, save: true, ..small(16, 16) };
        let mut case = made_case(Scene::new(triangles(&corners)), vec![Camera::screen()], settings);
        if faded {
            cut_out(&mut case);
        }
        let upstream = random_upstream(&case, case.settings.outputs, &GRADIENT);
        let whole = first_of(&case, &upstream, ENOUGH);
        assert!(whole.2 > 40_000 && whole.2 < u64::from(ENOUGH.list), "{}", whole.2);
        let short = Capacity { coarse: 1, list: 1, cells: 1 };
        assert_same(&format!("thin {thin}, faded {faded}"), &whole, &first_of(&case, &upstream, short));
    }
}

/// As many lanes as a GPU has for a tile, and bins of which some have lists.
#[test]
fn wide_workgroups_do_not_depend_on_the_room_for_lists() {
    let case = blurred_ball();
    let upstream = random_upstream(&case, ALL_OUTPUTS, &GRADIENT);
    let of = |capacity| {
        let options = RendererOptions { capacity: Some(capacity), lanes: Some(32), ..RendererOptions::default() };
        let mut renderer = renderer_with(options);
        let frame = renderer.render(&case.scene, &case.cameras, &case.settings).unwrap();
        let gradients = renderer.backward(&frame, &upstream, &Wanted::ALL).unwrap();
        (frame, gradients, 0)
    };
    let whole = of(ENOUGH);
    let few = [Capacity { coarse: 500, ..ENOUGH }, Capacity { list: 3000, cells: 7, ..ENOUGH }];
    for &capacity in tier(&few[1..], &few) {
        assert_same(&format!("{capacity:?}"), &whole, &of(capacity));
    }
}
