//! Even triangles: as long as asked for, on the surface that there was.

use crate::common::tier;
use crate::meshes::{cube, euler, grid, mapped, point, points, scaled, topology, volume};
use glam::DVec3;
use softras::scene::Appearance;
use softras::{Error, Mesh, shapes};
use softras_fit::{evened, is_closed, remeshed, voxel_iou};

/// The lengths of all edges, in rising order.
fn lengths(mesh: &Mesh) -> Vec<f64> {
    let length = |&[a, b]: &[u32; 2]| point(mesh, a).distance(point(mesh, b));
    let mut lengths: Vec<f64> = topology(mesh).edges().iter().map(length).collect();
    lengths.sort_by(f64::total_cmp);
    lengths
}

/// A sphere drawn out to a needle, as fits do it: long edges along it, short ones around.
fn stretched() -> Mesh {
    scaled(&shapes::icosphere(3).unwrap(), [4.0, 0.5, 0.5])
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
        let even = remeshed(&mesh, length..=length).unwrap();
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
        let even = remeshed(&mesh, length..=length).unwrap();
        assert!(is_closed(&even).unwrap() && euler(&even) == euler(&mesh), "{} and {}", euler(&even), euler(&mesh));
        let common = voxel_iou(&mesh, &even, 64).unwrap();
        assert!(common > least, "{common}");
        // None lies on its face: normals point outward as they did.
        assert!((volume(&even) / volume(&mesh) - 1.0).abs() < 0.1, "{} of {}", volume(&even), volume(&mesh));
        assert_eq!(remeshed(&mesh, length..=length).unwrap(), even, "another mesh the second time");
    }
}

/// Edges longer than the tube of a torus is around, and than a plate is thick, make nothing but a torus and a plate of it.
#[test]
fn handles_and_thin_plates_outlive_long_edges() {
    let plate = remeshed(&scaled(&cube(), [1.0, 1.0, 0.05]), 0.02..=0.02).unwrap();
    let torus = shapes::torus(0.7, 0.1, 96, 24).unwrap();
    for (mesh, length, kept) in [(torus, 0.7, 0.0), (plate.clone(), 0.08, 0.8), (plate, 0.3, 0.1)] {
        let even = remeshed(&mesh, length..=length).unwrap();
        assert!(even.triangles().len() * 2 < mesh.triangles().len(), "{length}: {}", even.triangles().len());
        assert!(is_closed(&even).unwrap() && euler(&even) == euler(&mesh), "{length}: {}", euler(&even));
        assert_eq!(
            2 * topology(&even).edges().len(),
            3 * even.triangles().len(),
            "{length}: an edge of more than two triangles"
        );
        assert!(volume(&even) > kept * volume(&mesh), "{length}: {} of {}", volume(&even), volume(&mesh));
    }
}

