//! Views as people have them: one of them wrong, close-ups, objects that fill the picture's height, cameras the wrong way round.

use crate::common::renderer;
use crate::meshes::{PERSPECTIVE, cameras, mapped, silhouettes};
use glam::{DMat4, DVec3};
use softras::{Camera, Error, Image, Mesh, Projection, Renderer, shapes};
use softras_fit::{Fit, FitOptions, Subject, Voxels};
use softras_io::Views;
use std::ops::ControlFlow;

pub fn solid() -> Mesh {
    mapped(&shapes::fish().unwrap(), |p| [0.6 * p[0], 0.9 * p[1] + 0.05, 0.6 * p[2]])
}

pub fn views(renderer: &mut Renderer, mesh: &Mesh, cameras: Vec<Camera>, size: (u32, u32)) -> Views {
    let names = (0..cameras.len()).map(|i| format!("{i}.png")).collect();
    Views { names, ..silhouettes(renderer, mesh, cameras, size) }
}

pub fn around(count: usize) -> Vec<Camera> {
    let angles = |i: usize| [20.0 * (i % 3) as f64 - 10.0, 360.0 * i as f64 / count as f64];
    cameras(PERSPECTIVE, 4.0, (0..count).map(angles))
}

/// The notes of a fit's begin.
fn notes(views: Views, renderer: &mut Renderer) -> Vec<String> {
    Fit::new(views).unwrap().begin(renderer, &mut |_| ControlFlow::Continue(())).unwrap().notes().to_vec()
}

/// A change of a mask.
type Change<'a> = &'a dyn Fn(&mut [f32]);

fn masks(views: &mut Views) -> &mut Image {
    views.silhouette.as_mut().unwrap()
}

