//! The promise of τ: in `guaranteed` mode no image is off by more than n τ of its range when n pairs are dropped.

use crate::common::gradient::made_case;
use crate::common::random::Random;
use crate::common::scenes::{Case, Kind, random_case, separate};
use crate::common::{renderer, tier, tolerance};
use softras::scene::{Appearance, Background, ColorAggregation, Outputs, Parity, SilhouetteAggregation, Support};
use softras::{Camera, Error, Lights, Mesh, Scene, Settings};
use softras_reference::pairs;
use softras_reference::{ReferenceFrame, Truncation, render, render_culled};

/// The largest |image - untruncated| over what the pixel's dropped pairs allow, and where it is; `slack` is for an
/// image that has errors of its own.
fn worst(images: &ReferenceFrame, untruncated: &ReferenceFrame, case: &Case, slack: f64) -> (f64, String) {
    let settings = &case.settings;
    let counted = pairs(&case.scene, &case.cameras, settings).unwrap();
    let pixels = (settings.width * settings.height) as usize;
    let pieces: Vec<u64> = (0..case.cameras.len()).map(|view| pieces_of(case, view)).collect();
    let parts = [
        ("color", &images.color, &untruncated.color, 3, 1.0),
        ("silhouette", &images.silhouette, &untruncated.silhouette, 1, 1.0),
        ("depth", &images.depth, &untruncated.depth, 1, settings.far),
        ("normal", &images.normal, &untruncated.normal, 3, 2.0),
    ];
    let mut found = (0.0, String::new());
    for (name, ours, exact, channels, range) in parts {
        assert_eq!(ours.len(), exact.len(), "{name}");
        for (i, (a, b)) in ours.iter().zip(exact).enumerate() {
            let pixel = i / channels;
            // The pairs that the pixel drops: the view's pieces without those that it needs.
            let dropped = pieces[pixel / pixels].saturating_sub(u64::from(counted.needed[pixel]));
            let allowed = (settings.tau * dropped as f64 + slack) * range + 1e-12;
            let share = (a - b).abs() / allowed;
            if share > found.0 || share.is_nan() {
                found = (share, format!("{name}, pixel {pixel}: {a} for {b}, {dropped} pairs dropped"));
            }
        }
    }
    found
}

fn pieces_of(case: &Case, view: usize) -> u64 {
    let cameras = &case.cameras[view..=view];
    let scene = Scene::new(case.scene.meshes[case.scene.mesh_of_view(view)].clone());
    pairs(&scene, cameras, &case.settings).unwrap().pieces
}

/// A random scene of few pixels and colours in [0, 1], with every image.
fn case(seed: u64) -> Case {
    let kind = if seed.is_multiple_of(3) { Kind::Clipped } else { Kind::Plain };
    let mut case = random_case(seed, kind);
    let random = &mut Random::new(seed ^ 0xfeed);
    case.scene.lights = Lights::unlit();
    let s = &mut case.settings;
    (s.width, s.height, s.outputs) = (s.width.min(24), s.height.min(20), Outputs::ALL);
    s.tau = random.log_range(1e-5, 0.2);
    s.gamma = random.log_range(1e-4, 0.3);
    s.silhouette = random.choose(&[
        SilhouetteAggregation::Product,
        SilhouetteAggregation::Product,
        SilhouetteAggregation::Sum,
        SilhouetteAggregation::Hard,
    ]);
    s.color = random.choose(&[ColorAggregation::Softmax, ColorAggregation::Softmax, ColorAggregation::Hard]);
    s.support = Support::Guaranteed;
    case
}

#[test]
fn guaranteed_images_are_within_tau_of_the_untruncated_ones() {
    let mut close = 0.0f64;
    for seed in 0..tier(100, 400) {
        let case = case(seed);
        let exact = render(&case.scene, &case.cameras, &case.settings, Truncation::None).unwrap();
        let ours = render_culled(&case.scene, &case.cameras, &case.settings).unwrap();
        let (share, place) = worst(&ours, &exact, &case, 0.0);
        assert!(share <= 1.0, "{share}: {place} in {case:?}");
        close = close.max(share);
    }
    // Some scene comes near to the bound: it is not so loose that nothing could exceed it.
    assert!(close > 0.01, "{close}");
}

