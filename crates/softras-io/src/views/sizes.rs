//! Pictures of several sizes in images of one: each lies at the upper left, and beyond it is nothing.

use softras::{Camera, Projection, Result};

/// Columns and rows.
type Size = (u32, u32);

/// Whether a border that larger pictures go beyond cuts the silhouette: then it is not known to end there.
pub fn is_cut(picture: &[[f64; 4]], (width, height): Size, whole: Size) -> bool {
    let is_last = |i: usize| {
        let (column, row) = (i as u32 % width + 1, i as u32 / width + 1);
        (column == width && width < whole.0) || (row == height && height < whole.1)
    };
    picture.iter().enumerate().any(|(i, pixel)| pixel[3] > 0.5 && is_last(i))
}

/// The pixels of the larger image.
pub fn padded(picture: &[[f64; 4]], (width, height): Size, whole: Size) -> impl Iterator<Item = [f64; 4]> {
    let row = move |row: u32| (0..whole.0).map(move |column| (column, row));
    (0..whole.1).flat_map(row).map(move |(column, row)| {
        let is_inside = column < width && row < height;
        if is_inside { picture[(row * width + column) as usize] } else { [0.0; 4] }
    })
}

/// The camera of the larger image; that of a file is a pinhole or a perspective one.
pub fn widened(camera: &Camera, size: Size, whole: Size) -> Result<Camera> {
    match camera.intrinsics(size).filter(|_| size != whole) {
        Some([fx, fy, cx, cy]) => Camera::from_affine(camera.matrix(), Projection::Pinhole { fx, fy, cx, cy }),
        None => Ok(*camera),
    }
}
