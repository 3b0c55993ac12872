//! Plans before there is a device: the memory of a frame and of a backward pass by the documented formulas, where plans
//! end, and the numbers that the kernels get.

#![allow(clippy::unwrap_used)]

mod depth_span;
mod properties;

use super::backward::BackwardGroups;
use super::{
    BackwardInput, BackwardPlan, Capacity, DepthSpan, ForwardPlan, Lenses, PlanInput, Rare, Sampling, ViewSize, split,
};
use crate::constants as c;
use crate::frame::buffers::{BufferId, TableLengths};
use crate::scene::{Background, Distance, Outputs, Parity, Shading};
use crate::{Error, GradientRequest, Lights, Settings};

const INSIDE: DepthSpan = DepthSpan { crosses_near: false, crosses_far: false };
/// Multiples of all that sizes are rounded to, so that the formulas hold to the byte.
const VIEW: ViewSize = ViewSize { vertices: 800, triangles: 1600 };
const CAPACITY: Capacity = Capacity { coarse: 3200, list: 4096, cells: 160 };

fn outputs(bits: u32) -> Outputs {
    let bit = |i: u32| bits >> i & 1 == 1;
    Outputs { color: bit(0), silhouette: bit(1), depth: bit(2), normal: bit(3), features: bit(4) }
}

fn smooth() -> Lights {
    Lights { shading: Shading::Smooth, ..Lights::official() }
}

fn input<'a>(settings: &'a Settings, views: &'a [ViewSize], lights: &'a Lights) -> PlanInput<'a> {
    PlanInput {
        settings,
        cutoff: settings.cutoff(),
        views,
        tables: TableLengths { meshes: 1, ..TableLengths::default() },
        lights,
        features: 5,
        sampling: Sampling::default(),
        depth_span: INSIDE,
        lenses: Lenses::default(),
        capacity: CAPACITY,
        save: true,
        loop_passes: u32::MAX,
        rare: Rare::ALL,
    }
}

/// 1 or 0 times a number of bytes.
fn when(on: bool, size: u64) -> u64 {
    if on { size } else { 0 }
}

#[test]
fn a_frame_takes_the_memory_of_the_formula() {
    let (views, b, t, p) = ([VIEW; 2], 2 * 16, 2 * 1024, 2 * 256 * 128);
    for case in 0..128u32 {
        let bit = |i: u32| case >> i & 1 == 1;
        let settings = Settings { width: 256, height: 128, outputs: outputs(case % 32), ..Settings::default() };
        let Outputs { color, silhouette, depth, normal, features } = settings.outputs;
        let (lights, [clips, far, save]) = (if bit(4) { smooth() } else { Lights::unlit() }, [bit(4), bit(5), bit(6)]);
        let plan = ForwardPlan::new(&PlanInput {
            sampling: Sampling { surface: bit(5), image: bit(6), opacity: false },
            depth_span: DepthSpan { crosses_near: clips, crosses_far: far },
            save,
            ..input(&settings, &views, &lights)
        });
        let plan = plan.unwrap();
        let sizes = plan.sizes;
        let (v, s) = (1600, if clips { 6400 } else { 3200 });
        let shaded = color || depth || normal || features || far;
        let bits = [
            (color, c::OUTPUT_COLOR),
            (silhouette, c::OUTPUT_SILHOUETTE),
            (depth, c::OUTPUT_DEPTH),
            (normal, c::OUTPUT_NORMAL),
            (features, c::OUTPUT_FEATURES),
        ];
        assert_eq!(plan.modes.outputs, bits.iter().map(|&(on, bit)| if on { bit } else { 0 }).sum::<u32>());
        assert_eq!((plan.sizes[BufferId::Shading] > 0, plan.modes.smooth == 1), (shaded, bit(4)));
        // Five features are two texels.
        let q = 4 + when(bit(5) || bit(6), 2) + when(normal, 3) + when(features, 6);
        let records = 32 * v + when(bit(4), 32 * v) + 80 * s + if shaded { 16 * q * s } else { 16 * s };
        // Each view has half of the records.
        let lists = b * (s / 2) / 8 + 8 * b + 12 * 3200 + 3200 / 4 + 52 * t + 4 * 4096;
        let images =
            when(color, 16 * p) + when(silhouette && !color, 4 * p) + when(depth, 4 * p) + when(normal, 16 * p);
        let images = images + when(features, 32 * p);
        let saved = when(save, 16 * p + 8 * t + 8 * s + 8 * 160);
        let few = 48 + 48;
        assert_eq!((sizes[BufferId::TileCounts], sizes[BufferId::Status]), (48, 48));
        assert_eq!(sizes.device_filled(), records + lists + images + saved + few, "case {case}");
    }
}

