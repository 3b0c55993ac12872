//! The picture of `softras grad`: four panels side by side.

use super::arrows::{self, HIDDEN, Pull, SEEN};
use super::target::{Loss, Target};
use image::{
    Rgba, RgbaImage,
    imageops::{self, FilterType},
};
use softras_io::Curve;
use softras_io::Picture;
use softras_view as sheet;
use softras_view::canvas;

const GROUND: [u8; 3] = [17, 19, 24];
const INK: [u8; 3] = [222, 224, 228];
/// Small images are enlarged up to this many pixels a side.
const SIDE: usize = 600;
/// The brightness of the image behind the arrows.
const DIMMED: f64 = 0.5;
/// The colours of losses from zero to the largest: black, violet, red, orange, pale yellow.
const HEAT: [[u8; 3]; 7] =
    [[0, 0, 4], [40, 11, 84], [101, 21, 110], [159, 42, 99], [212, 72, 66], [245, 125, 21], [252, 255, 164]];

/// The content of the picture.
pub struct Sheet<'a> {
    /// `[H, W, 3]` as rendered.
    pub color: &'a [f64],
    /// The target.
    pub target: &'a Target,
    /// The loss.
    pub loss: &'a Loss,
    /// The displacements of the vertices.
    pub pulls: &'a [Pull],
    /// The curve by which numbers are encoded as bytes.
    pub curve: Curve,
}

impl Sheet<'_> {
    /// The picture, and the number of arrows on it.
    pub fn draw(&self) -> (Picture, usize) {
        let larger = (SIDE / self.target.width.max(self.target.height)).clamp(1, 8);
        let render = enlarged(&self.colors(self.color), larger);
        let target = enlarged(&self.colors(&self.target.color), larger);
        let heat = enlarged(&self.heat(), larger);
        let (downhill, arrows) = self.downhill(&render, larger);
        let loss = format!("loss={:.2e}", self.loss.total());
        let panels =
            [(render, "render".into()), (target, "target".into()), (heat, loss), (downhill, "-gradient".into())];
        (side_by_side(&panels), arrows)
    }

    fn picture(&self, pixels: Vec<[u8; 4]>) -> Picture {
        Picture { width: self.target.width, height: self.target.height, pixels }
    }

    fn colors(&self, values: &[f64]) -> Picture {
        let byte = |x: f64| (self.curve.encode(x) * 255.0).round() as u8;
        self.picture(values.chunks_exact(3).map(|c| [byte(c[0]), byte(c[1]), byte(c[2]), 255]).collect())
    }

    /// The loss of every pixel, by its square root so that small losses are visible.
    fn heat(&self) -> Picture {
        let most = self.loss.pixels.iter().copied().fold(1e-12, f64::max);
        self.picture(self.loss.pixels.iter().map(|loss| heat((loss / most).sqrt())).collect())
    }

    /// Arrows over the dimmed image and the target's outline.
    fn downhill(&self, render: &Picture, larger: usize) -> (Picture, usize) {
        let mut panel = render.clone();
        for pixel in &mut panel.pixels {
            let grey = (u32::from(pixel[0]) * 3 + u32::from(pixel[1]) * 6 + u32::from(pixel[2])) / 10;
            for value in &mut pixel[..3] {
                let faded = 0.5 * f64::from(*value) + 0.5 * f64::from(grey);
                *value = (DIMMED * faded).round() as u8;
            }
        }
        for [from, to] in outline(self.target) {
            let scale = larger as f64;
            let ink = [150, 154, 162];
            canvas::line(&mut panel, from.map(|x| x * scale), to.map(|x| x * scale), 1.2, ink);
        }
        let arrows = arrows::draw(&mut panel, self.pulls, larger as f64);
        (panel, arrows)
    }
}

fn heat(part: f64) -> [u8; 4] {
    let at = part.clamp(0.0, 1.0) * (HEAT.len() - 1) as f64;
    let low = (at as usize).min(HEAT.len() - 2);
    let mix = |k: usize| {
        let (a, b) = (f64::from(HEAT[low][k]), f64::from(HEAT[low + 1][k]));
        (a + (at - low as f64) * (b - a)).round() as u8
    };
    [mix(0), mix(1), mix(2), 255]
}

