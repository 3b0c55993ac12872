//! Visual hulls: they hold the object, with its holes and parts, and impossible silhouettes are refused.

use crate::common::renderer;
use crate::meshes::{PERSPECTIVE, both, genus, moved, volume, without};
use softras::{Camera, Error, Mesh, Projection, Renderer, shapes};
use softras_fit::{Voxels, cube_around, is_closed, voxel_iou};
use softras_io::Views;

fn silhouettes(renderer: &mut Renderer, mesh: &Mesh, projection: Projection) -> Views {
    let angles = [[60.0, 0.0], [-50.0, 40.0], [5.0, 0.0], [10.0, 90.0], [0.0, 45.0], [-10.0, 135.0], [35.0, 200.0]];
    let more = (0..9).map(|i| [25.0 * f64::from(i % 3 - 1), 40.0 * f64::from(i)]);
    let cameras = crate::meshes::cameras(projection, 5.0, angles.into_iter().chain(more));
    crate::meshes::silhouettes(renderer, mesh, cameras, (80, 64))
}

fn hull(renderer: &mut Renderer, mesh: &Mesh, projection: Projection) -> Mesh {
    softras_fit::visual_hull(&silhouettes(renderer, mesh, projection), [0.0; 3], 3.0, 64).unwrap()
}

#[test]
fn a_hull_has_the_objects_holes_and_parts() {
    let mut renderer = renderer();
    let ball = shapes::icosphere(3).unwrap();
    let torus = shapes::torus(0.8, 0.3, 48, 24).unwrap();
    let balls = both(&moved(&ball, 0.4, [-0.6, 0.2, 0.0]), &moved(&ball, 0.3, [0.7, -0.3, 0.2]));
    for (name, mesh, parts, handles) in [("ball", &ball, 1, 0), ("torus", &torus, 1, 1), ("balls", &balls, 2, 0)] {
        assert_eq!(genus(mesh), (parts, Some(handles)), "{name} itself");
        let hull = hull(&mut renderer, mesh, PERSPECTIVE);
        assert_eq!(genus(&hull), (parts, Some(handles)), "{name}");
        let iou = voxel_iou(&hull, mesh, 64).unwrap();
        assert!(iou > 0.9, "{name}: {iou}");
        // Its triangles all face outwards, as those of the mesh do.
        let share = volume(&hull) / volume(mesh);
        assert!(is_closed(&hull).unwrap() && (0.9..1.2).contains(&share), "{name}: {share} of its volume");
        // The object lies in its hull, but for a layer of a quarter of a sample, which the blur takes.
        let (low, side) = cube_around(&[&hull, mesh]);
        let [inner, outer] = [mesh, &hull].map(|mesh| Voxels::new(mesh, low, side, 64).unwrap());
        let pairs = || inner.inside().iter().zip(outer.inside()).filter(|(object, _)| **object);
        let outside = pairs().filter(|(_, hull)| !**hull).count() as f64 / pairs().count() as f64;
        assert!(outside < 0.1, "{name}: {outside} of it are outside its hull");
    }
    // An object of a hole is not taken for one without.
    assert_eq!(genus(&without(&shapes::cube().unwrap(), |t| t == 0)), (1, None));
}

#[test]
fn every_kind_of_camera_sees_the_same_hull() {
    let mut renderer = renderer();
    let torus = shapes::torus(0.8, 0.3, 48, 24).unwrap();
    // The focal length of 64 rows that PERSPECTIVE has.
    let focal = 32.0 / f64::tan(0.3);
    let pinhole = Projection::Pinhole { fx: focal, fy: focal, cx: 40.0, cy: 32.0 };
    let straight = hull(&mut renderer, &torus, PERSPECTIVE);
    let iou = voxel_iou(&straight, &hull(&mut renderer, &torus, pinhole), 64).unwrap();
    assert!(iou > 0.999, "{iou}");
    let parallel = hull(&mut renderer, &torus, Projection::Orthographic { half_height: 1.5 });
    let iou = voxel_iou(&parallel, &torus, 64).unwrap();
    assert!(iou > 0.9, "{iou}");
    assert_eq!(straight, hull(&mut renderer, &torus, PERSPECTIVE));
}

#[test]
fn silhouettes_of_no_solid_are_refused() {
    let mut renderer = renderer();
    let targets = silhouettes(&mut renderer, &shapes::icosphere(2).unwrap(), PERSPECTIVE);
    let refused = |targets: &Views, side: f64, samples: usize, part: &str| match softras_fit::visual_hull(
        targets, [0.0; 3], side, samples,
    ) {
        Err(error @ Error::Fit { .. }) => assert!(error.to_string().contains(part), "{error} without {part}"),
        other => panic!("{other:?} without {part}"),
    };
    let changed = |change: &dyn Fn(&mut Views)| {
        let mut targets = targets.clone();
        change(&mut targets);
        targets
    };
    refused(&targets, 3.0, 4, "samples");
    refused(&targets, 3.0, 1 << 20, "samples");
    refused(&targets, f64::NAN, 64, "NaN");
    refused(&changed(&|t| t.silhouette = None), 3.0, 64, "without silhouettes");
    refused(&changed(&|t| t.cameras.truncate(3)), 3.0, 64, "3 cameras");
    refused(&changed(&|t| t.cameras[2] = Camera::screen()), 3.0, 64, "camera 2");
    let pixels = 80 * 64;
    let black = |t: &mut Views| t.silhouette.as_mut().unwrap().data[pixels..2 * pixels].fill(0.0);
    refused(&changed(&black), 3.0, 64, "picture 1");
    // Two pictures whose objects are far apart.
    let apart = |t: &mut Views| {
        let data = &mut t.silhouette.as_mut().unwrap().data;
        (0..2).for_each(|view| data[view * pixels..(view + 1) * pixels].fill(0.0));
        data[..80].fill(1.0);
        data[2 * pixels - 80..2 * pixels].fill(1.0);
        t.cameras[1] = t.cameras[0];
    };
    refused(&changed(&apart), 3.0, 64, "no solid");
}