#[test]
fn a_backward_pass_takes_the_memory_of_the_formula() {
    let views = [VIEW; 2];
    for case in 0..1024u32 {
        let bit = |i: u32| case >> i & 1 == 1;
        let upstream = outputs(1 + case % 31);
        let shaded = upstream.color || upstream.depth || upstream.normal || upstream.features;
        let background = if bit(4) { Background::Composite } else { Background::Weighted };
        let all = outputs(31);
        let settings = Settings { width: 256, height: 128, outputs: all, background, ..Settings::default() };
        let lights = if bit(5) { smooth() } else { Lights::official() };
        let forward = ForwardPlan::new(&input(&settings, &views, &lights)).unwrap();
        let wanted = GradientRequest {
            positions: bit(6),
            colors: bit(7),
            features: bit(4),
            texels: bit(8),
            uvs: bit(9),
            camera: bit(5),
            lights: bit(8),
            background: bit(7),
            scalars: bit(9) && bit(4),
            ..GradientRequest::default()
        };
        let lit = bit(9);
        let input = BackwardInput {
            forward: &forward,
            upstream,
            wanted: &wanted,
            lit,
            vertices: 800,
            largest_mesh: 800,
            most_corners: 6,
            texels: 64,
            texel_scale: 1.0,
        };
        let plan = BackwardPlan::new(&input);
        let (p, s, v) = (2 * 256 * 128, 3200, 1600);
        let (items, outlined) = (s + 160, upstream.silhouette || (shaded && bit(4)));
        let by_color = upstream.color && (wanted.colors || wanted.lights || (wanted.positions && lit));
        let (by_uv, by_normal) = (upstream.color && wanted.uvs, upstream.normal && wanted.positions);
        let by_features = upstream.features && wanted.features;
        let vertices = wanted.positions || wanted.colors || wanted.features;
        let per_vertex = !(upstream.normal || bit(5) || (upstream.color && lit));
        let by_light = upstream.color && wanted.lights;
        let corners = wanted.camera
            || wanted.scalars
            || by_uv
            || by_light
            || by_normal
            || !per_vertex && (wanted.positions || by_color || by_features);
        let corner = 3 + when(by_color, 3) + when(by_uv, 2) + when(by_features, 6);
        let q = corner + when(by_normal, 3);
        let second = upstream.normal || (upstream.depth && (upstream.color || upstream.features));
        let expected = 16 * p * (when(shaded, 1) + when(second, 1) + when(upstream.features, 2))
            + when(outlined, 4 * p)
            + items * (16 * q + 4 + when(shaded, 16) + when(outlined, 16))
            + when(corners || !per_vertex, 16 * s * corner)
            + 4 * s
            + when(vertices, 32 * 800)
            + when(by_features, 32 * 800)
            + when(wanted.background || wanted.scalars, 32 * p)
            + when(wanted.camera || wanted.scalars, 48 * s)
            + when(upstream.color && wanted.lights, 32 * if bit(5) { v } else { s })
            + when(bit(5), 96 * s + 16 * v)
            + when(upstream.color && wanted.texels, 24 * 64);
        let from_host = when(upstream.color, 16 * p)
            + when(upstream.silhouette && !upstream.color, 4 * p)
            + when(upstream.depth, 4 * p)
            + when(upstream.normal, 16 * p)
            + when(upstream.features, 32 * p);
        // Arguments of indirect dispatches, and three texels for each view, the ambient and one other light, the pixels.
        let few = 96 + 48 * (2 + 2 + 1);
        let total: u64 = plan.sizes.iter().map(|(_, size)| size).sum();
        assert_eq!(total, expected + from_host + few, "case {case}: {upstream:?} {wanted:?}");
        assert_eq!(u64::from(plan.corner_stride()), corner);
        assert_eq!(plan.shades(), shaded);
        assert_eq!(plan.outlines(), outlined);
        assert_eq!(plan.has(c::GRADIENT_GEOMETRY), wanted.positions || wanted.camera);
        let anything = plan.modes.gradients & !c::GRADIENT_BACKGROUND != 0;
        assert_eq!(plan.modes.per_vertex, u32::from(per_vertex), "case {case}");
        assert_eq!(plan.item_rows, u32::from(anything));
        let sums_pixels = wanted.background || wanted.scalars;
        assert_eq!(plan.tile_rows, u32::from(anything && !sums_pixels));
        let groups = |on: bool, groups: [u32; 3]| if on { groups } else { [0; 3] };
        let items_groups = (items as u32).div_ceil(c::LINEAR_GROUP);
        let (sums, by_corners) = (wanted.background || wanted.scalars, anything && corners);
        let expected = BackwardGroups {
            pixel_grad: groups(sums, [2 * 256 * 128 / (c::TILE_WIDTH * c::TILE_HEIGHT), 1, 1]),
            backward_cull: groups(anything, [items_groups, 1, 1]),
            triangle_grad: groups(by_corners, forward.groups.triangle),
            vertex_normal_grad: groups(by_corners && bit(5), forward.groups.vertex),
            vertex_grad: groups(vertices, [13, 1, 1]),
            reduce_views: groups(wanted.camera || wanted.scalars, [2, 1, 1]),
            reduce_lights: groups(upstream.color && wanted.lights, [2, 1, 1]),
            reduce_pixels: groups(sums, [1, 1, 1]),
        };
        assert_eq!(plan.groups, expected, "case {case}: {upstream:?} {wanted:?}");
        assert_eq!((plan.modes.lit, plan.modes.paper), (u32::from(lit || wanted.lights), 0));
        assert_eq!(u64::from(plan.light_rows), if bit(5) { v } else { s });
    }
}

