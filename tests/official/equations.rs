//! The images and gradients of the official renderer, recomputed from its published equations in plain f64 loops.
//!
//! Nothing here is shared with `src`: D is a quotient, the silhouette a product, the softmax a running sum, and every
//! derivative is written out. The official quirks that [`softras::scene::Parity::Official`] promises are named where they
//! are.

use softras::scene::{ColorAggregation, Distance, Faces, FrontFace, Settings, SilhouetteAggregation};

/// Triangles on the screen: x, y and view depth of each corner.
#[derive(Clone, Debug)]
pub struct Triangles {
    pub corners: Vec<[[f64; 3]; 3]>,
    /// One colour per corner, or R² per triangle.
    pub colors: Vec<[f64; 3]>,
    /// R of a surface texture; `None` for corner colours.
    pub resolution: Option<usize>,
}

/// The official renderer's images of one view.
#[derive(Clone, Debug)]
pub struct Image {
    /// RGB of each pixel, row by row.
    pub color: Vec<f64>,
    /// Alpha of each pixel.
    pub silhouette: Vec<f64>,
    /// Pixels for which rounding chooses the cell of a surface texture, so that no answer is the right one.
    pub undecided: Vec<bool>,
}

/// The derivatives of Σ upstream · image.
#[derive(Clone, Debug)]
pub struct Gradient {
    pub corners: Vec<[[f64; 3]; 3]>,
    pub colors: Vec<[f64; 3]>,
}

type Point = [f64; 2];

fn minus(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1]]
}

fn cross(a: Point, b: Point) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// One pixel and one triangle, where the pair counts.
struct Pair {
    triangle: usize,
    /// Whether the pixel's centre lies in the triangle.
    inside: bool,
    /// The probability D.
    d: f64,
    /// ∂D by x and y of each corner.
    d_by_corner: [Point; 3],
    /// Clipped barycentrics.
    clipped: [f64; 3],
    z: f64,
    /// Depth between near and far.
    in_range: bool,
    front: bool,
    /// Where the colour comes from, and with which weights.
    sources: Vec<(usize, f64)>,
    /// Those of `sources` that the official backward pass gives a gradient.
    differentiable: bool,
    undecided: bool,
}

fn barycentrics(p: &[Point; 3], pixel: Point) -> [f64; 3] {
    let area = cross(minus(p[1], p[0]), minus(p[2], p[0]));
    [0, 1, 2].map(|k| {
        let (a, b) = (p[(k + 1) % 3], p[(k + 2) % 3]);
        cross(minus(b, a), minus(pixel, a)) / area
    })
}

/// The squared distance to the boundary and its derivative by the corners: |pixel - q|² with q = (1 - t) a + t b.
fn boundary_distance(p: &[Point; 3], pixel: Point) -> (f64, [Point; 3]) {
    let mut best = (f64::INFINITY, [[0.0; 2]; 3]);
    for k in 0..3 {
        let (i, j) = (k, (k + 1) % 3);
        let edge = minus(p[j], p[i]);
        let t = (dot(minus(pixel, p[i]), edge) / dot(edge, edge)).clamp(0.0, 1.0);
        let q = [p[i][0] + t * edge[0], p[i][1] + t * edge[1]];
        let off = minus(q, pixel);
        if dot(off, off) < best.0 {
            let mut slope = [[0.0; 2]; 3];
            slope[i] = off.map(|x| 2.0 * (1.0 - t) * x);
            slope[j] = off.map(|x| 2.0 * t * x);
            best = (dot(off, off), slope);
        }
    }
    best
}

/// The square of the smallest barycentric and its derivative by the corners: ∂b_k / ∂p_l = -b_l ∇b_k.
fn barycentric_distance(p: &[Point; 3], b: [f64; 3]) -> (f64, [Point; 3]) {
    let k = (0..3).min_by(|&i, &j| b[i].total_cmp(&b[j])).unwrap_or(0);
    let area = cross(minus(p[1], p[0]), minus(p[2], p[0]));
    let edge = minus(p[(k + 2) % 3], p[(k + 1) % 3]);
    let gradient = [-edge[1] / area, edge[0] / area];
    (b[k] * b[k], [0, 1, 2].map(|l| gradient.map(|g| 2.0 * b[k] * -b[l] * g)))
}

/// The cell of a surface texture. An index of R² or more is the next triangle's, as the official lookup has it where a
/// barycentric is exactly 1.
fn cell(resolution: usize, b: [f64; 3]) -> usize {
    let size = resolution as f64;
    let (x, y) = ((b[0] * size).floor(), (b[1] * size).floor());
    let index =
        if (b[0] + b[1]) * size - x - y <= 1.0 { y * size + x } else { (size - 1.0 - y) * size + size - 1.0 - x };
    index as usize
}

