//! The kernels against the recorded outputs.

use crate::official::compare::{median_face, relative_l2};
use crate::recorded::Case;
use softras::{GradientMode, GradientRequest, Renderer, Settings};
use softras_check::agreement::numbers;

/// The image: within 2e-4 in all but few values. The gradient: as near as the official float32 run. In a surface texture rounding
/// decides which cell gets it.
pub fn scene(case: &Case) {
    let name = &case.name;
    let mut renderer = Renderer::new().unwrap();
    let settings = Settings { save: true, ..case.settings.clone() };
    let frame = renderer.render(&case.scene, &case.cameras, &settings).unwrap();
    let ours = [&frame.color().unwrap().data[..], &frame.silhouette().unwrap().data].concat();
    let (color, silhouette) = case.official_image();
    let theirs = [color, silhouette].concat();
    assert_eq!(ours.len(), theirs.len(), "{name}");
    let close = ours.iter().zip(&theirs).filter(|(a, b)| (f64::from(**a) - **b).abs() <= 2e-4).count();
    let part = close as f64 / ours.len() as f64;
    println!("kernels, {name}: {part} of the values agree");
    assert!(part >= 0.995, "{name}: {part}");
    if case.is_surface() {
        return;
    }
    let mode = GradientMode::Paper;
    let wanted = GradientRequest { positions: true, colors: true, mode, ..GradientRequest::NOTHING };
    let gradients = numbers(&renderer.backward(&frame, &case.image_gradient(), &wanted).unwrap());
    let all = |name| gradients.iter().filter(|(n, _)| *n == name).flat_map(|(_, v)| v.clone()).collect::<Vec<f64>>();
    let (ours, theirs) = (all("positions"), case.archive.f64s("grad_face_vertices"));
    let (median, whole) = (median_face(&ours, &theirs), relative_l2(&ours, &theirs));
    let single = relative_l2(&case.archive.f64s("grad_face_vertices_f32"), &theirs);
    let textures = relative_l2(&all("colors"), &case.archive.f64s("grad_textures"));
    println!(
        "kernels, {name}: median face {median:.1e}, whole {whole:.1e}, official float32 {single:.1e}, textures {textures:.1e}"
    );
    assert!(median < 1e-3, "{name}: median face {median:e}");
    assert!(whole <= single, "{name}: {whole:e}, the official float32 run {single:e}");
    assert!(textures < 1e-3, "{name}: textures {textures:e}");
}
