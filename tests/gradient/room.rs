//! Room for lists is a matter of time alone: without it images and gradients have the same bits.

use crate::common::{
    compare::same_bits,
    gradient::{ALL_OUTPUTS, made_case, random_upstream, same_gradient_bits},
    modes::in_every_mode,
    random::Random,
    renderer_with,
    scenes::{Case, random_appearance},
    tolerance::GRADIENT,
};
use glam::DVec3;
use softras::internals::plan::Capacity;
use softras::{
    Camera, Frame, Gradients, ImageGradient, Lights, Projection, RendererOptions, Scene, Settings, Wanted, shapes,
};

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
    let mesh = shapes::icosphere(1).unwrap();
    let appearance = random_appearance(&mut Random::new(1), &mesh);
    let scene = Scene::new(mesh.with_appearance(appearance).unwrap()).with_lights(Lights::official());
    let projection = Projection::Perspective { fov_y: 0.8 };
    let camera = |eye| Camera::look_at(DVec3::from_array(eye), DVec3::ZERO, DVec3::Y, projection).unwrap();
    let settings = Settings {
        width: 130,
        height: 70,
        sigma: 1.2e-2,
        gamma: 1e-2,
        epsilon: 0.5,
        far: 10.0,
        outputs: ALL_OUTPUTS,
        save: true,
        ..Settings::default()
    };
    made_case(scene, vec![camera([0.4, 0.7, 3.1]), camera([-2.9, 0.3, 0.8])], settings)
}

#[test]
fn no_mode_depends_on_the_room_for_lists() {
    for (name, case) in in_every_mode(&blurred_ball()) {
        let upstream = random_upstream(&case, case.settings.outputs, &GRADIENT);
        let whole = first_of(&case, &upstream, ENOUGH);
        let list = whole.2 as u32;
        assert!(list > 900 && list < ENOUGH.list, "{name}: {list}");
        // Nothing at all; then the bins' lists alone, and half of what the tiles' need.
        for short in [Capacity { coarse: 1, list: 1, cells: 1 }, Capacity { list: list / 2, cells: 40, ..ENOUGH }] {
            assert_same(&format!("{name}, {short:?}"), &whole, &first_of(&case, &upstream, short));
        }
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
    for capacity in [Capacity { coarse: 500, ..ENOUGH }, Capacity { list: 3000, cells: 7, ..ENOUGH }] {
        assert_same(&format!("{capacity:?}"), &whole, &of(capacity));
    }
}
