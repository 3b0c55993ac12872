//! Fragments: the point that a pixel shows lies behind the pixel's centre, and nothing lies before it.

use crate::common::renderer;
use softras::glam::DVec3;
use softras::scene::{Appearance, ColorAggregation, Distance, Interpolation, Outputs};
use softras::{Camera, Fragment, Lights, Mesh, Projection, Scene, Settings, shapes};

/// A ball, and a floor that reaches behind the camera.
fn meshes() -> Vec<Mesh> {
    let floor = vec![[-9.0, -0.8, -9.0], [9.0, -0.8, -9.0], [9.0, -0.8, 9.0], [-9.0, -0.8, 9.0]];
    vec![shapes::icosphere(2).unwrap(), Mesh::new(floor, vec![[0, 1, 2], [2, 3, 0]]).unwrap()]
}

/// The depth at which the ray through a pixel's centre meets a triangle first, by its plane and the signs of three volumes.
fn depth_by_rays(camera: &Camera, mesh: &Mesh, [x, y]: [f64; 2], near: f64) -> Option<(u32, f64)> {
    let points: Vec<DVec3> =
        mesh.positions().iter().map(|p| camera.to_view(DVec3::from_array(p.map(f64::from)))).collect();
    let (from, to) = match camera.projection() {
        Projection::Orthographic { .. } => (DVec3::new(x, y, 0.0), DVec3::Z),
        _ => (DVec3::ZERO, DVec3::new(x, y, 1.0)),
    };
    let meet = |(i, t): (usize, &[u32; 3])| {
        let [a, b, c] = t.map(|v| points[v as usize] - from);
        let sides = [to.dot(a.cross(b)), to.dot(b.cross(c)), to.dot(c.cross(a))];
        let inside = sides.iter().all(|s| *s > 0.0) || sides.iter().all(|s| *s < 0.0);
        let normal = (b - a).cross(c - a);
        let z = normal.dot(a) / normal.dot(to);
        (inside && z >= near).then_some((i as u32, z))
    };
    let all = mesh.triangles().iter().enumerate().filter_map(meet);
    all.min_by(|a, b| a.1.total_cmp(&b.1))
}

#[test]
fn a_pixel_shows_what_its_ray_meets_first() {
    let mut renderer = renderer();
    let (width, height) = (40, 30);
    let settings = Settings { width, height, near: 0.5, far: 20.0, sigma: 1e-2, ..Settings::default() };
    let (half_width, half_height) = (f64::from(width) / 2.0, f64::from(height) / 2.0);
    for (projection, scale) in [
        (Projection::Perspective { fov_y: 1.0 }, 0.5f64.tan()),
        (Projection::Pinhole { fx: 30.0, fy: 30.0, cx: 20.0, cy: 15.0 }, half_height / 30.0),
        (Projection::Orthographic { half_height: 1.3 }, 1.3),
    ] {
        let camera = Camera::look_at(DVec3::new(0.4, 0.5, 2.5), DVec3::ZERO, DVec3::Y, projection).unwrap();
        let scene = Scene::batch(meshes());
        let found = renderer.fragments(&scene, &[camera; 2], &settings).unwrap();
        assert_eq!((found.batch, found.height, found.width), (2, 30, 40));
        let (mut covered, mut differ) = ([0; 2], 0);
        for (at, fragment) in found.data.iter().enumerate() {
            let (view, row, column) = (at / 1200, (at / 40 % 30) as f64 + 0.5, (at % 40) as f64 + 0.5);
            let mesh = &scene.meshes[view];
            let ray = [(column - half_width) / half_height * scale, (half_height - row) / half_height * scale];
            let expected = depth_by_rays(&camera, mesh, ray, settings.near);
            match (fragment, expected) {
                (Some(Fragment { triangle, barycentrics, depth }), Some((nearest, z))) if *triangle == nearest => {
                    assert!((f64::from(*depth) - z).abs() < 1e-5 * z, "{projection:?}: {depth} and {z}");
                    let corners = mesh.triangles()[nearest as usize].map(|v| mesh.positions()[v as usize]);
                    let point = corners
                        .iter()
                        .zip(barycentrics)
                        .map(|(p, b)| f64::from(*b) * DVec3::from_array(p.map(f64::from)));
                    let place = camera.project(point.sum(), (width, height)).unwrap();
                    assert!((place[0] - column).abs() + (place[1] - row).abs() < 1e-3, "{place:?}");
                    covered[view] += 1;
                }
                (None, None) => {}
                // A centre on an edge belongs to either side.
                _ => differ += 1,
            }
        }
        assert!(covered.iter().all(|count| *count > 200) && differ < 5, "{projection:?}: {covered:?}, {differ}");
    }
}

