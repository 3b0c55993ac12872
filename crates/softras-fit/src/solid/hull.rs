//! The visual hull: the largest solid that has given silhouettes (Laurentini, "The Visual Hull Concept for Silhouette-Based
//! Image Understanding", 1994), as a mesh to begin a fit with.
//!
//! A point of a solid lies within its silhouette in every picture. For a picture take the signed
//! distance between p's projection and the silhouette's outline, in world units at p's depth; f(p) is the least of all pictures, and the
//! hull is where f > 0. f is sampled on a grid, and the mesh is its zero level. Where a picture has a depth, what lies in front of it is outside too: f is
//! at most p's depth less the picture's.

use crate::bad;
use crate::cores::on_all_cores;
use crate::mesh::regions::{is_border, regions};
use crate::optimize::shape::{known, masked};
use crate::optimize::soft_target::signed_distance;
use crate::work::GoesOn;
use glam::DVec3;
use rayon::prelude::*;
use softras::{
    Image, Result,
    scene::{Camera, Mesh, Projection},
    shapes::Samples,
};
use softras_io::Views;

/// The most samples along a side of the grid.
const MAX_RESOLUTION: usize = 256;
/// Samples along a side of the first grid, which finds the box that the hull fills.
const COARSE: usize = 48;
/// A part of a hull by depths, or of a solid that was cut, has at least this share of its samples.
const LEAST_PART: f64 = 1e-3;
/// Pictures below this height are enlarged, so that their outlines run between pixels as the grey of their pixels says.
const FINE_HEIGHT: usize = 1024;
/// The most that they are enlarged.
pub(crate) const MOST_ENLARGED: usize = 4;
/// Pictures that are worked on before the caller is asked whether to go on, and parts of the samples: few, since each starts threads.
const PICTURES_AT_ONCE: usize = 64;
const PARTS: usize = 16;

/// The visual hull of the silhouettes, less what the depths show to be empty, within the cube of side `side` around `center`,
/// in world units. Its triangles' edges are about as long as the hull's longest extent divided by `resolution`, 8 to 256.
///
/// Beyond the border of a picture nothing is, or nothing is known where the border cuts the silhouette.
///
/// # Errors
/// [`softras::Error::Fit`] where there is no hull: targets without silhouettes or that do not fit together, a silhouette without
/// an inside, silhouettes whose cameras have no point in common; for a camera of [`Projection::Official`] or
/// [`Projection::Screen`]; and for a cube or a resolution out of range.
pub fn visual_hull(of: &Views, center: [f64; 3], side: f64, resolution: usize) -> Result<Mesh> {
    meshed(samples(of, center, side, resolution, &mut || Ok(()))?, of)
}

/// The samples of the visual hull.
pub(crate) fn samples(
    of: &Views,
    center: [f64; 3],
    side: f64,
    resolution: usize,
    goes_on: &mut GoesOn,
) -> Result<Samples> {
    hull(&views(of, MOST_ENLARGED, goes_on)?, center, side, resolution, 0.0, goes_on)
}

/// The visual hull as a mesh, of its samples.
pub(crate) fn meshed(mut grid: Samples, of: &Views) -> Result<Mesh> {
    if of.depth.is_some() {
        mend(&mut grid);
    }
    match grid.mesh()? {
        Some(mesh) => Ok(mesh),
        None => bad("a hull thinner than its samples", "use a higher resolution"),
    }
}

/// The hull of silhouettes that are wider by `slack`, world units.
pub(crate) fn wide_hull(
    of: &Views,
    center: [f64; 3],
    side: f64,
    resolution: usize,
    slack: f64,
    goes_on: &mut GoesOn,
) -> Result<Option<Mesh>> {
    hull(&views(of, 1, goes_on)?, center, side, resolution, slack, goes_on)?.mesh()
}

