//! Pictures that a network is given, as PNG files.

use crate::data::PICTURE;
use crate::{SIZE, file_error};
use softras::Result;
use softras_io::{Picture, PictureFile};
use std::path::Path;

/// Reads a picture of 64×64 pixels with alpha as the four planes that networks are given, colours over black.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    let file = PictureFile::open(path)?;
    let (width, height) = (file.width as usize, file.height as usize);
    if [width, height] != [SIZE; 2] {
        let what = format!("the picture has {width} by {height} pixels");
        return Err(file_error(path, what, "give one of 64 by 64, the object in the middle"));
    }
    let decoded = file.decode(path)?;
    if !decoded.color().has_alpha() {
        return Err(file_error(path, "the picture has no alpha", "make its background transparent"));
    }
    let mut planes = vec![0; PICTURE];
    for (i, pixel) in decoded.to_rgba8().pixels().enumerate() {
        let [r, g, b, alpha] = pixel.0;
        let over = |value: u8| ((u32::from(value) * u32::from(alpha) + 127) / 255) as u8;
        for (plane, value) in [over(r), over(g), over(b), alpha].into_iter().enumerate() {
            planes[plane * SIZE * SIZE + i] = value;
        }
    }
    Ok(planes)
}

/// A picture as [`read`] takes it, of four planes.
pub fn pixels(planes: &[u8]) -> Picture {
    let at = |i: usize| {
        let [r, g, b, alpha] = [0, 1, 2, 3].map(|plane| planes[plane * SIZE * SIZE + i]);
        let apart = |value: u8| ((u32::from(value) * 255) / u32::from(alpha.max(1))).min(255) as u8;
        [apart(r), apart(g), apart(b), alpha]
    };
    Picture { width: SIZE, height: SIZE, pixels: (0..SIZE * SIZE).map(at).collect() }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn pictures_go_in_and_out() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("picture.png");
        // Colours are at most alpha, over black.
        let given: Vec<u8> =
            (0..PICTURE).map(|i| (i % (SIZE * SIZE) % 256 * (1 + i / (SIZE * SIZE)) / 4) as u8).collect();
        pixels(&given).save(&path).unwrap();
        // Colours are kept apart from alpha in the file, which rounds them.
        let apart = read(&path).unwrap().iter().zip(&given).map(|(a, b)| a.abs_diff(*b)).max();
        assert!(apart <= Some(1), "{apart:?}");

        let refused = |width: usize, alpha: u8| {
            Picture::filled(width, SIZE, [9, 9, 9, alpha]).save(&path).unwrap();
            read(&path).unwrap_err().to_string()
        };
        assert!(refused(65, 0).contains("65 by 64"));
        assert!(refused(SIZE, 255).contains("no alpha"));
        std::fs::write(&path, b"not a picture").unwrap();
        assert!(read(&path).unwrap_err().to_string().contains("picture.png"));
    }
}
