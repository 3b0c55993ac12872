//! Views that do not agree with the others, which are left out, and holes of masks that one picture alone shows, which are filled.
//!
//! A solid's silhouette covers the mask of every view. So views agree where the hull of all masks covers each of them. One wrong
//! mask carves away what the others show, and leaving it out is what makes the others agree.

use super::{
    cameras::{self, Sphere},
    subject::Subject,
};
use crate::{
    bad,
    mesh::regions::{holes, is_border, of_pixels, pixels_around},
    solid::hull::{View, views as pictures},
    work::Work,
};
use glam::DVec3;
use softras::{Image, Result, shapes::Samples};
use softras_io::Views;

/// Views from which on one can be told from the others.
const FEWEST: usize = 6;
/// Views beyond which none is looked for: each is compared with each.
const MOST: usize = 256;
/// Samples along a side of the hull.
const RESOLUTION: usize = 64;
/// Samples between two questions whether to go on.
const SLAB: usize = 2 * RESOLUTION * RESOLUTION;
/// Samples of the hull along a side of the squares that masks are compared in.
const SAMPLES_A_CELL: f64 = 2.0;
/// Leaving out a view makes this share of the others' masks agree, and this many times what the median view would.
const LEAST_GAIN: f64 = 0.005;
const TIMES_THE_MEDIAN: f64 = 4.0;
/// The share of the masks that the hull leaves uncovered must then fall below this multiple of what it was.
const MOST_LEFT: f64 = 0.7;
/// A mask with a larger share of its picture shows nothing but the object.
const FULL: f64 = 0.995;
/// So does one that has a larger share of its picture's border, as where inside and outside are exchanged.
const FULL_BORDER: f64 = 0.9;
/// Masks of which their hull leaves a larger share uncovered, in the mean, are not those of one solid.
const MOST_OPEN: f64 = 0.75;
/// A larger hole, as a share of its mask, is always taken for one.
const LARGEST_HOLE: f64 = 0.1;
/// Pixels of a small hole and of a speck, at most.
const SMALL: usize = 32;
/// Places along the ray through a hole where it may meet holes of other views by chance.
const PLACES: f64 = 12.0;
/// A hole is believed where fewer holes than this are expected to meet as many others by chance.
const BY_CHANCE: f64 = 0.5;

/// Leaves out the views that are empty, full, or do not agree with the others, at most a quarter of them, and fills small holes that
/// one mask alone has. Each is noted. Fewer than six views are not compared with each other.
///
/// # Errors
/// [`softras::Error::Fit`] where more views are empty or full, and where the masks have no solid in common.
pub fn settle(subject: &mut Subject, work: &mut Work) -> Result<()> {
    let (views, bounds) = (&subject.views, subject.bounds);
    let count = views.cameras.len();
    let Some(silhouettes) = &views.silhouette else { return Ok(()) };
    let share = |pixels: &mut dyn Iterator<Item = f32>| {
        let (inside, all) = pixels.fold((0.0, 0.0), |(inside, all), x| (inside + f64::from(x > 0.5), all + 1.0));
        inside / all
    };
    let size = (silhouettes.height, silhouettes.width);
    let plain = |view: usize| {
        let mask = silhouettes.view(view);
        let whole = share(&mut mask.iter().copied());
        let border = share(&mut mask.iter().enumerate().filter(|(i, _)| is_border(*i, size)).map(|(_, x)| *x));
        let is_full = whole > FULL || border > FULL_BORDER;
        let why = if is_full { "is all object" } else { "shows nothing of the object" };
        (whole == 0.0 || is_full).then_some((view, why))
    };
    let mut out: Vec<(usize, &str)> = (0..count).filter_map(plain).collect();
    let most = count / 4;
    if out.len() > most && (count >= FEWEST || out.len() == count) {
        let full = out.iter().filter(|(_, why)| *why == "is all object").count();
        let empty = out.len() - full;
        return bad(
            format!("of {count} views {full} are all object up to the border, and {empty} show nothing of it"),
            "give masks that are 1 (white) inside of the object alone: as alpha, or as masks beside the pictures",
        );
    }
    if !(FEWEST..=MOST).contains(&count) {
        return Ok(());
    }
    let mut left: Vec<usize> = (0..count).filter(|view| out.iter().all(|(other, _)| other != view)).collect();
    let seen = views.some(&left);
    let Ok(all) = pictures(&seen, 1, &mut || work.goes_on()) else { return work.goes_on() };
    let mut using: Vec<usize> = (0..left.len()).collect();
    let mut open = 0.0;
    while let Some((whole, worst)) = worst(&seen, &all, &using, bounds, work)? {
        open = whole;
        let Some(worst) = worst.filter(|_| out.len() < most) else { break };
        out.push((left[using.remove(worst)], "does not agree with the others"));
    }
    if open > MOST_OPEN {
        return bad(
            format!("the solid that all masks allow leaves {:.0} % of them uncovered", 100.0 * open),
            "check that each camera belongs to its picture, that masks are white inside, and that axes are the format's",
        );
    }
    left.retain(|view| out.iter().all(|(other, _)| other != view));
    out.sort_unstable();
    for (view, why) in out {
        work.notes.push(format!("{} {why}: it is left out", views.name(view)));
    }
    subject.keep(&left);
    fill(&mut subject.views, bounds, work)
}

