//! Converts the device's gradients to the reference's layout, so that all other code handles one layout only.

use softras::MeshGradients;
use softras::{Camera, Error, Gradients, Image, ImageGradient, Result, Scene, Settings};
use softras_reference::{Parameters, Upstream};

/// dL/dimage in the form that the reference takes.
pub fn upstream(images: &ImageGradient) -> Upstream {
    let exact = |image: &Option<Image>| image.as_ref().map(|i| i.data.iter().copied().map(f64::from).collect());
    Upstream {
        d_color: exact(&images.color),
        d_silhouette: exact(&images.silhouette),
        d_depth: exact(&images.depth),
        d_normal: exact(&images.normal),
    }
}

/// The device's gradients in the reference's layout, 0 for gradients that were not requested.
///
/// # Errors
/// [`Error::Backward`] when a gradient does not have as many values as its input.
pub fn as_parameters(
    gradients: &Gradients,
    scene: &Scene,
    cameras: &[Camera],
    settings: &Settings,
) -> Result<Parameters> {
    let mut parameters = Parameters::new(scene, cameras, settings);
    let mut flat = Flat(Vec::with_capacity(parameters.values().len()));
    let none = MeshGradients::default();
    for index in 0..scene.meshes.len() {
        let mesh = gradients.meshes.get(index).unwrap_or(&none);
        flat.put(mesh.positions.as_flattened(), parameters.positions(index).len())?;
        flat.put(mesh.colors.as_flattened(), parameters.colors(index).len())?;
        flat.put(mesh.surface_texels.as_flattened(), parameters.surface_texels(index).len())?;
        flat.put(mesh.uvs.as_flattened(), parameters.uvs(index).len())?;
        for texture in 0..textures(scene, index) {
            let texels = mesh.texture_texels.get(texture).map_or(&[][..], |t| t.as_flattened());
            flat.put(texels, parameters.texture_texels(index, texture).len())?;
        }
    }
    for view in 0..cameras.len() {
        let camera = gradients.cameras.get(view).copied().unwrap_or_default();
        flat.0.extend(camera.twist);
        flat.0.extend(&camera.projection[..parameters.projection(view).len()]);
    }
    let lights = gradients.lights.clone().unwrap_or_default();
    flat.0.extend(lights.ambient_color.into_iter().chain([lights.ambient_intensity]));
    for light in 0..scene.lights.directional.len() {
        let (direction, color, intensity) = lights.directional.get(light).copied().unwrap_or_default();
        flat.0.extend(direction.into_iter().chain(color).chain([intensity]));
    }
    flat.0.extend(gradients.background_color);
    flat.0.extend([gradients.sigma, gradients.gamma, gradients.epsilon]);
    check_count(flat.0.len(), parameters.values().len())?;
    parameters.values_mut().copy_from_slice(&flat.0);
    Ok(parameters)
}

fn textures(scene: &Scene, mesh: usize) -> usize {
    match scene.meshes[mesh].appearance() {
        softras::scene::Appearance::Textured { textures, .. } => textures.len(),
        _ => 0,
    }
}

/// Derivatives in the order of [`Parameters`].
struct Flat(Vec<f64>);

impl Flat {
    /// Appends the values, which must be as many as expected; without values it appends zeros.
    fn put(&mut self, values: &[f32], expected: usize) -> Result<()> {
        if values.is_empty() {
            self.0.resize(self.0.len() + expected, 0.0);
            return Ok(());
        }
        check_count(values.len(), expected)?;
        self.0.extend(values.iter().copied().map(f64::from));
        Ok(())
    }
}

fn check_count(count: usize, expected: usize) -> Result<()> {
    if count == expected {
        return Ok(());
    }
    Err(Error::Backward {
        what: format!("a gradient of {count} values came back for an input of {expected}"),
        fix: "this is a bug in softras: please report it".into(),
    })
}
