//! Opaque frames against frames that know no opacity.

use crate::common::{
    compare::same_bits,
    gradient::{ALL_OUTPUTS, made, random_upstream},
    modes::cut_out,
    renderer,
    scenes::Case,
};
use crate::modes::mode_base;
use softras::{GradientRequest, scene::Appearance};

/// A texture whose alpha is 1 throughout is an opaque one: the same bits, and no gradient by alpha.
#[test]
fn an_alpha_of_1_changes_no_bit() {
    let mut renderer = renderer();
    let mut faded = mode_base(11);
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
    let mut run = |case: &Case| made(&mut renderer, case, &upstream, &GradientRequest::ALL).unwrap();
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
