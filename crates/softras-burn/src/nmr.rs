//! The approximate gradient of a hard renderer, to compare with: H. Kato, Y. Ushiku and T. Harada, "Neural 3D Mesh Renderer",
//! CVPR 2018, section 3.
//!
//! A pixel of a hard image jumps from I to I' when an edge passes its centre. Section 3.2 replaces the jump by a line: with δx
//! how far a vertex moves until then, ∂I/∂x = (I' - I) / δx where that change would lessen the loss, ∂L/∂I (I' - I) < 0, and 0
//! elsewhere. Outside a triangle I' is the triangle's colour at the edge, inside it the colour beyond the edge. What another
//! triangle hides has no such gradient (section 3.3).
//!
//! Where the paper leaves a choice, this is what the authors' `neural_renderer` does: rows move edges along x and columns along y,
//! up to the image's border; the colours at the edge are those of the two pixels beside it; δx grows by 1e-3 of half the image,
//! so that it is never 0; and (I' - I) is one number, the sum over all channels of its product with ∂L/∂I.

use softras::glam::DVec3;
use softras::scene::{Camera, Projection, Settings};
use softras::{Error, Mesh, Result};

/// What δx grows by, as a share of half the image.
const LEAST_MOVE: f64 = 1e-3;
/// The pixels that no triangle covers.
const NOTHING: u32 = u32::MAX;

/// From world space to pixels: column = cx + fx x / z, row = cy - fy y / z, without z for orthographic cameras.
#[derive(Clone, Debug)]
struct Lens {
    camera: Camera,
    focal: [f64; 2],
    center: [f64; 2],
    by_depth: bool,
}

impl Lens {
    fn new(camera: &Camera, settings: &Settings) -> Result<Self> {
        let [width, height] = [settings.width, settings.height].map(f64::from);
        let (focal, center, by_depth) = match *camera.projection() {
            Projection::Perspective { fov_y } => {
                ([0.5 * height / (0.5 * fov_y).tan(); 2], [0.5 * width, 0.5 * height], true)
            }
            Projection::Orthographic { half_height } => {
                ([0.5 * height / half_height; 2], [0.5 * width, 0.5 * height], false)
            }
            Projection::Pinhole { fx, fy, cx, cy } => ([fx, fy], [cx, cy], true),
            Projection::Official { .. } | Projection::Screen => {
                let what = format!("the approximate gradient for {:?}", camera.projection());
                return Err(Error::Scene { what, fix: "use a perspective, orthographic or pinhole camera".into() });
            }
        };
        // A pixel's centre is its number here.
        Ok(Self { camera: *camera, focal, center: center.map(|c| c - 0.5), by_depth })
    }

    fn to_view(&self, p: [f32; 3]) -> [f64; 3] {
        self.camera.to_view(DVec3::from(p.map(f64::from))).to_array()
    }

    fn project(&self, position: [f32; 3]) -> Corner {
        let [x, y, z] = self.to_view(position);
        let scale = if self.by_depth { 1.0 / z } else { 1.0 };
        let at = [self.center[0] + self.focal[0] * x * scale, self.center[1] - self.focal[1] * y * scale];
        // What is linear on the image, and largest where it is nearest.
        Corner { at, depth: z, nearness: if self.by_depth { scale } else { -z } }
    }

    /// The gradient by a world position from the one by its column and row.
    fn pull_back(&self, position: [f32; 3], [by_column, by_row]: [f64; 2]) -> [f64; 3] {
        let [x, y, z] = self.to_view(position);
        let scale = if self.by_depth { 1.0 / z } else { 1.0 };
        let (by_x, by_y) = (by_column * self.focal[0] * scale, -by_row * self.focal[1] * scale);
        let by_z = if self.by_depth { -(by_x * x + by_y * y) * scale } else { 0.0 };
        let [right, up, forward] = self.camera.axes();
        (by_x * right + by_y * up + by_z * forward).to_array()
    }
}