/// An open sheet keeps its rim; colours go with the surface.
#[test]
fn rims_and_colours_stay() {
    let sheet = grid(12, |x, y| [x / 12.0, y / 12.0, 0.0]);
    let colors = sheet.positions().iter().map(|p| [p[0], p[1], 0.5]).collect();
    let sheet = sheet.with_appearance(Appearance::VertexColors(colors)).unwrap();
    for length in [0.03, 0.15] {
        let even = remeshed(&sheet, length..=length).unwrap();
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

/// The distance of a point from a triangle: from its plane where the point lies over it, else from its nearest edge.
fn from_triangle(p: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let normal = (b - a).cross(c - a);
    let over = [(a, b), (b, c), (c, a)].iter().all(|(from, to)| (*to - *from).cross(p - *from).dot(normal) >= 0.0);
    if over && normal != DVec3::ZERO {
        return ((p - a).dot(normal) / normal.length()).abs();
    }
    let from_edge = |(from, to): (DVec3, DVec3)| {
        let part = (p - from).dot(to - from) / (to - from).length_squared();
        p.distance(from.lerp(to, part.clamp(0.0, 1.0)))
    };
    [(a, b), (b, c), (c, a)].into_iter().map(from_edge).fold(f64::INFINITY, f64::min)
}

/// The largest distance of some points from a mesh.
fn farthest(points: impl Iterator<Item = DVec3>, mesh: &Mesh) -> f64 {
    let triangles: Vec<[DVec3; 3]> = mesh.triangles().iter().map(|t| t.map(|v| point(mesh, v))).collect();
    points.map(|p| triangles.iter().map(|t| from_triangle(p, *t)).fold(f64::INFINITY, f64::min)).fold(0.0, f64::max)
}

fn centers(mesh: &Mesh) -> impl Iterator<Item = DVec3> {
    mesh.triangles().iter().map(|t| (point(mesh, t[0]) + point(mesh, t[1]) + point(mesh, t[2])) / 3.0)
}

/// A ball with bumps, each some edges wide, coloured by its vertices' places.
fn bumpy() -> Mesh {
    let ball = shapes::icosphere(4).unwrap();
    let bump = |[x, y, z]: [f32; 3]| 1.0 + 0.06 * (9.0 * x).sin() * (8.0 * y).cos() * (7.0 * z + 1.0).sin();
    let bumpy = mapped(&ball, |p| p.map(|x| bump(p) * x));
    let colors = Appearance::VertexColors(bumpy.positions().to_vec());
    bumpy.with_appearance(colors).unwrap()
}

/// Vertices lie on the surface that is replaced, with its colours there, and triangles hardly leave it: a mesh that is
/// remeshed again and again keeps its bumps.
#[test]
fn no_detail_is_lost() {
    let bumpy = bumpy();
    let length = 0.06;
    let even = remeshed(&bumpy, length..=length).unwrap();
    // One point in five is tested: each is compared with every triangle.
    let off = farthest(points(&even).into_iter().step_by(5), &bumpy);
    assert!(off < 1e-6, "a vertex is {off} off the surface");
    let Appearance::VertexColors(colors) = even.appearance() else { panic!("the colours went") };
    for (p, color) in even.positions().iter().zip(colors) {
        assert!(DVec3::from(p.map(f64::from)).distance(DVec3::from(color.map(f64::from))) < 1e-6, "{p:?}: {color:?}");
    }
    let again = (0..tier(1, 4)).fold(even, |mesh, _| remeshed(&mesh, length..=length).unwrap());
    let off = [farthest(centers(&again).step_by(5), &bumpy), farthest(points(&bumpy).into_iter().step_by(5), &again)];
    assert!(off.iter().all(|off| *off < 0.2 * length), "{off:?}, edges of {length}");
    assert!((volume(&again) / volume(&bumpy) - 1.0).abs() < 0.003, "{} of {}", volume(&again), volume(&bumpy));
}

/// The cube's edges and corners are what they were, however its triangles change.
#[test]
fn creases_and_corners_stay() {
    for length in [0.07, 0.15, 0.4] {
        let even = remeshed(&cube(), length..=length).unwrap();
        let side = f64::from(cube().positions()[0][0].abs());
        let along = |i: usize| side * (i as f64 / 10.0 - 1.0);
        let creases = (0..=20).flat_map(|i| [DVec3::new(side, side, along(i)), DVec3::new(along(i), -side, side)]);
        let off = farthest(creases, &even);
        assert!(off < 1e-6, "{length}: {off}");
        assert!((volume(&even) / volume(&cube()) - 1.0).abs() < 1e-6, "{length}: {}", volume(&even));
    }
}

/// A surface of samples is evened out as before surfaces were kept: its edges and corners are smoothed.
#[test]
fn samples_are_smoothed() {
    let even = evened(&cube(), 0.15).unwrap();
    assert!(is_closed(&even).unwrap() && euler(&even) == 2);
    let off = farthest(points(&cube()).into_iter(), &even);
    assert!((0.01..0.15).contains(&off), "{off}");
    assert!(matches!(evened(&cube(), 0.0), Err(Error::Fit { .. })));
}

/// Edges are short where the surface is bent and long where it is flat, and between the two ends of the range.
#[test]
fn edges_follow_the_curvature() {
    let even = remeshed(&remeshed(&cube(), 0.1..=0.1).unwrap(), 0.04..=0.2).unwrap();
    assert!(is_closed(&even).unwrap() && euler(&even) == 2);
    let side = f64::from(cube().positions()[0][0].abs());
    let mean = |is_in: &dyn Fn(DVec3) -> bool| {
        let topology = topology(&even);
        let ends = topology.edges().iter().map(|e| e.map(|v| point(&even, v)));
        let lengths: Vec<f64> = ends.filter(|[a, b]| is_in(0.5 * (*a + *b))).map(|[a, b]| a.distance(b)).collect();
        lengths.iter().sum::<f64>() / lengths.len() as f64
    };
    let second = |p: DVec3| {
        let mut sizes = p.abs().to_array();
        sizes.sort_by(f64::total_cmp);
        sizes[1] / side
    };
    let [flat, bent] = [mean(&|p| second(p) < 0.4), mean(&|p| second(p) > 0.97)];
    assert!(flat > 0.16 && bent < 0.09, "{flat} where it is flat, {bent} at the cube's edges");
}

/// A mesh of 100 000 triangles takes seconds.
#[test]
fn a_large_mesh_is_remeshed_in_seconds() {
    // The quick tier has a sixteenth of them.
    let coarse = tier(4, 1);
    let torus = shapes::torus(0.7, 0.3, 320 / coarse, 160 / coarse).unwrap();
    assert!(torus.triangles().len() >= 100_000 / (coarse * coarse) as usize);
    let before = std::time::Instant::now();
    let length = 0.01 * f64::from(coarse);
    let even = remeshed(&torus, length..=2.0 * length).unwrap();
    let seconds = before.elapsed().as_secs_f64();
    assert!(is_closed(&even).unwrap() && euler(&even) == 0);
    assert!(seconds < 60.0, "{seconds} s");
}

#[test]
fn what_cannot_be_remeshed_is_refused() {
    for length in [0.0, -1.0, f64::NAN, 1e-6] {
        let refused = remeshed(&cube(), length..=length);
        assert!(matches!(&refused, Err(Error::Fit { what, .. }) if what.contains("edges of")), "{length}: {refused:?}");
    }
    let painted = remeshed(&shapes::cube().unwrap(), 0.5..=0.5);
    assert!(matches!(&painted, Err(Error::Fit { what, .. }) if what.contains("textured")), "{painted:?}");
    for edges in [0.2..=0.1, 0.1..=f64::INFINITY] {
        assert!(matches!(remeshed(&cube(), edges), Err(Error::Fit { fix, .. }) if fix.contains("the shorter first")));
    }
    let needle = Mesh::new(vec![[0.0; 3], [1e9, 0.0, 0.0], [2e9, 0.0, 0.0]], vec![[0, 1, 2]]).unwrap();
    assert!(matches!(remeshed(&needle, 0.1..=0.1), Err(Error::Fit { .. })), "no area, but no end of edges");
    // Nothing at all stays nothing.
    let empty = Mesh::new(Vec::new(), Vec::new()).unwrap();
    assert_eq!(remeshed(&empty, 0.5..=0.5).unwrap().triangles().len(), 0);
    // A triangle with a corner twice has no area and goes.
    let flat = Mesh::new(cube().positions().to_vec(), [cube().triangles(), &[[0, 0, 1]]].concat()).unwrap();
    assert!(is_closed(&remeshed(&flat, 0.3..=0.3).unwrap()).unwrap());
}
