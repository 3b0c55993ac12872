//! Even triangles: as long as asked for, on the surface that there was.

use glam::DVec3;
use softras::fit::{remeshed, voxel_iou};
use softras::internals::fit::{Topology, is_closed};
use softras::scene::Appearance;
use softras::{Error, Mesh, shapes};

fn point(mesh: &Mesh, vertex: u32) -> DVec3 {
    DVec3::from(mesh.positions()[vertex as usize].map(f64::from))
}

/// The lengths of all edges, in rising order.
fn lengths(mesh: &Mesh) -> Vec<f64> {
    let topology = Topology::new(mesh.positions().len(), mesh.triangles()).unwrap();
    let mut lengths: Vec<f64> =
        topology.edges().iter().map(|&[a, b]| point(mesh, a).distance(point(mesh, b))).collect();
    lengths.sort_by(f64::total_cmp);
    lengths
}

/// Vertices less edges plus triangles: 2 for a ball, 0 for a torus, 1 for a disc.
fn euler(mesh: &Mesh) -> i64 {
    let topology = Topology::new(mesh.positions().len(), mesh.triangles()).unwrap();
    mesh.positions().len() as i64 - topology.edges().len() as i64 + mesh.triangles().len() as i64
}

/// What a closed mesh holds, below 0 where it is inside out.
fn volume(mesh: &Mesh) -> f64 {
    let six = |t: &[u32; 3]| point(mesh, t[0]).dot(point(mesh, t[1]).cross(point(mesh, t[2])));
    mesh.triangles().iter().map(six).sum::<f64>() / 6.0
}

/// A sphere drawn out to a needle, as fits do it: long edges along it, short ones around.
fn stretched() -> Mesh {
    let sphere = shapes::icosphere(3).unwrap();
    let positions = sphere.positions().iter().map(|p| [4.0 * p[0], 0.5 * p[1], 0.5 * p[2]]).collect();
    Mesh::new(positions, sphere.triangles().to_vec()).unwrap()
}

/// The cube in one colour.
fn cube() -> Mesh {
    let cube = shapes::cube().unwrap();
    Mesh::new(cube.positions().to_vec(), cube.triangles().to_vec()).unwrap()
}

#[test]
fn edges_are_as_long_as_asked_for() {
    for (mesh, length) in [
        (stretched(), 0.15),
        (stretched(), 0.3),
        (shapes::torus(0.7, 0.3, 64, 32).unwrap(), 0.1),
        (shapes::icosphere(1).unwrap(), 0.1),
        (shapes::icosphere(4).unwrap(), 0.3),
    ] {
        let even = remeshed(&mesh, length).unwrap();
        let edges = lengths(&even);
        let at = |part: f64| edges[(part * (edges.len() - 1) as f64) as usize] / length;
        assert!(at(0.05) > 0.6 && at(0.95) < 1.4 && at(1.0) < 2.0, "{length}: {} {} {}", at(0.05), at(0.95), at(1.0));
    }
    let before = lengths(&stretched());
    assert!(before[before.len() * 9 / 10] > 4.0 * before[before.len() / 10], "the stretched one was even already");
}

#[test]
fn the_surface_stays() {
    let torus = shapes::torus(0.7, 0.3, 64, 32).unwrap();
    for (mesh, length, least) in [(stretched(), 0.1, 0.95), (torus, 0.06, 0.95), (cube(), 0.1, 0.9)] {
        let even = remeshed(&mesh, length).unwrap();
        assert!(is_closed(&even).unwrap() && euler(&even) == euler(&mesh), "{} and {}", euler(&even), euler(&mesh));
        let common = voxel_iou(&mesh, &even, 64).unwrap();
        assert!(common > least, "{common}");
        // None lies on its face: normals point outward as they did.
        assert!((volume(&even) / volume(&mesh) - 1.0).abs() < 0.1, "{} of {}", volume(&even), volume(&mesh));
        assert_eq!(remeshed(&mesh, length).unwrap(), even, "another mesh the second time");
    }
}

