//! Which triangles a hard renderer would draw.

use softras::scene::{Appearance, Camera, ColorAggregation, Mesh, Outputs, Scene, Settings};
use softras::{Renderer, Result};

/// For each triangle whether a hard rasterization of the settings' size shows it at the centre of a pixel or more.
pub fn visible_triangles(
    renderer: &mut Renderer,
    mesh: &Mesh,
    camera: &Camera,
    settings: &Settings,
) -> Result<Vec<bool>> {
    let count = mesh.triangles().len();
    // Every triangle in a colour of its own: its number, counted from 1.
    let texels = (1..=count).map(|t| [t as f32, 0.0, 0.0]).collect();
    let numbered = mesh.clone().with_appearance(Appearance::Surface { resolution: 1, texels })?;
    let settings = Settings {
        color: ColorAggregation::Hard,
        sigma: 1e-7,
        background_color: [0.0; 3],
        outputs: Outputs { color: true, silhouette: false, depth: false, normal: false },
        save: false,
        ..settings.clone()
    };
    let frame = renderer.render(&Scene::new(numbered), &[*camera], &settings)?;
    let mut visible = vec![false; count];
    for number in frame.color()?.data.iter().step_by(3) {
        if let Some(seen) = (number.round() as usize).checked_sub(1).and_then(|t| visible.get_mut(t)) {
            *seen = true;
        }
    }
    Ok(visible)
}