/// The samples of the hull of silhouettes that are wider by `slack`, on a grid around it.
pub(crate) fn hull(
    views: &[View],
    center: [f64; 3],
    side: f64,
    resolution: usize,
    slack: f64,
    goes_on: &mut GoesOn,
) -> Result<Samples> {
    if !(8..=MAX_RESOLUTION).contains(&resolution) {
        return bad(format!("a hull of {resolution} samples a side"), "use 8 to 256");
    }
    if !(side > 0.0 && side.is_finite() && center.iter().all(|x| x.is_finite())) {
        return bad(format!("a hull in a cube of side {side:?} around {center:?}"), "use a finite side above 0");
    }
    let mut coarse = Samples::new(DVec3::from(center) - 0.5 * side, side, COARSE);
    carve(&mut coarse, views, slack, View::outline_distance, goes_on)?;
    let Some((low, high)) = inside(&coarse) else {
        let fix = "check that every camera belongs to its picture, and that the object is in all of them";
        return bad("no solid fits the silhouettes", fix);
    };
    // Two samples more on each side than the hull takes.
    let side = (high - low).max_element() * (1.0 + 4.0 / resolution as f64);
    let mut grid = Samples::new((low + high) * 0.5 - 0.5 * side, side, resolution);
    carve(&mut grid, views, slack, View::distance, goes_on)?;
    (0..3).for_each(|axis| blur(&mut grid, axis));
    Ok(grid)
}

/// A picture's distances from its outline, and its camera.
pub(crate) struct View {
    /// A camera with its focal length in place of a field of view: an angle's tangent takes longer than all else of a point.
    camera: Camera,
    /// In screen units, above 0 inside.
    distance: Image,
    /// Pixels of the picture itself along its height.
    height: f64,
    /// Whether the picture's border cuts the silhouette: then it tells nothing of what lies beyond.
    is_cut: bool,
    /// The depths of the surface, 0 where they are not known.
    depths: Option<Image>,
    /// The most that the distance changes by as a point within the outline moves, by the length of its way. Infinite where it jumps.
    steepest: f64,
}

/// The views of all targets, their silhouettes enlarged `times` times at most.
pub(crate) fn views(targets: &Views, times: usize, goes_on: &mut GoesOn) -> Result<Vec<View>> {
    let Some(silhouettes) = &targets.silhouette else {
        return bad("a hull without silhouettes", "give the targets' silhouettes");
    };
    targets.size()?;
    let view = |(i, camera): (usize, &Camera)| {
        if matches!(camera.projection(), Projection::Official { .. } | Projection::Screen) {
            let what = format!("a hull from camera {i}, a {:?}", camera.projection());
            return bad(what, "use perspective, orthographic or pinhole cameras");
        }
        let picture = silhouettes.views(i..i + 1);
        if picture.data.iter().all(|x| *x <= 0.5) {
            return bad(format!("picture {i} without an inside"), "leave out pictures that do not show the object");
        }
        let depths = targets.depth.as_ref().map(|depths| {
            let depths = depths.views(i..i + 1);
            masked(&depths, &known(&depths, Some(&picture)))
        });
        let distance = signed_distance(&enlarged(&picture, times))?;
        let camera = match camera.intrinsics((picture.width as u32, picture.height as u32)) {
            Some([fx, fy, cx, cy]) => Camera::from_affine(camera.matrix(), Projection::Pinhole { fx, fy, cx, cy })?,
            None => *camera,
        };
        let (height, is_cut) = (picture.height as f64, is_cut(&picture));
        let jumps = is_cut || depths.is_some();
        let steepest = if jumps { f64::INFINITY } else { steepest(&camera, picture.width as f64, height) };
        Ok(View { camera, distance, height, is_cut, depths, steepest })
    };
    let pictures: Vec<(usize, &Camera)> = targets.cameras.iter().enumerate().collect();
    let mut views = Vec::with_capacity(pictures.len());
    for some in pictures.chunks(PICTURES_AT_ONCE) {
        // All are looked at before the first error is taken, so that it is the same each time.
        let some: Vec<Result<View>> = on_all_cores(|| some.par_iter().copied().map(view).collect());
        views.extend(some.into_iter().collect::<Result<Vec<_>>>()?);
        goes_on()?;
    }
    Ok(views)
}

