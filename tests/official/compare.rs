//! Differences of images and gradients.

/// The largest absolute difference; infinite for different lengths and where either is not a number.
pub fn max_difference(a: &[f64], b: &[f64]) -> f64 {
    if a.len() != b.len() {
        return f64::INFINITY;
    }
    let differences = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    differences.fold(0.0, |worst, d| if d.is_nan() { f64::INFINITY } else { worst.max(d) })
}

/// |a - b| / |b|; infinite for different lengths.
pub fn relative_l2(a: &[f64], b: &[f64]) -> f64 {
    if a.len() != b.len() {
        return f64::INFINITY;
    }
    let difference: f64 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
    let size: f64 = b.iter().map(|b| b * b).sum();
    if difference.is_finite() { (difference / size.max(1e-300)).sqrt() } else { f64::INFINITY }
}

/// Some of the axes of points.
pub fn axes(points: &[f64], wanted: &[usize]) -> Vec<f64> {
    points.chunks(3).flat_map(|p| wanted.iter().map(|&k| p[k])).collect()
}

/// The sum of RGB texels.
pub fn texel_sum(texels: &[f64]) -> [f64; 3] {
    [0, 1, 2].map(|c| texels.iter().skip(c).step_by(3).sum::<f64>())
}

/// The median over the faces that have a gradient of |a - b| / |b|.
pub fn median_face(a: &[f64], b: &[f64]) -> f64 {
    let faces = a.chunks(9).zip(b.chunks(9)).filter(|(_, b)| b.iter().any(|x| *x != 0.0));
    let mut errors: Vec<f64> = faces.map(|(a, b)| relative_l2(a, b)).collect();
    errors.sort_by(f64::total_cmp);
    errors[errors.len() / 2]
}

/// The values of an RGB image at the pixels that are not masked.
pub fn unmasked(color: &[f64], masked: &[bool]) -> Vec<f64> {
    let pixels = color.chunks(3).zip(masked).filter(|(_, masked)| !**masked);
    pixels.flat_map(|(pixel, _)| pixel.to_vec()).collect()
}
