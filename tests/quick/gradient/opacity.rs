//! Opacity: the kernels against the f64 reference in every mode, and opaque frames against frames that know no opacity.

use crate::common::{
    compare::{compare_frames, same_bits},
    gradient::{ALL_OUTPUTS, backward, check, random_upstream, small_case},
    modes::{cut_out, in_every_mode},
    renderer, renderer_with,
    scenes::{Case, Kind},
    tier,
    tolerance::{self, GRADIENT},
};
use softras::{
    GradientMode, GradientRequest, Projection, Renderer, RendererOptions,
    scene::{Appearance, Background, Outputs},
};
use softras_reference::render_culled;

/// One camera before one lit blob or soup, every image asked for.
fn base(seed: u64) -> Case {
    let usable = |case: &Case| {
        case.cameras.len() == 1
            && case.scene.meshes[0].triangles().len() > 20
            && matches!(case.cameras[0].projection(), Projection::Perspective { .. })
            && !case.scene.lights.directional.is_empty()
    };
    let mut case = (seed..).map(|seed| small_case(seed, Kind::Plain)).find(usable).unwrap();
    case.settings.outputs = ALL_OUTPUTS;
    case.settings.background = Background::Weighted;
    (case.settings.sigma, case.settings.gamma, case.settings.epsilon) = (1e-3, 1e-2, 0.9);
    case
}

const MODES: [GradientMode; 2] = [GradientMode::Exact, GradientMode::Paper];

/// Whether there was a gradient by alpha.
fn image_and_gradients_agree(
    renderer: &mut Renderer,
    case: &Case,
    images: Outputs,
    modes: &[GradientMode],
) -> Result<bool, String> {
    let frame = renderer.render(&case.scene, &case.cameras, &case.settings).map_err(|e| e.to_string())?;
    let reference = render_culled(&case.scene, &case.cameras, &case.settings).unwrap();
    compare_frames(&frame, &reference, &tolerance::of(case))?;
    let upstream = random_upstream(case, images);
    let mut compared = false;
    for mode in modes {
        let errors = check(renderer, case, &upstream, *mode, &GRADIENT)?;
        compared |= errors.iter().any(|(name, _)| *name == "texture alpha");
    }
    Ok(compared)
}

/// A few modes in the quick tier, beside `modes`. Losses on all images together or, in every third mode, on the silhouette alone, whose gradient goes through the texture
/// all the same; the paper's gradient in every other mode, because each of the two has kernels of its own to compile.
#[test]
fn every_mode_with_cut_outs() {
    let mut renderer = renderer();
    let (mut failures, mut compared_alphas) = (Vec::new(), 0);
    for (i, (name, mut case)) in in_every_mode(&base(11)).take(tier(2, usize::MAX)).enumerate() {
        cut_out(&mut case);
        let rendered = case.settings.outputs;
        let alone = rendered.silhouette && i % 3 == 1;
        let silhouette = Outputs::SILHOUETTE;
        let images = if alone { silhouette } else { rendered };
        match image_and_gradients_agree(&mut renderer, &case, images, &MODES[..1 + i % 2]) {
            // Hard images have none.
            Ok(compared) => compared_alphas += u32::from(compared),
            Err(error) => failures.push(format!("{name}, of the silhouette alone {alone}: {error}")),
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
    assert!(compared_alphas > tier(1, 25), "{compared_alphas}");
}

/// Lanes that share records by shuffles, that share them through memory, and that share nothing.
#[test]
fn every_number_of_lanes() {
    let mut case = base(11);
    cut_out(&mut case);
    let mut first = None;
    for &lanes in tier(&[1][..], &[1, 4, 8, 32]) {
        let mut renderer = renderer_with(RendererOptions { lanes: Some(lanes), ..RendererOptions::default() });
        assert_eq!(
            image_and_gradients_agree(&mut renderer, &case, ALL_OUTPUTS, &MODES[..tier(1, 2)]),
            Ok(true),
            "{lanes} lanes"
        );
        let frame = renderer.render(&case.scene, &case.cameras, &case.settings).unwrap();
        same_bits(first.get_or_insert_with(|| frame.clone()), &frame).unwrap();
    }
}

/// A texture whose alpha is 1 throughout is an opaque one: the same bits, and no gradient by alpha.
#[test]
fn an_alpha_of_1_changes_no_bit() {
    let mut renderer = renderer();
    let mut faded = base(11);
    cut_out(&mut faded);
    let of_alpha = |alpha: Option<f32>| {
        let mut case = faded.clone();
        let mesh = case.scene.meshes.remove(0);
        let mut appearance = mesh.appearance().clone();
        if let Appearance::Textured { textures, .. } = &mut appearance {
            for texture in textures {
                let opaque = texture.clone().with_alpha(vec![1.0; texture.texels().len()]).unwrap();
                let values = alpha.map(|alpha| vec![alpha; texture.texels().len()]);
                *texture = values.map_or(opaque.clone(), |values| opaque.with_alpha(values).unwrap());
            }
        }
        case.scene.meshes.push(mesh.with_appearance(appearance).unwrap());
        case
    };
    let [bare, opaque, other] = [None, Some(1.0), Some(0.75)].map(of_alpha);
    let upstream = random_upstream(&bare, ALL_OUTPUTS);
    let mut run = |case: &Case| {
        let frame = renderer.render(&case.scene, &case.cameras, &case.settings).unwrap();
        (frame, backward(&mut renderer, case, &upstream, &GradientRequest::ALL).unwrap())
    };
    let [(frame, gradients), (same_frame, same_gradients), (other_frame, other_gradients)] =
        [&bare, &opaque, &other].map(&mut run);
    same_bits(&frame, &same_frame).unwrap();
    assert_eq!(gradients, same_gradients);
    assert!(gradients.meshes[0].texture_alphas.iter().all(Vec::is_empty));
    same_bits(&frame, &other_frame).unwrap_err();
    assert!(other_gradients.meshes[0].texture_alphas.iter().all(|alpha| alpha.iter().any(|a| *a != 0.0)));
    // And after frames with opacity, those without are the same again.
    same_bits(&frame, &run(&bare).0).unwrap();
}