/// The mean share of the masks that their hull leaves uncovered, and the place in `using` of the view without which the others agree much
/// better.
fn worst(
    views: &Views,
    all: &[View],
    using: &[usize],
    bounds: Sphere,
    work: &mut Work,
) -> Result<Option<(f64, Option<usize>)>> {
    let Some(uncovered) = uncovered(views, all, using, bounds, work)? else { return Ok(None) };
    let n = using.len();
    // The mean over all views, and over the others where one is left out.
    let whole = (0..n).map(|u| uncovered[u * (n + 1) + n]).sum::<f64>() / n as f64;
    let without =
        |c: usize| (0..n).filter(|u| *u != c).map(|u| uncovered[u * (n + 1) + c]).sum::<f64>() / (n - 1).max(1) as f64;
    let gains: Vec<f64> = (0..n).map(|c| whole - without(c)).collect();
    let mut sorted = gains.clone();
    sorted.sort_by(f64::total_cmp);
    let Some((at, gain)) = gains.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)) else { return Ok(None) };
    let is_worse = *gain > LEAST_GAIN && *gain > TIMES_THE_MEDIAN * sorted[n / 2] && whole - gain < MOST_LEFT * whole;
    Ok(Some((whole, is_worse.then_some(at))))
}

/// The share of each view's mask that the hull leaves uncovered: a row a view, a column for the hull without each view, and at last
/// one for the hull of all.
fn uncovered(
    views: &Views,
    all: &[View],
    using: &[usize],
    bounds: Sphere,
    work: &mut Work,
) -> Result<Option<Vec<f64>>> {
    let Some(silhouettes) = &views.silhouette else { return Ok(None) };
    let n = using.len();
    let grid = Samples::new(bounds.center - bounds.radius, 2.0 * bounds.radius, RESOLUTION);
    let mut cells: Vec<MaskSquares> =
        using.iter().map(|view| MaskSquares::of(views, silhouettes, *view, bounds.center, grid.step, n + 1)).collect();
    // A sample stands for all of its cube.
    let reach = 0.5 * grid.step;
    for at in 0..grid.values.len() {
        if at.is_multiple_of(SLAB) {
            work.goes_on()?;
        }
        let point = grid.position(at);
        let mut carvers = (0..n).filter(|u| all[using[*u]].outline_distance(point).is_some_and(|d| d < -reach));
        let (first, second) = (carvers.next(), carvers.next());
        if second.is_some() {
            continue;
        }
        for (u, cells) in cells.iter_mut().enumerate() {
            if let Some(covered) = all[using[u]].pixel(point).and_then(|pixel| cells.at(pixel)) {
                match first {
                    None => covered.fill(true),
                    Some(carver) => covered[carver] = true,
                }
            }
        }
    }
    Ok(Some(cells.iter().flat_map(|cells| (0..=n).map(|column| cells.open(column))).collect()))
}

/// A mask in squares, each some samples of the hull wide, and by which hulls each square is covered.
struct MaskSquares {
    /// Pixels along a side of a square.
    side: usize,
    columns: usize,
    hulls: usize,
    /// Whether the mask fills a square.
    is_inside: Vec<bool>,
    covered: Vec<bool>,
}

impl MaskSquares {
    fn of(views: &Views, silhouettes: &Image, view: usize, center: DVec3, step: f64, hulls: usize) -> Self {
        let (height, width) = (silhouettes.height, silhouettes.width);
        let pixel = cameras::pixel_of(&views.cameras[view], center, (height, width));
        let side = ((SAMPLES_A_CELL * step / pixel).ceil() as usize).clamp(1, height.min(width));
        let (rows, columns) = (height / side, width / side);
        let mask = silhouettes.view(view);
        let is_inside = |at: usize| {
            let (row, column) = (at / columns * side, at % columns * side);
            2 * (0..side * side).filter(|i| mask[(row + i / side) * width + column + i % side] > 0.5).count()
                > side * side
        };
        let is_inside = (0..rows * columns).map(is_inside).collect();
        Self { side, columns, hulls, is_inside, covered: vec![false; rows * columns * hulls] }
    }

