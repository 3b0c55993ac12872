//! Many layers at one place: the promise of the images does not depend on their number.

use crate::common::{
    compare::compare_frames,
    renderer,
    scenes::{small, triangles},
    tier, tolerance,
};
use softras::{
    Camera, Mesh, Scene, Settings,
    scene::{Distance, Parity, SilhouetteAggregation},
};
use softras_reference::render_culled;

/// How the depths of layers follow each other.
#[derive(Clone, Copy, Debug)]
enum Order {
    /// All the same: every addition of a sum is the same one, so that roundings add up and do not cancel.
    Same,
    /// Each nearer than the one before, so that every layer becomes the reference of the sums.
    Nearer,
}

/// One triangle `count` times between the depths 3 and 5, each with colours of its own.
fn layers(count: usize, order: Order) -> Mesh {
    let corners: Vec<_> = (0..count)
        .map(|i| {
            let z = match order {
                Order::Same => 4.0,
                Order::Nearer => 5.0 - 2.0 * i as f32 / count as f32,
            };
            [[-0.6, -0.5], [0.7, -0.4], [0.1, 0.6]].map(|[x, y]: [f32; 2]| [x, y, z])
        })
        .collect();
    triangles(&corners)
}

/// Sums of a term for each layer, one after another in single precision, were off by up to 4e-4 here.
#[test]
fn errors_do_not_grow_with_the_number_of_layers() {
    let renderer = &mut renderer();
    let base = Settings { near: 1.0, far: 10.0, ..small(16, 16) };
    let modes = [
        ("soft", base.clone()),
        ("sum", Settings { silhouette: SilhouetteAggregation::Sum, ..base.clone() }),
        ("barycentric", Settings { distance: Distance::Barycentric, ..base.clone() }),
        ("official", Settings { parity: Parity::Official, ..base }),
    ];
    let counts = [(1024, 1e-2, 1e-2), (30_000, 1e-4, 1e-2), (30_000, 1e-3, 1e-1)];
    for &(count, sigma, gamma) in tier(&counts[..2], &counts) {
        for order in [Order::Same, Order::Nearer] {
            let scene = Scene::new(layers(count, order));
            for (mode, settings) in &modes[..if count > 2000 { tier(1, 4) } else { 4 }] {
                let settings = Settings { sigma, gamma, ..settings.clone() };
                let frame = renderer.render(&scene, &[Camera::screen()], &settings).unwrap();
                let reference = render_culled(&scene, &[Camera::screen()], &settings).unwrap();
                compare_frames(&frame, &reference, &tolerance::LAYERS)
                    .unwrap_or_else(|error| panic!("{count} layers, {order:?}, {mode}, sigma {sigma}: {error}"));
            }
        }
    }
}
