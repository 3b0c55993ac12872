//! Pictures: those that a network is given, and a sheet of what it made of them beside the truth.

use super::data::{PICTURE, Set};
use super::network::Network;
use super::train::meshes;
use super::{SIZE, VIEWS, camera, file_error, fit_error};
use burn::tensor::Device;
use image::{ImageFormat, RgbImage, RgbaImage};
use softras::internals::files;
use softras::scene::DirectionalLight;
use softras::{Error, Lights, Mesh, Renderer, Result, Scene, Settings};
use std::io::Cursor;
use std::path::Path;

/// Columns of a sheet: the input; the prediction in that view; prediction and truth a quarter turn on, and half a turn on.
const COLUMNS: usize = 6;
/// The background of sheets.
const GREY: f32 = 0.92;

/// Reads a picture of 64×64 pixels with alpha as the four planes that networks are given, colours over black.
///
/// # Errors
/// [`Error::Io`]; [`Error::File`] for what is no PNG, another size, or a picture without transparency.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    let reader = image::ImageReader::with_format(std::io::BufReader::new(files::open(path)?), ImageFormat::Png);
    let decoded = reader.decode().or_else(|e| file_error(path, e.to_string(), "give a PNG picture"))?;
    let size = [decoded.width(), decoded.height()];
    if size != [SIZE as u32; 2] {
        let what = format!("the picture has {} by {} pixels", size[0], size[1]);
        return file_error(path, what, "give one of 64 by 64, the object in the middle");
    }
    if !decoded.color().has_alpha() {
        return file_error(path, "the picture has no alpha", "make its background transparent");
    }
    let pixels = decoded.to_rgba8();
    let mut planes = vec![0; PICTURE];
    for (i, pixel) in pixels.pixels().enumerate() {
        let [r, g, b, alpha] = pixel.0;
        let over = |value: u8| ((u32::from(value) * u32::from(alpha) + 127) / 255) as u8;
        for (plane, value) in [over(r), over(g), over(b), alpha].into_iter().enumerate() {
            planes[plane * SIZE * SIZE + i] = value;
        }
    }
    Ok(planes)
}

/// Writes a picture of a set as [`read`] takes it.
///
/// # Errors
/// [`Error::Io`].
pub fn write(path: &Path, picture: &[u8]) -> Result<()> {
    let mut pixels = RgbaImage::new(SIZE as u32, SIZE as u32);
    for (i, pixel) in pixels.pixels_mut().enumerate() {
        let [r, g, b, alpha] = [0, 1, 2, 3].map(|plane| picture[plane * SIZE * SIZE + i]);
        let apart = |value: u8| ((u32::from(value) * 255) / u32::from(alpha.max(1))).min(255) as u8;
        pixel.0 = [apart(r), apart(g), apart(b), alpha];
    }
    let mut bytes = Cursor::new(Vec::new());
    let io = |e: image::ImageError| Error::Io { path: path.into(), source: std::io::Error::other(e) };
    pixels.write_to(&mut bytes, ImageFormat::Png).map_err(io)?;
    files::write_file(path, bytes.get_ref())
}

/// Renders a prediction: in its own colours, or as a grey surface under a light.
fn render(renderer: &mut Renderer, mesh: &Mesh, color: bool, views: &[usize]) -> Result<Vec<Vec<[f32; 3]>>> {
    let cameras = views.iter().map(|&view| camera(view)).collect::<Result<Vec<_>>>()?;
    let light = |direction, intensity| DirectionalLight { direction, color: [1.0; 3], intensity };
    let directional = vec![light([0.0, 1.0, 0.0], 0.35), light([1.0, 0.4, 0.6], 0.3)];
    let lit = Lights { ambient_intensity: 0.3, directional, ..Lights::unlit() };
    let scene = Scene::new(mesh.clone()).with_lights(if color { Lights::unlit() } else { lit });
    let background_color = [f64::from(GREY); 3];
    let background = softras::scene::Background::Composite;
    let (width, height) = (SIZE as u32, SIZE as u32);
    let settings = Settings { width, height, background, background_color, ..Settings::default() };
    let frame = renderer.render(&scene, &cameras, &settings)?;
    let Some(image) = frame.color() else { return fit_error("the renderer gave no colour", "report this") };
    Ok((0..views.len()).map(|view| image.view(view).as_chunks::<3>().0.to_vec()).collect())
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
    let (width, height) = ((COLUMNS * SIZE) as u32, (objects.len() * SIZE) as u32);
    let mut pixels = RgbImage::new(width, height);
    for (row, &index) in objects.iter().enumerate() {
        let object = &set.objects[index];
        let seen = (7 * row + 3) % VIEWS;
        let turned = [6, 12].map(|turn| (seen + turn) % VIEWS);
        let predicted = meshes(network, &[object.picture(seen)], &Device::flex())?;
        let color = matches!(predicted[0].appearance(), softras::scene::Appearance::VertexColors(_));
        let [own, quarter, half] = [seen, turned[0], turned[1]];
        let mut views = render(renderer, &predicted[0], color, &[own, quarter, half])?.into_iter();
        let mut next = || views.next().unwrap_or_default();
        let [given, at_quarter, at_half] = [own, quarter, half].map(|view| over_grey(object.picture(view)));
        let cells = [given, next(), next(), at_quarter, next(), at_half];
        for (column, cell) in cells.iter().enumerate() {
            for (i, value) in cell.iter().enumerate() {
                let (x, y) = (column * SIZE + i % SIZE, row * SIZE + i / SIZE);
                pixels.put_pixel(x as u32, y as u32, image::Rgb(value.map(|v| (255.0 * v.clamp(0.0, 1.0)) as u8)));
            }
        }
    }
    let mut bytes = Cursor::new(Vec::new());
    let io = |e: image::ImageError| Error::Io { path: path.into(), source: std::io::Error::other(e) };
    pixels.write_to(&mut bytes, ImageFormat::Png).map_err(io)?;
    files::write_file(path, bytes.get_ref())
}

fn over_grey(picture: &[u8]) -> Vec<[f32; 3]> {
    let at = |plane: usize, i: usize| f32::from(picture[plane * SIZE * SIZE + i]) / 255.0;
    (0..SIZE * SIZE).map(|i| [0, 1, 2].map(|plane| at(plane, i) + GREY * (1.0 - at(3, i)))).collect()
}
