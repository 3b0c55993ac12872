//! Properties of every plan, whatever the numbers: proptest shrinks the case that breaks one.

use super::input;
use crate::constants as c;
use crate::frame::buffers::BufferId;
use crate::frame::plan::{Capacity, DepthSpan, ForwardPlan, PlanInput, ViewSize};
use crate::scene::Outputs;
use crate::{Lights, Settings};
use proptest::prelude::*;

fn epsilon() -> impl Strategy<Value = f64> {
    prop_oneof![3 => -10f64..10.0, 1 => any::<f64>(), 1 => Just(f64::NAN)]
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// Settings that are not refused leave nothing unbounded: every number that kernels get is finite.
    #[test]
    fn valid_settings_make_finite_plans(
        sigma in -12.1f64..3.1, gamma in -10.1f64..6.1, tau in -12.1f64..0.0, epsilon in epsilon(), near in -6.1f64..9.1,
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

    /// Sizes hold what the counts say, in 64 bits, and workgroups cover every vertex, triangle, bin and tile.
    #[test]
    fn plans_cover_everything(
        sizes in prop::collection::vec((0u32..5_000_000, 0u32..5_000_000), 1..5),
        width in 1u32..=Settings::MAX_SIZE, height in 1u32..=Settings::MAX_SIZE, outputs in 1u32..16, crosses in any::<bool>(),
    ) {
        let bit = |i: u32| outputs >> i & 1 == 1;
        let outputs = Outputs { color: bit(0), silhouette: bit(1), depth: bit(2), normal: bit(3), features: false };
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

fn plan(settings: &Settings, views: &[ViewSize], crosses_near: bool) -> crate::Result<ForwardPlan> {
    ForwardPlan::new(&PlanInput {
        depth_span: DepthSpan { crosses_near, crosses_far: false },
        capacity: Capacity::estimate(settings, settings.cutoff(), views),
        ..input(settings, views, &Lights::unlit())
    })
}
