//! One test per hazard of a soft rasterizer's gradient, named after it, each against the f64 reference.

use crate::common::{
    gradient::{
        ALL_OUTPUTS, all_finite, backward, check, made_case, modes, norm, only_pixel, random_upstream,
        reference_gradient, upstream_of,
    },
    random::Random,
    renderer,
    scenes::{Case, separate},
    tolerance::GRADIENT,
};
use glam::DVec3;
use softras::{
    Camera, GradientMode, GradientRequest, Gradients, ImageGradient, Lights, Mesh, Projection, Renderer, Scene,
    Settings,
    scene::{Appearance, Background, Shading, Texture, Wrap},
    shapes,
};

fn settings(width: u32, height: u32) -> Settings {
    Settings {
        width,
        height,
        sigma: 1e-3,
        gamma: 3e-2,
        epsilon: 0.5,
        near: 1.0,
        far: 10.0,
        background_color: [0.2, 0.5, 0.3],
        outputs: ALL_OUTPUTS,
        save: true,
        ..Settings::default()
    }
}

/// Triangles on the screen, each with corners of its own; every corner another colour.
fn on_screen(triangles: &[[[f32; 3]; 3]], settings: Settings) -> Case {
    case(separate(triangles), vec![Camera::screen()], settings)
}

fn case(mesh: Mesh, cameras: Vec<Camera>, settings: Settings) -> Case {
    let random = &mut Random::new(5);
    let colors = (0..mesh.positions().len()).map(|_| random.color()).collect();
    let mesh = mesh.with_appearance(Appearance::VertexColors(colors)).unwrap();
    made_case(Scene::new(mesh), cameras, settings)
}

/// Both modes against the reference, with random weights on every image; the exact gradient.
#[track_caller]
fn assert_agrees(renderer: &mut Renderer, case: &Case) -> Gradients {
    assert_agrees_under(renderer, case, &random_upstream(case, ALL_OUTPUTS))
}

#[track_caller]
fn assert_agrees_under(renderer: &mut Renderer, case: &Case, upstream: &ImageGradient) -> Gradients {
    for &mode in modes() {
        if let Err(error) = check(renderer, case, upstream, mode, &GRADIENT.without_exceptions()) {
            panic!("{error}\n{case:?}{:?}", case.scene);
        }
    }
    backward(renderer, case, upstream, &GradientRequest::ALL).unwrap()
}

#[track_caller]
fn assert_finite(renderer: &mut Renderer, case: &Case, upstream: &ImageGradient) {
    for &mode in modes() {
        let gradients = backward(renderer, case, upstream, &GradientRequest { mode, ..GradientRequest::ALL }).unwrap();
        all_finite(&gradients).unwrap_or_else(|error| panic!("{error}\n{case:?}{:?}", case.scene));
    }
}

fn size_of_vertex(gradients: &Gradients, vertex: usize) -> f64 {
    norm(&gradients.meshes[0].positions[vertex].map(f64::from))
}

const FRONT: [[f32; 3]; 3] = [[-0.71, -0.63, 2.0], [0.69, -0.57, 2.1], [0.03, 0.81, 2.2]];

#[test]
fn occluded_vertex() {
    let hidden = [[-0.31, -0.23, 2.6], [0.29, -0.27, 2.7], [0.01, 0.21, 2.5]];
    let case = on_screen(&[FRONT, hidden], settings(32, 32));
    let upstream = upstream_of(&case, |image, _, _| if image == "color" { [1.0, -0.5, 0.25] } else { [0.0; 3] });
    let gradients = assert_agrees_under(&mut renderer(), &case, &upstream);
    for vertex in 3..6 {
        let size = size_of_vertex(&gradients, vertex);
        assert!(size > 1e-4, "vertex {vertex}, wholly covered by what is in front, has the gradient {size:e}");
    }
}

#[test]
fn far_range_triangle() {
    let mut renderer = renderer();
    // Only a pixel at 0.26 from the triangle, whose reach is 0.3, has a gradient. Then a triangle just before far.
    let near = [[0.51, -0.13, 2.0], [0.83, -0.11, 2.3], [0.67, 0.23, 2.2]];
    let mut case = on_screen(&[near], Settings { sigma: 1e-2, background: Background::Composite, ..settings(32, 32) });
    let upstream = upstream_of(&case, |_, row, column| if (row, column) == (16, 20) { [1.0; 3] } else { [0.0; 3] });
    let gradients = assert_agrees_under(&mut renderer, &case, &upstream);
    assert!(size_of_vertex(&gradients, 0) > 1e-4, "{gradients:?}");
    let far = [[-0.51, -0.53, 9.97], [0.83, -0.41, 9.95], [0.17, 0.63, 9.98]];
    for gamma in [1e-1, 1e-3, 1e-5] {
        case = on_screen(&[near, far], Settings { gamma, epsilon: 0.0, ..settings(32, 32) });
        let gradients = assert_agrees(&mut renderer, &case);
        assert!(size_of_vertex(&gradients, 3) > 1e-3, "gamma {gamma}: {gradients:?}");
    }
}

