//! Converts options to [`Settings`].

use crate::{
    framing::Viewpoint,
    options::{Look, Output, Swept},
};
use softras::{
    Settings,
    scene::{ColorAggregation, Distance, Outputs, SilhouetteAggregation},
};

/// Sigma of the default picture of [`DEFAULT_HEIGHT`] rows.
const DEFAULT_SIGMA: f64 = 1e-5;
const DEFAULT_HEIGHT: f64 = 256.0;

/// The settings of one frame; `step` is the setting that a sweep changes, with its value.
pub fn settings(
    look: &Look,
    view: &Viewpoint,
    wanted: &[Output],
    samples: u32,
    step: Option<(Swept, f64)>,
) -> Settings {
    let (width, height) = (look.size.0 * samples, look.size.1 * samples);
    // Sigma is in units of the image's height, so the same blur in pixels needs a smaller sigma in larger images.
    let scaled = DEFAULT_SIGMA * (DEFAULT_HEIGHT / f64::from(height)).powi(2);
    let mut settings = Settings {
        width,
        height,
        sigma: look.sigma.unwrap_or(scaled),
        near: view.near,
        far: view.far,
        outputs: outputs(wanted),
        background_color: look.background.unwrap_or_default(),
        ..look.model.clone()
    };
    // The blur is given in pixels of the picture.
    let rendered = f64::from(samples);
    let mut blur = look.blur;
    match step {
        Some((Swept::Sigma, value)) => (settings.sigma, blur) = (value, None),
        Some((Swept::Gamma, value)) => settings.gamma = value,
        Some((Swept::Tau, value)) => settings.tau = value,
        Some((Swept::Blur, value)) => blur = Some(value),
        None => {}
    }
    match blur {
        Some(pixels) => settings.with_blur_pixels(pixels * rendered),
        None => settings,
    }
}

/// The settings with hard modes, where each sample shows what it hits.
pub fn sharp(settings: Settings) -> Settings {
    Settings {
        color: ColorAggregation::Hard,
        silhouette: SilhouetteAggregation::Hard,
        distance: Distance::Hard,
        ..settings
    }
}

/// The images to render. The silhouette is always one of them: it is the alpha of every picture.
fn outputs(wanted: &[Output]) -> Outputs {
    Outputs {
        color: wanted.contains(&Output::Color),
        silhouette: true,
        depth: wanted.contains(&Output::Depth),
        normal: wanted.contains(&Output::Normal),
        features: false,
    }
}
