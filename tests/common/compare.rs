//! Comparing what the kernels made with what the reference says.

use super::tolerance::Tolerance;
use softras::{Frame, Image};
use softras_reference::ReferenceFrame;

/// One image against the reference's, value by value: |actual - reference| ≤ tolerance · max(1, |reference|).
///
/// Pixels whose `margin` is below the tolerance's may fall on the other side of a jump of the model and are left out,
/// but no more than its share of them. The largest error of the others, in units of the tolerance.
///
/// # Errors
/// The fault: the shape, a value that is not finite, the worst pixel, or too many pixels left out.
pub fn compare(
    name: &str,
    actual: &Image,
    reference: &[f64],
    margin: &[f64],
    tolerance: &Tolerance,
) -> Result<f64, String> {
    let channels = actual.channels;
    let pixels = actual.batch * actual.height * actual.width;
    if [actual.data.len(), reference.len()] != [pixels * channels; 2] || margin.len() != pixels {
        let [a, b, c] = [actual.data.len(), reference.len(), margin.len()];
        return Err(format!("{name}: {a} values, {b} of the reference's and {c} margins for {pixels} pixels"));
    }
    let place = |i: usize| {
        let (pixel, channel) = (i / channels, i % channels);
        let (view, row, column) =
            (pixel / (actual.height * actual.width), pixel / actual.width % actual.height, pixel % actual.width);
        let (is, should) = (actual.data[i], reference[i]);
        let error = f64::from(is) - should;
        let margin = margin[pixel];
        format!(
            "{name}: view {view}, row {row}, column {column}, channel {channel} is {is}, should be {should} (off by \
             {error:e}, margin {margin:e})"
        )
    };
    let (mut worst, mut at) = (0.0, 0);
    for (i, (&is, &should)) in actual.data.iter().zip(reference).enumerate() {
        if !is.is_finite() || !should.is_finite() {
            return Err(place(i));
        }
        let error = (f64::from(is) - should).abs() / (tolerance.value * should.abs().max(1.0));
        if margin[i / channels] >= tolerance.margin && error > worst {
            (worst, at) = (error, i);
        }
    }
    let left_out = margin.iter().filter(|&&m| m < tolerance.margin).count() as f64 / pixels.max(1) as f64;
    if left_out > tolerance.left_out {
        return Err(format!(
            "{name}: {left_out} of the pixels lie at a jump of the model, at most {} may",
            tolerance.left_out
        ));
    }
    if worst > 1.0 { Err(place(at)) } else { Ok(worst) }
}

/// Every image that the frame has, and that it has those which the reference has; the largest error.
///
/// # Errors
/// As [`compare`].
pub fn compare_frames(actual: &Frame, reference: &ReferenceFrame, tolerance: &Tolerance) -> Result<f64, String> {
    let mut worst: f64 = 0.0;
    for (name, image, expected) in [
        ("color", actual.color(), &reference.color),
        ("silhouette", actual.silhouette(), &reference.silhouette),
        ("depth", actual.depth(), &reference.depth),
        ("normal", actual.normal(), &reference.normal),
    ] {
        let Ok(image) = image else {
            if expected.is_empty() {
                continue;
            }
            return Err(format!("{name}: asked for and not there"));
        };
        worst = worst.max(compare(name, image, expected, &reference.margin, tolerance)?);
    }
    Ok(worst)
}

/// Every value of every image the same bits.
///
/// # Errors
/// The first image that differs and in how many values.
pub fn same_bits(a: &Frame, b: &Frame) -> Result<(), String> {
    for (name, a, b) in images(a, b) {
        let (Some(a), Some(b)) = (a, b) else {
            if a.is_some() != b.is_some() {
                return Err(format!("{name}: only one of the frames has it"));
            }
            continue;
        };
        same_image_bits(name, a, b)?;
    }
    Ok(())
}

/// Every value the same bits.
///
/// # Errors
/// In how many values they differ, and the first.
pub fn same_image_bits(name: &str, a: &Image, b: &Image) -> Result<(), String> {
    if (a.batch, a.height, a.width, a.channels, a.data.len()) != (b.batch, b.height, b.width, b.channels, b.data.len())
    {
        return Err(format!("{name}: different shapes"));
    }
    let mut differing = a.data.iter().zip(&b.data).enumerate().filter(|(_, (a, b))| a.to_bits() != b.to_bits());
    match differing.next() {
        None => Ok(()),
        Some((i, (x, y))) => {
            Err(format!("{name}: {} values differ, the first is value {i}, {x} and {y}", 1 + differing.count()))
        }
    }
}

/// Both frames' images by name.
pub fn images<'a>(a: &'a Frame, b: &'a Frame) -> [(&'static str, Option<&'a Image>, Option<&'a Image>); 4] {
    let find = |frame: &'a Frame, name| frame.images().find(|(n, _)| *n == name).map(|(_, image)| image);
    ["color", "silhouette", "depth", "normal"].map(|name| (name, find(a, name), find(b, name)))
}

/// One view of a batch as a batch of its own.
pub fn view_of(image: &Image, view: usize) -> Image {
    Image { batch: 1, data: image.view(view).to_vec(), ..*image }
}
