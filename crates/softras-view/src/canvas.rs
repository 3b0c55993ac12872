//! Draws anti-aliased lines, discs and arrows on a picture.

use glam::DVec2;
use softras_io::Picture;

/// Column and row in pixels; (0, 0) is the upper left corner of the picture, (0.5, 0.5) the centre of its first pixel.
pub type Point = [f64; 2];

/// The distance from a point to a segment.
fn distance(p: DVec2, a: DVec2, b: DVec2) -> f64 {
    let (edge, to) = (b - a, p - a);
    let t = (to.dot(edge) / edge.length_squared().max(1e-12)).clamp(0.0, 1.0);
    (to - t * edge).length()
}

/// An arrow.
#[derive(Clone, Copy, Debug)]
pub struct Arrow {
    /// The start.
    pub from: Point,
    /// The tip.
    pub to: Point,
    /// Width of the line.
    pub width: f64,
    /// Its colour.
    pub color: [u8; 3],
}

/// Mixes `color` into the pixels around the points by `coverage(pixel centre)`, from 0 to 1.
fn paint(picture: &mut Picture, points: &[DVec2], reach: f64, color: [u8; 3], coverage: impl Fn(DVec2) -> f64) {
    let range = |axis: usize, side: usize| {
        let low = points.iter().map(|p| p[axis]).fold(f64::INFINITY, f64::min) - reach;
        let high = points.iter().map(|p| p[axis]).fold(f64::NEG_INFINITY, f64::max) + reach;
        let pixel = |x: f64| x.clamp(0.0, side as f64) as usize;
        pixel(low.floor())..pixel(high.ceil())
    };
    for row in range(1, picture.height) {
        for column in range(0, picture.width) {
            let share = coverage(DVec2::new(column as f64 + 0.5, row as f64 + 0.5)).clamp(0.0, 1.0);
            let pixel = &mut picture.pixels[row * picture.width + column];
            for (value, ink) in pixel.iter_mut().zip(color) {
                *value = (f64::from(*value) + share * (f64::from(ink) - f64::from(*value))).round() as u8;
            }
        }
    }
}

/// A line with round ends.
pub fn line(picture: &mut Picture, from: Point, to: Point, width: f64, color: [u8; 3]) {
    let (from, to) = (DVec2::from(from), DVec2::from(to));
    paint(picture, &[from, to], width / 2.0 + 1.0, color, |p| width / 2.0 + 0.5 - distance(p, from, to));
}

/// A disc.
pub fn disc(picture: &mut Picture, centre: Point, radius: f64, color: [u8; 3]) {
    line(picture, centre, centre, 2.0 * radius, color);
}

/// The corners of an arrow's head and the end of its shaft; `None` for an arrow too short to have a direction.
fn head(arrow: &Arrow) -> Option<([DVec2; 3], Point)> {
    let to = DVec2::from(arrow.to);
    let way = to - DVec2::from(arrow.from);
    let length = way.length();
    if length < 1.0 {
        return None;
    }
    let direction = DVec2::new(way.x / length, way.y / length);
    let size = (4.0 * arrow.width).min(0.6 * length);
    let base = to + -size * direction;
    let side = 0.5 * size * direction.perp();
    Some(([to, base + side, base - side], base.into()))
}

/// A filled triangle, enlarged by `grow` pixels.
fn triangle(picture: &mut Picture, [a, b, c]: [DVec2; 3], grow: f64, color: [u8; 3]) {
    let beside = |p: DVec2, a: DVec2, b: DVec2| (b - a).perp_dot(p - a) / (b - a).length().max(1e-9);
    let turn = beside(c, a, b).signum();
    let depth =
        |p: DVec2| [(a, b), (b, c), (c, a)].map(|(a, b)| turn * beside(p, a, b)).into_iter().fold(9.0, f64::min);
    paint(picture, &[a, b, c], 4.0 * grow + 1.0, color, |p| depth(p) + 0.5 + grow);
}

/// Draws an arrow with a dark rim, so that it is visible on any background.
pub fn arrow(picture: &mut Picture, arrow: &Arrow) {
    const RIM: [u8; 3] = [8, 9, 12];
    let Some((corners, base)) = head(arrow) else { return };
    line(picture, arrow.from, base, arrow.width + 1.6, RIM);
    triangle(picture, corners, 0.8, RIM);
    line(picture, arrow.from, base, arrow.width, arrow.color);
    triangle(picture, corners, 0.0, arrow.color);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn red(picture: &Picture, column: usize, row: usize) -> u8 {
        picture.pixels[row * picture.width + column][0]
    }

    #[test]
    fn an_arrow_is_where_it_should_be() {
        for (from, to) in [([4.5, 10.5], [24.5, 10.5]), ([24.5, 10.5], [4.5, 10.5])] {
            let mut picture = Picture::filled(30, 20, [0, 0, 0, 255]);
            arrow(&mut picture, &Arrow { from, to, width: 2.0, color: [255, 0, 0] });
            assert_eq!(red(&picture, 14, 10), 255, "the shaft");
            let near_tip = if to[0] > from[0] { 20 } else { 8 };
            assert_eq!(red(&picture, near_tip, 11), 255, "the head is wider than the shaft");
            assert_eq!(red(&picture, 28 - near_tip, 13), 0, "the tail is not");
            assert!(red(&picture, 14, 16) == 0 && red(&picture, 28, 10) == 0 && red(&picture, 1, 10) == 0);
        }
    }

    #[test]
    fn what_sticks_out_is_cut() {
        let mut picture = Picture::filled(4, 4, [0, 0, 0, 255]);
        arrow(&mut picture, &Arrow { from: [-50.0, 2.0], to: [90.0, -3.0], width: 3.0, color: [9; 3] });
        disc(&mut picture, [2.0, 2.0], 1.0, [255; 3]);
        assert!(red(&picture, 1, 1) > 128);
    }
}
