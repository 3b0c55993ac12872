//! The kernels `loss_pool`, `image_loss`, `loss_sum` and `image_upstream` on the host.

use crate::constants as c;
use crate::error::Result;
use crate::fit::bad;
use crate::fit::device::arithmetic::{GROUP, group_sum, slope, strided_sum, terms};
use crate::fit::device::plan::{FitPlan, Level};
use crate::fit::device::tables::Tables;
use crate::gradients::ImageGradient;
use crate::image::Image;
use crate::renderer::Frame;

/// One pixel: red, green, blue, silhouette.
type Pixel = [f32; 4];

/// The frame's images as pixels of four values.
pub fn texels(plan: &FitPlan, frame: &Frame) -> Result<Vec<Pixel>> {
    let count = (plan.views * plan.width * plan.height) as usize;
    let outputs = plan.outputs();
    let color = frame.color().filter(|image| image.data.len() == 3 * count);
    let silhouette = frame.silhouette().filter(|image| image.data.len() == count);
    if outputs.color != color.is_some() || outputs.silhouette != silhouette.is_some() {
        return bad("a frame with other images or sizes than the targets", "render it with HostFit::render");
    }
    let one = |i: usize| {
        let rgb = color.map_or([0.0; 3], |image| [image.data[3 * i], image.data[3 * i + 1], image.data[3 * i + 2]]);
        [rgb[0], rgb[1], rgb[2], silhouette.map_or(0.0, |image| image.data[i])]
    };
    Ok((0..count).map(one).collect())
}

/// The pixels of all levels except the rendered image itself.
pub fn pyramid(plan: &FitPlan, rendered: &[Pixel]) -> Vec<Pixel> {
    let mut pyramid: Vec<Pixel> = Vec::new();
    let (mut from, mut width, mut height) = (None, plan.width, plan.height);
    let mut factor = plan.samples;
    for level in &plan.levels {
        if let Some(first) = level.pyramid_first {
            let source = from.map_or(rendered, |first: u32| &pyramid[first as usize..]);
            let coarse = pooled(source, (width, height), level, factor, plan.views);
            pyramid.extend(coarse);
            from = Some(first);
        }
        (width, height, factor) = (level.width, level.height, 2);
    }
    pyramid
}

fn pooled(source: &[Pixel], (width, height): (u32, u32), level: &Level, factor: u32, views: u32) -> Vec<Pixel> {
    let one = |i: u32| {
        let (row, column) = (i / level.width, i % level.width);
        let (view, row) = (row / level.height, row % level.height);
        let (row, column) = (row * factor, column * factor);
        let (rows, columns) = (factor.min(height - row), factor.min(width - column));
        let share = 1.0 / (rows * columns) as f32;
        let mut sum = [0.0; 4];
        for r in row..row + rows {
            for c in column..column + columns {
                let pixel = source[((view * height + r) * width + c) as usize];
                (0..4).for_each(|k| sum[k] += pixel[k] * share);
            }
        }
        sum
    };
    (0..views * level.width * level.height).map(one).collect()
}

fn predicted<'a>(level: &Level, rendered: &'a [Pixel], pyramid: &'a [Pixel]) -> &'a [Pixel] {
    level.pyramid_first.map_or(rendered, |first| &pyramid[first as usize..])
}

fn target(plan: &FitPlan, tables: &Tables, at: usize) -> Pixel {
    match plan.has_color {
        true => [0, 1, 2, 3].map(|k| tables.targets[4 * at + k]),
        false => [0.0, 0.0, 0.0, tables.targets[at]],
    }
}

