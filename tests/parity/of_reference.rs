//! The f64 reference against the recorded outputs.

use crate::cells::{lookups_in_row, undecided_cells};
use crate::official::compare::{axes, max_difference, relative_l2, texel_sum, unmasked};
use crate::recorded::{Archive, Case, soup, split_planes};
use crate::{GRADIENT_TOLERANCE, IMAGE_TOLERANCE};
use softras::scene::{Camera, Parity, Projection, Scene, Settings};
use softras_reference::{GradientMode, Truncation, gradient, render, render_culled};

/// Most pairs of a triangle and a pixel that brute force takes.
const PAIRS: usize = 10_000_000;

pub fn scene(case: &Case) {
    if case.is_surface() {
        return surface(case);
    }
    let name = &case.name;
    let triangles: usize = case.scene.meshes.iter().map(|mesh| mesh.triangles().len()).sum();
    let frame = if triangles * (case.settings.width * case.settings.height) as usize <= PAIRS {
        render(&case.scene, &case.cameras, &case.settings, Truncation::Tau).unwrap()
    } else {
        render_culled(&case.scene, &case.cameras, &case.settings).unwrap()
    };
    let official = case.official_image();
    let color = max_difference(&frame.color, &official.0);
    let silhouette = max_difference(&frame.silhouette, &official.1);
    println!("{name}: colour {color:.2e}, silhouette {silhouette:.2e}");
    assert!(color.max(silhouette) <= IMAGE_TOLERANCE, "{name}: colour {color:e}, silhouette {silhouette:e}");
    let ours = gradient(&case.scene, &case.cameras, &case.settings, &case.upstream(), GradientMode::Paper).unwrap();
    let meshes = 0..case.scene.meshes.len();
    let positions: Vec<f64> = meshes.clone().flat_map(|m| ours.positions(m).to_vec()).collect();
    let colors: Vec<f64> = meshes.flat_map(|m| ours.colors(m).to_vec()).collect();
    let official = case.archive.f64s("grad_face_vertices");
    let xy = relative_l2(&axes(&positions, &[0, 1]), &axes(&official, &[0, 1]));
    let z = relative_l2(&axes(&positions, &[2]), &axes(&official, &[2]));
    let texture = relative_l2(&colors, &case.archive.f64s("grad_textures"));
    println!("{name}: gradient x, y {xy:.2e}, z {z:.2e}, textures {texture:.2e}");
    assert!(xy.max(z).max(texture) <= GRADIENT_TOLERANCE, "{name}");
}

/// Rounding decides which cell a pixel looks up, so that only decided pixels and the sums of each face's gradients are compared.
fn surface(case: &Case) {
    let frame = render(&case.scene, &case.cameras, &case.settings, Truncation::Tau).unwrap();
    let official = case.official_image();
    let undecided = undecided_cells(&case.archive.f32s("face_vertices"), &case.settings);
    let compared = undecided.iter().filter(|u| !**u).count();
    let color = max_difference(&unmasked(&frame.color, &undecided), &unmasked(&official.0, &undecided));
    println!("{}: colour {color:.2e} on {compared} of {} pixels", case.name, undecided.len());
    assert!(color < IMAGE_TOLERANCE && compared > 512, "{color:e} on {compared}");
    assert!(max_difference(&frame.silhouette, &official.1) < IMAGE_TOLERANCE);
    let ours = gradient(&case.scene, &case.cameras, &case.settings, &case.upstream(), GradientMode::Paper).unwrap();
    let official = case.archive.f64s("grad_textures");
    let decided = lookups_in_row(&case.archive.f32s("face_vertices"), &case.settings);
    let texels = ours.surface_texels(0).len() / decided.len();
    let faces = ours.surface_texels(0).chunks(texels).zip(official.chunks(texels)).zip(&decided);
    let faces = faces.filter(|(_, decided)| **decided);
    let differences: Vec<f64> = faces.map(|((a, b), _)| relative_l2(&texel_sum(a), &texel_sum(b))).collect();
    let worst = differences.iter().fold(0.0, |worst: f64, &d| worst.max(d));
    println!("{}: texel gradient summed by face {worst:.2e} on {} faces", case.name, differences.len());
    assert!(worst < GRADIENT_TOLERANCE && differences.len() >= 3, "{differences:?}");
}

pub fn render_demo() {
    let archive = Archive::open("spot_demo_render.npz");
    let light = archive.f32s("light");
    let unlit = archive.f32s("textures_unlit_u16");
    let lit: Vec<f32> = unlit.iter().enumerate().map(|(i, t)| t / 65535.0 * light[i / 75]).collect();
    let vertices = archive.f32s("face_vertices");
    let scene = Scene::new(soup(&vertices, &lit, true));
    let settings = Settings { parity: Parity::Official, ..Settings::default() };
    let frame = render_culled(&scene, &[Camera::screen()], &settings).unwrap();
    let image: Vec<f64> = archive.f32s("image").into_iter().map(f64::from).collect();
    let (color, silhouette) = split_planes(&image, 256 * 256);
    let undecided = undecided_cells(&vertices, &settings);
    let (ours, official) = (unmasked(&frame.color, &undecided), unmasked(&color, &undecided));
    let mean = ours.iter().zip(&official).map(|(a, b)| (a - b).abs()).sum::<f64>() / ours.len() as f64;
    let inside = undecided.iter().zip(&silhouette).filter(|(u, a)| !**u && **a > 0.5).count();
    println!("render demo: mean colour difference {mean:.2e}, {inside} pixels of the object compared");
    // Textures were stored to 16 bits.
    assert!(mean < 2e-5 && inside > 100, "{mean:e} on {inside}");
    let worst = max_difference(&frame.silhouette, &silhouette);
    assert!(worst < 1e-6, "silhouette {worst:e}");
}

/// The official camera at (2.732, 30°, 40°), 30° wide to each side. It mirrors: its x axis points to the left of the image.
pub fn camera() {
    let archive = Archive::open("pipeline.npz");
    let points = |key: &str| archive.f64s(key).chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect::<Vec<_>>();
    let camera = Camera::from_angles(2.732, 30.0, 40.0, Projection::Perspective { fov_y: 60f64.to_radians() }).unwrap();
    let view = |p: [f64; 3]| camera.to_view(p.into()).to_array();
    let screen = |p: [f64; 3]| camera.project(p.into(), (2, 2)).unwrap();
    let vertices = points("vertices");
    for (key, ours) in [
        ("look_at", vertices.iter().map(|&p| view(p)).map(|[x, y, z]| [-x, y, z]).collect::<Vec<_>>()),
        ("perspective30", vertices.iter().map(|&p| screen(p)).map(|[x, y, z]| [1.0 - x, 1.0 - y, z]).collect()),
    ] {
        let difference = max_difference(ours.as_flattened(), points(key).as_flattened());
        println!("camera, {key}: {difference:.2e}");
        assert!(difference < 1e-12, "{key}: {difference:e}");
    }
}