/// A vertex on the image.
#[derive(Clone, Copy, Debug)]
struct Corner {
    /// Column and row.
    at: [f64; 2],
    depth: f64,
    nearness: f64,
}

/// The views of a frame: one mesh with any number of cameras, or one camera for each mesh.
#[derive(Clone, Debug)]
pub(crate) struct HardViews {
    meshes: Vec<Mesh>,
    lenses: Vec<Lens>,
    size: [usize; 2],
    depths: [f64; 2],
}

impl HardViews {
    pub fn new(meshes: Vec<Mesh>, cameras: &[Camera], settings: &Settings) -> Result<Self> {
        let lenses = cameras.iter().map(|camera| Lens::new(camera, settings)).collect::<Result<_>>()?;
        let size = [settings.width as usize, settings.height as usize];
        Ok(Self { meshes, lenses, size, depths: [settings.near, settings.far] })
    }

    /// The gradient by all positions, from images `[views, height, width, channels]` and the gradient by them.
    pub fn by_positions(&self, images: &[f32], upstream: &[f32]) -> Vec<f32> {
        let mut firsts = vec![0];
        for mesh in &self.meshes {
            firsts.push(firsts.last().unwrap_or(&0) + mesh.positions().len());
        }
        let mut sums = vec![[0.0; 3]; firsts.last().copied().unwrap_or(0)];
        // Views are shared among threads, and their gradients summed in one order.
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let mut views = vec![Vec::new(); self.lenses.len()];
        let share = views.len().div_ceil(threads).max(1);
        std::thread::scope(|scope| {
            for (part, views) in views.chunks_mut(share).enumerate() {
                scope.spawn(move || {
                    for (i, view) in views.iter_mut().enumerate() {
                        *view = self.by_view(part * share + i, images, upstream);
                    }
                });
            }
        });
        for (i, view) in views.into_iter().enumerate() {
            for (sum, gradient) in sums[firsts[self.shape(i)]..].iter_mut().zip(view) {
                (0..3).for_each(|k| sum[k] += gradient[k]);
            }
        }
        sums.iter().flatten().map(|&x| x as f32).collect()
    }

    /// The mesh of a view.
    fn shape(&self, view: usize) -> usize {
        if self.meshes.len() == 1 { 0 } else { view }
    }

    /// The gradient by the positions of a view's mesh.
    fn by_view(&self, i: usize, images: &[f32], upstream: &[f32]) -> Vec<[f64; 3]> {
        let (mesh, lens) = (&self.meshes[self.shape(i)], &self.lenses[i]);
        let corners: Vec<Corner> = mesh.positions().iter().map(|&p| lens.project(p)).collect();
        let size = images.len() / self.lenses.len();
        let [image, upstream] = [images, upstream].map(|all| self.pixels(&all[i * size..(i + 1) * size]));
        let by_pixels = View::new(self.size, self.depths, &corners, mesh.triangles()).by_corners(image, upstream);
        mesh.positions().iter().zip(by_pixels).map(|(&p, by_pixel)| lens.pull_back(p, by_pixel)).collect()
    }

    /// The pixels of an image of at most four channels.
    fn pixels(&self, image: &[f32]) -> Vec<Pixel> {
        let channels = image.len() / (self.size[0] * self.size[1]);
        let pixel = |values: &[f32]| std::array::from_fn(|k| values.get(k).copied().unwrap_or(0.0));
        image.chunks_exact(channels).map(pixel).collect()
    }
}

/// The channels of a pixel, zeros after the last.
type Pixel = [f32; 4];

fn dot(a: Pixel, b: Pixel) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
}

/// A mesh on an image.
struct View<'a> {
    size: [usize; 2],
    corners: &'a [Corner],
    triangles: &'a [[u32; 3]],
    /// The triangle that each pixel shows.
    front: Vec<u32>,
}

