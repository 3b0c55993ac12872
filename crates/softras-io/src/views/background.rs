//! The object before a plain background, whose colour and noise the border of an opaque picture shows.

use super::{
    parts::{Part, parts},
    shadow::Shade,
    surface,
};
use image::{Rgba, RgbaImage};

/// The width of the border that is looked at, as a share of the shorter side.
const BORDER: f64 = 1.0 / 64.0;
/// Pixels of the border, and of the picture, that are looked at, at most, about.
const SAMPLES: usize = 4096;
/// The least share of the border that a plain background has.
const LEAST_SHARE: f64 = 0.6;
/// The most that half of a plain background differs from its model, of 255.
const ROUGHEST: f64 = 9.0;
/// How far the background reaches from its model, in medians of the differences, and beside edges of a format that changes pixels.
const REACH: f64 = 4.0;
const LOSSY: f64 = 32.0;
/// The height of the waves around black that such a format leaves beside edges. A dark surface differs: all pixels of a square exceed
/// that, and most of them are dark, as they are not at the blurred edge of a bright one.
const WAVES: u8 = 6;
const SQUARE: usize = 5;
const LEAST_DARK: usize = 18;
/// Pixels of the picture that tell a second surface from the object, about.
const SURFACE_SAMPLES: usize = 1 << 16;
/// The least channel of a background on which shadows are looked for.
const BRIGHT: f64 = 64.0;
/// Backgrounds of one set that differ by more are not the same.
const ALIKE: f64 = 48.0;
/// Smaller parts and holes of a noisy picture's object, as shares of its area, are noise.
const SPECK: f64 = 2e-3;

/// A plain background.
#[derive(Clone, Debug)]
pub struct Plain {
    /// One polynomial for each channel, by the place, which goes from -1 to 1 along both sides: 1, x, y, x², xy, y².
    colors: [[f64; 6]; 3],
    /// The most that a channel of it differs from that.
    tolerance: f64,
    /// How far a second surface differs that the border shows, such as a cloth.
    surface: Option<u8>,
}

/// A place and the colour there.
type Sample = ([f64; 2], [f64; 3]);

impl Plain {
    /// The background of a picture; `None` where its border is not plain.
    pub fn of(picture: &RgbaImage, is_lossy: bool) -> Option<Self> {
        let border = border(picture);
        let median = [0, 1, 2].map(|k| quantile(border.iter().map(|(_, color)| color[k]), 0.5));
        let mut plain = Self { colors: median.map(|x| [x, 0.0, 0.0, 0.0, 0.0, 0.0]), tolerance: 0.0, surface: None };
        if plain.differs(&border, 0.5) > 0.0 {
            for _ in 0..8 {
                let near = 1.0 + REACH * plain.differs(&border, 0.5);
                plain.fit(&border, near)?;
            }
        }
        let middle = plain.differs(&border, 0.5);
        // The background's own pixels, without what of the object the border shows.
        let own: Vec<Sample> =
            border.iter().filter(|sample| plain.distance(sample) <= 4.0 + 2.0 * REACH * middle).copied().collect();
        if middle > ROUGHEST {
            return None;
        }
        plain.tolerance = match plain.differs(&own, 0.98) {
            0.0 => 0.0,
            _ => f64::max(3.0 + REACH * middle, 1.5 * plain.differs(&own, 0.95)),
        };
        if is_lossy {
            plain.tolerance = if middle < 1.0 { LOSSY } else { plain.tolerance.max(LOSSY / 2.0) };
        }
        let distances: Vec<f64> = border.iter().map(|sample| plain.distance(sample)).collect();
        let all = inner(picture, SURFACE_SAMPLES).map(|sample| plain.distance(&sample));
        plain.surface = if plain.tolerance > 0.0 { surface::reach(&distances, all, plain.ground()) } else { None };
        let reach = plain.surface.map_or(4.0 + 2.0 * REACH * middle, f64::from);
        if (distances.iter().filter(|x| **x <= reach).count() as f64) < LEAST_SHARE * border.len() as f64 {
            return None;
        }
        // The pixels inside the border show how the background goes on there.
        if plain.tolerance > 0.0 && middle > 0.0 {
            plain.fit(&inner(picture, SAMPLES).collect::<Vec<_>>(), plain.tolerance)?;
        }
        Some(plain)
    }