/// The most that the distance from an outline changes by, in world units, as a point that is seen within a picture moves by one.
///
/// In pixels the distance from an outline changes by at most 1 a pixel, and between pixels by √2, as it is interpolated along both
/// axes. A point at an angle a to the optical axis moves by at most 1 / cos a of its pixels. Its pixels grow with its depth, and
/// no distance is longer than half of the picture. A matrix that is no rotation stretches ways by at most the root of the largest
/// sum of products of its rows.
fn steepest(camera: &Camera, width: f64, height: f64) -> f64 {
    let axes = camera.axes();
    let stretch = axes.map(|a| axes.map(|b| a.dot(b).abs()).iter().sum::<f64>()).into_iter().fold(0.0, f64::max).sqrt();
    let of_view = match *camera.projection() {
        Projection::Pinhole { fx, fy, cx, cy } => {
            let tangent = (cx.abs().max((width - cx).abs()) / fx).hypot(cy.abs().max((height - cy).abs()) / fy);
            2f64.sqrt() * (1.0 + tangent * tangent).sqrt() + 0.5 * width.max(height) / fx.max(fy)
        }
        Projection::Orthographic { .. } => 2f64.sqrt(),
        _ => f64::INFINITY,
    };
    of_view * stretch
}

/// Whether a silhouette reaches the border of its picture.
fn is_cut(picture: &Image) -> bool {
    let size = (picture.height, picture.width);
    picture.data.iter().enumerate().any(|(i, x)| *x > 0.5 && is_border(i, size))
}

/// The picture enlarged by linear interpolation.
fn enlarged(picture: &Image, most: usize) -> Image {
    let times = (FINE_HEIGHT / picture.height).clamp(1, most);
    let (height, width) = (times * picture.height, times * picture.width);
    let at = |i: usize| (i as f64 + 0.5) / times as f64;
    let data =
        (0..height).flat_map(|row| (0..width).map(move |column| sample(picture, 0, 0, at(column), at(row)) as f32));
    Image { height, width, data: data.collect(), ..*picture }
}

/// The depth at a place, between those of the four pixels around it or, where they differ by more than `step`, of the pixel that it
/// lies in; `None` where one of them is not known.
pub(crate) fn depth_at(depths: &Image, view: usize, column: f64, row: f64, step: f64) -> Option<f64> {
    let (left, top) = ((column - 0.5).floor(), (row - 0.5).floor());
    if left < 0.0 || top < 0.0 || left as usize + 1 >= depths.width || top as usize + 1 >= depths.height {
        return None;
    }
    let at = |down: usize, right: usize| f64::from(depths.pixel(view, top as usize + down, left as usize + right)[0]);
    let around = [at(0, 0), at(0, 1), at(1, 0), at(1, 1)];
    let (least, most) = around.iter().fold((f64::INFINITY, 0.0f64), |(least, most), z| (least.min(*z), most.max(*z)));
    if least <= 0.0 {
        return None;
    }
    let own = || f64::from(depths.pixel(view, row as usize, column as usize)[0]);
    Some(if most - least <= step { sample(depths, view, 0, column, row) } else { own() })
}

/// The value of a view's channel at a column and a row, where the centre of the first pixel is at (0.5, 0.5); that of its border beyond it.
pub(crate) fn sample(image: &Image, view: usize, channel: usize, column: f64, row: f64) -> f64 {
    between((image.width, image.height), (column, row), |row, column| {
        f64::from(image.pixel(view, row, column)[channel])
    })
}

/// Interpolates between the pixels of a picture, whose values are asked for by row and column, as [`sample`].
#[inline]
pub(crate) fn between(
    (width, height): (usize, usize),
    (column, row): (f64, f64),
    at: impl Fn(usize, usize) -> f64,
) -> f64 {
    // In place of `x.fract()`, which calls a function on processors without an instruction for it.
    let near = |x: f64, count: usize| {
        let x = (x - 0.5).clamp(0.0, (count - 1) as f64);
        let first = x as usize;
        (first, (first + 1).min(count - 1), x - first as f64)
    };
    let (left, right, along) = near(column, width);
    let (top, bottom, down) = near(row, height);
    let mix = |row: usize| at(row, left) * (1.0 - along) + at(row, right) * along;
    mix(top) * (1.0 - down) + mix(bottom) * down
}