/// Where the target's silhouette crosses ½, as segments between pixel centres (marching squares).
fn outline(target: &Target) -> Vec<[canvas::Point; 2]> {
    let (width, height) = (target.width, target.height);
    let at = |row: usize, column: usize| target.silhouette[row * width + column] - 0.5;
    let mut segments = Vec::new();
    for (row, column) in (1..height).flat_map(|row| (1..width).map(move |column| (row, column))) {
        let corners = [(row - 1, column - 1), (row - 1, column), (row, column), (row, column - 1)];
        let crossings: Vec<canvas::Point> = (0..4)
            .filter_map(|i| {
                let ((r0, c0), (r1, c1)) = (corners[i], corners[(i + 1) % 4]);
                let (a, b) = (at(r0, c0), at(r1, c1));
                let t = a / (a - b);
                let mix = |x: usize, y: usize| 0.5 + x as f64 + t * (y as f64 - x as f64);
                ((a > 0.0) != (b > 0.0)).then(|| [mix(c0, c1), mix(r0, r1)])
            })
            .collect();
        segments.extend(crossings.chunks_exact(2).map(|pair| [pair[0], pair[1]]));
    }
    segments
}

/// Enlarges a picture n times with linear interpolation.
fn enlarged(picture: &Picture, n: usize) -> Picture {
    let (width, height) = (picture.width * n, picture.height * n);
    let [w, h, columns, rows] = [picture.width, picture.height, width, height].map(|side| side as u32);
    let small = RgbaImage::from_fn(w, h, |x, y| Rgba(picture.pixels[(y * w + x) as usize]));
    let large = imageops::resize(&small, columns, rows, FilterType::Triangle);
    Picture { width, height, pixels: large.pixels().map(|pixel| pixel.0).collect() }
}

fn side_by_side(panels: &[(Picture, String)]) -> Picture {
    let (width, height) = (panels[0].0.width, panels[0].0.height);
    let scale = (width / 160).clamp(1, 3);
    let margin = 5 * scale;
    let [r, g, b] = GROUND;
    let size = (panels.len() * (width + margin) + margin, height + 2 * margin + 10 * scale);
    let mut sheet = Picture::filled(size.0, size.1, [r, g, b, 255]);
    for (i, (panel, label)) in panels.iter().enumerate() {
        let left = margin + i * (width + margin);
        sheet.paste(panel, left, margin);
        let top = margin + height + 3 * scale;
        let ink = |[r, g, b]: [u8; 3]| [r, g, b, 255];
        sheet::write_text(&mut sheet, label, left + scale, top, scale, ink(INK));
        if i + 1 == panels.len() {
            legend(&mut sheet, left + width, top, scale);
        }
    }
    sheet
}

/// The legend of the arrows' colours, right-aligned to the last panel; left out where it does not fit.
fn legend(sheet: &mut Picture, right: usize, top: usize, scale: usize) {
    let mut start = right;
    for (text, [r, g, b]) in [("occluded", HIDDEN), ("seen", SEEN)] {
        start = start.saturating_sub(sheet::text_width(text, scale) + 3 * scale);
        sheet::write_text(sheet, text, start, top, scale, [r, g, b, 255]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heat_goes_from_black_to_white() {
        assert_eq!(heat(0.0), [0, 0, 4, 255]);
        assert_eq!(heat(1.0), [252, 255, 164, 255]);
        assert!(heat(f64::NAN)[3] == 255);
    }

    #[test]
    fn outlines_go_around() {
        let silhouette = (0..25).map(|i| f64::from(u8::from(i == 12))).collect();
        let target = Target { width: 5, height: 5, color: vec![0.0; 75], silhouette };
        let segments = outline(&target);
        assert_eq!(segments.len(), 4);
        assert!(segments.iter().flatten().all(|p| ((p[0] - 2.5).abs() + (p[1] - 2.5).abs() - 0.5).abs() < 1e-12));
    }
}
