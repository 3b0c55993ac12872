//! Textures that are made when a file is read: of vertex colours, and for edges that the renderer does not know.

use crate::{notes::Notes, texture::Decoded};
use softras::scene::{Appearance, Texture, Wrap};

/// The way in which an image goes on beyond its edges along one axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Edge {
    Repeat,
    Clamp,
    Mirror,
}

/// The most tiles of an image along a clamped side, and texels that a small image may have besides.
const MOST_TILES: i64 = 16;
const LEAST_CANVAS: i64 = 1 << 12;

/// Where UVs of an image lie in the texture that is made of it: scale and offset along u and v.
#[derive(Clone, Copy, Debug)]
pub struct Canvas([[f32; 2]; 2]);

impl Canvas {
    pub fn place(self, uv: [f32; 2]) -> [f32; 2] {
        [0, 1].map(|k| uv[k] * self.0[k][0] + self.0[k][1])
    }
}

/// The texture of an image with its edges. Mirrored sides are doubled. If the image is clamped along one axis and repeats along the
/// other, the clamped side is made longer by repeating its edge, as far as UVs of this range, [low, high], reach; if that takes
/// too many texels, the image repeats along both, with a note.
///
/// # Errors
/// A text that tells what is wrong with the image.
pub fn on_canvas(
    image: Decoded,
    edges: [Edge; 2],
    range: [[f32; 2]; 2],
    notes: &mut Notes,
) -> Result<(Texture, Canvas), String> {
    let wrong = |error: softras::Error| error.to_string();
    let plain = Canvas([[1.0, 0.0]; 2]);
    if edges == [Edge::Repeat; 2] || edges == [Edge::Clamp; 2] {
        let wrap = if edges[0] == Edge::Clamp { Wrap::Clamp } else { Wrap::Repeat };
        return Ok((image.texture(wrap).map_err(wrong)?, plain));
    }
    let sides = [image.width, image.height].map(i64::from);
    // For each side the first texel, and the number of texels.
    let mut spans = [(0, 0); 2];
    for (k, span) in spans.iter_mut().enumerate() {
        let [low, high] = [range[0][k], range[1][k]].map(f64::from);
        *span = match edges[k] {
            Edge::Repeat => (0, sides[k]),
            Edge::Mirror => (0, 2 * sides[k]),
            Edge::Clamp => {
                // v runs up, rows run down.
                let (low, high) = if k == 0 { (low, high) } else { (1.0 - high, 1.0 - low) };
                let first = (low.min(0.0) * sides[k] as f64).floor() as i64 - 1;
                let end = (high.max(1.0) * sides[k] as f64).ceil() as i64 + 1;
                if (end - first) * sides[1 - k] > MOST_TILES * sides[0] * sides[1] + LEAST_CANVAS {
                    notes.count(None, "textures clamped along one side whose UVs lie far outside repeat instead");
                    return Ok((image.texture(Wrap::Repeat).map_err(wrong)?, plain));
                }
                (first, end - first)
            }
        };
    }
    let from = |k: usize, i: i64| {
        let i = i + spans[k].0;
        (if i >= sides[k] && edges[k] == Edge::Mirror { 2 * sides[k] - 1 - i } else { i.clamp(0, sides[k] - 1) })
            as usize
    };
    let all = (0..spans[1].1).flat_map(|row| (0..spans[0].1).map(move |column| (row, column)));
    let at: Vec<usize> = all.map(|(row, column)| from(1, row) * sides[0] as usize + from(0, column)).collect();
    let alpha = image.alpha.as_ref().map(|alpha| at.iter().map(|&i| alpha[i]).collect());
    let texels = at.iter().map(|&i| image.texels[i]).collect();
    let made = Decoded { width: spans[0].1 as u32, height: spans[1].1 as u32, texels, alpha };
    let [u, v] = [0, 1].map(|k| {
        let scale = sides[k] as f64 / spans[k].1 as f64;
        (scale, -(spans[k].0 as f64) / spans[k].1 as f64)
    });
    // With v upwards: 1 - v' = (1 - v) scale + offset.
    let canvas = [[u.0, u.1], [v.0, 1.0 - v.0 - v.1]].map(|side| side.map(|x| x as f32));
    Ok((made.texture(Wrap::Repeat).map_err(wrong)?, Canvas(canvas)))
}

/// A triangle that is painted by the colours of its corners, times an image at its UVs if it has one.
pub struct Patch<'a> {
    pub colors: [[f32; 3]; 3],
    pub image: Option<(&'a Texture, Corners)>,
}

/// A mesh's textures, and where its triangles lie in them.
pub struct Sheet {
    pub uvs: Vec<[f32; 2]>,
    pub uv_triangles: Vec<[u32; 3]>,
    pub textures: Vec<Texture>,
    pub texture_of_triangle: Vec<u32>,
}

impl Sheet {
    /// Adds the texture of the [`patches`] of some triangles.
    pub fn add(&mut self, triangles: Vec<usize>, (texture, corners): (Texture, Vec<Corners>)) {
        self.textures.push(texture);
        for (t, corners) in triangles.into_iter().zip(corners) {
            self.texture_of_triangle[t] = self.textures.len() as u32 - 1;
            self.uv_triangles[t] = [0, 1, 2].map(|k| self.uvs.len() as u32 + k);
            self.uvs.extend(corners);
        }
    }

    pub fn appearance(self) -> Appearance {
        let Self { uvs, uv_triangles, textures, mut texture_of_triangle } = self;
        if textures.len() == 1 {
            texture_of_triangle = Vec::new();
        }
        Appearance::Textured { uvs, uv_triangles, textures, texture_of_triangle }
    }
}

