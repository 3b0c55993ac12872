//! Geometry, sizes and numbers at the edge of what there is, against the reference.

use crate::common::{
    compare::compare_frames,
    random::Random,
    renderer,
    scenes::{Kind, small, soup, triangles},
    tolerance::{self, Tolerance},
};
use glam::DVec3;
use softras::{
    Camera, Frame, Lights, Mesh, Projection, Renderer, Scene, Settings,
    scene::{Appearance, Background, ColorAggregation, Distance, Outputs},
    shapes,
};
use softras_reference::render_culled;

#[track_caller]
fn against_reference(renderer: &mut Renderer, scene: &Scene, camera: Camera, settings: &Settings) -> Frame {
    against_reference_within(renderer, scene, camera, settings, &tolerance::IMAGE)
}

#[track_caller]
fn against_reference_within(
    renderer: &mut Renderer,
    scene: &Scene,
    camera: Camera,
    settings: &Settings,
    tolerance: &Tolerance,
) -> Frame {
    let frame = renderer.render(scene, &[camera], settings).unwrap();
    let reference = render_culled(scene, &[camera], settings).unwrap();
    compare_frames(&frame, &reference, tolerance).unwrap_or_else(|e| panic!("{e}\n{settings:?}"));
    frame
}

/// Faces much smaller than a pixel. The official kernels' D is off by more than 0.01 for 72 % of such fragments.
#[test]
fn small_faces_keep_their_edges() {
    const SIDE: u32 = 64;
    let edge: f64 = 0.003;
    let settings = Settings {
        width: SIDE,
        height: SIDE,
        sigma: (0.3 * edge).powi(2),
        outputs: Outputs::SILHOUETTE,
        ..Settings::default()
    };
    let random = &mut Random::new(1);
    // One triangle around each pixel's centre, too small to reach the next: the silhouette is its D.
    let mut on_screen = Vec::new();
    for pixel in 0..SIDE * SIDE {
        let centre = [pixel % SIDE, SIDE - 1 - pixel / SIDE].map(|i| f64::from(2 * i + 1) / f64::from(SIDE) - 1.0);
        let middle = [(); 2].map(|()| random.range(-0.8, 0.8) * edge);
        let turn = random.range(0.0, 6.3);
        on_screen.push([0.0, 2.1, 4.2].map(|corner: f64| {
            let (sin, cos) = (turn + corner).sin_cos();
            let radius = edge / 3f64.sqrt();
            [centre[0] + middle[0] + radius * cos, centre[1] + middle[1] + radius * sin]
        }));
    }
    let renderer = &mut renderer();
    let fov_y: f64 = 0.7;
    let eye = Camera::look_at(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, Projection::Perspective { fov_y });
    for (camera, lift) in [(Camera::screen(), 1.0), (eye.unwrap(), 4.9 * (fov_y / 2.0).tan())] {
        let z = if lift == 1.0 { 5.0 } else { 0.1 };
        let corners: Vec<_> =
            on_screen.iter().map(|t| t.map(|[x, y]| [(x * lift) as f32, (y * lift) as f32, z as f32])).collect();
        let scene = Scene::new(triangles(&corners));
        let frame = renderer.render(&scene, &[camera], &settings).unwrap();
        let reference = render_culled(&scene, &[camera], &settings).unwrap();
        let errors =
            frame.silhouette().unwrap().data.iter().zip(&reference.silhouette).map(|(a, b)| (f64::from(*a) - b).abs());
        let far_off = errors.filter(|error| error.is_nan() || *error > tolerance::SMALL_FACE).count();
        let partial = reference.silhouette.iter().filter(|d| (0.01..0.99).contains(*d)).count();
        assert!(partial > 2000, "only {partial} fragments at an edge");
        let all = reference.silhouette.len();
        assert!(far_off * 1000 <= all, "{far_off} of {all} fragments are off");
    }
}

