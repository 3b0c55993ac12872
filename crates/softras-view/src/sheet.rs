//! Contact sheets: a grid of frames with a label under each, in a font of 5×7 pixels.

use softras_io::Picture;

const MARGIN: usize = 6;

/// A grid of pictures of one size, each above its label, on the given background.
pub fn sheet(frames: &[(Picture, String)], ground: [u8; 3]) -> Picture {
    let Some((first, _)) = frames.first() else { return Picture::filled(1, 1, [0; 4]) };
    let scale = (first.width / 160).clamp(1, 4);
    let cell = (first.width.max(label_width(frames, scale)), first.height + 9 * scale);
    let columns = columns(frames.len(), cell);
    let rows = frames.len().div_ceil(columns);
    let [r, g, b] = ground;
    let size = |n: usize, side: usize| n * (side + MARGIN) + MARGIN;
    let mut sheet = Picture::filled(size(columns, cell.0), size(rows, cell.1), [r, g, b, 255]);
    for (i, (picture, label)) in frames.iter().enumerate() {
        let (left, top) = (size(i % columns, cell.0), size(i / columns, cell.1));
        sheet.paste(picture, left + (cell.0 - picture.width) / 2, top);
        let start = left + (cell.0 - text_width(label, scale).min(cell.0)) / 2;
        write_text(&mut sheet, label, start, top + picture.height + scale, scale, ink(ground));
    }
    sheet
}

/// The number of columns that makes the sheet about 1.5 times as wide as high.
fn columns(count: usize, (width, height): (usize, usize)) -> usize {
    let ideal = (1.5 * count as f64 * height as f64 / width as f64).sqrt();
    let rows = (count as f64 / ideal).round().max(1.0) as usize;
    count.div_ceil(rows)
}

/// Dark or light text, whichever is more legible on the background.
fn ink([r, g, b]: [u8; 3]) -> [u8; 4] {
    let bright = 299 * u32::from(r) + 587 * u32::from(g) + 114 * u32::from(b) > 128_000;
    if bright { [40, 40, 40, 255] } else { [230, 230, 230, 255] }
}

/// The width of a text in pixels.
pub fn text_width(text: &str, scale: usize) -> usize {
    6 * scale * text.chars().count()
}

fn label_width(frames: &[(Picture, String)], scale: usize) -> usize {
    frames.iter().map(|(_, label)| text_width(label, scale)).max().unwrap_or(0)
}

/// Writes a text, with `scale × scale` pixels for each pixel of the font.
pub fn write_text(sheet: &mut Picture, text: &str, left: usize, top: usize, scale: usize, ink: [u8; 4]) {
    for (i, letter) in text.chars().enumerate() {
        // Letters that reach below the line are a pixel lower.
        let top = if matches!(letter, 'g' | 'p' | 'y') { top + scale } else { top };
        for (r, row) in glyph(letter).iter().enumerate() {
            for c in (0..5).filter(|c| row >> (4 - c) & 1 == 1) {
                let dot = Picture::filled(scale, scale, ink);
                sheet.paste(&dot, left + (6 * i + c) * scale, top + r * scale);
            }
        }
    }
}

/// Seven rows of five bits, the leftmost highest; unknown letters are blank.
fn glyph(letter: char) -> [u8; 7] {
    match letter {
        '0' => [14, 17, 19, 21, 25, 17, 14],
        '1' => [4, 12, 4, 4, 4, 4, 14],
        '2' => [14, 17, 1, 2, 4, 8, 31],
        '3' => [31, 2, 4, 2, 1, 17, 14],
        '4' => [2, 6, 10, 18, 31, 2, 2],
        '5' => [31, 16, 30, 1, 1, 17, 14],
        '6' => [6, 8, 16, 30, 17, 17, 14],
        '7' => [31, 1, 2, 4, 8, 8, 8],
        '8' => [14, 17, 17, 14, 17, 17, 14],
        '9' => [14, 17, 17, 15, 1, 2, 12],
        '.' => [0, 0, 0, 0, 0, 12, 12],
        '-' => [0, 0, 0, 31, 0, 0, 0],
        '=' => [0, 0, 31, 0, 31, 0, 0],
        ':' => [0, 12, 12, 0, 12, 12, 0],
        '|' => [4, 4, 4, 4, 4, 4, 4],
        'a' => [0, 0, 14, 1, 15, 17, 15],
        'b' => [16, 16, 22, 25, 17, 17, 30],
        'c' => [0, 0, 14, 16, 16, 17, 14],
        'd' => [1, 1, 13, 19, 17, 17, 15],
        'e' => [0, 0, 14, 17, 31, 16, 14],
        'f' => [6, 9, 8, 28, 8, 8, 8],
        'g' => [0, 15, 17, 17, 15, 1, 14],
        'h' => [16, 16, 22, 25, 17, 17, 17],
        'i' => [4, 0, 12, 4, 4, 4, 14],
        'k' => [16, 16, 18, 20, 24, 20, 18],
        'l' => [12, 4, 4, 4, 4, 4, 14],
        'm' => [0, 0, 26, 21, 21, 17, 17],
        'n' => [0, 0, 22, 25, 17, 17, 17],
        'o' => [0, 0, 14, 17, 17, 17, 14],
        'p' => [0, 30, 17, 17, 30, 16, 16],
        'r' => [0, 0, 22, 25, 16, 16, 16],
        's' => [0, 0, 14, 16, 14, 1, 30],
        't' => [8, 8, 28, 8, 8, 9, 6],
        'u' => [0, 0, 17, 17, 17, 19, 13],
        'v' => [0, 0, 17, 17, 17, 10, 4],
        'w' => [0, 0, 17, 17, 21, 21, 10],
        'x' => [0, 0, 17, 10, 4, 10, 17],
        'y' => [0, 17, 17, 17, 15, 1, 14],
        'z' => [0, 0, 31, 2, 4, 8, 31],
        _ => [0; 7],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_label_that_is_written_has_its_letters() {
        assert!(
            "sigma=1.23e-5 gamma tau blur azimuth=067890 loss render target downhill seen occluded -gradient fixed key \
             turned across up by degrees sharp: soft:"
                .chars()
                .all(|c| c == ' ' || glyph(c) != [0; 7])
        );
    }

    #[test]
    fn sheets_hold_all_frames_and_labels() {
        let frame = Picture::filled(40, 30, [200, 0, 0, 255]);
        for n in 1..20 {
            let frames = vec![(frame.clone(), "tau=1e-4".to_string()); n];
            let sheet = sheet(&frames, [255; 3]);
            assert_eq!(sheet.pixels.iter().filter(|p| p[1] == 0).count(), n * 40 * 30);
            assert!(sheet.pixels.iter().filter(|p| p[0] == 40).count() > n * 50);
        }
    }
}
