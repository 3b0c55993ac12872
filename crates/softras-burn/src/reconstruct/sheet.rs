//! What a network makes of pictures, to look at: a sheet of several objects beside the truth, and a shape that turns.

use super::data::Set;
use super::network::{Network, meshes};
use super::{SIZE, VIEWS, camera, fit_error};
use burn::tensor::Device;
use font8x8::{BASIC_FONTS, UnicodeFonts};
use image::codecs::gif::{GifEncoder, Repeat};
use image::{Delay, Frame, ImageFormat, Rgb, RgbImage};
use softras::scene::{Appearance, Background, DirectionalLight};
use softras::{Camera, Error, Lights, Mesh, Projection, Renderer, Result, Scene, Settings};
use softras_io::output;
use std::io::Cursor;
use std::path::Path;

/// Pixels along the side of a cell: twice a picture's.
const CELL: usize = 2 * SIZE;
/// The two lines above each column of a sheet.
const COLUMNS: [[&str; 2]; 6] = [
    ["input", ""],
    ["prediction", "same view"],
    ["prediction", "quarter turn"],
    ["truth", "quarter turn"],
    ["prediction", "half turn"],
    ["truth", "half turn"],
];
/// The side of a letter, and the height of the lines above the columns.
const LETTER: usize = 8;
const HEAD: usize = 28;
/// The brightness of the background and of the letters.
const GREY: f32 = 0.92;
const INK: f32 = 0.15;
/// Frames of a turn, and the milliseconds of each.
const FRAMES: usize = 48;
const DELAY: u32 = 80;

/// A grid of square cells below a heading.
struct Canvas(RgbImage);

impl Canvas {
    fn new(columns: usize, rows: usize, head: usize) -> Self {
        let (width, height) = ((columns * CELL) as u32, (head + rows * CELL) as u32);
        Self(RgbImage::from_pixel(width, height, pixel([GREY; 3])))
    }

    /// Draws a square picture of any size, each of its pixels as often as it fits.
    fn paste(&mut self, left: usize, top: usize, picture: &[[f32; 3]]) {
        let side = picture.len().isqrt();
        for (x, y) in (0..CELL * CELL).map(|i| (i % CELL, i / CELL)) {
            let value = picture[y * side / CELL * side + x * side / CELL];
            self.0.put_pixel((left + x) as u32, (top + y) as u32, pixel(value));
        }
    }

    /// Writes a line in the middle of a column.
    fn write(&mut self, column: usize, top: usize, text: &str) {
        let left = column * CELL + (CELL - LETTER * text.len().min(CELL / LETTER)) / 2;
        for (i, glyph) in text.chars().take(CELL / LETTER).filter_map(|letter| BASIC_FONTS.get(letter)).enumerate() {
            for (x, y) in
                (0..LETTER * LETTER).map(|k| (k % LETTER, k / LETTER)).filter(|(x, y)| glyph[*y] >> x & 1 == 1)
            {
                self.0.put_pixel((left + LETTER * i + x) as u32, (top + y) as u32, pixel([INK; 3]));
            }
        }
    }
}

fn pixel(value: [f32; 3]) -> Rgb<u8> {
    Rgb(value.map(|x| (255.0 * x.clamp(0.0, 1.0)).round() as u8))
}

/// Renders a prediction: in its own colours, or as a grey surface under a light.
fn render(renderer: &mut Renderer, mesh: &Mesh, cameras: &[Camera]) -> Result<Vec<Vec<[f32; 3]>>> {
    let light = |direction, intensity| DirectionalLight { direction, color: [1.0; 3], intensity };
    let directional = vec![light([0.0, 1.0, 0.0], 0.35), light([1.0, 0.4, 0.6], 0.3)];
    let lights = match mesh.appearance() {
        Appearance::VertexColors(_) => Lights::unlit(),
        _ => Lights { ambient_intensity: 0.3, directional, ..Lights::unlit() },
    };
    let scene = Scene::new(mesh.clone()).with_lights(lights);
    let (width, height, background) = (CELL as u32, CELL as u32, Background::Composite);
    let settings =
        Settings { width, height, background, background_color: [f64::from(GREY); 3], ..Settings::default() };
    let frame = renderer.render(&scene, cameras, &settings)?;
    let image = frame.color()?;
    Ok((0..cameras.len()).map(|view| image.view(view).as_chunks::<3>().0.to_vec()).collect())
}