    /// By which hulls the square around a pixel is covered.
    fn at(&mut self, (column, row): (usize, usize)) -> Option<&mut [bool]> {
        let (column, row) = (column / self.side, row / self.side);
        let at = row * self.columns + column;
        (column < self.columns).then_some(())?;
        self.covered.get_mut(at * self.hulls..(at + 1) * self.hulls)
    }

    /// The share of the mask's squares that a hull leaves open.
    fn open(&self, hull: usize) -> f64 {
        let inside = || self.is_inside.iter().enumerate().filter(|(_, is)| **is).map(|(at, _)| at);
        let open = inside().filter(|at| !self.covered[at * self.hulls + hull]).count();
        open as f64 / inside().count().max(1) as f64
    }
}

/// Fills holes of masks that too few others look through, and takes away specks beside the object that no solid has. Where many
/// masks have small holes, rays through some of them meet by chance: their own density says how many have to.
fn fill(views: &mut Views, bounds: Sphere, work: &mut Work) -> Result<()> {
    let Some(silhouettes) = &views.silhouette else { return Ok(()) };
    let (height, width) = (silhouettes.height, silhouettes.width);
    let size = (height, width);
    let count = views.cameras.len();
    let of = |view: usize| {
        let mask = silhouettes.view(view);
        let is_inside = |pixel: usize| mask[pixel] > 0.5;
        let mut parts = of_pixels(size, is_inside, true);
        parts.sort_by_key(Vec::len);
        parts.pop();
        parts.retain(|part| part.len() <= SMALL);
        [Spots::of(holes(size, is_inside), mask.len()), Spots::of(parts, mask.len())]
    };
    let (holes, specks): (Vec<Spots>, Vec<Spots>) = (0..count).map(of).map(|[holes, specks]| (holes, specks)).unzip();
    if holes.iter().chain(&specks).all(|spots| spots.pixels.is_empty()) {
        return Ok(());
    }
    let area = |view: usize| silhouettes.view(view).iter().filter(|x| **x > 0.5).count() as f64;
    let areas: Vec<f64> = (0..count).map(area).collect();
    let needed = needed(&holes, &areas);
    let [through, beside] = meetings(views, bounds, [&holes, &specks], work)?;
    let Views { silhouette: Some(silhouettes), color, .. } = views else { return Ok(()) };
    let (mut pierced, mut specked) = (Vec::new(), Vec::new());
    for (view, mask) in silhouettes.data.chunks_exact_mut(height * width).enumerate() {
        let is_alone = |at: &usize| {
            through[view][*at] <= needed && holes[view].pixels[*at].len() as f64 <= LARGEST_HOLE * areas[view]
        };
        let is_speck = |at: &usize| beside[view][*at] == 0;
        let (filled, count) = paint(mask, &holes[view], is_alone, 1.0, size);
        // The colours behind a hole are not known: at least black.
        let first = view * height * width;
        if let Some(color) = color {
            let unknown = |pixel: &usize| color.data[3 * (first + pixel)..][..3].fill(-f32::MIN_POSITIVE);
            filled.iter().for_each(unknown);
        }
        pierced.push(count);
        specked.push(paint(mask, &specks[view], is_speck, 0.0, size).1);
    }
    let told = [
        (pierced, "holes", "that too few other pictures look through are filled"),
        (specked, "specks", "that the other pictures leave no room for are taken away"),
    ];
    work.notes.extend(told.into_iter().filter_map(|(pixels, what, why)| {
        let first = pixels.iter().position(|count| *count > 0)?;
        let (sum, more) = (pixels.iter().sum::<usize>(), pixels.iter().filter(|count| **count > 0).count() - 1);
        let others = if more == 0 { String::new() } else { format!(" and {more} more") };
        let plural = if sum == 1 { "" } else { "s" };
        Some(format!("{}{others}: {what}, {sum} pixel{plural} in all, {why}", views.name(first)))
    }));
    Ok(())
}

