//! Solid voxelisation against volumes that are known.

use crate::meshes::{both, moved, without};
use softras::{Mesh, shapes};
use softras_fit::{Voxels, cube_around, is_closed, voxel_iou};

fn volume(mesh: &Mesh, resolution: usize) -> f64 {
    let (low, side) = cube_around(&[mesh]);
    Voxels::new(mesh, low, side, resolution).unwrap().volume()
}

/// Whether two numbers are within a part of the second of each other.
fn close(a: f64, b: f64, part: f64) -> bool {
    (a - b).abs() <= part * b
}

#[test]
fn volumes_are_those_of_geometry() {
    let ball = 4.0 / 3.0 * std::f64::consts::PI;
    let torus = 2.0 * std::f64::consts::PI.powi(2) * 0.7 * 0.3 * 0.3;
    for (mesh, expected, part) in [
        (shapes::cube().unwrap(), 1.728, 0.005),
        (shapes::icosphere(4).unwrap(), ball, 0.01),
        (shapes::torus(0.7, 0.3, 128, 64).unwrap(), torus, 0.01),
    ] {
        let volume = volume(&mesh, 96);
        assert!(close(volume, expected, part), "{volume} instead of {expected}");
        assert!(!close(1.03 * volume, expected, part), "3 % too much would not be seen");
    }
}

#[test]
fn ious_are_those_of_geometry() {
    let cube = shapes::cube().unwrap();
    assert_eq!(voxel_iou(&cube, &cube, 32).unwrap(), 1.0);
    // Half a side along x: 1/2 common of 3/2.
    let offset = moved(&cube, 1.0, [0.6, 0.0, 0.0]);
    let overlap = voxel_iou(&cube, &offset, 60).unwrap();
    assert!((overlap - 1.0 / 3.0).abs() < 0.02, "{overlap}");
    let ball = shapes::icosphere(4).unwrap();
    let half = voxel_iou(&ball, &moved(&ball, 0.8, [0.0; 3]), 96).unwrap();
    assert!((half - 0.512).abs() < 0.01, "{half}");
    // The cube within the ball: 1.728 of 4 π / 3, less what of its corners (at 1.039) sticks out.
    let mixed = voxel_iou(&cube, &ball, 100).unwrap();
    assert!((mixed - 0.4125).abs() < 0.005, "{mixed}");
    assert_eq!(voxel_iou(&cube, &moved(&cube, 1.0, [9.0, 0.0, 0.0]), 32).unwrap(), 0.0);
}

/// A part that is inside out cancels another one where both overlap, and a hollow is no such part.
#[test]
fn parts_that_are_inside_out_are_told() {
    let (cube, large) = (shapes::cube().unwrap(), moved(&shapes::icosphere(3).unwrap(), 2.0, [0.0; 3]));
    let turned = cube.triangles().iter().map(|&[a, b, c]| [a, c, b]).collect();
    let turned = Mesh::new(cube.positions().to_vec(), turned).unwrap();
    let is_mixed = |a: &Mesh, b: &Mesh| {
        let mesh = both(a, b);
        let (low, side) = cube_around(&[&mesh]);
        Voxels::new(&mesh, low, side, 32).unwrap().is_mixed()
    };
    let aside = |mesh: &Mesh| moved(mesh, 1.0, [0.6, 0.1, 0.0]);
    assert!(is_mixed(&cube, &aside(&turned)) && !is_mixed(&cube, &aside(&cube)) && !is_mixed(&turned, &aside(&turned)));
    assert!(!is_mixed(&large, &turned));
}

#[test]
fn axes_are_not_confused() {
    let cube = moved(&shapes::cube().unwrap(), 0.5, [0.0; 3]);
    let voxels = Voxels::new(&moved(&cube, 1.0, [0.4, -0.4, 0.0]), [-1.0; 3], 2.0, 10).unwrap();
    let at = |x: usize, y: usize, z: usize| voxels.inside()[x + 10 * (y + 10 * z)];
    assert!(at(7, 3, 5) && at(6, 2, 4) && !at(3, 7, 5) && !at(7, 7, 5) && !at(5, 3, 7) && !at(3, 3, 5));
    assert_eq!(voxels.inside().len(), 1000);
}

#[test]
fn a_small_hole_or_an_overlap_leaves_a_solid_a_solid() {
    let ball = shapes::icosphere(3).unwrap();
    let open = without(&ball, |t| t == 100);
    assert!(is_closed(&ball).unwrap() && !is_closed(&open).unwrap());
    assert!(voxel_iou(&ball, &open, 48).unwrap() > 0.999);
    // Two balls in one mesh, half within each other: nothing between them is hollow.
    let both = both(&ball, &moved(&ball, 1.0, [0.5, 0.0, 0.0]));
    let lens = 5.0 / 12.0 * std::f64::consts::PI * 1.5f64.powi(2) * 0.9;
    let whole = volume(&both, 64);
    assert!(whole > volume(&ball, 64) && whole < 8.0 * std::f64::consts::PI / 3.0 - 0.5 * lens, "{whole}");
    let union = 8.0 * std::f64::consts::PI / 3.0 - std::f64::consts::PI * (4.0 + 0.5) * (1.5f64).powi(2) / 12.0;
    assert!(close(whole, union, 0.02), "{whole} instead of {union}");
}

#[test]
fn a_sheet_has_no_inside_and_nonsense_is_refused() {
    let sheet = Mesh::new(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.3]], vec![[0, 1, 2]]).unwrap();
    assert!(close(1.0 + volume(&sheet, 32), 1.0, 1e-9));
    assert_eq!(voxel_iou(&sheet, &Mesh::new(Vec::new(), Vec::new()).unwrap(), 8).unwrap(), 1.0);
    assert!(voxel_iou(&sheet, &sheet, 0).is_err());
    let cube = |side: f64, low: f64| Voxels::new(&sheet, [0.0, low, 0.0], side, 8).is_ok();
    assert!(cube(1.0, 0.0) && !cube(0.0, 0.0) && !cube(f64::NAN, 0.0) && !cube(f64::INFINITY, 0.0));
    assert!(!cube(1.0, f64::NAN) && !cube(1.0, f64::INFINITY));
}

#[test]
fn half_the_rays_make_no_inside() {
    // A box without three faces that meet: along each axis one of two rays leaves through a face.
    let cube = shapes::cube().unwrap();
    let is_open = |t: usize| {
        let corners = cube.triangles()[t].map(|i| cube.positions()[i as usize]);
        !(0..3).any(|axis| corners.iter().all(|p| p[axis] < -0.5))
    };
    let open = without(&cube, is_open);
    assert_eq!(open.triangles().len(), 6);
    let (low, side) = cube_around(&[&cube]);
    assert_eq!(Voxels::new(&open, low, side, 16).unwrap().volume(), 0.0);
    // The grid reaches beyond what it is around, on all sides.
    let flat = Mesh::new(vec![[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [0.0, 1.0, 5.0]], vec![[0, 1, 2]]).unwrap();
    let ([.., bottom], height) = cube_around(&[&flat]);
    assert!(bottom < 5.0 && bottom + height > 5.0, "{bottom} {height}");
    assert!(low.iter().all(|x| (-0.61..-0.6).contains(x)) && (1.2..1.22).contains(&side), "{low:?} {side}");
}