/// Whether there is a plan for these views in an image of `size` × `size` pixels.
fn fits(views: &[ViewSize], size: u32) -> bool {
    let settings = Settings { width: size, height: size, ..Settings::default() };
    ForwardPlan::new(&input(&settings, views, &Lights::unlit())).is_ok()
}

/// A plan may have as many elements as a signed index of 32 bits counts, and not one more.
#[test]
fn plans_end_where_indices_do() {
    let view = |vertices: u32, triangles: u32| ViewSize { vertices, triangles };
    let most = i32::MAX as u32;
    for (fitting, beyond, size) in [
        (vec![view(3, 1); 1 << 18], vec![view(3, 1); (1 << 18) + 1], 1),
        (vec![view(most / 3, 1)], vec![view(most / 3 + 1, 1)], 1),
        (vec![view(3, 1 << 22)], vec![view(3, (1 << 22) + 1)], 1),
        (vec![view(3, 1); 7], vec![view(3, 1); 8], 16384),
        // 256 × 512 bins with a bit for each triangle.
        (vec![view(3, (most >> 17) * 32)], vec![view(3, (most >> 17) * 32 + 1)], 16384),
        // Records of nine texels.
        (
            [vec![view(3, 1 << 22); 56], vec![view(3, most / 9 - (56 << 22))]].concat(),
            [vec![view(3, 1 << 22); 56], vec![view(3, most / 9 - (56 << 22) + 1)]].concat(),
            1,
        ),
    ] {
        assert!(fits(&fitting, size), "{} views of {:?}", fitting.len(), fitting.last());
        assert!(!fits(&beyond, size), "{} views of {:?}", beyond.len(), beyond.last());
    }
    let (settings, lights) = (Settings::default(), Lights::unlit());
    let error = ForwardPlan::new(&input(&settings, &[view(3, (1 << 22) + 1)], &lights)).unwrap_err();
    assert!(matches!(error, Error::Limit { needed: 4_194_305, limit: 4_194_304, .. }), "{error}");
}