/// The column and the row of the pixel that a point is seen in; `None` behind the camera and beyond the picture.
pub(crate) fn pixel_of(camera: &Camera, point: DVec3, size: (u32, u32)) -> Option<(usize, usize)> {
    let [column, row, _] = camera.project(point, size)?;
    let inside = column >= 0.0 && row >= 0.0 && column < f64::from(size.0) && row < f64::from(size.1);
    inside.then_some((column as usize, row as usize))
}

impl View {
    /// The signed distance of a point from the silhouette's outline in world units; `None` behind the camera.
    pub(crate) fn outline_distance(&self, point: DVec3) -> Option<f64> {
        let place = self.place(point)?;
        Some(place.unit * sample(&self.distance, 0, 0, place.column, place.row))
    }

    /// The distance from the outline as in `outline_distance`, but no more than the depth of the point behind the surface in the picture.
    fn distance(&self, point: DVec3) -> Option<f64> {
        let place = self.place(point)?;
        let times = self.distance.height as f64 / self.height;
        // Depths differ by more than four pixels from one pixel to the next where a surface is seen at less than some 14 degrees.
        let step = 8.0 * place.unit / self.height;
        let shown = |depths| depth_at(depths, 0, place.column / times, place.row / times, step);
        let behind = self.depths.as_ref().and_then(shown).map_or(f64::INFINITY, |shown| place.depth - shown);
        Some(behind.min(place.unit * sample(&self.distance, 0, 0, place.column, place.row)))
    }

    /// As [`pixel_of`].
    pub(crate) fn pixel(&self, point: DVec3) -> Option<(usize, usize)> {
        let width = self.height * self.distance.width as f64 / self.distance.height as f64;
        pixel_of(&self.camera, point, (width as u32, self.height as u32))
    }

    /// Where a point is seen; `None` behind the camera, and beyond the border of a picture that cuts its silhouette.
    fn place(&self, point: DVec3) -> Option<PixelPlace> {
        let (width, height) = (self.distance.width as f64, self.distance.height as f64);
        let times = height / self.height;
        let [column, row, depth] = self.camera.project(point, ((width / times) as u32, self.height as u32))?;
        let is_inside = column >= 0.0 && row >= 0.0 && column * times < width && row < self.height;
        if self.is_cut && !is_inside {
            return None;
        }
        let unit = match *self.camera.projection() {
            Projection::Pinhole { fx, fy, .. } => 0.5 * self.height * depth / fx.max(fy),
            Projection::Orthographic { half_height } => half_height,
            _ => return None,
        };
        Some(PixelPlace { column: times * column, row: times * row, unit, depth })
    }
}

/// Where a view sees a point: column and row in the image of distances, and the view depth. `unit` is the length in world units of half
/// the image's height at that depth.
struct PixelPlace {
    column: f64,
    row: f64,
    unit: f64,
    depth: f64,
}

/// Sets each sample to the least of the views' distances and the slack.
fn carve(
    grid: &mut Samples,
    views: &[View],
    slack: f64,
    distance: impl Fn(&View, DVec3) -> Option<f64> + Sync,
    goes_on: &mut GoesOn,
) -> Result<()> {
    // Distances beyond some samples do not matter, and what no picture shows is outside.
    let far = far(grid);
    let mut values = std::mem::take(&mut grid.values);
    let carve_row = |(row, values): (usize, &mut [f32])| {
        // The view that shows a sample to be far outside mostly shows so of the next one, which then needs no other view. And a view
        // that shows one deep inside does so for those that are near: until which column.
        let (mut last, mut deep) = (0, vec![0; views.len()]);
        for (column, value) in values.iter_mut().enumerate() {
            let point = grid.position(row * grid.resolution + column);
            let mut least = f32::MAX;
            for view in std::iter::once(last).chain((0..views.len()).filter(|view| *view != last)) {
                if column < deep[view] {
                    least = least.min(far);
                    continue;
                }
                let Some(distance) = distance(&views[view], point) else { continue };
                // Until there the distance is above 0, so that the point is seen within the picture, and with the slack above `far`.
                let room = distance.min(distance + slack - f64::from(far));
                deep[view] = column + 1 + (room / (1.001 * views[view].steepest * grid.step)) as usize;
                least = least.min((distance + slack) as f32);
                if least < -far {
                    last = view;
                    break;
                }
            }
            *value = if least == f32::MAX { -far } else { least.clamp(-far, far) };
        }
    };
    let at_once = grid.resolution.pow(2).div_ceil(PARTS);
    for (part, values) in values.chunks_mut(at_once * grid.resolution).enumerate() {
        let numbered = |(row, values)| carve_row((part * at_once + row, values));
        on_all_cores(|| values.par_chunks_mut(grid.resolution).enumerate().for_each(numbered));
        goes_on()?;
    }
    grid.values = values;
    Ok(())
}