fn perspective() -> Projection {
    Projection::Perspective { fov_y: 0.9 }
}

/// At the origin, looking along -z.
fn looking_ahead() -> Camera {
    Camera::look_direction(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, perspective()).unwrap()
}

#[test]
fn triangle_behind_the_camera() {
    let ahead = [[-0.81, -0.63, -3.0], [0.79, -0.57, -3.1], [0.03, 0.91, -3.2]];
    let behind = ahead.map(|[x, y, z]| [x, y, -z]);
    let mut case = on_screen(&[ahead, behind], settings(32, 32));
    case.cameras = vec![looking_ahead()];
    let gradients = assert_agrees(&mut renderer(), &case);
    let mesh = &gradients.meshes[0];
    assert_eq!(mesh.positions[3..], [[0.0; 3]; 3]);
    assert_eq!(mesh.colors[3..], [[0.0; 3]; 3]);
    assert!(size_of_vertex(&gradients, 0) > 1e-2);
}

#[test]
fn clipped_triangle() {
    let mut renderer = renderer();
    // Near is 1. One triangle has one corner nearer, one has two, and one has a corner behind the eye.
    let one = [[-0.81, -0.63, -3.0], [0.79, -0.57, -3.1], [0.13, 0.31, -0.4]];
    let two = [[-0.33, -0.23, -0.5], [0.39, -0.27, -0.7], [0.13, 0.61, -2.9]];
    let behind = [[-0.81, -0.63, -3.0], [0.79, -0.57, -3.1], [0.13, 0.31, 2.0]];
    for (name, triangles) in
        [("one", vec![one]), ("two", vec![two]), ("behind", vec![behind]), ("all", vec![one, two, behind])]
    {
        let mut case = on_screen(&triangles, settings(32, 32));
        case.cameras = vec![looking_ahead()];
        case.scene.lights = Lights::official();
        let gradients = assert_agrees(&mut renderer, &case);
        for vertex in 0..3 {
            assert!(size_of_vertex(&gradients, vertex) > 1e-3, "{name}: vertex {vertex}");
        }
    }
}

#[test]
fn shared_edge() {
    let positions = vec![[-0.73, -0.61, 2.0], [0.71, -0.67, 2.3], [0.69, 0.73, 2.1], [-0.67, 0.69, 2.6]];
    let mesh = Mesh::new(positions, vec![[0, 1, 2], [0, 2, 3]]).unwrap();
    let mut renderer = renderer();
    for sigma in [1e-2, 1e-4, 1e-6] {
        let case = case(mesh.clone(), vec![Camera::screen()], Settings { sigma, ..settings(33, 33) });
        assert_agrees(&mut renderer, &case);
    }
}

#[test]
fn degenerate_and_duplicate_triangles() {
    let mut renderer = renderer();
    let [a, b, c] = FRONT;
    // Collinear to the last bit.
    let line = [[-0.484375, -0.3515625, 2.0], [0.515625, 0.3984375, 2.25], [0.015625, 0.0234375, 2.5]];
    let point = [[0.41, 0.43, 2.0]; 3];
    // A triangle twice and turned about, a segment from each of its corners, and triangles with two corners in one place.
    let each = [
        ("duplicates", vec![[a, b, c], [a, b, c], [b, c, a], [c, b, a]]),
        ("line", vec![line]),
        ("line 2", vec![[line[1], line[2], line[0]]]),
        ("line 3", vec![[line[2], line[0], line[1]]]),
        ("two corners in one", vec![[a, a, c], [b, c, c], [a, b, a]]),
    ];
    for (name, triangles) in each {
        let case = on_screen(&triangles, settings(33, 33));
        println!("{name}");
        assert_agrees(&mut renderer, &case);
    }
    let case = on_screen(&[[a, b, c], point, line, [a, a, b]], settings(33, 33));
    for sigma in [1e-2, 1e-5, 1e-8] {
        let case = Case { settings: Settings { sigma, ..case.settings.clone() }, ..case.clone() };
        let upstream = random_upstream(&case, ALL_OUTPUTS);
        assert_finite(&mut renderer, &case, &upstream);
    }
}

