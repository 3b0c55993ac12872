//! What holds of every scene, camera and plan, whatever the numbers: proptest shrinks what does not.

use glam::DVec3;
use proptest::prelude::*;
use softras::{
    Camera, Lights, Mesh, Projection, Settings,
    internals::buffers::{BufferId, TableLengths},
    internals::constants as c,
    internals::plan::{Capacity, DepthSpan, ForwardPlan, PlanInput, Rare, Sampling, ViewSize},
    scene::Outputs,
};

/// Any float there is, and more often a usual one.
fn float() -> impl Strategy<Value = f32> {
    prop_oneof![2 => -10f32..10.0, 1 => any::<f32>(), 1 => Just(f32::NAN), 1 => Just(f32::INFINITY)]
}

fn double() -> impl Strategy<Value = f64> {
    prop_oneof![3 => -10f64..10.0, 1 => any::<f64>(), 1 => Just(f64::NAN)]
}

/// A camera's view-space place of a world point.
fn seen(camera: &Camera, p: DVec3) -> DVec3 {
    DVec3::from_array(camera.view().map(|r| r[0] * p.x + r[1] * p.y + r[2] * p.z + r[3]))
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// A mesh is refused exactly where a value is not finite or too large, or an index names no vertex.
    #[test]
    fn meshes_are_validated(
        positions in prop::collection::vec([float(), float(), float()], 0..6),
        triangles in prop::collection::vec([0u32..7, 0u32..7, 0u32..7], 0..6),
    ) {
        let finite = positions.iter().flatten().all(|x| x.abs() <= Mesh::FARTHEST);
        let inside = triangles.iter().flatten().all(|&i| (i as usize) < positions.len());
        prop_assert_eq!(Mesh::new(positions, triangles).is_ok(), finite && inside);
    }

    /// Settings that are not refused leave nothing unbounded: every number that kernels get is finite.
    #[test]
    fn valid_settings_make_finite_plans(
        sigma in -12.1f64..3.1, gamma in -10.1f64..6.1, tau in -12.1f64..0.0, epsilon in double(), near in -6.1f64..9.1,
        beyond in -6.1f64..6.0, width in 0u32..17000, height in 0u32..17000,
    ) {
        // Powers of ten, a little beyond what is allowed.
        let [sigma, gamma, tau, near] = [sigma, gamma, tau, near].map(|power| 10f64.powf(power));
        let far = near * (1.0 + 10f64.powf(beyond));
        let settings = Settings { width, height, epsilon, sigma, gamma, tau, near, far, ..Settings::default() };
        if settings.validate().is_err() {
            return Ok(());
        }
        let plan = plan(&settings, &[ViewSize { vertices: 3, triangles: 1 }], true).unwrap();
        let f = plan.push;
        let numbers = [
            f.scale, f.radius_squared, f.radius_pixels, f.barycentric_scale, f.barycentric_radius, f.near_high, f.far_high,
            f.score_high, f.background_exponent, f.background_fraction,
        ];
        prop_assert!(numbers.iter().all(|x| x.is_finite()), "{numbers:?} of {settings:?}");
        prop_assert!(f.scale > 0.0 && f.radius_squared > 0.0 && f.score_high > 0.0, "{settings:?}");
    }

    /// A camera that is not refused is a rigid motion that keeps its target before it, in the middle.
    #[test]
    fn cameras_look_at_their_targets(
        eye in [double(), double(), double()], target in [double(), double(), double()],
        up in [double(), double(), double()], fov_y in 0.01f64..3.0,
    ) {
        let (eye, target, up) = (DVec3::from(eye), DVec3::from(target), DVec3::from(up));
        let Ok(camera) = Camera::look_at(eye, target, up, Projection::Perspective { fov_y }) else { return Ok(()) };
        let (distance, size) = ((target - eye).length(), eye.length().max(target.length()).max(1.0));
        let p = seen(&camera, target);
        prop_assert!((p - DVec3::new(0.0, 0.0, distance)).length() <= 1e-12 * size, "{p} at {distance}");
        prop_assert!(seen(&camera, eye).length() <= 1e-12 * size);
        let rows = camera.view().map(|r| DVec3::new(r[0], r[1], r[2]));
        // x right, y up, z forward: not mirrored is x × y = -z.
        prop_assert!((rows[0].cross(rows[1]) + rows[2]).length() < 1e-9, "{rows:?}");
    }

    /// Sizes hold what the counts say, in 64 bits, and workgroups cover every vertex, triangle, bin and tile.
    #[test]
    fn plans_cover_everything(
        sizes in prop::collection::vec((0u32..5_000_000, 0u32..5_000_000), 1..5),
        width in 1u32..=Settings::MAX_SIZE, height in 1u32..=Settings::MAX_SIZE, outputs in 1u32..16, crosses in any::<bool>(),
    ) {
        let bit = |i: u32| outputs >> i & 1 == 1;
        let outputs = Outputs { color: bit(0), silhouette: bit(1), depth: bit(2), normal: bit(3) };
        let settings = Settings { width, height, outputs, ..Settings::default() };
        let views: Vec<_> = sizes.iter().map(|&(vertices, triangles)| ViewSize { vertices, triangles }).collect();
        let most = views.iter().map(|v| v.triangles).max().unwrap();
        let Ok(plan) = plan(&settings, &views, crosses) else {
            let (limit, pieces) = (i32::MAX as u64, 1 + u64::from(crosses));
            let sum = |f: &dyn Fn(&ViewSize) -> u64| views.iter().map(f).sum::<u64>();
            let bins = u64::from(width.div_ceil(c::BIN_WIDTH)) * u64::from(height.div_ceil(c::BIN_HEIGHT));
            let words = |v: &ViewSize| (u64::from(v.triangles) * pieces).div_ceil(c::WORD_BITS.into()) * bins;
            let records = sum(&|v| 9 * pieces * u64::from(v.triangles));
            let vertices = sum(&|v| 3 * u64::from(v.vertices));
            let pixels = views.len() as u64 * u64::from(width) * u64::from(height);
            let beyond = [records, vertices, pixels, sum(&words)].iter().any(|needed| *needed > limit);
            prop_assert!(most > 1 << 22 || beyond, "refused for nothing");
            return Ok(());
        };
        let pieces = if crosses { 2 } else { 1 };
        let records: u64 = views.iter().map(|v| pieces * u64::from(v.triangles)).sum();
        let pixels = views.len() as u64 * u64::from(width) * u64::from(height);
        prop_assert_eq!((plan.totals.records, plan.totals.pixels), (records, pixels));
        prop_assert!(plan.sizes[BufferId::Geometry] >= records * 16 * u64::from(c::GEOMETRY_TEXELS));
        prop_assert!(plan.sizes[BufferId::Boxes] >= records * 16 && plan.sizes.device_filled() >= plan.sizes[BufferId::Geometry]);
        let covers = |[x, y, z]: [u32; 3], each: u32, needed: u64| {
            u64::from(x) * u64::from(z) * u64::from(each) >= needed && y as usize == views.len()
        };
        let vertices = views.iter().map(|v| v.vertices).max().unwrap();
        prop_assert!(covers(plan.groups.vertex, c::LINEAR_GROUP, vertices.into()));
        prop_assert!(covers(plan.groups.triangle, c::LINEAR_GROUP, most.into()));
        let tiles = u64::from(width.div_ceil(c::TILE_WIDTH)) * u64::from(height.div_ceil(c::TILE_HEIGHT));
        prop_assert_eq!(plan.totals.tiles, tiles * plan.views.len() as u64);
        prop_assert!(plan.totals.tile_rows() * u64::from(c::FORWARD_ROW) >= plan.totals.tiles);
        let bins = u64::from(width.div_ceil(c::BIN_WIDTH)) * u64::from(height.div_ceil(c::BIN_HEIGHT));
        prop_assert!(covers(plan.groups.bin_fine, 1, bins));
        // Shares of the views follow each other without a gap or an overlap.
        for pair in plan.views.windows(2) {
            prop_assert_eq!(pair[0].record_base + pair[0].records, pair[1].record_base);
        }
    }
}

