//! Room for lists affects time alone: without it images and gradients have the same bits.

use super::repeat::{EYES, SORTS, ball};
use crate::common::{
    gradient::{ALL_OUTPUTS, made_case, random_upstream},
    modes::{alone, cut_out},
    renderer_with,
    scenes::{Case, crowd, small, triangles},
    tier,
};
use crate::host::{Planned, Planner};
use softras::embed::Capacity;
use softras::{Camera, GradientRequest, Lights, Mesh, RendererOptions, Scene, Settings};

const ENOUGH: Capacity = Capacity { coarse: 1 << 18, list: 1 << 20, cells: 1 << 12 };

/// A lit ball before two cameras, so blurred that boxes are larger than a cell and lists longer than two words.
fn blurred_ball() -> Case {
    let mut case = ball(SORTS[2], &EYES[..2], 130);
    (case.settings.height, case.settings.sigma) = (70, 1.2e-2);
    case
}

/// Entries of all tiles' lists.
fn list_entries(case: &Case) -> u32 {
    let mut renderer = renderer_with(RendererOptions::default());
    renderer.render(&case.scene, &case.cameras, &case.settings).unwrap();
    renderer.frame_counts().unwrap().list_entries as u32
}

#[test]
fn no_mode_depends_on_the_room_for_lists() {
    // No room at all; or room for the bins' lists alone, and half of what the tiles' lists need.
    let shorts =
        |list: u32| [Capacity { coarse: 1, list: 1, cells: 1 }, Capacity { list: list / 2, cells: 40, ..ENOUGH }];
    let planner = Planner::new();
    for (i, (name, case)) in alone(&blurred_ball()).take(tier(1, usize::MAX)).enumerate() {
        let upstream = random_upstream(&case, case.settings.outputs);
        let of = |capacity| planner.render(&case, &upstream, GradientRequest::ALL, capacity);
        let whole = of(ENOUGH);
        let list = list_entries(&case);
        assert!(list > 900 && list < ENOUGH.list, "{name}: {list}");
        let short = shorts(list)[i % 2];
        assert_eq!(whole.difference(&of(short)), None, "{name}, {short:?}");
    }
    planner.assert_silent();
}

/// Tiles with a triangle too thin for forward_soft, and tiles without, are walked by one kernel each. A new renderer finds out
/// which kernels the frame needs, and so does one that has rendered larger triangles before, of which none was thin.
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
    let upstream = random_upstream(&case, ALL_OUTPUTS);
    let planner = Planner::new();
    let of = |capacity| planner.render(&case, &upstream, GradientRequest::ALL, capacity);
    let whole = of(ENOUGH);
    for short in [Capacity { coarse: 1, list: 1, cells: 1 }, Capacity { list: 700, ..ENOUGH }] {
        assert_eq!(whole.difference(&of(short)), None, "{short:?}");
    }
    planner.assert_silent();
    for before in [None, Some(blurred_ball())] {
        let mut renderer = renderer_with(RendererOptions::default());
        if let Some(before) = &before {
            renderer.render(&before.scene, &before.cameras, &before.settings).unwrap();
        }
        let frame = renderer.render(&case.scene, &case.cameras, &case.settings).unwrap();
        let gradients = renderer.backward(&frame, &upstream, &GradientRequest::ALL).unwrap();
        assert_eq!(whole.difference(&Planned::of(&frame, gradients)), None, "after {before:?}");
    }
}

/// A list that lavapipe walks in one loop but finds in the bin's bitmap in several; and one that it walks in several.
#[test]
fn turns_do_not_change_bits() {
    let planner = Planner::new();
    let all = [(48_000, false, false), (48_000, true, false), (48_000, false, true), (130_000, false, false)];
    for &(count, thin, faded) in tier(&all[..1], &all) {
        let mut corners = crowd(count);
        if thin {
            corners[7] = [[0.05, 0.0, 3.0], [0.05 + 1e-7, 0.1, 3.0], [0.05, 0.1, 3.0]];
        }
        let settings = Settings { sigma: 1e-5, gamma: 1e-2, save: true, ..small(16, 16) };
        let mut case = made_case(Scene::new(triangles(&corners)), vec![Camera::screen()], settings);
        if faded {
            cut_out(&mut case);
        }
        let upstream = random_upstream(&case, case.settings.outputs);
        let of = |capacity| planner.render(&case, &upstream, GradientRequest::ALL, capacity);
        let whole = of(ENOUGH);
        let list = list_entries(&case);
        assert!((40_001..ENOUGH.list).contains(&list), "{list}");
        let short = Capacity { coarse: 1, list: 1, cells: 1 };
        assert_eq!(whole.difference(&of(short)), None, "{count}, thin {thin}, faded {faded}");
    }
    planner.assert_silent();
}

/// As many lanes as a GPU has for a tile, and bins of which some have lists.
#[test]
fn wide_workgroups_do_not_depend_on_the_room_for_lists() {
    let case = blurred_ball();
    let upstream = random_upstream(&case, ALL_OUTPUTS);
    let planner = Planner::new().with_lanes(32);
    let of = |capacity| planner.render(&case, &upstream, GradientRequest::ALL, capacity);
    let whole = of(ENOUGH);
    let few = [Capacity { coarse: 500, ..ENOUGH }, Capacity { list: 3000, cells: 7, ..ENOUGH }];
    for &capacity in tier(&few[1..], &few) {
        assert_eq!(whole.difference(&of(capacity)), None, "{capacity:?}");
    }
    planner.assert_silent();
}