/// The rows of an image, or its columns.
struct Lines {
    /// Pixels of a line.
    count: usize,
    /// Line after line: what a pixel shows, the gradient by it, and the triangle there.
    image: Vec<Pixel>,
    upstream: Vec<Pixel>,
    front: Vec<u32>,
}

/// Where an edge of a triangle crosses a line.
struct Crossing {
    line: usize,
    /// Where on the line it does.
    at: f64,
    /// How far that point moves with each end of the edge.
    shares: [f64; 2],
    /// 1 where the triangle lies before that point, -1 where it lies behind.
    outward: isize,
    /// Where the line leaves the triangle again.
    end: f64,
}

impl<'a> View<'a> {
    fn new(size: [usize; 2], depths: [f64; 2], corners: &'a [Corner], triangles: &'a [[u32; 3]]) -> Self {
        let pixels = size[0] * size[1];
        let mut view = Self { size, corners, triangles, front: vec![NOTHING; pixels] };
        let mut nearest = vec![f64::NEG_INFINITY; pixels];
        for i in 0..triangles.len() {
            // What the near or the far plane cuts is left out.
            if view.triangle(i).iter().all(|corner| (depths[0]..=depths[1]).contains(&corner.depth)) {
                view.fill(i, &mut nearest);
            }
        }
        view
    }

    fn triangle(&self, i: usize) -> [Corner; 3] {
        self.triangles[i].map(|vertex| self.corners[vertex as usize])
    }

    /// Shows a triangle wherever it is the nearest so far.
    fn fill(&mut self, i: usize, nearest: &mut [f64]) {
        let corners = self.triangle(i);
        let [a, b, c] = corners.map(|corner| corner.at);
        let double_area = cross(a, b, c);
        if double_area == 0.0 {
            return;
        }
        let range = |axis: usize| lines(corners.map(|corner| corner.at[axis]), self.size[axis]);
        for row in range(1) {
            for column in range(0) {
                let p = [column as f64, row as f64];
                let shares = [cross(p, b, c), cross(a, p, c), cross(a, b, p)].map(|area| area / double_area);
                let nearness = (0..3).map(|k| shares[k] * corners[k].nearness).sum::<f64>();
                let pixel = row * self.size[0] + column;
                if shares.iter().all(|&share| share >= 0.0) && nearness > nearest[pixel] {
                    nearest[pixel] = nearness;
                    self.front[pixel] = i as u32;
                }
            }
        }
    }

    /// The gradient by each corner's column and row.
    fn by_corners(self, image: Vec<Pixel>, upstream: Vec<Pixel>) -> Vec<[f64; 2]> {
        let mut sums = vec![[0.0; 2]; self.corners.len()];
        let mut seen = vec![false; self.triangles.len()];
        self.front.iter().filter(|&&i| i != NOTHING).for_each(|&i| seen[i as usize] = true);
        let [width, height] = self.size;
        let turned = Lines {
            count: height,
            image: turned(&image, width),
            upstream: turned(&upstream, width),
            front: turned(&self.front, width),
        };
        let lines = [Lines { count: width, image, upstream, front: self.front.clone() }, turned];
        // A triangle that no pixel shows has no gradient.
        for i in (0..self.triangles.len()).filter(|&i| seen[i]) {
            for (edge, axis) in [(0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1)] {
                let ends = [0, 1].map(|k| self.triangles[i][(edge + k) % 3] as usize);
                for crossing in self.crossings(i, edge, axis) {
                    let gradient = lines[axis].by_crossing(i as u32, &crossing);
                    (0..2).for_each(|k| sums[ends[k]][axis] += gradient[k]);
                }
            }
        }
        sums
    }