#[test]
fn triangles_without_area_are_segments_and_points() {
    let [a, b, c] = [[-0.6, -0.5, 3.0], [0.7, 0.4, 4.0], [0.1, 0.6, 5.0]];
    let middle = [(a[0] + b[0]) / 2.0, (a[1] + b[1]) / 2.0, (a[2] + b[2]) / 2.0];
    let scene = Scene::new(triangles(&[[a, a, b], [a, b, a], [b, a, a], [c, c, c], [a, middle, b], [a, b, middle]]));
    let renderer = &mut renderer();
    for distance in [Distance::Euclidean, Distance::Barycentric, Distance::Hard] {
        for sigma in [1e-6, 1e-2] {
            let settings = Settings { distance, sigma, ..small(40, 30) };
            let frame = against_reference(renderer, &scene, Camera::screen(), &settings);
            assert!(frame.color().unwrap().data.iter().all(|x| x.is_finite()));
        }
    }
}

#[test]
fn the_same_triangle_again_counts_again() {
    let triangle = [[-0.6, -0.5, 3.0], [0.7, -0.4, 4.0], [0.1, 0.6, 5.0]];
    let renderer = &mut renderer();
    for color in [ColorAggregation::Softmax, ColorAggregation::Hard] {
        let settings = Settings { color, sigma: 1e-2, ..small(40, 30) };
        // Five equal depths make no jump in the hard mode: the first triangle is the nearest.
        let all = Tolerance { margin: 0.0, ..tolerance::IMAGE };
        let scene = Scene::new(triangles(&[triangle; 5]));
        let five = against_reference_within(renderer, &scene, Camera::screen(), &settings, &all);
        let one = against_reference(renderer, &Scene::new(triangles(&[triangle])), Camera::screen(), &settings);
        for (five, one) in five.silhouette().unwrap().data.iter().zip(&one.silhouette().unwrap().data) {
            assert!((five - (1.0 - (1.0 - one).powi(5))).abs() < 1e-5 || *one < 1e-3, "{five} from {one}");
        }
    }
}

/// A floor from behind the viewer to the horizon.
fn floor() -> Mesh {
    let mut corners = Vec::new();
    for (x, z) in (0..64).map(|i| ((i % 8) as f32, (i / 8) as f32)) {
        let at = |dx: f32, dz: f32| [(x + dx - 4.0) * 3.0, -1.0, (z + dz - 4.0) * 6.0];
        corners.push([at(0.0, 0.0), at(0.0, 1.0), at(1.0, 1.0)]);
        corners.push([at(0.0, 0.0), at(1.0, 1.0), at(1.0, 0.0)]);
    }
    triangles(&corners)
}

#[test]
fn a_floor_under_the_viewer_is_cut_at_near_and_far() {
    let projection = Projection::Perspective { fov_y: 1.4 };
    let camera = Camera::look_direction(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, projection).unwrap();
    let renderer = &mut renderer();
    for (near, far) in [(0.1, 100.0), (1.0, 12.0), (2.5, 20.0)] {
        for background in [Background::Weighted, Background::Composite] {
            let settings = Settings { near, far, background, gamma: 0.01, ..small(60, 50) };
            let scene = Scene::new(floor()).with_lights(Lights::official());
            let tolerance = tolerance::cut_at(near, 6.0);
            let frame = against_reference_within(renderer, &scene, camera, &settings, &tolerance);
            let silhouette = frame.silhouette().unwrap();
            let column: Vec<f32> = (0..50).map(|row| silhouette.pixel(0, row, 30)[0]).collect();
            assert!(column[..24].iter().all(|&a| a == 0.0), "nothing above the horizon: {column:?}");
            if near < 1.0 {
                assert!(column[49] > 0.7, "the floor reaches the lower border (½ of each side at a seam)");
            }
        }
    }
}