    /// The background of a picture: its own, or, where that is not plain or unlike that of most others, what they share. A border of
    /// another colour is one that the object fills.
    pub fn like(picture: &RgbaImage, is_lossy: bool, shared: Option<&Self>) -> Option<Self> {
        let own = Self::of(picture, is_lossy).filter(|own| shared.is_none_or(|shared| own.is_like(shared)));
        own.or_else(|| shared.cloned())
    }

    /// The background that three of four backgrounds are like; `None` where they are of several colours.
    pub fn shared(all: &[Self]) -> Option<&Self> {
        let alike = |one: &&Self| 4 * all.iter().filter(|other| one.is_like(other)).count() >= 3 * all.len();
        all.iter().find(alike)
    }

    /// Whether two have about one colour.
    pub fn is_like(&self, other: &Self) -> bool {
        (0..3).all(|k| (self.colors[k][0] - other.colors[k][0]).abs() <= ALIKE)
    }

    /// A note on it; `None` where it is wholly black, and there is no doubt.
    pub fn told(&self) -> Option<String> {
        let is_exact = self.tolerance == 0.0 && self.colors.iter().all(|channel| channel[0] == 0.0);
        let what = if self.surface.is_some() {
            "plain background, and another surface at the border,"
        } else {
            "plain background"
        };
        (!is_exact).then(|| format!("the {what} is cut away (alpha or a mask says it exactly)"))
    }

    /// Makes the background of an opaque picture transparent. A pixel of the outline is a mixture: its alpha is its distance from the
    /// background divided by that of the farthest pixel around, and its colour is what remains without the background.
    pub fn remove(&self, picture: &mut RgbaImage) {
        let size = [picture.width() as usize, picture.height() as usize];
        let [width, height] = size;
        let mut distances = Vec::with_capacity(width * height);
        let object = self.tolerance.min(253.0) as u8 + 1;
        let shade = self.has_shadows().then(|| Shade::new(picture, |row| self.along(row, size)));
        let light = |column: usize, row: usize| shade.as_ref().map_or(Some(1.0), |shade| shade.light(column, row));
        for (row, pixels) in picture.rows().enumerate() {
            let along = self.along(row, size);
            distances.extend(pixels.enumerate().map(|(column, pixel)| match light(column, row) {
                Some(light) => away(pixel, &along(column).map(|x| light * x)).round() as u8,
                None => (away(pixel, &along(column)).round() as u8).max(object),
            }));
        }
        let black = self.tolerance.min(254.0) as u8;
        let dark =
            if self.surface.is_none() && self.is_black() { dark_surfaces(&distances, size, black) } else { Vec::new() };
        // From here on all of the background is 0.
        match self.surface {
            Some(reach) => surface::cut(&mut distances, size, self.ground().min(254.0) as u8, reach),
            None => distances.iter_mut().filter(|distance| **distance <= black).for_each(|distance| *distance = 0),
        }
        dark.into_iter().for_each(|(at, distance)| distances[at] = distance);
        // An edge before a real background is blurred, and one that was painted is not.
        let reach = if self.tolerance > 0.0 { 2 } else { 1 };
        let around = |column: usize, row: usize, reach: usize| {
            let rows = row.saturating_sub(reach)..(row + reach + 1).min(height);
            let columns = column.saturating_sub(reach)..(column + reach + 1).min(width);
            let near = rows.flat_map(|r| distances[r * width..][columns.clone()].iter().copied());
            near.fold((u8::MAX, 0), |(least, most), x| (x.min(least), x.max(most)))
        };
        let alpha = |column: usize, row: usize| {
            let own = distances[row * width + column];
            if own == 0 {
                return 0;
            }
            let (least, most) = around(column, row, reach);
            let is_second = || around(column, row, 1).0 > 0;
            if least > 0 || 2 * u16::from(own) >= u16::from(most) && is_second() {
                return 255;
            }
            (255.0 * f64::from(own) / f64::from(most)).round() as u8
        };
        for row in 0..height {
            let along = self.along(row, size);
            for column in 0..width {
                let pixel = &mut picture[(column as u32, row as u32)].0;
                pixel[3] = alpha(column, row);
                if (1..255).contains(&pixel[3]) {
                    let (ground, times) = (along(column), 255.0 / f64::from(pixel[3]));
                    for (value, ground) in pixel.iter_mut().zip(ground) {
                        *value = (ground + (f64::from(*value) - ground) * times).round().clamp(0.0, 255.0) as u8;
                    }
                }
            }
        }
        if self.tolerance > 0.0 {
            mend(picture, size);
        }
    }