/// Edges longer than the tube of a torus is around, and than a plate is thick, make nothing but a torus and a plate of it.
#[test]
fn handles_and_thin_plates_outlive_long_edges() {
    let plate = cube().positions().iter().map(|p| [p[0], p[1], 0.05 * p[2]]).collect();
    let plate = remeshed(&Mesh::new(plate, cube().triangles().to_vec()).unwrap(), 0.02).unwrap();
    let torus = shapes::torus(0.7, 0.1, 96, 24).unwrap();
    for (mesh, length, kept) in [(torus, 0.7, 0.0), (plate.clone(), 0.08, 0.8), (plate, 0.3, 0.1)] {
        let even = remeshed(&mesh, length).unwrap();
        let topology = Topology::new(even.positions().len(), even.triangles()).unwrap();
        assert!(even.triangles().len() * 2 < mesh.triangles().len(), "{length}: {}", even.triangles().len());
        assert!(is_closed(&even).unwrap() && euler(&even) == euler(&mesh), "{length}: {}", euler(&even));
        assert_eq!(
            2 * topology.edges().len(),
            3 * even.triangles().len(),
            "{length}: an edge of more than two triangles"
        );
        assert!(volume(&even) > kept * volume(&mesh), "{length}: {} of {}", volume(&even), volume(&mesh));
    }
}

/// An open sheet keeps its rim; colours go with the surface.
#[test]
fn rims_and_colours_stay() {
    let (n, mut positions, mut triangles) = (12u32, Vec::new(), Vec::new());
    for i in 0..=n {
        for k in 0..=n {
            positions.push([i as f32 / n as f32, k as f32 / n as f32, 0.0]);
            if i < n && k < n {
                let at = i * (n + 1) + k;
                triangles.extend([[at, at + n + 1, at + 1], [at + 1, at + n + 1, at + n + 2]]);
            }
        }
    }
    let colors = positions.iter().map(|p| [p[0], p[1], 0.5]).collect();
    let sheet = Mesh::new(positions, triangles).unwrap().with_appearance(Appearance::VertexColors(colors)).unwrap();
    for length in [0.03, 0.15] {
        let even = remeshed(&sheet, length).unwrap();
        let Appearance::VertexColors(colors) = even.appearance() else { panic!("the colours went") };
        for (p, c) in even.positions().iter().zip(colors) {
            assert_eq!(p[2], 0.0);
            let off = (p[0] - c[0]).abs().max((p[1] - c[1]).abs());
            assert!(off < 1e-6, "{p:?} has the colour {c:?}");
        }
        assert_eq!(euler(&even), 1);
        let area = |t: &[u32; 3]| {
            0.5 * (point(&even, t[1]) - point(&even, t[0])).cross(point(&even, t[2]) - point(&even, t[0])).z
        };
        assert!(even.triangles().iter().all(|t| area(t) < 0.0 || area(t) > 0.0));
        assert!((even.triangles().iter().map(area).sum::<f64>().abs() - 1.0).abs() < 1e-5, "the sheet's rim moved");
    }
}

#[test]
fn what_cannot_be_remeshed_is_refused() {
    let cube = cube();
    for length in [0.0, -1.0, f64::NAN, 1e-6] {
        let refused = remeshed(&cube, length);
        assert!(matches!(&refused, Err(Error::Fit { what, .. }) if what.contains("edges of")), "{length}: {refused:?}");
    }
    let painted = remeshed(&shapes::cube().unwrap(), 0.5);
    assert!(matches!(&painted, Err(Error::Fit { what, .. }) if what.contains("textured")), "{painted:?}");
    let needle = Mesh::new(vec![[0.0; 3], [1e9, 0.0, 0.0], [2e9, 0.0, 0.0]], vec![[0, 1, 2]]).unwrap();
    assert!(matches!(remeshed(&needle, 0.1), Err(Error::Fit { .. })), "no area, but no end of edges");
    // Nothing at all stays nothing.
    let empty = Mesh::new(Vec::new(), Vec::new()).unwrap();
    assert_eq!(remeshed(&empty, 0.5).unwrap().triangles().len(), 0);
    // A triangle with a corner twice has no area and goes.
    let flat = Mesh::new(cube.positions().to_vec(), [cube.triangles(), &[[0, 0, 1]]].concat()).unwrap();
    assert!(is_closed(&remeshed(&flat, 0.3).unwrap()).unwrap());
}