/// Each view's range in the buffers begins where that of the view before ends.
#[test]
fn views_follow_each_other() {
    let views = [ViewSize { vertices: 5, triangles: 40 }, ViewSize { vertices: 7, triangles: 3 }, VIEW];
    let settings = Settings { width: 65, height: 33, ..Settings::default() };
    let lights = Lights::unlit();
    let crosses = DepthSpan { crosses_near: true, crosses_far: false };
    let plan = ForwardPlan::new(&PlanInput { depth_span: crosses, ..input(&settings, &views, &lights) }).unwrap();
    let bases = |i: usize| {
        let view = plan.views[i];
        [view.screen_base, view.record_base, view.bin_base, view.word_base]
    };
    // Two records a triangle, 2 × 2 bins, words of 32 records.
    assert_eq!([bases(0), bases(1), bases(2)], [[0; 4], [5, 80, 4, 4 * 3], [12, 86, 8, 4 * (3 + 1)]]);
    assert_eq!((plan.totals.vertices, plan.totals.records, plan.totals.bins), (812, 86 + 3200, 12));
    assert_eq!((plan.totals.words, plan.totals.tiles, plan.totals.pixels), (4 * (3 + 1 + 100), 3 * 81, 3 * 65 * 33));
    // The official code does not clip, so each triangle has one record.
    let settings = Settings { parity: Parity::Official, ..settings };
    let plan = ForwardPlan::new(&PlanInput { depth_span: crosses, ..input(&settings, &views, &lights) }).unwrap();
    assert_eq!(plan.totals.records, 43 + 1600);
}

/// Whether fragments beyond far are rejected depends on the depths, but not under official parity.
#[test]
fn depth_ranges_are_those_of_the_parity() {
    let lights = Lights::unlit();
    let range = |parity, bits: u32, crosses_far| {
        let settings = Settings { parity, outputs: outputs(bits), ..Settings::default() };
        let depth_span = DepthSpan { crosses_near: false, crosses_far };
        ForwardPlan::new(&PlanInput { depth_span, ..input(&settings, &[VIEW], &lights) }).unwrap().modes.depth_range
    };
    for bits in 1..16 {
        let official = if bits == 2 { c::DEPTH_RANGE_INSIDE } else { c::DEPTH_RANGE_OFFICIAL };
        assert_eq!([false, true].map(|far| range(Parity::Official, bits, far)), [official; 2]);
        let expected = [c::DEPTH_RANGE_INSIDE, c::DEPTH_RANGE_FAR];
        assert_eq!([false, true].map(|far| range(Parity::Model, bits, far)), expected);
    }
}

/// More workgroups than a row holds go on in further rows.
#[test]
fn workgroups_go_on_in_rows() {
    let (settings, lights) = (Settings { width: 16384, height: 16384, ..Settings::default() }, Lights::unlit());
    let forward = ForwardPlan::new(&input(&settings, &[VIEW], &lights)).unwrap();
    let plan = BackwardPlan::new(&BackwardInput {
        forward: &forward,
        upstream: outputs(2),
        wanted: &GradientRequest::default(),
        lit: false,
        vertices: 800,
        largest_mesh: 800,
        most_corners: 6,
        texels: 0,
        texel_scale: 1.0,
    });
    assert_eq!((plan.groups.pixel_grad, plan.tile_rows), ([0; 3], 256));
    // 2048 × 4096 tiles in 256 rows; three texels for the view, the ambient light and the pixels each.
    assert_eq!((forward.sizes[BufferId::TileCounts], plan.sizes[BufferId::Totals]), (256 * 48, 3 * 48));
}

