//! A clownfish with a 7 on its sides: one closed surface with one painted texture. A mirrored or flipped image is noticed
//! at once, because the fish swims towards +x with its back up (+y) and the 7 is legible from either side.

use crate::{
    error::Result,
    scene::{Appearance, Mesh, Texture, Wrap},
};
use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, TAU};

/// Cross-sections from nose to tail, and vertices around each, of a fish of detail 1; the latter even, so that the last
/// cross-section can be sewn up.
const RINGS: u32 = 44;
const AROUND: u32 = 56;

/// Texels around the body and from nose to tail.
const TEXTURE_WIDTH: u32 = 512;
const TEXTURE_HEIGHT: u32 = 512;

/// The body's outline: for equal steps from nose to tail x, the height of back and belly, and half the width.
const OUTLINE: [[f64; 4]; 13] = [
    [1.00, -0.02, -0.02, 0.00],
    [0.95, 0.13, -0.14, 0.11],
    [0.83, 0.26, -0.25, 0.19],
    [0.62, 0.38, -0.35, 0.25],
    [0.36, 0.44, -0.40, 0.27],
    [0.08, 0.41, -0.38, 0.25],
    [-0.20, 0.31, -0.30, 0.19],
    [-0.44, 0.19, -0.18, 0.12],
    [-0.60, 0.12, -0.11, 0.07],
    [-0.72, 0.15, -0.14, 0.045],
    [-0.83, 0.28, -0.26, 0.03],
    [-0.92, 0.40, -0.37, 0.02],
    [-0.99, 0.46, -0.43, 0.006],
];

/// x and y of the eyes, and their radius.
const EYE: [f64; 3] = [0.70, 0.13, 0.12];

/// The fish: 4926 triangles, 2 units long, in one image texture.
///
/// # Errors
/// Never; the result type is that of the other shapes.
pub fn fish() -> Result<Mesh> {
    fine_fish(1)
}

/// The fish with `detail` times as many cross-sections, and vertices around each.
pub(super) fn fine_fish(detail: u32) -> Result<Mesh> {
    let (rings, around) = (RINGS * detail, AROUND * detail);
    let (mut points, mut uvs) = (vec![surface(0.0, 0.0)], Vec::new());
    // Row 0 of the image is the nose. Half a texel from the border, where sampling would wrap from nose to tail.
    let v = |t: f64| 1.0 - (0.5 + t * f64::from(TEXTURE_HEIGHT - 1)) / f64::from(TEXTURE_HEIGHT);
    for ring in 0..=rings {
        let t = f64::from(ring) / f64::from(rings);
        for j in 0..=around {
            let turn = f64::from(j) / f64::from(around);
            uvs.push([turn as f32, v(t) as f32]);
            if ring > 0 && j < around {
                points.push(surface(t, turn));
            }
        }
    }
    let (triangles, uv_triangles) = triangles(rings, around);
    let positions = points.iter().map(|p| p.as_vec3().to_array()).collect();
    Mesh::new(positions, triangles)?.with_appearance(Appearance::Textured {
        uvs,
        uv_triangles,
        textures: vec![paint()?],
        texture_of_triangle: Vec::new(),
    })
}

/// Vertex and UV indices: a fan at the nose, quads between rings, and a seam that sews the last ring's sides together.
fn triangles(rings: u32, around: u32) -> (Vec<[u32; 3]>, Vec<[u32; 3]>) {
    let (mut triangles, mut uv_triangles) = (Vec::new(), Vec::new());
    let mut add = |corners: [[u32; 2]; 3]| {
        // The nose is one vertex; every other ring has its own, the UVs one more column than the vertices.
        let vertex = |[ring, j]: [u32; 2]| if ring == 0 { 0 } else { 1 + (ring - 1) * around + j % around };
        triangles.push(corners.map(vertex));
        uv_triangles.push(corners.map(|[ring, j]| ring * (around + 1) + j));
    };
    for ring in 0..rings {
        for j in 0..around {
            let [a, b, c, d] = [[ring, j], [ring + 1, j], [ring + 1, j + 1], [ring, j + 1]];
            add([a, c, b]);
            if ring > 0 {
                add([a, d, c]);
            }
        }
    }
    for j in 0..around / 2 {
        let [a, b, c, d] = [j, j + 1, around - j - 1, around - j].map(|j| [rings, j]);
        if j > 0 {
            add([a, c, d]);
        }
        if j + 1 < around / 2 {
            add([a, b, c]);
        }
    }
    (triangles, uv_triangles)
}

