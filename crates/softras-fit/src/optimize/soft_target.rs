//! Soft silhouettes from hard masks, as targets for soft renderings.
//!
//! A soft silhouette is not only blurred but also too large, since every triangle near an outline adds to the coverage:
//! at the outline of a closed surface, a triangle of its front and one of its back both have D = ½, and 1 - (1 - ½)² =
//! ¾. A mesh fitted to a hard mask would therefore end too small by about √σ. The soft target is instead the silhouette
//! that a closed surface with the mask's outline has at the same σ. From the signed distance s to the outline, positive
//! inside, it is T = 1 - (1 - D)^sheets with D = sigmoid(sign(s) s² / σ).

use crate::bad;
use crate::shown;
use softras::{Image, Result};

/// The number of triangles at each point of a closed surface's outline: one in front, one behind.
pub const CLOSED: f64 = 2.0;

/// The signed distance of every pixel's centre from the outline of its view's mask, in screen units (half the image's
/// height), above 0 inside. A mask's inside is where it is above ½, and its outline runs midway between the centres of
/// neighbouring pixels on different sides. In a view without an outline all distances are ±∞.
///
/// # Errors
/// [`softras::Error::Fit`] for an image of several channels, without pixels, or not as its shape says.
pub fn signed_distance(mask: &Image) -> Result<Image> {
    if mask.channels != 1 || !mask.is_whole() {
        let Image { batch, height, width, channels, ref data } = *mask;
        let what = format!("a mask of shape {:?} with {} values", [batch, height, width, channels], data.len());
        return bad(what, "give an image of one channel with a value for each pixel, at least one");
    }
    let unit = 2.0 / mask.height as f64;
    let mut data = Vec::with_capacity(mask.data.len());
    for view in 0..mask.batch {
        let inside: Vec<bool> = mask.view(view).iter().map(|x| *x > 0.5).collect();
        let to_outside = squared_distance(&inside, mask.width, false);
        let to_inside = squared_distance(&inside, mask.width, true);
        data.extend(to_outside.into_iter().zip(to_inside).map(|(out, into)| {
            // One of the two distances is 0; the outline is half a pixel nearer than the next centre on the other side.
            let signed = if into > 0.0 { 0.5 - into.sqrt() } else { out.sqrt() - 0.5 };
            (signed * unit) as f32
        }));
    }
    Ok(Image { data, ..*mask })
}

/// The soft silhouette at σ of a surface with the mask's outline. A SoftRas silhouette is too large as well as blurred,
/// since front and back both cover its outline; against this target a mesh fits the mask itself.
///
/// `mask` is `[views, height, width, 1]`, inside above ½. `sheets` is the number of triangles at each point of the
/// outline: 2 for a closed surface, 1 for an open one. The result has the mask's shape and is in [0, 1].
///
/// # Errors
/// [`softras::Error::Fit`] for an image of several channels or without pixels, and for a σ or `sheets` that is not above
/// 0.
pub fn soft_target(mask: &Image, sigma: f64, sheets: f64) -> Result<Image> {
    if !(sigma > 0.0 && sigma.is_finite() && sheets > 0.0 && sheets.is_finite()) {
        return bad(
            format!("a soft target of sigma {} and {} sheets", shown(sigma), shown(sheets)),
            "both must be above 0",
        );
    }
    let mut image = signed_distance(mask)?;
    for x in &mut image.data {
        let s = f64::from(*x);
        let outside = 1.0 / (1.0 + (s * s.abs() / sigma).exp());
        *x = (1.0 - outside.powf(sheets)) as f32;
    }
    Ok(image)
}

/// The squared distance of every pixel to the nearest one that is `wanted`, in pixels; infinite without one. First
/// along rows, then as the lower envelope of parabolas along columns (Felzenszwalb and Huttenlocher 2012).
fn squared_distance(inside: &[bool], width: usize, wanted: bool) -> Vec<f64> {
    let height = inside.len() / width;
    let mut squares: Vec<f64> = inside.iter().map(|&x| if x == wanted { 0.0 } else { f64::INFINITY }).collect();
    squares.chunks_exact_mut(width).for_each(envelope);
    for column in 0..width {
        let mut line: Vec<f64> = (0..height).map(|row| squares[row * width + column]).collect();
        envelope(&mut line);
        line.into_iter().enumerate().for_each(|(row, x)| squares[row * width + column] = x);
    }
    squares
}

