//! The bits of frames and gradients: equal between two runs, and never those of NaN or infinity.

use softras::{Frame, Gradients};
use std::hash::{DefaultHasher, Hasher};

/// The bits of all values of a frame's images.
pub(super) fn bits(frame: &Frame) -> impl Iterator<Item = u32> {
    let images = [frame.color(), frame.silhouette(), frame.depth(), frame.normal()];
    images.into_iter().flatten().flat_map(|image| image.data.iter().map(|x| x.to_bits()))
}

/// The single-precision gradients with their names.
fn arrays(gradients: &Gradients) -> Vec<(&'static str, &[f32])> {
    let meshes = gradients.meshes.iter().flat_map(|mesh| {
        let whole: [(&str, &[f32]); 4] = [
            ("positions", mesh.positions.as_flattened()),
            ("colors", mesh.colors.as_flattened()),
            ("surface texels", mesh.surface_texels.as_flattened()),
            ("UVs", mesh.uvs.as_flattened()),
        ];
        whole.into_iter().chain(mesh.texture_texels.iter().map(|t| ("texture texels", t.as_flattened())))
    });
    meshes.collect()
}

/// The double-precision gradients with their names.
fn numbers(gradients: &Gradients) -> Vec<(&'static str, f64)> {
    let mut all = vec![("sigma", gradients.sigma), ("gamma", gradients.gamma), ("epsilon", gradients.epsilon)];
    all.extend(gradients.background_color.map(|x| ("background", x)));
    for camera in &gradients.cameras {
        all.extend(camera.twist.map(|x| ("the camera's twist", x)));
        all.extend(camera.projection.map(|x| ("the projection", x)));
    }
    if let Some(lights) = &gradients.lights {
        all.extend(lights.ambient_color.map(|x| ("ambient colour", x)));
        all.push(("ambient intensity", lights.ambient_intensity));
        for (direction, color, intensity) in &lights.directional {
            all.extend(direction.map(|x| ("a light's direction", x)));
            all.extend(color.map(|x| ("a light's colour", x)));
            all.push(("a light's intensity", *intensity));
        }
    }
    all
}

/// Names the first gradient that is not finite.
pub(super) fn not_finite(gradients: &Gradients) -> Option<String> {
    let array = arrays(gradients).into_iter().find_map(|(name, values)| {
        let i = values.iter().position(|x| !x.is_finite())?;
        Some(format!("{name}, value {i} is {}", values[i]))
    });
    array.or_else(|| numbers(gradients).into_iter().find(|(_, x)| !x.is_finite()).map(|(n, x)| format!("{n} is {x}")))
}

/// The bits of all gradients.
pub(super) fn gradient_bits(gradients: &Gradients) -> impl Iterator<Item = u64> {
    let arrays = arrays(gradients).into_iter().flat_map(|(_, values)| values.iter().map(|x| x.to_bits().into()));
    arrays.chain(numbers(gradients).into_iter().map(|(_, x)| x.to_bits()))
}

/// A fingerprint of the bits of all images and gradients.
pub fn fingerprint(frame: &Frame, gradients: &Gradients) -> u64 {
    let mut hasher = DefaultHasher::new();
    bits(frame).for_each(|word| hasher.write_u32(word));
    gradient_bits(gradients).for_each(|word| hasher.write_u64(word));
    hasher.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gradients_that_are_not_numbers_are_found() {
        let mut gradients = Gradients::default();
        assert_eq!(not_finite(&gradients), None);
        gradients.sigma = f64::NAN;
        assert!(not_finite(&gradients).is_some_and(|text| text.contains("sigma")));
        gradients.sigma = 0.0;
        let same = gradients.clone();
        gradients.gamma = -0.0;
        assert!(!gradient_bits(&gradients).eq(gradient_bits(&same)) && gradient_bits(&same).eq(gradient_bits(&same)));
    }
}