#[test]
fn pixel_exactly_on_an_edge_or_a_vertex() {
    let mut renderer = renderer();
    // 17 × 17 pixels: one at the origin, others at multiples of 2 / 17; 16 × 16: at odd multiples of 1 / 16.
    let (a, b) = (1.0 / 16.0, 9.0 / 16.0);
    let through = [
        (17, [[0.0, 0.0, 2.0], [0.5, 0.0, 2.0], [0.0, 0.5, 2.0]]),
        (17, [[-0.5, 0.0, 2.0], [0.5, 0.0, 2.5], [0.0, 0.0, 2.0]]),
        (16, [[a, a, 2.0], [b, a, 2.2], [a, b, 2.4]]),
        (16, [[a, a, 2.0], [b, b, 2.2], [-b, b, 2.4]]),
        (16, [[a, a, 2.0], [a, a, 2.0], [a, a, 2.0]]),
    ];
    for (size, triangle) in through {
        for (sigma, gamma) in [(1e-2, 1e-1), (1e-5, 1e-4), (1e-8, 1e-8)] {
            let case = on_screen(&[triangle], Settings { sigma, gamma, ..settings(size, size) });
            let upstream = upstream_of(&case, |_, row, column| [1.0, -1.0, 0.5].map(|w| w + (row * 7 + column) as f32));
            assert_finite(&mut renderer, &case, &upstream);
        }
    }
}

#[test]
fn non_square_image() {
    let mut renderer = renderer();
    for (width, height) in [(61, 13), (13, 61), (1, 40), (40, 1), (9, 5)] {
        let camera = Camera::look_at(DVec3::new(0.5, 1.0, 3.0), DVec3::ZERO, DVec3::Y, perspective()).unwrap();
        let mesh = shapes::icosphere(0).unwrap();
        assert_agrees(&mut renderer, &case(mesh, vec![camera], settings(width, height)));
    }
}

#[test]
fn rotated_and_off_centre_camera() {
    let mut renderer = renderer();
    let pinhole = Projection::Pinhole { fx: 31.0, fy: 43.0, cx: 9.3, cy: 21.7 };
    for projection in [pinhole, perspective(), Projection::Orthographic { half_height: 1.3 }] {
        let (eye, up) = (DVec3::new(1.7, -2.1, 2.3), DVec3::new(0.9, 0.2, -0.5));
        let camera = Camera::look_at(eye, DVec3::new(0.2, 0.1, -0.1), up, projection).unwrap();
        let mut case = case(shapes::cube().unwrap(), vec![camera], settings(36, 30));
        case.scene.lights = Lights { shading: Shading::Smooth, ..Lights::official() };
        let gradients = assert_agrees(&mut renderer, &case);
        let some = gradients.cameras[0].twist.iter().chain(&gradients.cameras[0].projection[..1]);
        assert!(some.clone().all(|x| x.abs() > 1e-3), "{:?}", gradients.cameras[0]);
    }
}

#[test]
fn weighted_loss_per_pixel() {
    let mut renderer = renderer();
    let case = on_screen(&[FRONT, [[-0.2, 0.9, 3.0], [0.9, 0.1, 2.5], [0.8, 0.83, 1.5]]], settings(24, 24));
    let upstream = random_upstream(&case, ALL_OUTPUTS);
    let whole = assert_agrees_under(&mut renderer, &case, &upstream);
    // The gradient of each pixel alone is the reference's, and their sum is the gradient of all.
    let mut sum = [0.0; 18];
    for pixel in 0..24 * 24 {
        let alone = only_pixel(&upstream, pixel);
        let ours = backward(&mut renderer, &case, &alone, &GradientRequest::default()).unwrap();
        let ours: Vec<f64> = ours.meshes[0].positions.iter().flatten().map(|&x| f64::from(x)).collect();
        sum.iter_mut().zip(&ours).for_each(|(sum, x)| *sum += x);
        if pixel % 13 == 5 {
            let reference = reference_gradient(&case, &alone, GradientMode::Exact).positions(0).to_vec();
            let off = norm(&ours.iter().zip(&reference).map(|(a, b)| a - b).collect::<Vec<_>>());
            assert!(off <= 1e-4 * norm(&reference) + 1e-5, "pixel {pixel}: off by {off:e} of {:e}", norm(&reference));
        }
    }
    let whole: Vec<f64> = whole.meshes[0].positions.iter().flatten().map(|&x| f64::from(x)).collect();
    let off = norm(&sum.iter().zip(&whole).map(|(a, b)| a - b).collect::<Vec<_>>());
    assert!(off < 1e-5 * norm(&whole), "{off:e} of {:e}", norm(&whole));
}