#[test]
fn what_is_behind_the_viewer_is_not_seen() {
    let renderer = &mut renderer();
    for projection in [Projection::Perspective { fov_y: 1.0 }, Projection::Orthographic { half_height: 1.0 }] {
        let camera = Camera::look_at(DVec3::Z * -5.0, DVec3::Z * -9.0, DVec3::Y, projection).unwrap();
        let scene = Scene::new(shapes::cube().unwrap());
        let frame = against_reference(renderer, &scene, camera, &small(20, 20));
        assert!(frame.silhouette().unwrap().data.iter().all(|&a| a == 0.0));
    }
    // The camera inside the cube sees it all around.
    let camera = Camera::look_at(DVec3::ZERO, DVec3::ONE, DVec3::Y, Projection::Perspective { fov_y: 1.0 }).unwrap();
    let settings = Settings { near: 0.1, ..small(20, 20) };
    let frame = against_reference(renderer, &Scene::new(shapes::cube().unwrap()), camera, &settings);
    assert!(frame.silhouette().unwrap().data.iter().all(|&a| a > 0.7), "½ of each side at an edge");
}

#[test]
fn images_of_any_shape() {
    let renderer = &mut renderer();
    let scene = Scene::new(shapes::fish().unwrap()).with_lights(Lights::official());
    let camera = Camera::from_angles(3.0, 20.0, 30.0, Projection::Perspective { fov_y: 0.8 }).unwrap();
    for (width, height) in [(1, 1), (1, 257), (257, 1), (7, 3), (8, 4), (9, 5), (64, 32), (65, 33), (63, 31), (300, 2)]
    {
        against_reference(renderer, &scene, camera, &Settings { sigma: 1e-5, ..small(width, height) });
    }
}

#[test]
fn an_empty_mesh_has_company() {
    let renderer = &mut renderer();
    let empty = Mesh::new(vec![], vec![]).unwrap();
    let bare = Mesh::new(vec![[0.0; 3]; 3], vec![]).unwrap();
    let scene = Scene::batch(vec![empty, shapes::cube().unwrap(), bare]);
    let camera = Camera::from_angles(3.0, 20.0, 30.0, Projection::Perspective { fov_y: 0.8 }).unwrap();
    let frame = renderer.render(&scene, &[camera; 3], &small(30, 20)).unwrap();
    let reference = render_culled(&scene, &[camera; 3], &small(30, 20)).unwrap();
    compare_frames(&frame, &reference, &tolerance::IMAGE).unwrap();
    let image = frame.silhouette().unwrap();
    let sums = [0, 1, 2].map(|view| image.view(view).iter().sum::<f32>());
    assert!(sums[0] == 0.0 && sums[1] > 50.0 && sums[2] == 0.0, "{sums:?}");
}

#[test]
fn a_fine_mesh_is_whole() {
    let scene = Scene::new(shapes::icosphere(6).unwrap()).with_lights(Lights::official());
    let camera = Camera::from_angles(3.0, 20.0, 30.0, Projection::Perspective { fov_y: 0.8 }).unwrap();
    let settings = Settings { sigma: 1e-5, ..small(128, 128) };
    against_reference_within(&mut renderer(), &scene, camera, &settings, &tolerance::CROWD);
}

#[test]
fn one_triangle_may_be_far_larger_than_the_image() {
    let renderer = &mut renderer();
    for size in [1e2, 1e4, 1e6f32] {
        let corners = [[-size, -0.3, 3.0], [size, 0.2, 4.0], [0.1, size, 5.0]];
        against_reference(renderer, &Scene::new(triangles(&[corners])), Camera::screen(), &small(40, 30));
    }
}

/// Surface textures of an even resolution: far beyond an edge b̂ is (½, ½, 0), which is a border of cells, so rounding
/// decides and many pixels are left out.
#[test]
fn even_surface_resolutions() {
    let renderer = &mut renderer();
    let camera = Camera::from_angles(4.0, 20.0, 30.0, Projection::Perspective { fov_y: 0.8 }).unwrap();
    for resolution in [2, 4] {
        let random = &mut Random::new(u64::from(resolution));
        let mesh = soup(random, Kind::Plain);
        let texels = vec![[0.0; 3]; mesh.triangles().len() * (resolution * resolution) as usize];
        let texels = texels.into_iter().map(|_| random.color()).collect();
        let mesh = mesh.with_appearance(Appearance::Surface { resolution, texels }).unwrap();
        let tolerance = Tolerance { left_out: 0.6, ..tolerance::IMAGE };
        against_reference_within(renderer, &Scene::new(mesh), camera, &small(80, 60), &tolerance);
    }
}