/// The most that a sample is; its opposite is the least.
pub fn far(grid: &Samples) -> f32 {
    (4.0 * grid.step) as f32
}

/// The box of all points that may be inside: those nearer to a sample than the outline.
fn inside(grid: &Samples) -> Option<(DVec3, DVec3)> {
    // Half the diagonal of a cell.
    let reach = 0.5 * 3f64.sqrt() * grid.step;
    let near = (0..grid.values.len()).filter(|i| f64::from(grid.values[*i]) > -reach);
    let points = near.map(|i| grid.position(i));
    let bounds = points.map(|p| (p, p)).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))?;
    Some((bounds.0 - 0.5 * grid.step, bounds.1 + 0.5 * grid.step))
}

/// Puts small parts outside, and air that is enclosed inside: depths leave both where an outline runs before a surface farther
/// away, a cut leaves shavings, and of what is enclosed no picture shows anything.
pub fn mend(grid: &mut Samples) {
    let fewest = LEAST_PART * grid.values.iter().filter(|value| **value > 0.0).count() as f64;
    let n = grid.resolution;
    let beside = |i: usize, around: &mut Vec<usize>| {
        for stride in [1, n, n * n] {
            let place = i / stride % n;
            around.extend((place > 0).then(|| i - stride).into_iter().chain((place + 1 < n).then_some(i + stride)));
        }
    };
    let on_side = |is_in: bool| regions(grid.values.len(), |i| (grid.values[i] > 0.0) == is_in, beside);
    let (solids, airs) = (on_side(true), on_side(false));
    for crumb in solids.into_iter().filter(|part| (part.len() as f64) < fewest) {
        crumb.into_iter().for_each(|i| grid.values[i] = -grid.values[i]);
    }
    let is_border = |i: usize| [1, n, n * n].iter().any(|stride| [0, n - 1].contains(&(i / stride % n)));
    for enclosed in airs.into_iter().filter(|part| !part.iter().any(|&i| is_border(i))) {
        enclosed.into_iter().for_each(|i| grid.values[i] = (-grid.values[i]).max(f32::MIN_POSITIVE));
    }
}