/// The loss sums of each view at each level.
pub fn sums(plan: &FitPlan, tables: &Tables, rendered: &[Pixel], pyramid: &[Pixel]) -> Vec<[f32; 4]> {
    let mut sums = Vec::new();
    for level in &plan.levels {
        let pixels = (level.width * level.height) as usize;
        let predicted = predicted(level, rendered, pyramid);
        for view in 0..plan.views as usize {
            let partial = |block: usize| {
                let mut lanes = [[0.0; 4]; GROUP];
                for (lane, sum) in lanes.iter_mut().enumerate() {
                    for k in 0..c::LOSS_PIXELS as usize {
                        let pixel = block * GROUP * c::LOSS_PIXELS as usize + k * GROUP + lane;
                        let at = view * pixels + pixel.min(pixels - 1);
                        let (p, t) = (predicted[at], target(plan, tables, level.target_first as usize + at));
                        let mask = tables.weights.get(level.target_first as usize + at).copied().unwrap_or(1.0);
                        add_terms(plan, sum, p, t, if pixel < pixels { mask } else { 0.0 });
                    }
                }
                group_sum(lanes)
            };
            sums.push(strided_sum(level.blocks as usize, partial));
        }
    }
    sums
}

fn add_terms(plan: &FitPlan, sum: &mut [f32; 4], p: Pixel, t: Pixel, weight: f32) {
    let [a, b] = terms(plan.silhouette.code, p[3], t[3], weight, plan.silhouette.delta);
    (sum[0], sum[1]) = (sum[0] + a, sum[1] + b);
    if plan.color.code != c::LOSS_NONE {
        for k in 0..3 {
            let [a, b] = terms(plan.color.code, p[k], t[k], weight, plan.color.delta);
            (sum[2], sum[3]) = (sum[2] + a, sum[3] + b);
        }
    }
}

/// dL by every rendered pixel.
pub fn upstream(
    plan: &FitPlan,
    tables: &Tables,
    rendered: &[Pixel],
    pyramid: &[Pixel],
    sums: &[[f32; 4]],
) -> Vec<Pixel> {
    let one = |i: u32| {
        let (row, mut column) = (i / plan.width, i % plan.width);
        let (view, mut row) = (row / plan.height, row % plan.height);
        let (mut width, mut height, mut factor) = (plan.width, plan.height, plan.samples);
        let mut share = 1.0;
        let mut sum = [0.0; 4];
        for (l, level) in plan.levels.iter().enumerate() {
            let (r, k) = (row / factor, column / factor);
            let (rows, columns) = (factor.min(height - r * factor), factor.min(width - k * factor));
            share *= 1.0 / (rows * columns) as f32;
            (row, column, width, height, factor) = (r, k, level.width, level.height, 2);
            let at = ((view * height + row) * width + column) as usize;
            let p = predicted(level, rendered, pyramid)[at];
            let t = target(plan, tables, level.target_first as usize + at);
            let weight = tables.weights.get(level.target_first as usize + at).copied().unwrap_or(1.0);
            let s = sums[l * plan.views as usize + view as usize];
            let (kind, scaled) = (&plan.silhouette, weight * level.scales[2]);
            sum[3] += share * slope(kind.code, p[3], t[3], [s[0], s[1]], scaled, kind.delta);
            let (kind, scaled) = (&plan.color, weight * level.scales[3]);
            if kind.code != c::LOSS_NONE {
                for k in 0..3 {
                    sum[k] += share * slope(kind.code, p[k], t[k], [s[2], s[3]], scaled, kind.delta);
                }
            }
        }
        sum
    };
    (0..plan.views * plan.width * plan.height).map(one).collect()
}

/// The upstream gradient as images.
pub fn gradient(plan: &FitPlan, upstream: Vec<Pixel>) -> ImageGradient {
    let image = |channels: usize, data: Vec<f32>| Image {
        batch: plan.views as usize,
        height: plan.height as usize,
        width: plan.width as usize,
        channels,
        data,
    };
    let outputs = plan.outputs();
    ImageGradient {
        color: outputs.color.then(|| image(3, upstream.iter().flat_map(|p| [p[0], p[1], p[2]]).collect())),
        silhouette: outputs.silhouette.then(|| image(1, upstream.iter().map(|p| p[3]).collect())),
        ..ImageGradient::default()
    }
}