/// A sheet of objects, a row for each: the input, what the network makes of it in the same view, and then prediction and
/// truth side by side a quarter and half a turn on.
///
/// # Errors
/// [`Error::Fit`] without objects; [`Error::Io`]; as [`Renderer::render`] and [`meshes`].
pub fn sheet(path: &Path, set: &Set, network: &Network, objects: &[usize], renderer: &mut Renderer) -> Result<()> {
    if objects.is_empty() {
        return fit_error("a sheet of no objects", "use at least one");
    }
    let mut canvas = Canvas::new(COLUMNS.len(), objects.len(), HEAD);
    for (column, lines) in COLUMNS.into_iter().enumerate() {
        lines.into_iter().enumerate().for_each(|(i, text)| canvas.write(column, 4 + i * (LETTER + 4), text));
    }
    for (row, &index) in objects.iter().enumerate() {
        let object = &set.objects[index];
        let seen = (7 * row + 3) % VIEWS;
        let turned = [0, VIEWS / 4, VIEWS / 2].map(|turn| (seen + turn) % VIEWS);
        let predicted = meshes(network, &[object.picture(seen)], &Device::flex())?;
        let cameras = turned.map(camera).into_iter().collect::<Result<Vec<_>>>()?;
        let mut views = render(renderer, &predicted[0], &cameras)?.into_iter();
        let mut next = || views.next().unwrap_or_default();
        let [given, at_quarter, at_half] = turned.map(|view| over_grey(object.picture(view)));
        for (column, cell) in [given, next(), next(), at_quarter, next(), at_half].iter().enumerate() {
            canvas.paste(column * CELL, HEAD + row * CELL, cell);
        }
    }
    let mut bytes = Cursor::new(Vec::new());
    let io = |e: image::ImageError| Error::Io { path: path.into(), source: std::io::Error::other(e) };
    canvas.0.write_to(&mut bytes, ImageFormat::Png).map_err(io)?;
    output::write_file(path, bytes.get_ref())
}

/// An endless GIF film: the picture that a network was given, beside the mesh that it saw there, which turns once.
///
/// # Errors
/// [`Error::Io`]; as [`Renderer::render`].
pub fn turn(path: &Path, given: &[u8], mesh: &Mesh, renderer: &mut Renderer) -> Result<()> {
    let perspective = Projection::Perspective { fov_y: 30f64.to_radians() };
    let camera = |i: usize| Camera::from_angles(2.732, 30.0, 360.0 * i as f64 / FRAMES as f64, perspective);
    let cameras = (0..FRAMES).map(camera).collect::<Result<Vec<_>>>()?;
    let given = over_grey(given);
    let frame = |view: Vec<[f32; 3]>| {
        let mut canvas = Canvas::new(2, 1, 0);
        canvas.paste(0, 0, &given);
        canvas.paste(CELL, 0, &view);
        let opaque = image::DynamicImage::ImageRgb8(canvas.0).into_rgba8();
        Frame::from_parts(opaque, 0, 0, Delay::from_numer_denom_ms(DELAY, 1))
    };
    let mut bytes = Vec::new();
    let io = |e: image::ImageError| Error::Io { path: path.into(), source: std::io::Error::other(e) };
    let mut encoder = GifEncoder::new(&mut bytes);
    encoder.set_repeat(Repeat::Infinite).map_err(io)?;
    encoder.encode_frames(render(renderer, mesh, &cameras)?.into_iter().map(frame)).map_err(io)?;
    drop(encoder);
    output::write_file(path, &bytes)
}

fn over_grey(picture: &[u8]) -> Vec<[f32; 3]> {
    let at = |plane: usize, i: usize| f32::from(picture[plane * SIZE * SIZE + i]) / 255.0;
    (0..SIZE * SIZE).map(|i| [0, 1, 2].map(|plane| at(plane, i) + GREY * (1.0 - at(3, i)))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headings_fit_their_columns_and_have_ink() {
        for (column, lines) in COLUMNS.into_iter().enumerate() {
            let mut canvas = Canvas::new(COLUMNS.len(), 1, HEAD);
            lines.into_iter().enumerate().for_each(|(i, text)| canvas.write(column, 4 + i * (LETTER + 4), text));
            let ink = pixel([INK; 3]);
            let columns: Vec<u32> =
                canvas.0.enumerate_pixels().filter(|(_, _, p)| **p == ink).map(|(x, ..)| x).collect();
            let letters: usize = lines.iter().map(|text| text.replace(' ', "").len()).sum();
            assert!(columns.len() > 8 * letters, "{lines:?}");
            let cell = (column * CELL) as u32..((column + 1) * CELL) as u32;
            assert!(columns.iter().all(|x| cell.contains(x)) && lines.iter().all(|text| text.len() * LETTER <= CELL));
        }
    }
}