/// 0 below `low`, 1 above `high` (or the reverse), smooth between.
fn step(low: f64, high: f64, x: f64) -> f64 {
    let x = ((x - low) / (high - low)).clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// The outline at `t`, 0 at the nose and 1 at the tail: a Catmull-Rom spline.
fn outline(t: f64) -> [f64; 4] {
    let last = OUTLINE.len() - 1;
    let at = t * last as f64;
    let i = (at as usize).min(last - 1);
    let x = at - i as f64;
    let [a, b, c, d] = [i.saturating_sub(1), i, i + 1, (i + 2).min(last)].map(|i| OUTLINE[i]);
    std::array::from_fn(|k| {
        let (slope_b, slope_c) = ((c[k] - a[k]) / 2.0, (d[k] - b[k]) / 2.0);
        let (x2, x3) = (x * x, x * x * x);
        b[k] * (2.0 * x3 - 3.0 * x2 + 1.0)
            + slope_b * (x3 - 2.0 * x2 + x)
            + c[k] * (3.0 * x2 - 2.0 * x3)
            + slope_c * (x3 - x2)
    })
}

/// How far the fins on the back and under the belly stand out at `t`.
fn fins(t: f64) -> [f64; 2] {
    [0.30 * step(0.27, 0.40, t) * step(0.64, 0.46, t), 0.24 * step(0.43, 0.54, t) * step(0.66, 0.57, t)]
}

/// The surface at `t` from nose (0) to tail (1) and `turn` around it: belly 0, left side (+z) ¼, back ½, right side ¾.
fn surface(t: f64, turn: f64) -> DVec3 {
    let [x, back, belly, width] = outline(t);
    // Denser at back and belly, where the fins are.
    let angle = TAU * turn - FRAC_PI_2 - 0.36 * (2.0 * TAU * turn).sin();
    let (sin, cos) = angle.sin_cos();
    let mut point = DVec3::new(x, (back + belly) / 2.0 + (back - belly) / 2.0 * sin, width * cos);
    let [dorsal, anal] = fins(t);
    let (up, down) = (sin.max(0.0).powi(36), (-sin).max(0.0).powi(36));
    point.y += dorsal * up - anal * down;
    // Fins lean back, and so do the tips of the tail.
    point.x -= 0.6 * (dorsal * up + anal * down) + 0.11 * step(0.7, 1.0, t) * sin.abs().powi(3);
    point.z +=
        0.045 * cos.signum() * step(EYE[2], 0.0, (point.x - EYE[0]).hypot(point.y - EYE[1])) * cos.abs().min(0.5);
    point
}

type Color = DVec3;
const ORANGE: Color = DVec3::new(1.0, 0.45, 0.05);
const DARK_ORANGE: Color = DVec3::new(0.85, 0.28, 0.02);
const YELLOW: Color = DVec3::new(1.0, 0.68, 0.22);
const WHITE: Color = DVec3::new(0.98, 0.98, 0.95);
const BLACK: Color = DVec3::new(0.06, 0.05, 0.08);

/// Blur of painted borders, about a texel, in world units.
const SOFT: f64 = 0.006;

/// 1 where `distance` is below 0, 0 above, with a soft border.
fn within(distance: f64) -> f64 {
    step(SOFT, -SOFT, distance)
}

fn paint() -> Result<Texture> {
    let mut texels = Vec::with_capacity((TEXTURE_WIDTH * TEXTURE_HEIGHT) as usize);
    for row in 0..TEXTURE_HEIGHT {
        for column in 0..TEXTURE_WIDTH {
            let t = f64::from(row) / f64::from(TEXTURE_HEIGHT - 1);
            let turn = (f64::from(column) + 0.5) / f64::from(TEXTURE_WIDTH);
            let color = color(t, surface(t, turn));
            // Whole 255ths, so that an 8-bit file holds it exactly.
            texels.push(color.to_array().map(|x| (x.clamp(0.0, 1.0) * 255.0).round() as f32 / 255.0));
        }
    }
    Texture::new(TEXTURE_WIDTH, TEXTURE_HEIGHT, texels, Wrap::Repeat)
}

/// The paint at a point of the surface, layer upon layer.
fn color(t: f64, p: DVec3) -> Color {
    let [_, back, belly, _] = outline(t);
    let mut color = YELLOW.lerp(ORANGE, step(-0.35, -0.05, p.y)).lerp(DARK_ORANGE, step(0.15, 0.6, p.y));
    let mut cover = |paint: Color, amount: f64| color = color.lerp(paint, amount);
    // Fins and tail: rays, and a black rim.
    let beyond = (p.y - back).max(belly - p.y);
    let tail = step(0.74, 0.80, t);
    let rays = (26.0 * (p.y / (0.75 - p.x).max(0.1)) * TAU).sin();
    cover(DARK_ORANGE, 0.5 * tail * step(0.2, 0.6, rays));
    cover(BLACK, step(0.905, 0.915, t));
    let [dorsal, anal] = fins(t);
    cover(BLACK, within(0.6 * dorsal.max(anal) + 0.02 - beyond));
    // Three white bands with black borders, the middle one widened towards the head.
    let bulge = 0.09 * (-(p.y * p.y) / 0.05).exp();
    for (centre, half_width) in [(0.47 - 0.35 * p.y * p.y, 0.065), (-0.07 + bulge, 0.11 + bulge), (-0.57, 0.05)] {
        let distance = (p.x - centre).abs() - half_width;
        cover(BLACK, within(distance - 0.022));
        cover(WHITE, within(distance));
    }
    // A 7 on either side. There `right` grows to the reader's right.
    let right = if p.z > 0.0 { p.x } else { -p.x };
    let middle = if p.z > 0.0 { 0.03 } else { -0.03 };
    cover(BLACK, within(seven((right - middle) / 0.15, (p.y - 0.02) / 0.15) * 0.15));
    // The breast fin: a leaf that points back.
    let (along, off) = (p.x - 0.27, p.y + 0.17 - 0.4 * (p.x - 0.27));
    let leaf = (along / 0.13).hypot(off / (0.065 - 0.16 * along).max(0.01)) - 1.0;
    cover(BLACK, within((leaf - 0.25) * 0.06));
    cover(DARK_ORANGE, within(leaf * 0.06));
    // Eyes and a smile.
    let eye = (p.x - EYE[0]).hypot(p.y - EYE[1]);
    cover(BLACK, within(eye - 0.118));
    cover(WHITE, within(eye - 0.098));
    cover(BLACK, within((p.x - EYE[0] - 0.02).hypot(p.y - EYE[1]) - 0.06));
    cover(WHITE, within((p.x - EYE[0] - 0.04).hypot(p.y - EYE[1] - 0.027) - 0.019));
    let smile = ((p.x - 0.93).hypot(p.y - 0.02) - 0.13).abs() - 0.012;
    cover(BLACK, within(smile.max(p.y + 0.06)));
    color
}

/// Distance to the strokes of a 7 within ±1 in height.
fn seven(x: f64, y: f64) -> f64 {
    let stroke = |[ax, ay]: [f64; 2], [bx, by]: [f64; 2]| {
        let (dx, dy) = (bx - ax, by - ay);
        let along = (((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy)).clamp(0.0, 1.0);
        (x - ax - along * dx).hypot(y - ay - along * dy) - 0.17
    };
    stroke([-0.6, 0.8], [0.6, 0.8]).min(stroke([0.6, 0.8], [-0.15, -0.85]))
}