/// A bright triangle before a dark wall: beyond its support, though D is small there, it outweighs the wall.
fn before_a_wall(support: Support) -> Case {
    let wall = [[-9.0, -9.0, 3.0], [9.0, -9.0, 3.0], [0.0, 9.0, 3.0]];
    let bright = [[-0.5, -0.5, 2.0], [0.1, -0.5, 2.0], [-0.5, 0.5, 2.0]];
    let colors = [[[0.0; 3]; 3], [[1.0; 3]; 3]].concat();
    let scene = Scene::new(separate(&[wall, bright]).with_appearance(Appearance::VertexColors(colors)).unwrap());
    let settings = Settings {
        width: 40,
        height: 40,
        sigma: 1e-3,
        gamma: 0.01,
        near: 1.0,
        far: 5.0,
        background: Background::Composite,
        outputs: Outputs::ALL,
        support,
        ..Settings::default()
    };
    made_case(scene, vec![Camera::screen()], settings)
}

#[test]
fn probability_support_loses_what_outweighs_a_wall() {
    let share = |support| {
        let case = before_a_wall(support);
        let exact = render(&case.scene, &case.cameras, &case.settings, Truncation::None).unwrap();
        let ours = render_culled(&case.scene, &case.cameras, &case.settings).unwrap();
        worst(&ours, &exact, &case, 0.0)
    };
    assert!(share(Support::Guaranteed).0 <= 1.0);
    // A whole white pixel is missing where two pairs may change it by 2e-4.
    let (lost, place) = share(Support::Probability);
    assert!(lost > 1e3, "{lost}: {place}");
}

/// `SOFTRAS_CASES=10000 cargo test --release -p softras --test quick -- keeps_the_promise --nocapture` renders that many.
#[test]
fn the_device_keeps_the_promise() {
    let wanted: Option<usize> = std::env::var("SOFTRAS_CASES").ok().map(|count| count.parse().unwrap());
    let mut renderer = renderer();
    let (mut rendered, mut refused, mut largest) = (0, 0, (0.0, String::new()));
    let few = wanted.is_none().then_some(tier(20, 60));
    let seeds = (400..).take(few.unwrap_or(usize::MAX));
    for mut case in [before_a_wall(Support::Guaranteed)].into_iter().chain(seeds.map(case)) {
        if wanted == Some(rendered) {
            break;
        }
        // Few kinds of kernel, because a software device takes long to compile them; and no modes with jumps, where
        // rounding may decide.
        (case.settings.silhouette, case.settings.color) = Default::default();
        for mesh in &mut case.scene.meshes {
            let colors = mesh.positions().iter().map(|p| p.map(|x| (0.5 + 0.4 * x).clamp(0.0, 1.0))).collect();
            *mesh = mesh.clone().with_appearance(Appearance::VertexColors(colors)).unwrap();
        }
        let frame = match renderer.render(&case.scene, &case.cameras, &case.settings) {
            Ok(frame) => frame,
            // This support would reach farther than single precision can hold D.
            Err(Error::Settings { field: "support", .. }) => {
                refused += 1;
                continue;
            }
            Err(error) => panic!("{error}: {case:?}"),
        };
        let exact = render(&case.scene, &case.cameras, &case.settings, Truncation::None).unwrap();
        let data =
            |image: softras::Result<&softras::Image>| image.unwrap().data.iter().copied().map(f64::from).collect();
        let mut ours = ReferenceFrame {
            color: data(frame.color()),
            silhouette: data(frame.silhouette()),
            depth: data(frame.depth()),
            normal: data(frame.normal()),
            ..exact.clone()
        };
        // Rounding decides which pairs near the far plane take part. Elsewhere the kernels' own tolerance is added.
        let margin = tolerance::of(&case);
        for pixel in (0..exact.margin.len()).filter(|&i| exact.margin[i] < margin.margin) {
            let range = 3 * pixel..3 * pixel + 3;
            ours.color[range.clone()].copy_from_slice(&exact.color[range.clone()]);
            ours.normal[range.clone()].copy_from_slice(&exact.normal[range]);
            ours.silhouette[pixel] = exact.silhouette[pixel];
            ours.depth[pixel] = exact.depth[pixel];
        }
        let (share, place) = worst(&ours, &exact, &case, margin.value);
        assert!(share <= 1.0, "{share}: {place} in {case:?}");
        if share > largest.0 {
            largest = (share, format!("{place} of seed {}", case.seed));
        }
        rendered += 1;
    }
    println!(
        "{rendered} scenes, {refused} refused; largest error over what tau promises {:.3}: {}",
        largest.0, largest.1
    );
    assert!(rendered > 5 || wanted.is_some(), "{rendered}");
}

#[test]
fn what_cannot_be_promised_is_refused() {
    let mut renderer = renderer();
    let case = before_a_wall(Support::Guaranteed);
    let official = Settings { parity: Parity::Official, ..case.settings.clone() };
    let error = renderer.render(&case.scene, &case.cameras, &official).unwrap_err().to_string();
    assert!(error.contains("support") && error.contains("parity"), "{error}");
    let sharp = Settings { gamma: 1e-5, ..case.settings.clone() };
    let error = renderer.render(&case.scene, &case.cameras, &sharp).unwrap_err().to_string();
    assert!(error.contains("support") && error.contains("gamma"), "{error}");
}