/// For each view and hole the most views that look through theirs at one point. For each view and speck the most that show theirs at
/// one point of the hull; 0 where the hull has no point there.
fn meetings(views: &Views, bounds: Sphere, spots: [&[Spots]; 2], work: &mut Work) -> Result<[Vec<Vec<usize>>; 2]> {
    let (all, size) = (pictures(views, 1, &mut || work.goes_on())?, views.size()?);
    let grid = Samples::new(bounds.center - bounds.radius, 2.0 * bounds.radius, RESOLUTION);
    let mut met = spots.map(|spots| spots.iter().map(|spots| vec![0; spots.pixels.len()]).collect::<Vec<_>>());
    for at in 0..grid.values.len() {
        if at.is_multiple_of(SLAB) {
            work.goes_on()?;
        }
        let point = grid.position(at);
        let is_inside = || all.iter().all(|view| view.outline_distance(point).is_none_or(|d| d > -grid.step));
        for (k, spots) in spots.iter().enumerate() {
            let one = |view: usize| Some((view, spots[view].near(all[view].pixel(point)?, size)?));
            let shown: Vec<(usize, usize)> = (0..all.len()).filter_map(one).collect();
            if !shown.is_empty() && (k == 0 || is_inside()) {
                let most = |(view, spot): &(usize, usize)| met[k][*view][*spot] = shown.len().max(met[k][*view][*spot]);
                shown.iter().for_each(most);
            }
        }
    }
    Ok(met)
}

/// The number of other views that must look through a small hole for it to be believed. Fewer than [`BY_CHANCE`] holes are expected
/// to have that many by chance, given how much of the masks' areas is in small holes.
fn needed(holes: &[Spots], areas: &[f64]) -> usize {
    let shares: Vec<f64> = holes.iter().zip(areas).map(|(spots, area)| spots.small() / area.max(1.0)).collect();
    let counts: Vec<f64> =
        holes.iter().map(|spots| spots.pixels.iter().filter(|spot| spot.len() <= SMALL).count() as f64).collect();
    let (all, sum) = (counts.iter().sum::<f64>().max(1.0), shares.iter().sum::<f64>());
    // The other views that look through their small holes at a point of the object, in the mean.
    let mean = counts.iter().zip(&shares).map(|(count, own)| count * (sum - own)).sum::<f64>() / all;
    // Two holes that meet are believed. The terms and the tail of Poisson's distribution.
    let (mut share, mut tail, mut views) = ((-mean).exp(), 1.0, 0);
    while views == 0 || all > 2.0 && views < holes.len() && PLACES * all * tail > BY_CHANCE {
        views += 1;
        tail -= share;
        share *= mean / views as f64;
    }
    views
}

/// Gives the pixels of some spots of a mask a value, and those beside them that are neither inside nor outside. Returns the
/// pixels, and how many of them are of the spots.
fn paint(
    mask: &mut [f32],
    spots: &Spots,
    is_some: impl Fn(&usize) -> bool,
    value: f32,
    size: (usize, usize),
) -> (Vec<usize>, usize) {
    let mut painted: Vec<usize> =
        (0..spots.pixels.len()).filter(is_some).flat_map(|spot| spots.pixels[spot].iter().copied()).collect();
    let count = painted.len();
    painted.iter().for_each(|pixel| mask[*pixel] = value);
    for beside in painted.clone().into_iter().flat_map(|pixel| pixels_around(pixel, size, true)) {
        if (mask[beside] > 0.5) == (value > 0.5) && spots.of_pixel[beside] == 0 && mask[beside] != value {
            mask[beside] = value;
            painted.push(beside);
        }
    }
    (painted, count)
}

/// Holes or specks of a mask.
struct Spots {
    pixels: Vec<Vec<usize>>,
    /// One more than the number of each pixel's spot, or 0.
    of_pixel: Vec<usize>,
}

impl Spots {
    fn of(pixels: Vec<Vec<usize>>, count: usize) -> Self {
        let mut of_pixel = vec![0; count];
        for (at, spot) in pixels.iter().enumerate() {
            spot.iter().for_each(|&pixel| of_pixel[pixel] = at + 1);
        }
        Self { pixels, of_pixel }
    }

    /// A spot in or beside a pixel.
    fn near(&self, (column, row): (usize, usize), size: (usize, usize)) -> Option<usize> {
        pixels_around(row * size.1 + column, size, true).find_map(|pixel| self.of_pixel[pixel].checked_sub(1))
    }

    /// An estimate of the pixels in and beside small spots: each spot counts as a square that is one pixel wider on every side.
    fn small(&self) -> f64 {
        let wide = |spot: &Vec<usize>| ((spot.len() as f64).sqrt() + 2.0).powi(2);
        self.pixels.iter().filter(|spot| spot.len() <= SMALL).map(wide).sum()
    }
}