/// Weighs each sample with its neighbours along an axis by (1, 2, 1) / 4, which removes handles and cavities that are only of
/// the samples: the least of many distances has sharp ridges between them.
fn blur(grid: &mut Samples, axis: usize) {
    let n = grid.resolution;
    let stride = n.pow(axis as u32);
    for first in (0..grid.values.len()).filter(|i| (i / stride).is_multiple_of(n)) {
        let mut before = grid.values[first];
        for i in (1..n - 1).map(|k| first + k * stride) {
            let here = grid.values[i];
            grid.values[i] = 0.25 * (before + 2.0 * here + grid.values[i + stride]);
            before = here;
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn crumbs_go_outside_and_enclosed_air_inside() {
        const SIDE: usize = 24;
        let mut samples = Samples::new(DVec3::ZERO, 1.0, SIDE);
        let at = |x: usize, y: usize, z: usize| (z * SIDE + y) * SIDE + x;
        // A block with a bubble in it, one sample of which lies on the outline itself, and a crumb beside it.
        samples.values.fill(-1.0);
        for (x, y, z) in (4..20).flat_map(|x| (4..20).flat_map(move |y| (4..16).map(move |z| (x, y, z)))) {
            samples.values[at(x, y, z)] = 1.0;
        }
        let block = samples.values.clone();
        samples.values[at(9, 9, 9)] = -0.5;
        samples.values[at(10, 9, 9)] = 0.0;
        samples.values[at(12, 12, 20)] = 0.5;
        mend(&mut samples);
        let outside = |values: &[f32]| values.iter().map(|value| *value <= 0.0).collect::<Vec<bool>>();
        assert_eq!(outside(&samples.values), outside(&block));
        // Air that reaches the border of the grid stays, wherever it does.
        samples.values.fill(1.0);
        (0..12).for_each(|z| samples.values[at(9, 9, z)] = -1.0);
        let tunnel = samples.values.clone();
        mend(&mut samples);
        assert_eq!(samples.values, tunnel);
    }

    #[test]
    fn views_that_are_not_asked_change_nothing() {
        // Discs and bars before cameras that are near, and one that sees no perspective.
        const SIDE: usize = 48;
        let inside = |i: usize, row: f64, column: f64| match i % 3 {
            0 => (row - 22.0).hypot(column - 25.0) < 18.0,
            1 => (row - 24.0).abs() < 9.0 || (column - 20.0).abs() < 5.0 && row > 6.0,
            _ => (row - 26.0).hypot(column - 24.0) < 17.0 && (row - 26.0).hypot(column - 24.0) > 4.0,
        };
        let cameras: Vec<Camera> = (0..7)
            .map(|i| {
                let (angle, up) = (0.9 * i as f64, 0.6 * (2.0 * i as f64).sin());
                let eye = DVec3::new(angle.cos(), up, angle.sin()) * 1.6;
                let lens = Projection::Pinhole { fx: 40.0, fy: 44.0, cx: 23.0, cy: 26.0 };
                let lens = if i == 6 { Projection::Orthographic { half_height: 0.8 } } else { lens };
                let camera = Camera::look_at(eye, DVec3::ZERO, DVec3::Y, lens).unwrap();
                // A view in another unit than the world's, and sheared.
                let stretch = glam::DMat3::from_cols_array(&[3.0, 0.0, 0.0, 0.4, 3.0, 0.0, 0.0, 0.0, 3.0]);
                let stretch = glam::DMat4::from_mat3(if i == 5 { stretch } else { glam::DMat3::IDENTITY });
                Camera::from_affine(stretch * camera.matrix(), lens).unwrap()
            })
            .collect();
        let data = (0..cameras.len() * SIDE * SIDE).map(|at| {
            let (i, at) = (at / (SIDE * SIDE), at % (SIDE * SIDE));
            let (row, column) = (at / SIDE, at % SIDE);
            // One of them reaches the border.
            let is_near = (i == 4 || !is_border(at, (SIDE, SIDE))) && inside(i, row as f64, column as f64);
            f32::from(u8::from(is_near))
        });
        let data = data.collect();
        let silhouette = Some(Image { batch: cameras.len(), height: SIDE, width: SIDE, channels: 1, data });
        let mut all = views(&Views { cameras, silhouette, ..Views::default() }, 4, &mut || Ok(())).unwrap();
        assert_eq!(all.iter().filter(|view| view.steepest.is_infinite()).count(), 1);
        for slack in [0.0, 0.02, 0.2] {
            let mut some = Samples::new(DVec3::splat(-0.7), 1.4, 56);
            let mut whole = some.clone();
            carve(&mut some, &all, slack, View::distance, &mut || Ok(())).unwrap();
            let steepest: Vec<f64> = all.iter().map(|view| view.steepest).collect();
            all.iter_mut().for_each(|view| view.steepest = f64::INFINITY);
            carve(&mut whole, &all, slack, View::distance, &mut || Ok(())).unwrap();
            all.iter_mut().zip(steepest).for_each(|(view, steepest)| view.steepest = steepest);
            assert_eq!(some.values, whole.values);
            let deep = whole.values.iter().filter(|value| **value >= far(&whole)).count();
            assert!(deep > 500, "{deep}");
        }
    }
}
