//! Pictures of a network's predictions: a sheet of several objects beside the truth, and a shape that turns.

use crate::data::Set;
use crate::network::{Network, meshes};
use crate::picture::pixels;
use crate::{SIZE, VIEWS, camera, camera_at};
use burn::tensor::Device;
use softras::scene::{Appearance, Background, DirectionalLight};
use softras::{Camera, Lights, Mesh, Renderer, Result, Scene, Settings};
use softras_io::{Picture, write_gif};
use softras_view::{text_width, write_text};
use std::path::Path;

/// Pixels along the side of a cell: twice a picture's.
const CELL: usize = 2 * SIZE;
/// The two lines above each column of a sheet.
const COLUMNS: [[&str; 2]; 6] = [
    ["input", ""],
    ["prediction", "same view"],
    ["prediction", "turned 90"],
    ["truth", "turned 90"],
    ["prediction", "turned 180"],
    ["truth", "turned 180"],
];
/// The height of the lines above the columns, and of one of them.
const HEAD: usize = 28;
const LINE: usize = 12;
/// The brightness of the background and of the letters.
const GREY: u8 = 235;
const INK: u8 = 38;
/// Frames of a turn, and the hundredths of a second of each.
const FRAMES: usize = 48;
const DELAY: u16 = 8;

fn ground(columns: usize, height: usize) -> Picture {
    Picture::filled(columns * CELL, height, [GREY, GREY, GREY, 255])
}

/// The picture that a network was given, in the size of a cell.
fn given(planes: &[u8]) -> Picture {
    let small = pixels(planes).flattened([GREY; 3]);
    let at = |i: usize| small.pixels[i / CELL * SIZE / CELL * SIZE + i % CELL * SIZE / CELL];
    Picture { width: CELL, height: CELL, pixels: (0..CELL * CELL).map(at).collect() }
}

/// Renders a prediction: in its own colours, or as a grey surface under a light.
fn render(renderer: &mut Renderer, mesh: &Mesh, cameras: &[Camera]) -> Result<Vec<Picture>> {
    let light = |direction, intensity| DirectionalLight { direction, color: [1.0; 3], intensity };
    let directional = vec![light([0.0, 1.0, 0.0], 0.35), light([1.0, 0.4, 0.6], 0.3)];
    let lights = match mesh.appearance() {
        Appearance::VertexColors(_) => Lights::unlit(),
        _ => Lights { ambient_intensity: 0.3, directional, ..Lights::unlit() },
    };
    let settings = Settings {
        width: CELL as u32,
        height: CELL as u32,
        background: Background::Composite,
        background_color: [f64::from(GREY) / 255.0; 3],
        ..Settings::default()
    };
    let frame = renderer.render(&Scene::new(mesh.clone()).with_lights(lights), cameras, &settings)?;
    let image = frame.color()?;
    let byte = |x: f32| (255.0 * x.clamp(0.0, 1.0)).round() as u8;
    let pixel = |&[r, g, b]: &[f32; 3]| [byte(r), byte(g), byte(b), 255];
    let picture = |view: usize| {
        let pixels = image.view(view).as_chunks().0.iter().map(pixel).collect();
        Picture { width: CELL, height: CELL, pixels }
    };
    Ok((0..cameras.len()).map(picture).collect())
}

/// A sheet of the first object of each class, a row for each: the input, what the network makes of it in the same view, and
/// then prediction and truth side by side a quarter and half a turn on.
pub fn sheet(path: &Path, set: &Set, network: &Network, renderer: &mut Renderer) -> Result<()> {
    let first = |class| set.objects.iter().find(|object| object.class == class);
    let objects: Vec<_> = (0..set.classes.len()).filter_map(first).collect();
    let mut sheet = ground(COLUMNS.len(), HEAD + objects.len() * CELL);
    for (column, lines) in COLUMNS.iter().enumerate() {
        for (i, text) in lines.iter().enumerate() {
            let left = column * CELL + (CELL - text_width(text, 1)) / 2;
            write_text(&mut sheet, text, left, 4 + i * LINE, 1, [INK, INK, INK, 255]);
        }
    }
    for (row, object) in objects.into_iter().enumerate() {
        let seen = (7 * row + 3) % VIEWS;
        let turned = [0, VIEWS / 4, VIEWS / 2].map(|turn| (seen + turn) % VIEWS);
        let predicted = meshes(network, &[object.picture(seen)], &Device::flex())?;
        let cameras = turned.map(camera).into_iter().collect::<Result<Vec<_>>>()?;
        let mut predicted = render(renderer, &predicted[0], &cameras)?.into_iter();
        let mut next = || predicted.next().unwrap_or_else(|| ground(1, CELL));
        let [input, at_quarter, at_half] = turned.map(|view| given(object.picture(view)));
        for (column, cell) in [input, next(), next(), at_quarter, next(), at_half].iter().enumerate() {
            sheet.paste(cell, column * CELL, HEAD + row * CELL);
        }
    }
    sheet.save(path)
}

/// An endless GIF film: the picture that a network was given, beside the mesh that it saw there, which turns once.
pub fn turn(path: &Path, planes: &[u8], mesh: &Mesh, renderer: &mut Renderer) -> Result<()> {
    write_gif(path, &frames(planes, mesh, renderer)?, DELAY)
}

fn frames(planes: &[u8], mesh: &Mesh, renderer: &mut Renderer) -> Result<Vec<Picture>> {
    let cameras = (0..FRAMES).map(|i| camera_at(360.0 * i as f64 / FRAMES as f64)).collect::<Result<Vec<_>>>()?;
    let input = given(planes);
    let frame = |view: Picture| {
        let mut frame = ground(2, CELL);
        frame.paste(&input, 0, 0);
        frame.paste(&view, CELL, 0);
        frame
    };
    Ok(render(renderer, mesh, &cameras)?.into_iter().map(frame).collect())
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::data::PICTURE;

    #[test]
    fn headings_fit_their_columns_and_have_ink() {
        for text in COLUMNS.as_flattened() {
            assert!(text_width(text, 1) <= CELL);
            for letter in text.chars().filter(|letter| *letter != ' ') {
                let mut picture = ground(1, LINE);
                write_text(&mut picture, &letter.to_string(), 0, 0, 1, [INK; 4]);
                assert!(picture.pixels.iter().filter(|pixel| pixel[0] == INK).count() > 4, "{letter}");
            }
        }
    }

    #[test]
    fn the_mesh_turns_beside_a_still_picture() {
        let planes: Vec<u8> = (0..PICTURE).map(|i| (i % 200) as u8).collect();
        let mesh = softras::shapes::cube().unwrap();
        let frames = frames(&planes, &mesh, &mut Renderer::new().unwrap()).unwrap();
        assert_eq!(frames.len(), 48);
        let half = |frame: &Picture, half: usize| {
            frame.pixels.chunks(2 * CELL).flat_map(|row| row[half * CELL..][..CELL].to_vec()).collect::<Vec<_>>()
        };
        for [a, b] in frames.array_windows() {
            assert_eq!(half(a, 0), half(b, 0));
            assert_ne!(half(a, 1), half(b, 1));
        }
    }
}