fn plan(settings: &Settings, views: &[ViewSize], crosses_near: bool) -> softras::Result<ForwardPlan> {
    ForwardPlan::new(&PlanInput {
        settings,
        cutoff: settings.cutoff(),
        views,
        tables: TableLengths { meshes: 1, ..TableLengths::default() },
        lights: &Lights::unlit(),
        sampling: Sampling::default(),
        depth_span: DepthSpan { crosses_near, crosses_far: false },
        distorted: false,
        capacity: Capacity::estimate(settings, settings.cutoff(), views),
        save: true,
        loop_passes: u32::MAX,
        rare: Rare::ALL,
    })
}

/// A frame that keeps nothing for backward has none of the buffers that backward reads, and nothing else changes.
#[test]
fn frames_for_looking_at_have_no_buffers_for_gradients() {
    let views = [ViewSize { vertices: 100, triangles: 200 }; 2];
    let settings = Settings::default();
    let sizes_of = |save: bool| {
        let lights = Lights::unlit();
        let input = PlanInput {
            settings: &settings,
            cutoff: settings.cutoff(),
            views: &views,
            tables: TableLengths { meshes: 1, ..TableLengths::default() },
            lights: &lights,
            sampling: Sampling::default(),
            depth_span: DepthSpan { crosses_near: false, crosses_far: false },
            distorted: false,
            capacity: Capacity::estimate(&settings, settings.cutoff(), &views),
            save,
            loop_passes: u32::MAX,
            rare: Rare::ALL,
        };
        ForwardPlan::new(&input).unwrap().sizes
    };
    let (look, save) = (sizes_of(false), sizes_of(true));
    let kept = [BufferId::Saved, BufferId::TileBounds, BufferId::CellRanges, BufferId::Cells];
    assert!(kept.iter().all(|&id| look[id] == 0 && save[id] > 0));
    let size: u64 = kept.iter().map(|&id| save[id]).sum();
    assert_eq!(look.device_filled() + size, save.device_filled());
}