/// The UVs of a triangle's corners.
pub type Corners = [[f32; 2]; 3];

/// The most steps along a side of a patch, and the least width of a texture of many.
const MOST_CELLS: usize = 255;
const LEAST_WIDTH: usize = 512;

impl Patch<'_> {
    /// Steps along each side, as many as the image has texels there.
    fn steps(&self, most: usize) -> usize {
        let Some((texture, [a, b, c])) = self.image else { return 1 };
        let size = [texture.width(), texture.height()].map(|side| side as f32);
        let length = |p: [f32; 2], q: [f32; 2]| ((p[0] - q[0]) * size[0]).hypot((p[1] - q[1]) * size[1]);
        let longest = length(a, b).max(length(b, c)).max(length(c, a));
        // A texture of one texel has the same colour everywhere.
        if texture.texels().len() == 1 { 1 } else { (longest.ceil() as usize).clamp(1, most) }
    }

    /// The colour and alpha at a step along the first and the second side.
    fn at(&self, b: f32, c: f32) -> ([f32; 3], f32) {
        let mixed = |x: f32, y: f32, z: f32| x + b * (y - x) + c * (z - x);
        let [p, q, r] = self.colors;
        let color = [0, 1, 2].map(|k| mixed(p[k], q[k], r[k]));
        let Some((texture, [p, q, r])) = self.image else { return (color, 1.0) };
        let (texel, alpha) = sample(texture, [0, 1].map(|k| mixed(p[k], q[k], r[k])));
        ([0, 1, 2].map(|k| color[k] * texel[k]), alpha)
    }
}

/// One texture of all patches, each a square whose first row, first column and diagonal are the sides of its triangle, and the UVs
/// of their corners. Between texels the renderer interpolates as it does between corners, so that colours alone are exact. The
/// squares have at most `most` texels together, but never fewer than 2 by 2 each.
pub fn patches(patches: &[Patch], most: u64) -> Result<(Texture, Vec<Corners>), String> {
    let mut limit = MOST_CELLS;
    let cells = loop {
        let cells: Vec<usize> = patches.iter().map(|patch| patch.steps(limit) + 1).collect();
        if limit == 1 || cells.iter().map(|&side| (side * side) as u64).sum::<u64>() <= most {
            break cells;
        }
        limit /= 2;
    };
    let area: usize = cells.iter().map(|side| side * side).sum();
    let width = ((area as f64).sqrt().ceil() as usize).max(LEAST_WIDTH.min(cells.iter().sum()));
    // Largest first, in rows.
    let mut order: Vec<usize> = (0..cells.len()).collect();
    order.sort_by_key(|&i| std::cmp::Reverse(cells[i]));
    let (mut places, mut column, mut row, mut tall) = (vec![[0usize; 2]; cells.len()], 0, 0, 0);
    for i in order {
        if column + cells[i] > width {
            (column, row, tall) = (0, row + tall, 0);
        }
        places[i] = [column, row];
        column += cells[i];
        tall = tall.max(cells[i]);
    }
    let height = row + tall;
    let mut texels = vec![[0.0; 3]; width * height];
    let mut alpha = vec![1.0; texels.len()];
    for ((patch, side), [left, top]) in patches.iter().zip(&cells).zip(&places) {
        let steps = (side - 1) as f32;
        for (y, x) in (0..*side).flat_map(|y| (0..*side).map(move |x| (y, x))) {
            let at = (top + y) * width + left + x;
            (texels[at], alpha[at]) = patch.at(x as f32 / steps, y as f32 / steps);
        }
    }
    let uv = |x: usize, y: usize| {
        [(x as f64 + 0.5) / width as f64, 1.0 - (y as f64 + 0.5) / height as f64].map(|x| x as f32)
    };
    let corners = cells.iter().zip(&places);
    let corners = corners.map(|(side, [x, y])| [uv(*x, *y), uv(x + side - 1, *y), uv(*x, y + side - 1)]).collect();
    let texture = Texture::new(width as u32, height as u32, texels, Wrap::Clamp).map_err(|error| error.to_string())?;
    Ok((texture.with_alpha(alpha).map_err(|error| error.to_string())?, corners))
}

/// The colour and alpha of a texture at UVs, between its four nearest texels.
fn sample(texture: &Texture, [u, v]: [f32; 2]) -> ([f32; 3], f32) {
    let (width, height) = (texture.width() as i64, texture.height() as i64);
    let (x, y) = (u * width as f32 - 0.5, (1.0 - v) * height as f32 - 0.5);
    let whole = |i: i64, side: i64| match texture.wrap() {
        Wrap::Clamp => i.clamp(0, side - 1),
        Wrap::Repeat => i.rem_euclid(side),
    };
    let (left, top) = (x.floor() as i64, y.floor() as i64);
    let (mut color, mut alpha) = ([0.0; 3], 0.0);
    for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        let share = |at: f32, low: i64, d: i64| if d == 1 { at - low as f32 } else { 1.0 - (at - low as f32) };
        let weight = share(x, left, dx) * share(y, top, dy);
        let at = (whole(top + dy, height) * width + whole(left + dx, width)) as usize;
        (0..3).for_each(|k| color[k] += weight * texture.texels()[at][k]);
        alpha += weight * texture.alpha().map_or(1.0, |alpha| alpha[at]);
    }
    (color, f32::clamp(alpha, 0.0, 1.0))
}