    /// Whether soft shadows show on it: it is bright and a camera's, and has no second surface.
    fn has_shadows(&self) -> bool {
        self.tolerance > 0.0 && self.surface.is_none() && self.colors.iter().any(|channel| channel[0] >= BRIGHT)
    }

    /// Whether it is black in a format that changes pixels.
    fn is_black(&self) -> bool {
        self.tolerance == LOSSY && self.colors.iter().all(|channel| channel[0] < f64::from(WAVES))
    }

    /// How far its own pixels differ from it, beyond which a second surface or a shadow may lie.
    fn ground(&self) -> f64 {
        if self.is_black() { WAVES.into() } else { self.tolerance }
    }

    /// The colours along a row of a picture.
    fn along(&self, row: usize, size: [usize; 2]) -> impl Fn(usize) -> [f64; 3] {
        let y = across(row, size[1]);
        let row = self.colors.map(|[a, b, c, d, e, f]| [a + c * y + f * y * y, b + e * y, d]);
        move |column| {
            let x = across(column, size[0]);
            row.map(|[a, b, c]| a + x * (b + x * c))
        }
    }

    fn at(&self, [x, y]: [f64; 2]) -> [f64; 3] {
        self.colors.map(|channel| channel.iter().zip(terms([x, y])).map(|(c, term)| c * term).sum())
    }

