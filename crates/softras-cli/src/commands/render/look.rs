//! Converts the arguments of `softras render` to [`Settings`].

use super::args::{Alpha, BackgroundMode, DistanceMode, LookArgs, ModeArgs, Output, RenderArgs, SilhouetteMode};
use super::framing::View;
use crate::commands::Failure;
use crate::commands::parse::Swept;
use softras::Settings;
use softras::scene::Outputs;

/// Sigma of the default picture of [`DEFAULT_HEIGHT`] rows.
const DEFAULT_SIGMA: f64 = 1e-5;
const DEFAULT_HEIGHT: f64 = 256.0;

/// The settings of one frame; `step` is the setting that a sweep changes, with its value.
pub fn settings(
    look: &LookArgs,
    modes: &ModeArgs,
    view: &View,
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
        gamma: look.gamma,
        epsilon: look.epsilon,
        tau: look.tau,
        support: look.support.into(),
        near: view.near,
        far: view.far,
        outputs: outputs(wanted),
        color: modes.color_mode.into(),
        silhouette: modes.silhouette_mode.into(),
        distance: modes.distance_mode.into(),
        background: look.background_mode.into(),
        background_color: look.background.map_or([0.0; 3], |b| b.numbers(look.curve())),
        faces: modes.faces.into(),
        interpolation: modes.interpolation.into(),
        ..Settings::default()
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

/// The settings of the frame with the widest blur: of a sweep's ends the one that reaches farther.
pub fn widest(args: &RenderArgs, view: &View) -> Settings {
    let step = args.sweep.map(|sweep| match sweep.swept {
        Swept::Tau => (sweep.swept, sweep.from.min(sweep.to)),
        _ => (sweep.swept, sweep.from.max(sweep.to)),
    });
    settings(&args.look, &args.modes, view, &args.output, 1, step)
}

/// Whether alpha is 1 inside of surfaces in pictures: unless the softness of edges or the model's own values were asked for.
pub fn is_solid(args: &RenderArgs) -> bool {
    let look = &args.look;
    let swept = args.sweep.is_some_and(|s| matches!(s.swept, Swept::Sigma | Swept::Blur));
    let asked_soft = look.raw || look.sigma.is_some() || look.blur.is_some() || swept;
    args.alpha.map_or(has_usual_modes(args) && !asked_soft, |alpha| alpha == Alpha::Solid)
}

/// Whether the silhouette is the one whose least value inside of a surface is known, and colour fades with it.
fn has_usual_modes(args: &RenderArgs) -> bool {
    args.modes.silhouette_mode == SilhouetteMode::Product
        && args.modes.distance_mode == DistanceMode::Euclidean
        && args.look.background_mode == BackgroundMode::Composite
}

/// Refuses to make alpha solid in modes in which that is not known how.
///
/// # Errors
/// [`Failure::Usage`] naming the modes.
pub fn validate_alpha(args: &RenderArgs) -> Result<(), Failure> {
    if args.alpha == Some(Alpha::Solid) && !has_usual_modes(args) {
        let needs = "needs --silhouette-mode product, --distance-mode euclidean and --background-mode composite";
        return Err(Failure::Usage(format!("--alpha solid: {needs}")));
    }
    Ok(())
}

/// The images to render. The silhouette is always one of them: it is the alpha of every picture.
fn outputs(wanted: &[Output]) -> Outputs {
    Outputs {
        color: wanted.contains(&Output::Color),
        silhouette: true,
        depth: wanted.contains(&Output::Depth),
        normal: wanted.contains(&Output::Normal),
    }
}