/// D and its derivative, `None` where the pair is dropped.
fn probability(s: &Settings, p: &[Point; 3], b: [f64; 3], pixel: Point) -> Option<(f64, [Point; 3])> {
    let support = s.sigma * (1.0 / s.tau - 1.0).ln();
    let inside = b.iter().all(|&b| b > 0.0);
    // Quirk 12: whatever the distance, the box grown by the Euclidean radius ends the support.
    let beyond = |axis: usize| {
        let values = p.map(|p| p[axis]);
        let (low, high) = values.iter().fold((f64::MAX, f64::MIN), |(l, h), &v| (l.min(v), h.max(v)));
        pixel[axis] < low - support.sqrt() || pixel[axis] > high + support.sqrt()
    };
    if beyond(0) || beyond(1) {
        return None;
    }
    let (distance, slope) = match s.distance {
        Distance::Hard => return inside.then_some((1.0, [[0.0; 2]; 3])),
        Distance::Euclidean => boundary_distance(p, pixel),
        Distance::Barycentric => barycentric_distance(p, b),
    };
    if !inside && distance >= support {
        return None;
    }
    let sign = if inside { 1.0 } else { -1.0 };
    let d = 1.0 / (1.0 + (-sign * distance / s.sigma).exp());
    Some((d, slope.map(|row| row.map(|x| d * (1.0 - d) * sign * x / s.sigma))))
}

fn pair(triangles: &Triangles, s: &Settings, triangle: usize, pixel: Point) -> Option<Pair> {
    let corners = &triangles.corners[triangle];
    let p = corners.map(|c| [c[0], c[1]]);
    let b = barycentrics(&p, pixel);
    let (d, d_by_corner) = probability(s, &p, b, pixel)?;
    let clamped = b.map(|b| b.clamp(0.0, 1.0));
    let clipped = clamped.map(|b| b / clamped.iter().sum::<f64>());
    let z = 1.0 / (0..3).map(|k| clipped[k] / corners[k][2]).sum::<f64>();
    let clockwise = cross(minus(p[1], p[0]), minus(p[2], p[0])) < 0.0;
    let (sources, differentiable, undecided) = match triangles.resolution {
        None => ((0..3).map(|k| (3 * triangle + k, clipped[k])).collect(), true, false),
        Some(r) => {
            let index = cell(r, clipped);
            let corner = clipped[0].max(clipped[1]) == 1.0;
            (vec![(triangle * r * r + index, 1.0)], index < r * r, r > 1 && b[2] <= 1e-9 && !corner)
        }
    };
    Some(Pair {
        triangle,
        inside: b.iter().all(|&b| b > 0.0),
        d,
        d_by_corner,
        clipped,
        z,
        in_range: (s.near..=s.far).contains(&z),
        front: clockwise == (s.front_face == FrontFace::Clockwise),
        sources,
        differentiable,
        undecided,
    })
}

impl Pair {
    /// A cell behind the last triangle's is black.
    fn color(&self, triangles: &Triangles) -> [f64; 3] {
        let at = |&(i, weight): &(usize, f64)| triangles.colors.get(i).map_or([0.0; 3], |c| c.map(|c| weight * c));
        self.sources.iter().map(at).fold([0.0; 3], |sum, c| [0, 1, 2].map(|k| sum[k] + c[k]))
    }

    fn drawn(&self, s: &Settings) -> bool {
        self.in_range && (self.front || s.faces == Faces::Both)
    }

    fn depth_score(&self, s: &Settings) -> f64 {
        (s.far - self.z) / (s.far - s.near)
    }
}

/// One pixel: its pairs, the weights of their colours, and what comes of them.
struct Pixel {
    pairs: Vec<Pair>,
    weights: Vec<f64>,
    color: [f64; 3],
    silhouette: f64,
}

fn pixel(triangles: &Triangles, s: &Settings, at: Point) -> Pixel {
    let pairs: Vec<Pair> = (0..triangles.corners.len()).filter_map(|t| pair(triangles, s, t, at)).collect();
    // Quirks 5 and 6: alpha counts what is outside [near, far] or seen from behind. Quirk 7: a sum is a mean.
    let silhouette = match s.silhouette {
        SilhouetteAggregation::Product => 1.0 - pairs.iter().map(|p| 1.0 - p.d).product::<f64>(),
        SilhouetteAggregation::Sum => pairs.iter().map(|p| p.d).sum::<f64>() / triangles.corners.len() as f64,
        SilhouetteAggregation::Hard => f64::from(u8::from(pairs.iter().any(|p| p.d > 0.5))),
    };
    let (weights, background) = match s.color {
        ColorAggregation::Softmax => softmax(s, &pairs),
        ColorAggregation::Hard => nearest(s, &pairs),
    };
    let mut color = s.background_color.map(|c| background * c);
    for (pair, weight) in pairs.iter().zip(&weights) {
        let c = pair.color(triangles);
        color = [0, 1, 2].map(|k| color[k] + weight * c[k]);
    }
    Pixel { pairs, weights, color, silhouette }
}