    fn distance(&self, (place, color): &Sample) -> f64 {
        self.at(*place).iter().zip(color).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    /// How far a share of some samples is at most.
    fn differs(&self, samples: &[Sample], share: f64) -> f64 {
        quantile(samples.iter().map(|sample| self.distance(sample)), share)
    }

    /// Fits the polynomials by least squares to the samples that are no farther than `near`; `None` where there are too few.
    fn fit(&mut self, samples: &[Sample], near: f64) -> Option<()> {
        let (mut matrix, mut count) = ([[0.0; 9]; 6], 0.0);
        for (place, color) in samples.iter().filter(|sample| self.distance(sample) <= near) {
            let terms = terms(*place);
            for (row, term) in matrix.iter_mut().zip(terms) {
                row.iter_mut().zip(terms.iter().chain(color)).for_each(|(sum, x)| *sum += term * x);
            }
            count += 1.0;
        }
        // A little of the diagonal more, so that what no sample tells is 0.
        (1..6).for_each(|i| matrix[i][i] += 1e-6 * count);
        for pivot in 0..6 {
            let row = matrix[pivot];
            for other in (0..6).filter(|other| *other != pivot) {
                let times = matrix[other][pivot] / row[pivot];
                matrix[other].iter_mut().zip(row).for_each(|(x, y)| *x -= times * y);
            }
        }
        let colors = [0, 1, 2].map(|k| [0, 1, 2, 3, 4, 5].map(|i| matrix[i][6 + k] / matrix[i][i]));
        colors.iter().flatten().all(|x| x.is_finite()).then(|| self.colors = colors)
    }
}

/// The pixels of dark surfaces, with their distances from black, among those that are `black` at most: they lie in a square of such
/// pixels.
fn dark_surfaces(distances: &[u8], [width, height]: [usize; 2], black: u8) -> Vec<(usize, u8)> {
    let around = |at: usize, from: usize, size: usize| at.saturating_sub(from)..(at + SQUARE - from).min(size);
    let is_filled = |column: usize, row: usize| {
        let columns = around(column, 0, width);
        let own = || around(row, 0, height).flat_map(|row| &distances[row * width..][columns.clone()]);
        own().all(|distance| *distance > WAVES) && own().filter(|distance| **distance <= black).count() >= LEAST_DARK
    };
    let is_surface = |at: &usize| {
        let (columns, mut rows) = (around(at % width, SQUARE - 1, width), around(at / width, SQUARE - 1, height));
        let first = |at: usize, size: usize| at.min(size.saturating_sub(SQUARE));
        rows.any(|row| columns.clone().any(|column| is_filled(first(column, width), first(row, height))))
    };
    let dim = (0..distances.len()).filter(|at| (WAVES + 1..=black).contains(&distances[*at]));
    dim.filter(is_surface).map(|at| (at, distances[at])).collect()
}

fn terms([x, y]: [f64; 2]) -> [f64; 6] {
    [1.0, x, y, x * x, x * y, y * y]
}

/// From -1 to 1 along a side.
fn across(at: usize, size: usize) -> f64 {
    (2.0 * at as f64 + 1.0) / size as f64 - 1.0
}

fn away(pixel: &Rgba<u8>, ground: &[f64; 3]) -> f64 {
    pixel.0.iter().zip(ground).map(|(a, b)| (f64::from(*a) - b).abs()).fold(0.0, f64::max)
}

fn sample(picture: &RgbaImage, column: usize, row: usize) -> Sample {
    let [r, g, b, _] = picture[(column as u32, row as u32)].0;
    let size = [picture.width() as usize, picture.height() as usize];
    ([across(column, size[0]), across(row, size[1])], [r, g, b].map(f64::from))
}

/// Samples of the border.
fn border(picture: &RgbaImage) -> Vec<Sample> {
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let wide = ((BORDER * width.min(height) as f64) as usize).max(1);
    let rim = |side: usize| (0..wide).chain(side.saturating_sub(wide).max(wide)..side);
    let along = rim(height).flat_map(|row| (0..width).map(move |column| (column, row)));
    let down = rim(width).flat_map(|column| (wide..height.saturating_sub(wide)).map(move |row| (column, row)));
    // An odd step is that of no pattern of even length.
    let step = (2 * wide * (width + height) / SAMPLES).max(1) | 1;
    along.chain(down).step_by(step).map(|(column, row)| sample(picture, column, row)).collect()
}

/// Samples of all of a picture, about so many.
fn inner(picture: &RgbaImage, count: usize) -> impl Iterator<Item = Sample> {
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let step = (width * height / count).isqrt().max(1);
    let rows = (step / 2..height).step_by(step);
    rows.flat_map(move |row| (step / 2..width).step_by(step).map(move |column| sample(picture, column, row)))
}

/// The value that a share of some values is at most.
fn quantile(values: impl Iterator<Item = f64>, share: f64) -> f64 {
    let mut values: Vec<f64> = values.collect();
    let at = (share * values.len().saturating_sub(1) as f64) as usize;
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(at, f64::total_cmp).1 }
}

/// Takes away specks of noise beside the object, and fills those within it.
fn mend(picture: &mut RgbaImage, size: [usize; 2]) {
    for (is_object, value) in [(true, 0), (false, 255)] {
        let (runs, all) =
            parts(size, is_object, |column, row| (picture[(column as u32, row as u32)].0[3] > 127) == is_object);
        let area = if is_object { all.iter().map(|part| part.area).max() } else { None };
        let object = area.unwrap_or_else(|| size[0] * size[1] - all.iter().map(|part| part.area).sum::<usize>());
        let is_speck = |part: &Part| (part.area as f64) < SPECK * object as f64 && (is_object || !part.is_cut(size));
        for run in runs.iter().filter(|run| is_speck(&all[run.part])) {
            run.columns.clone().for_each(|column| picture[(column as u32, run.row as u32)].0[3] = value);
        }
    }
}