/// The depth image is the depth along a pixel's ray, and colours with perspective correction are those of the point that it meets,
/// by every kind of camera.
#[test]
fn images_show_what_a_ray_meets_first() {
    let mut renderer = renderer();
    let settings = Settings {
        width: 40,
        height: 30,
        near: 0.5,
        far: 30.0,
        color: ColorAggregation::Hard,
        interpolation: Interpolation::Perspective,
        outputs: Outputs { color: true, depth: true, ..Outputs::NOTHING },
        ..Settings::default()
    };
    // A floor that rises away from the camera, and a card that stands before it: as one mesh, since one hides the other.
    let points = vec![
        [-1.0, -1.0, -1.0],
        [1.0, -1.0, -1.0],
        [1.0, 1.0, -9.0],
        [-1.0, 1.0, -9.0],
        [-0.5, -0.5, -2.4],
        [0.5, -0.5, -2.4],
        [0.0, 0.5, -2.4],
    ];
    let color = |p: &[f32; 3]| p.map(|x| (x + 10.0) / 20.0);
    let colors = points.iter().map(color).collect();
    let mesh = Mesh::new(points, vec![[0, 1, 2], [2, 3, 0], [4, 5, 6]]).unwrap();
    let scene = Scene::new(mesh.clone().with_appearance(Appearance::VertexColors(colors)).unwrap());
    for (projection, scale) in
        [(Projection::Perspective { fov_y: 1.0 }, 0.5f64.tan()), (Projection::Orthographic { half_height: 1.3 }, 1.3)]
    {
        let camera = Camera::look_at(DVec3::Z, DVec3::ZERO, DVec3::Y, projection).unwrap();
        let frame = renderer.render(&scene, &[camera], &settings).unwrap();
        let (mut compared, mut card) = (0, 0);
        for (at, (depth, color)) in
            frame.depth().unwrap().data.iter().zip(frame.color().unwrap().data.chunks(3)).enumerate()
        {
            let ray = [((at % 40) as f64 - 19.5) / 15.0 * scale, (14.5 - (at / 40) as f64) / 15.0 * scale];
            let Some((nearest, z)) = depth_by_rays(&camera, &mesh, ray, settings.near).filter(|_| *depth > 0.0) else {
                continue;
            };
            assert!((f64::from(*depth) - z).abs() < 1e-5 * z, "{projection:?}, pixel {at}: {depth} and {z}");
            let world_z = f64::from(color[2]) * 20.0 - 10.0;
            assert!((world_z - (1.0 - z)).abs() < 1e-5 * z, "{projection:?}, pixel {at}: {world_z} and {}", 1.0 - z);
            (compared, card) = (compared + 1, card + usize::from(nearest == 2));
        }
        assert!(compared > 200 && card > 20, "{projection:?}: {compared} pixels, {card} of the card");
    }
}

/// Neither the scene's softness nor its look changes a fragment, and the depths are those of a hard image.
#[test]
fn fragments_are_those_of_the_hard_image() {
    let mut renderer = renderer();
    let camera =
        Camera::look_at(DVec3::new(0.4, 0.5, 2.5), DVec3::ZERO, DVec3::Y, Projection::Perspective { fov_y: 1.0 });
    let cameras = [camera.unwrap()];
    let scene = Scene::new(shapes::fish().unwrap()).with_lights(Lights::official());
    let outputs = Outputs { depth: true, ..Outputs::NOTHING };
    let hard = Settings { width: 40, height: 30, near: 0.5, far: 20.0, sigma: 1e-12, outputs, ..Settings::default() };
    let hard = Settings { color: ColorAggregation::Hard, distance: Distance::Euclidean, ..hard };
    let found = renderer.fragments(&scene, &cameras, &hard).unwrap();
    let soft = Settings {
        sigma: 1e-3,
        color: ColorAggregation::Softmax,
        outputs: Settings::default().outputs,
        ..hard.clone()
    };
    assert_eq!(found, renderer.fragments(&scene, &cameras, &soft).unwrap());
    let frame = renderer.render(&scene, &cameras, &hard).unwrap();
    for (fragment, depth) in found.data.iter().zip(&frame.depth().unwrap().data) {
        let ours = fragment.map_or(0.0, |one| one.depth);
        assert!((ours - depth).abs() < 1e-4 * (1.0 + depth), "{ours} and {depth}");
    }
}
