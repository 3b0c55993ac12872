//! The ranges that the values of images must lie in.

use super::draw::Case;
use super::outcome::Outcome;
use softras::scene::{Appearance, Lights, Parity};
use softras::{Frame, Image, Settings};

/// The least and the greatest possible value of each colour channel.
pub(super) type Hull = [[f64; 2]; 3];

/// Checks that every value is finite and in its range: colours within each view's hull, silhouettes in [0, 1], depths in
/// [0, far], components of normals in [-1, 1].
pub(super) fn bounds(frame: &Frame, settings: &Settings, hulls: &[Hull], outcome: &mut Outcome) {
    for (name, image) in frame.images() {
        let ranges = match name {
            "color" => hulls,
            "silhouette" => &[[[0.0, 1.0]; 3]],
            "depth" => &[[[0.0, settings.far]; 3]],
            _ => &[[[-1.0, 1.0]; 3]],
        };
        if let Some(i) = image.data.iter().position(|x| !x.is_finite()) {
            outcome.find("not finite", format!("{name}, value {i} is {}", image.data[i]));
        } else if let Some((i, [low, high])) = outside(image, ranges, name != "silhouette") {
            outcome.find("range", format!("{name}, value {i} is {}, not in {low} to {high}", image.data[i]));
        }
    }
}

/// The first value that lies outside its channel's range, with that range. There is one hull per view, or one for all
/// views; where `rounded`, values may exceed it by rounding errors.
fn outside(image: &Image, hulls: &[Hull], rounded: bool) -> Option<(usize, [f64; 2])> {
    let size = (image.data.len() / hulls.len()).max(1);
    for ((view, values), hull) in image.data.chunks(size).enumerate().zip(hulls) {
        for (i, (&x, [low, high])) in values.iter().zip(hull.iter().take(image.channels).cycle()).enumerate() {
            let slack = if rounded { 1e-5 * low.abs().max(high.abs()) } else { 0.0 };
            if f64::from(x) < low - slack || f64::from(x) > high + slack {
                return Some((view * size + i, [*low, *high]));
            }
        }
    }
    None
}

/// The range of each channel over the background and all colours under all lights.
pub(super) fn color_hull(case: &Case) -> Hull {
    let colors: Vec<[f32; 3]> = case.scene.meshes.iter().flat_map(|mesh| colors_of(mesh.appearance())).collect();
    std::array::from_fn(|channel| {
        let light = light_hull(&case.scene.lights, channel);
        let lit = colors.iter().flat_map(|c| light.map(|light| f64::from(c[channel]) * light));
        let background = case.settings.background_color[channel];
        // The official lookup reads black beyond the cells of the last triangle.
        let nothing = (case.settings.parity == Parity::Official).then_some(0.0);
        lit.chain(nothing).fold([background; 2], |[low, high], x| [low.min(x), high.max(x)])
    })
}

fn colors_of(appearance: &Appearance) -> Vec<[f32; 3]> {
    match appearance {
        Appearance::Uniform(color) => vec![*color],
        Appearance::VertexColors(colors) => colors.clone(),
        Appearance::Surface { texels, .. } => texels.clone(),
        Appearance::Textured { textures, .. } => textures.iter().flat_map(|t| t.texels().to_vec()).collect(),
    }
}

/// The least and the greatest light: ambient alone, and ambient with every light at normal incidence.
fn light_hull(lights: &Lights, channel: usize) -> [f64; 2] {
    let ambient = lights.ambient_color[channel] * lights.ambient_intensity;
    let direct: f64 = lights.directional.iter().map(|light| light.color[channel] * light.intensity).sum();
    [ambient, ambient + direct]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_out_of_range_are_found() {
        let image = |data: Vec<f32>| Image { batch: 1, height: 1, width: data.len(), channels: 1, data };
        assert_eq!(outside(&image(vec![0.0, 1.0]), &[[[0.0, 1.0]; 3]], false), None);
        assert_eq!(outside(&image(vec![0.0, 1.0000001]), &[[[0.0, 1.0]; 3]], false), Some((1, [0.0, 1.0])));
        assert_eq!(outside(&image(vec![-1e-7]), &[[[0.0, 1.0]; 3]], true), None);
        let (narrow, wide) = ([[0.0, 1.0]; 3], [[0.0, 2.0]; 3]);
        assert_eq!(outside(&image(vec![1.0, 1.5, 1.5, 1.5]), &[narrow, wide], true), Some((1, [0.0, 1.0])));
        assert_eq!(outside(&image(vec![1.0, 1.0, 1.5, 1.5]), &[narrow, wide], true), None);
        assert_eq!(outside(&image(vec![1.1]), &[[[0.0, 1.0]; 3]], true), Some((0, [0.0, 1.0])));
    }
}