/// The radius of support by hand: depths of 2 and 4 between near 1 and far 11 are scores of 0.9 and 0.7.
#[test]
fn cutoffs_by_hand() {
    let mesh =
        |near: f32, far: f32| Mesh::new(vec![[0.0, 0.0, near], [1.0, 0.0, far], [0.0, 1.0, near]], vec![[0, 1, 2]]);
    let scene = Scene::new(mesh(2.0, 4.0).unwrap());
    let settings = Settings {
        tau: 0.25,
        epsilon: 0.3,
        gamma: 0.5,
        near: 1.0,
        far: 11.0,
        support: Support::Guaranteed,
        ..Settings::default()
    };
    let cutoff = |settings: &Settings, scene: &Scene, cameras: &[Camera]| settings.cutoff_of(scene, cameras);
    let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-8, "{a} instead of {b}");
    let screen = [Camera::screen()];
    let (plain, ln7) = (3f64.ln(), 7f64.ln());
    close(settings.cutoff(), plain);
    close(cutoff(&settings, &scene, &screen), plain + (0.9 - 0.3) / 0.5);
    let composite = Settings { background: Background::Composite, ..settings.clone() };
    close(cutoff(&composite, &scene, &screen), ln7 + (0.9 - 0.7) / 0.5);
    // Depths beyond near and far count as near and far; what no camera sees does not count.
    close(cutoff(&composite, &Scene::new(mesh(0.5, 60.0).unwrap()), &screen), ln7 + 1.0 / 0.5);
    close(cutoff(&settings, &Scene::new(mesh(12.0, 60.0).unwrap()), &screen), plain);
    close(cutoff(&settings, &Scene::new(mesh(-12.0, 0.9).unwrap()), &screen), plain);
    // Never below that of the silhouette.
    close(cutoff(&Settings { epsilon: 5.0, ..settings.clone() }, &scene, &screen), plain);
    // Through a camera half a unit closer, looking along -z from 0: depths of 3.5 and 5.5 at z = -3 and -5.
    let eye = glam::DVec3::new(0.0, 0.0, 0.5);
    let projection = softras::Projection::Perspective { fov_y: 0.5 };
    let behind = Camera::look_direction(eye, glam::DVec3::NEG_Z, glam::DVec3::Y, projection).unwrap();
    let away = Scene::new(mesh(-3.0, -5.0).unwrap());
    close(cutoff(&composite, &away, &[behind]), ln7 + 0.2 / 0.5);
    close(cutoff(&settings, &away, &[behind]), plain + (0.75 - 0.3) / 0.5);
    // A screen's depths are the vertices' own, whatever the view transform beside it.
    let turned = Camera::look_direction(eye, glam::DVec3::NEG_Z, glam::DVec3::Y, softras::Projection::Screen).unwrap();
    close(cutoff(&settings, &scene, &[turned]), plain + (0.9 - 0.3) / 0.5);
    // With several views the one that reaches farthest decides.
    let batch = Scene::batch(vec![mesh(8.0, 9.0).unwrap(), mesh(2.0, 4.0).unwrap()]);
    close(cutoff(&settings, &batch, &[Camera::screen(); 2]), plain + (0.9 - 0.3) / 0.5);
    // If no image is mixed by depth, the support is that of the silhouette.
    let silhouette = Outputs::SILHOUETTE;
    for same in [
        Settings { support: Support::Probability, ..settings.clone() },
        Settings { color: ColorAggregation::Hard, ..settings.clone() },
        Settings { outputs: silhouette, ..settings.clone() },
    ] {
        close(cutoff(&same, &scene, &screen), plain);
    }
    for outputs in [Outputs { depth: true, ..silhouette }, Outputs { normal: true, ..silhouette }] {
        close(cutoff(&Settings { outputs, ..settings.clone() }, &scene, &screen), plain + (0.9 - 0.3) / 0.5);
    }
}

/// D is τ where the support ends, which is where a blur of that number of pixels ends.
#[test]
fn a_blur_ends_where_d_is_tau() {
    for (tau, pixels, height) in [(0.3, 3.0, 64), (1e-4, 0.7, 256)] {
        let settings = Settings { tau, height, ..Settings::default() }.with_blur_pixels(pixels);
        let distance = pixels * 2.0 / f64::from(height);
        let d = 1.0 / (1.0 + (distance * distance / settings.sigma).exp());
        assert!((d / tau - 1.0).abs() < 1e-9 && (settings.blur_pixels() - pixels).abs() < 1e-9, "{d}");
    }
}