/// An image that repeats across u = 1, and a vertex with two UVs.
#[test]
fn texture_seams() {
    let mut renderer = renderer();
    let positions = vec![[-0.73, -0.61, 2.0], [0.71, -0.67, 2.3], [0.69, 0.73, 2.1], [-0.67, 0.69, 2.6]];
    let mesh = Mesh::new(positions, vec![[0, 1, 2], [0, 2, 3]]).unwrap();
    for wrap in [Wrap::Repeat, Wrap::Clamp] {
        let random = &mut Random::new(9);
        let mut image =
            |w: u32, h: u32| Texture::new(w, h, (0..w * h).map(|_| random.color()).collect(), wrap).unwrap();
        let appearance = Appearance::Textured {
            uvs: vec![[0.81, 0.93], [1.37, 0.88], [1.31, 1.21], [0.77, 1.17], [-0.19, -0.31], [3.31, 2.21]],
            uv_triangles: vec![[0, 1, 2], [4, 5, 3]],
            textures: vec![image(5, 3), image(1, 1)],
            texture_of_triangle: vec![0, 0],
        };
        let mesh = mesh.clone().with_appearance(appearance).unwrap();
        let settings = Settings { far: 10.0, epsilon: 0.0, ..settings(32, 32) };
        let case = made_case(Scene::new(mesh.clone()), vec![Camera::screen()], settings);
        let gradients = assert_agrees(&mut renderer, &case);
        let size = norm(&gradients.meshes[0].uvs[5].map(f64::from));
        assert!(size > 1e-3, "{wrap:?}: the second UV of a vertex has the gradient {size:e}");
        assert!(gradients.meshes[0].texture_texels[1] == [[0.0; 3]], "an image that no triangle shows");
    }
}

#[test]
fn saturated_interior() {
    let mut renderer = renderer();
    for sigma in [1e-4, 1e-6, 1e-8] {
        let case = on_screen(&[FRONT], Settings { sigma, gamma: 1e-4, epsilon: 1e-3, ..settings(48, 48) });
        // Inside, far from every edge, D is 1: gradients come only through the colour and the depth.
        let upstream = upstream_of(&case, |image, row, column| match (image, row, column) {
            ("color" | "depth", 26..=34, 20..=27) => [1.0, -0.3, 0.2 * row as f32],
            _ => [0.0; 3],
        });
        let gradients = assert_agrees_under(&mut renderer, &case, &upstream);
        assert!(size_of_vertex(&gradients, 0) > 1e-3, "sigma {sigma}");
        assert_eq!(gradients.sigma, 0.0);
    }
}

#[test]
fn thousand_overlapping_faces() {
    let random = &mut Random::new(17);
    let mut corner =
        |x: f64, y: f64| [x + random.range(-0.3, 0.3), y + random.range(-0.3, 0.3), random.range(2.0, 8.0)];
    let mut faces = Vec::new();
    for _ in 0..1000 {
        faces.push([corner(-0.6, -0.6), corner(0.6, -0.5), corner(0.0, 0.7)].map(|p| p.map(|x| x as f32)));
    }
    let mut renderer = renderer();
    for (gamma, sigma) in [(1e-1, 1e-2), (1e-3, 1e-4)] {
        let case = on_screen(&faces, Settings { gamma, sigma, ..settings(16, 16) });
        let upstream = random_upstream(&case, ALL_OUTPUTS);
        for &mode in modes() {
            // The crowd's shares are small differences of a pixel's 1000 colours from their mean.
            let errors = check(&mut renderer, &case, &upstream, mode, &GRADIENT).unwrap();
            println!("gamma {gamma}, sigma {sigma}: {errors:?}");
        }
    }
}

/// Triangles whose middle corner is ever closer to the opposite edge: two edges become parallel, and which of them is nearest
/// to a pixel is decided by ever fewer digits of its distances to their lines.
#[test]
fn obtuse_slivers() {
    let mut renderer = renderer();
    for height in [1e-1_f32, 1e-2, 1e-4, 1e-6, 1e-8, 3e-9] {
        let sliver = [[-0.75, -0.375, 2.0], [0.75, 0.375, 2.1], [-0.5 * height, height, 2.2]];
        let case = on_screen(&[sliver], settings(32, 32));
        let upstream = upstream_of(&case, |image, row, column| match image {
            "silhouette" => [(row as f32 * 0.7 + column as f32 * 1.3).sin(); 3],
            _ => [0.0; 3],
        });
        assert_agrees_under(&mut renderer, &case, &upstream);
    }
}