/// Vertices take their gradients from the triangles without a stage between if one loop can walk all cells of all
/// triangles at a vertex. The capacity for cells does not count, because gradients must have the same bits with any.
#[test]
fn the_stage_between_depends_on_the_most_corners_and_not_on_the_room() {
    let (settings, lights) = (Settings { width: 512, height: 512, ..Settings::default() }, Lights::unlit());
    let per_vertex = |cells: u32, most_corners: u32| {
        let of = input(&settings, &[VIEW], &lights);
        let capacity = Capacity { cells, ..of.capacity };
        let forward = ForwardPlan::new(&PlanInput { capacity, loop_passes: 65535, ..of }).unwrap();
        let plan = BackwardPlan::new(&BackwardInput {
            forward: &forward,
            upstream: outputs(2),
            wanted: &GradientRequest { positions: true, ..GradientRequest::NOTHING },
            lit: false,
            vertices: 800,
            largest_mesh: 800,
            most_corners,
            texels: 0,
            texel_scale: 1.0,
        });
        plan.modes.per_vertex == 1
    };
    for cells in [1, 1 << 20] {
        // 8 × 16 cells: 65535 passes are just enough for 129 of each of 508 corners, and three more.
        assert!(per_vertex(cells, 508) && !per_vertex(cells, 509), "{cells}");
    }
}

/// Rows of items for all triangles and cells, and nothing at all where there is no triangle.
#[test]
fn backward_passes_of_many_triangles_and_of_none() {
    let (settings, lights) = (Settings::default(), Lights::unlit());
    let of = |triangles: u32| {
        let views = [ViewSize { vertices: 3, triangles }];
        let forward = ForwardPlan::new(&input(&settings, &views, &lights)).unwrap();
        BackwardPlan::new(&BackwardInput {
            forward: &forward,
            upstream: outputs(1),
            wanted: &GradientRequest { texels: true, ..GradientRequest::default() },
            lit: false,
            vertices: 3,
            largest_mesh: 3,
            most_corners: 6,
            texels: 64,
            texel_scale: 1.0,
        })
    };
    // 160 cells beyond two full rows.
    let many = of(2 * c::FORWARD_ROW);
    assert_eq!((many.item_rows, many.sizes[BufferId::ItemCounts]), (3, (3u64 * 21 * 4).next_multiple_of(16)));
    assert_eq!((of(2 * c::FORWARD_ROW - 160).item_rows, many.sizes[BufferId::TexelSums]), (2, 24 * 64));
    let none = of(0);
    assert_eq!((none.item_rows, none.sizes[BufferId::TexelSums], none.groups.backward_cull), (0, 0, [0; 3]));
}

#[test]
fn a_bin_has_lanes_for_its_records() {
    let lanes = |triangles: u32| {
        let (settings, lights) = (Settings::default(), Lights::unlit());
        let views = [ViewSize { vertices: 3, triangles }, ViewSize { vertices: 3, triangles: 1 }];
        ForwardPlan::new(&input(&settings, &views, &lights)).unwrap().coarse_lanes
    };
    assert_eq!([0, 1 << 14, (1 << 14) + 1, 3 << 14, 1 << 22].map(lanes), [1, 1, 2, 4, 128]);
}