#[test]
fn a_wrong_view_is_left_out_by_its_name_and_a_right_one_stays() {
    let mut renderer = renderer();
    let good = views(&mut renderer, &solid(), around(12), (64, 64));
    assert_eq!(notes(good.clone(), &mut renderer), [""; 0]);
    let pixels = 64 * 64;
    let mask = |views: &mut Views, change: Change<'_>| change(&mut masks(views).data[5 * pixels..6 * pixels]);
    let rolled = |mask: &mut [f32]| mask.rotate_right(64 * 9 + 11);
    let changes: [(&str, Change<'_>); 4] = [
        ("does not agree with the others", &|mask| mask.reverse()),
        ("does not agree with the others", &rolled),
        ("shows nothing of the object", &|mask| mask.fill(0.0)),
        ("is all object", &|mask| mask.fill(1.0)),
    ];
    for (why, change) in changes {
        let mut wrong = good.clone();
        mask(&mut wrong, change);
        assert_eq!(notes(wrong.clone(), &mut renderer), [format!("5.png {why}: it is left out")], "{why}");
    }
    // Views that are held out keep their pictures where others go, and go with theirs.
    let mut wrong = good.clone();
    mask(&mut wrong, &rolled);
    let held_out = vec![5, 8, 11];
    let mut fit = Fit { subject: Subject { held_out, ..Subject::of(wrong).unwrap() }, options: FitOptions::default() };
    fit.options.iterations = Some(1);
    let fitted = fit.run(&mut renderer, |_| ControlFlow::Continue(())).unwrap();
    let held_out = fitted.scores.held_out.iter().map(|view| fitted.views.names[*view].as_str());
    assert_eq!(held_out.collect::<Vec<_>>(), ["8.png", "11.png"]);
    // Two of twelve.
    let mut wrong = good.clone();
    mask(&mut wrong, &rolled);
    masks(&mut wrong).data[8 * pixels..9 * pixels].fill(0.0);
    assert_eq!(notes(wrong, &mut renderer).iter().filter(|note| note.ends_with("left out")).count(), 2);
}

/// Four small holes in each mask, of which some meet others by chance.
#[test]
fn holes_in_all_masks_drill_no_tunnel() {
    let mut renderer = renderer();
    let mut pierced = views(&mut renderer, &solid(), around(16), (64, 64));
    let mut random = 1u32;
    for mask in masks(&mut pierced).data.chunks_exact_mut(64 * 64) {
        let mut holes = 0;
        while holes < 4 {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let (row, column) = ((random >> 16) as usize % 60 + 1, (random >> 24) as usize % 60 + 1);
            let around = |size: usize| (0..size * size).map(move |i| (row + i / size - 1) * 64 + column + i % size - 1);
            if around(4).all(|pixel| mask[pixel] > 0.5) {
                (0..4).for_each(|i| mask[(row + i / 2) * 64 + column + i % 2] = 0.0);
                holes += 1;
            }
        }
    }
    let fitting = Fit::new(pierced).unwrap().begin(&mut renderer, &mut |_| ControlFlow::Continue(())).unwrap();
    let (vertices, triangles) = (fitting.mesh().positions().len(), fitting.mesh().triangles().len());
    // The number of Euler of a closed surface without a tunnel.
    assert_eq!(vertices - triangles / 2, 2);
}

#[test]
fn a_hole_needs_two_pictures() {
    let mut renderer = renderer();
    let whole = views(&mut renderer, &solid(), around(12), (64, 64));
    let pierced = |views: &[usize]| {
        let mut pierced = whole.clone();
        for (row, column) in (31..34).flat_map(|row| (30..33).map(move |column| (row, column))) {
            views.iter().for_each(|view| masks(&mut pierced).data[(view * 64 + row) * 64 + column] = 0.0);
        }
        pierced
    };
    let due = "5.png: holes, 9 pixels in all, that too few other pictures look through are filled";
    assert_eq!(notes(pierced(&[5]), &mut renderer), [due]);
    assert_eq!(notes(pierced(&[5, 7]), &mut renderer), [""; 0]);
    // A speck beside the object.
    let mut speck = whole.clone();
    (0..9).for_each(|i| masks(&mut speck).data[(5 * 64 + 5 + i / 3) * 64 + 5 + i % 3] = 1.0);
    let due = "5.png: specks, 9 pixels in all, that the other pictures leave no room for are taken away";
    assert_eq!(notes(speck, &mut renderer), [due]);
    // A hole that the object has.
    let torus = shapes::torus(0.7, 0.25, 48, 24).unwrap();
    let seen = views(&mut renderer, &torus, around(12), (64, 64));
    assert_eq!(notes(seen, &mut renderer), [""; 0]);
}

#[test]
fn close_ups_and_tall_objects_leave_the_object_whole() {
    let mut renderer = renderer();
    let radius = |views| Subject::of(views).unwrap().bounds.radius;
    let whole = views(&mut renderer, &solid(), around(12), (64, 64));
    let mut cameras = around(12);
    cameras[3] = Camera::from_angles(4.0, 10.0, 90.0, Projection::Perspective { fov_y: 0.12 }).unwrap();
    let close = views(&mut renderer, &solid(), cameras, (64, 64));
    assert!((radius(close.clone()) - radius(whole.clone())).abs() < 1e-12);
    let volume = |views: &Views| {
        let hull = softras_fit::visual_hull(views, [0.0; 3], 3.0, 48).unwrap();
        Voxels::new(&hull, [-1.5; 3], 3.0, 64).unwrap().volume()
    };
    // One side of a ring, with its hole at the border, beyond which the other side is.
    let ring = shapes::torus(0.7, 0.25, 48, 24).unwrap();
    let [mut cameras, alone] = [around(12), around(12)];
    cameras.push(
        Camera::look_at(DVec3::new(0.5, 0.1, 4.0), DVec3::X * 0.7, DVec3::Y, Projection::Perspective { fov_y: 0.25 })
            .unwrap(),
    );
    let [with, without] = [cameras, alone].map(|cameras| volume(&views(&mut renderer, &ring, cameras, (64, 64))));
    assert!(with > 0.9 * without && with < 1.01 * without, "{with} for {without}");
    assert_eq!(notes(close, &mut renderer), [""; 0]);
    // Half the height of the picture is 1.2 at the middle, half its width 0.4.
    let positions = solid().positions().iter().map(|p| [0.3 * p[0], 1.5 * p[1], 0.3 * p[2]]).collect();
    let tall = Mesh::new(positions, solid().triangles().to_vec()).unwrap();
    let reach = tall.positions().iter().map(|p| f64::from(p[1].abs())).fold(0.0, f64::max);
    let seen = radius(views(&mut renderer, &tall, around(12), (32, 96)));
    assert!(reach < 1.1 && seen > reach && seen < 1.3 * reach, "{seen} for {reach}");
}

#[test]
fn masks_that_cannot_be_right_are_refused_at_once() {
    let mut renderer = renderer();
    let good = views(&mut renderer, &solid(), around(12), (48, 48));
    let mut error = |views: Views| {
        let begun = Fit::new(views).unwrap().begin(&mut renderer, &mut |_| ControlFlow::Continue(()));
        begun.unwrap_err().to_string()
    };
    for change in [|x: &mut f32| *x = 1.0, |x: &mut f32| *x = 1.0 - *x] {
        let mut wrong = good.clone();
        masks(&mut wrong).data.iter_mut().for_each(change);
        assert!(error(wrong).contains("of 12 views 12 are all object up to the border"));
    }
    // Small objects at places that no solid has.
    let mut wrong = good.clone();
    for (view, mask) in masks(&mut wrong).data.chunks_exact_mut(48 * 48).enumerate() {
        let (row, column) = (6 + 11 * view % 35, 6 + 17 * view % 35);
        mask.fill(0.0);
        (0..16).for_each(|i| mask[(row + i / 4) * 48 + column + i % 4] = 1.0);
    }
    let told = error(wrong);
    assert!(told.contains("the solid that all masks allow leaves"), "{told}");
}

#[test]
fn cameras_that_look_away_are_refused() {
    let mut renderer = renderer();
    let mut views = views(&mut renderer, &solid(), around(8), (32, 32));
    let turned = DMat4::from_diagonal(glam::DVec4::new(-1.0, 1.0, -1.0, 1.0));
    let away = |camera: &Camera| Camera::from_matrix(turned * camera.matrix(), PERSPECTIVE).unwrap();
    views.cameras = views.cameras.iter().map(away).collect();
    let error = Fit::new(views).unwrap_err();
    assert!(
        matches!(&error, Error::Fit { what, fix } if what.starts_with("8 of 8") && fix.contains("OpenCV")),
        "{error}"
    );
}