/// f(i) ← min over j of f(j) + (i - j)².
fn envelope(values: &mut [f64]) {
    // The parabolas of the envelope: the position of each one's vertex, and from where on it is the lowest.
    let mut parabolas: Vec<(usize, f64)> = Vec::new();
    for (j, &f) in values.iter().enumerate().filter(|(_, f)| f.is_finite()) {
        let height_of = |k: usize, f: f64| f + (k * k) as f64;
        let mut from = f64::NEG_INFINITY;
        while let Some(&(k, start)) = parabolas.last() {
            from = (height_of(j, f) - height_of(k, values[k])) / (2.0 * (j - k) as f64);
            if from > start {
                break;
            }
            parabolas.pop();
            from = f64::NEG_INFINITY;
        }
        parabolas.push((j, from));
    }
    let mut at = 0;
    let lowest: Vec<f64> = (0..values.len())
        .map(|i| {
            while parabolas.get(at + 1).is_some_and(|next| next.1 < i as f64) {
                at += 1;
            }
            parabolas.get(at).map_or(f64::INFINITY, |&(j, _)| values[j] + (i as f64 - j as f64).powi(2))
        })
        .collect();
    values.copy_from_slice(&lowest);
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn mask(width: usize, inside: impl Fn(usize, usize) -> bool) -> Image {
        let pixel = |i: usize| f32::from(u8::from(inside(i / width, i % width)));
        Image { batch: 1, height: width, width, channels: 1, data: (0..width * width).map(pixel).collect() }
    }

    #[test]
    fn distances_are_those_of_brute_force() {
        let side = 23;
        let image = mask(side, |r, c| (r * 7 + c * 3) % 11 == 0 || (r as i32 - 9).pow(2) + (c as i32 - 14).pow(2) < 30);
        let found = signed_distance(&image).unwrap();
        for i in 0..side * side {
            let other = |j: &usize| (image.data[*j] > 0.5) != (image.data[i] > 0.5);
            let square = |j: usize| (i / side).abs_diff(j / side).pow(2) + (i % side).abs_diff(j % side).pow(2);
            let nearest = (0..side * side).filter(other).map(square).min().unwrap();
            let sign = if image.data[i] > 0.5 { 1.0 } else { -1.0 };
            let expected = sign * ((nearest as f64).sqrt() - 0.5) * 2.0 / side as f64;
            assert!((f64::from(found.data[i]) - expected).abs() < 1e-6, "{i}: {} for {expected}", found.data[i]);
        }
    }

    #[test]
    fn a_soft_target_is_one_half_or_more_inside_alone() {
        let image = mask(32, |r, c| (8..24).contains(&r) && (8..24).contains(&c));
        let single = soft_target(&image, 4e-3, 1.0).unwrap();
        let closed = soft_target(&image, 4e-3, CLOSED).unwrap();
        for ((one, two), hard) in single.data.iter().zip(&closed.data).zip(&image.data) {
            assert_eq!(*one > 0.5, *hard > 0.5);
            assert!((f64::from(*two) - (1.0 - (1.0 - f64::from(*one)).powi(2))).abs() < 1e-6);
        }
        assert!(closed.data[12 * 32 + 7] > 0.5 && closed.data[0] < 1e-6, "a closed surface's outline is too large");
    }

    #[test]
    fn nothing_and_everything_are_far_from_any_outline() {
        for all in [false, true] {
            let soft = soft_target(&mask(4, |_, _| all), 1e-4, CLOSED).unwrap();
            assert!(soft.data.iter().all(|x| *x == f32::from(u8::from(all))), "{:?}", soft.data);
        }
        assert!(soft_target(&mask(4, |_, _| true), 0.0, 2.0).is_err_and(|e| e.to_string().contains("sigma 0")));
        assert!(soft_target(&mask(4, |_, _| true), 1e-4, 0.0).is_err_and(|e| e.to_string().contains("0 sheets")));
        // One half is not above one half.
        let half = Image { data: vec![0.5; 16], ..mask(4, |_, _| true) };
        assert!(signed_distance(&half).unwrap().data.iter().all(|x| *x == f32::NEG_INFINITY));
        let colored = Image { channels: 3, ..mask(4, |_, _| true) };
        assert!(signed_distance(&colored).is_err_and(|e| e.to_string().contains("one channel")));
    }
}