/// Estimates of room, by hand: for a hard image of few triangles every tile, for a soft one the mean triangle and its blur.
#[test]
fn capacities_by_hand() {
    let views = |triangles: u32| [ViewSize { vertices: 3, triangles }, ViewSize { vertices: 0, triangles: 0 }];
    let hard = Settings { width: 128, height: 64, distance: Distance::Hard, ..Settings::default() };
    // 128 × 64 pixels: 256 + 2 tiles, 4 + 2 bins, of which each of two views rounds each up to 32 entries.
    let one = Capacity::estimate(&hard, hard.cutoff(), &views(1));
    assert_eq!((one.coarse, one.list), (6 + 6 * 2 * 32 + 1024, 258 + 1024));
    // 256 triangles: sides of √(2 · 8192 / 256) = 8 pixels, so 9/8 of a bin by 5/4, 2 by 3 tiles.
    let many = Capacity::estimate(&hard, hard.cutoff(), &views(256));
    assert_eq!((many.coarse, many.list), (256 * 45 / 32 + 384 + 1024, 256 * 6 + 1024));
    // A blur of 4 pixels on both sides makes 16 of 8.
    let soft = Settings { distance: Distance::Euclidean, ..hard.clone() }.with_blur_pixels(4.0);
    let blurred = Capacity::estimate(&soft, soft.cutoff(), &views(256));
    assert!(blurred.coarse.abs_diff(256 * 15 / 8 + 384 + 1024) <= 1 && blurred.list.abs_diff(256 * 15 + 1024) <= 1);
    // A blur over all of a square image: every triangle in every tile and bin; of few triangles all that they can need, where
    // each may have two records.
    let square = Settings { width: 64, sigma: 10.0, ..soft.clone() };
    let wide = Capacity::estimate(&square, square.cutoff(), &views(10));
    assert_eq!((wide.coarse, wide.list), (10 * 4 + 4 * 2 * 32 + 1024, 2 * 10 * 128));
    let crowd = Capacity::estimate(&soft, soft.cutoff(), &views(1 << 30));
    assert_eq!((crowd.coarse, crowd.list), ((1 << 24) + 1024, (1 << 24) + 1024));
    let (a, b) = (Capacity { coarse: 1, list: 5, cells: 3 }, Capacity { coarse: 2, list: 4, cells: 6 });
    assert_eq!(a.max(b), Capacity { coarse: 2, list: 5, cells: 6 });
}

/// The push constants against the settings that they are made of.
#[test]
fn numbers_are_those_of_the_settings() {
    let settings = Settings {
        width: 200,
        height: 80,
        sigma: 3e-4,
        gamma: 0.3,
        epsilon: 0.7,
        near: 1.1,
        far: 9.3,
        ..Settings::default()
    };
    let lights = Lights::unlit();
    let numbers = |settings: &Settings| ForwardPlan::new(&input(settings, &[VIEW], &lights)).unwrap().push;
    let close = |a: f32, b: f64| assert!((f64::from(a) - b).abs() <= 1e-6 * b.abs(), "{a} instead of {b}");
    let both = |high: f32, low: f32| f64::from(high) + f64::from(low);
    let exact = |a: f64, b: f64| assert!((a - b).abs() <= 1e-13 * b.abs(), "{a} instead of {b}");
    let (f, log2e) = (numbers(&settings), std::f64::consts::LOG2_E);
    assert_eq!([f.tiles_x, f.tiles_y, f.bins_x, f.bins_y], [25, 20, 4, 3]);
    // A distance of 7 pixels: in screen units, over σ, in units of log2.
    close((7.0f32 * f.scale).powi(2), (7.0f64 / 40.0).powi(2) / 3e-4 * log2e);
    close(f.radius_squared, settings.cutoff() * log2e);
    close(f.radius_pixels, settings.blur_pixels());
    close(f.barycentric_scale, log2e / 3e-4);
    close(f.barycentric_radius, (3e-4 * settings.cutoff()).sqrt());
    for (high, low, expected) in
        [(f.near_high, f.near_low, 1.1), (f.far_high, f.far_low, 9.3), (f.score_high, f.score_low, log2e / (8.2 * 0.3))]
    {
        exact(both(high, low), expected);
    }
    close(f.background_exponent, (0.7 * log2e / 0.3).round());
    let background = |f: super::FramePush| both(f.background_exponent, f.background_fraction);
    assert!((background(f) - 0.7 * log2e / 0.3).abs() < 1e-7);
    let official = numbers(&Settings { parity: Parity::Official, ..settings.clone() });
    assert!((background(official) - 1.4 * log2e / 0.3).abs() < 1e-7);
    let hard = numbers(&Settings { distance: Distance::Hard, ..settings });
    assert_eq!((hard.radius_squared, hard.radius_pixels), (0.0, 0.0));
    let (high, low) = split(1.0 / 3.0);
    assert!(low != 0.0 && (both(high, low) - 1.0 / 3.0).abs() < 1e-15);
}