/// Quirk 1: the sum begins at exp(ε / γ) with its maximum already at ε, so that the background's logit is 2 ε / γ.
fn softmax(s: &Settings, pairs: &[Pair]) -> (Vec<f64>, f64) {
    let mut maximum = s.epsilon;
    for pair in pairs.iter().filter(|p| p.drawn(s)) {
        maximum = pair.depth_score(s).max(maximum);
    }
    let background = (s.epsilon / s.gamma).exp() * ((s.epsilon - maximum) / s.gamma).exp();
    let term = |p: &Pair| if p.drawn(s) { p.d * ((p.depth_score(s) - maximum) / s.gamma).exp() } else { 0.0 };
    let terms: Vec<f64> = pairs.iter().map(term).collect();
    let sum = background + terms.iter().sum::<f64>();
    (terms.iter().map(|t| t / sum).collect(), background / sum)
}

/// All of the weight to the nearest triangle that covers the pixel's centre.
fn nearest(s: &Settings, pairs: &[Pair]) -> (Vec<f64>, f64) {
    let covering = (0..pairs.len()).filter(|&i| pairs[i].drawn(s) && pairs[i].inside);
    let nearest = covering.min_by(|&i, &j| pairs[i].z.total_cmp(&pairs[j].z));
    let one_at = |i| if Some(i) == nearest { 1.0 } else { 0.0 };
    ((0..pairs.len()).map(one_at).collect(), if nearest.is_none() { 1.0 } else { 0.0 })
}

fn pixels(s: &Settings) -> impl Iterator<Item = Point> {
    let (width, height) = (f64::from(s.width), f64::from(s.height));
    let row = move |r: u32| (height - 1.0 - 2.0 * f64::from(r)) / height;
    let column = move |c: u32| (2.0 * f64::from(c) + 1.0 - width) / height;
    (0..s.height).flat_map(move |r| (0..s.width).map(move |c| (r, c))).map(move |(r, c)| [column(c), row(r)])
}

/// The official image of triangles on the screen.
pub fn image(triangles: &Triangles, s: &Settings) -> Image {
    let mut image = Image { color: Vec::new(), silhouette: Vec::new(), undecided: Vec::new() };
    for at in pixels(s) {
        let pixel = pixel(triangles, s, at);
        image.color.extend(pixel.color);
        image.silhouette.push(pixel.silhouette);
        image.undecided.push(pixel.pairs.iter().any(|p| p.undecided));
    }
    image
}

/// The official gradient. Quirk 3: barycentrics are constants to colour and depth. Quirk 5: what is outside [near, far]
/// has none. Quirk 8: 1 - D is at least 1e-6 where the silhouette is divided by it.
pub fn gradient(triangles: &Triangles, s: &Settings, up_color: &[f64], up_silhouette: &[f64]) -> Gradient {
    let mut sum = Gradient {
        corners: vec![[[0.0; 3]; 3]; triangles.corners.len()],
        colors: vec![[0.0; 3]; triangles.colors.len()],
    };
    for (i, at) in pixels(s).enumerate() {
        let pixel = pixel(triangles, s, at);
        for (pair, &weight) in pixel.pairs.iter().zip(&pixel.weights).filter(|(pair, _)| pair.in_range) {
            let up = &up_color[3 * i..3 * i + 3];
            let mut by_d = up_silhouette[i]
                * match s.silhouette {
                    SilhouetteAggregation::Product => (1.0 - pixel.silhouette) / (1.0 - pair.d).max(1e-6),
                    SilhouetteAggregation::Sum => 1.0 / triangles.corners.len() as f64,
                    SilhouetteAggregation::Hard => 0.0,
                };
            if pair.differentiable {
                for &(source, share) in &pair.sources {
                    (0..3).for_each(|k| sum.colors[source][k] += up[k] * weight * share);
                }
            }
            let corners = &mut sum.corners[pair.triangle];
            if s.color == ColorAggregation::Softmax {
                let color = pair.color(triangles);
                // ∂I by the logarithm of the pair's term.
                let by_log = (0..3).map(|k| up[k] * weight * (color[k] - pixel.color[k])).sum::<f64>();
                by_d += by_log / pair.d;
                let by_z = -by_log / s.gamma / (s.far - s.near);
                for (k, corner) in corners.iter_mut().enumerate() {
                    let z = triangles.corners[pair.triangle][k][2];
                    corner[2] += by_z * pair.clipped[k] * (pair.z / z).powi(2);
                }
            }
            for (corner, slope) in corners.iter_mut().zip(pair.d_by_corner) {
                corner[0] += by_d * slope[0];
                corner[1] += by_d * slope[1];
            }
        }
    }
    sum
}