    /// Where an edge of a triangle crosses the rows (axis 0) or the columns (axis 1).
    fn crossings(&self, i: usize, edge: usize, axis: usize) -> impl Iterator<Item = Crossing> + use<> {
        let corners = self.triangle(i);
        // Each point along the line, then across the lines.
        let [a, b, c] = [0, 1, 2].map(|k| corners[(edge + k) % 3].at).map(|at| [at[axis], at[1 - axis]]);
        let third = on_line(a, b, c[1]);
        let within = lines([a[1], b[1], b[1]], self.size[1 - axis]);
        let is_flat = a[1] == b[1] || third == c[0];
        within.filter(move |_| !is_flat).map(move |line| {
            let across = line as f64;
            let share = (across - a[1]) / (b[1] - a[1]);
            let other = if (across - a[1]) * (across - c[1]) < 0.0 { a } else { b };
            let end = if other[1] == c[1] { c[0] } else { on_line(other, c, across) };
            let outward = if third > c[0] { 1 } else { -1 };
            Crossing { line, at: on_line(a, b, across), shares: [1.0 - share, share], outward, end }
        })
    }
}

impl Lines {
    /// The gradient by where the ends of an edge lie along a line that it crosses.
    fn by_crossing(&self, triangle: u32, &Crossing { line, at, shares, outward, end }: &Crossing) -> [f64; 2] {
        let count = self.count as isize;
        let inside = if outward > 0 { at.floor() } else { at.ceil() } as isize;
        let outside = inside + outward;
        if [inside, outside].iter().any(|p| !(0..count).contains(p)) {
            return [0.0; 2];
        }
        let pixels = line * self.count..(line + 1) * self.count;
        let (image, upstream) = (&self.image[pixels.clone()], &self.upstream[pixels.clone()]);
        let front = &self.front[pixels];
        let least = 0.5 * LEAST_MOVE * self.count as f64;
        let mut sums = [0.0; 2];
        // What a pixel adds that changes to a colour once the edge has passed it.
        let mut add = |p: isize, changed: Pixel| {
            let (now, by_now) = (image[p as usize], upstream[p as usize]);
            let gain = dot(changed, by_now) - dot(now, by_now);
            if gain < 0.0 {
                let distance = p as f64 - at;
                for (sum, share) in sums.iter_mut().zip(shares).filter(|(_, share)| *share > 0.0) {
                    let moved = distance / share;
                    *sum += f64::from(gain) / if moved > 0.0 { moved + least } else { moved - least };
                }
            }
        };
        if front[inside as usize] == triangle {
            let border = if outward > 0 { count } else { -1 };
            steps(outside, border, outward).for_each(|p| add(p, image[inside as usize]));
        }
        let end = if outward > 0 { end.ceil() } else { end.floor() } as isize;
        let beyond = end.clamp(0, count - 1) - outward;
        for p in steps(inside, beyond, -outward).filter(|&p| front[p as usize] == triangle) {
            add(p, image[outside as usize]);
        }
        sums
    }
}

/// An image of this width, column after column.
fn turned<T: Copy>(image: &[T], width: usize) -> Vec<T> {
    (0..width).flat_map(|column| image[column..].iter().step_by(width).copied()).collect()
}

/// Pixels from one to another, which is left out; none where that lies behind.
fn steps(from: isize, to: isize, step: isize) -> impl Iterator<Item = isize> {
    (0..((to - from) * step).max(0)).map(move |i| from + i * step)
}

/// The numbers of the pixels between the least and the largest of three.
fn lines(values: [f64; 3], count: usize) -> std::ops::Range<usize> {
    let low = values.iter().copied().fold(f64::INFINITY, f64::min).ceil().max(0.0);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max).floor().min(count as f64 - 1.0);
    if low <= high { low as usize..high as usize + 1 } else { 0..0 }
}

/// Where the line through two points (along, across) lies along, at a place across.
fn on_line(a: [f64; 2], b: [f64; 2], across: f64) -> f64 {
    a[0] + (across - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
}

/// Twice the area of a triangle, with the sign of its winding.
fn cross(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}
