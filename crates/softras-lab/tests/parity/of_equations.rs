//! The equations that the tests recompute (`tests/official`) against the recorded outputs.

use crate::cells::{lookups_in_row, undecided_cells};
use crate::official::compare::{axes, max_difference, relative_l2, texel_sum, unmasked};
use crate::official::equations::{Gradient, Image, Triangles, gradient, image};
use crate::recorded::Case;
use crate::{GRADIENT_TOLERANCE, IMAGE_TOLERANCE, SURFACE};

type Vector = [f64; 3];

fn points(values: &[f64]) -> Vec<Vector> {
    values.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect()
}

/// The triangles of each view.
fn triangles(case: &Case) -> Vec<Triangles> {
    let wide = |key: &str| points(&case.archive.f32s(key).into_iter().map(f64::from).collect::<Vec<_>>());
    let (corners, colors) = (wide("face_vertices"), wide("textures"));
    let views = case.cameras.len();
    let (corners, colors) = (corners.chunks(corners.len() / views), colors.chunks(colors.len() / views));
    let surface = case.archive.json("options")["texture_type"] == "surface";
    let of_view = |(corners, colors): (&[Vector], &[Vector])| {
        let corners: Vec<[Vector; 3]> = corners.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
        let resolution = surface.then(|| ((colors.len() / corners.len()) as f64).sqrt() as usize);
        Triangles { corners, colors: colors.to_vec(), resolution }
    };
    corners.zip(colors).map(of_view).collect()
}

/// Images and gradients of each view, one after the other.
fn computed(case: &Case) -> (Image, Gradient) {
    let mut images = Image { color: Vec::new(), silhouette: Vec::new(), undecided: Vec::new() };
    let mut gradients = Gradient { corners: Vec::new(), colors: Vec::new() };
    let upstream = case.upstream();
    let (color, silhouette) = (upstream.d_color.unwrap(), upstream.d_silhouette.unwrap());
    let pixels = (case.settings.width * case.settings.height) as usize;
    for (view, triangles) in triangles(case).iter().enumerate() {
        let made = image(triangles, &case.settings);
        images.color.extend(made.color);
        images.silhouette.extend(made.silhouette);
        images.undecided.extend(made.undecided);
        let color = &color[3 * pixels * view..][..3 * pixels];
        let made = gradient(triangles, &case.settings, color, &silhouette[pixels * view..][..pixels]);
        gradients.corners.extend(made.corners);
        gradients.colors.extend(made.colors);
    }
    (images, gradients)
}

pub fn image_and_gradient(name: &str) {
    let case = Case::open(name);
    let (image, gradient) = computed(&case);
    let official = case.official_image();
    assert!(image.undecided.iter().all(|u| !u));
    let color = max_difference(&image.color, &official.0);
    let silhouette = max_difference(&image.silhouette, &official.1);
    let (ours, theirs) = (gradient.corners.as_flattened().as_flattened(), case.archive.f64s("grad_face_vertices"));
    let xy = relative_l2(&axes(ours, &[0, 1]), &axes(&theirs, &[0, 1]));
    let z = relative_l2(&axes(ours, &[2]), &axes(&theirs, &[2]));
    let textures = relative_l2(gradient.colors.as_flattened(), &case.archive.f64s("grad_textures"));
    println!(
        "equations, {name}: colour {color:.2e}, silhouette {silhouette:.2e}, gradient x, y {xy:.2e}, z {z:.2e}, textures {textures:.2e}"
    );
    assert!(color.max(silhouette) <= IMAGE_TOLERANCE && xy.max(z).max(textures) <= GRADIENT_TOLERANCE, "{name}");
}

pub fn surface() {
    let case = Case::open(SURFACE);
    let (image, gradient) = computed(&case);
    let official = case.official_image();
    let vertices = case.archive.f32s("face_vertices");
    let undecided = undecided_cells(&vertices, &case.settings);
    let color = max_difference(&unmasked(&image.color, &undecided), &unmasked(&official.0, &undecided));
    let silhouette = max_difference(&image.silhouette, &official.1);
    let theirs = case.archive.f64s("grad_textures");
    let faces = gradient.colors.as_flattened().chunks(48).zip(theirs.chunks(48));
    let decided = faces.zip(lookups_in_row(&vertices, &case.settings)).filter(|(_, decided)| *decided);
    let differences: Vec<f64> = decided.map(|((a, b), _)| relative_l2(&texel_sum(a), &texel_sum(b))).collect();
    let texels = differences.iter().fold(0.0, |worst: f64, &d| worst.max(d));
    println!(
        "equations, {SURFACE}: colour {color:.2e}, silhouette {silhouette:.2e}, texel gradient by face {texels:.2e}"
    );
    assert!(color.max(silhouette) <= IMAGE_TOLERANCE && texels <= GRADIENT_TOLERANCE && differences.len() >= 3);
}
