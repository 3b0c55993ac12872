//! The way from vertices to pieces against the official pipeline's published formulas, written down a second time in
//! `tests/official/pipeline.rs`.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use super::parameters::{Leaves, Parameters, Values};
use super::setup::{Corner, Piece, pieces};
use super::tape;
use softras::{
    scene::{Camera, Lights, Mesh, Outputs, Projection, Scene, Settings, Shading},
    shapes,
};

#[path = "../../../tests/official/pipeline.rs"]
mod pipeline;

use pipeline::{eye, light, look_at, orthogonal, perspective, perspective_gradient, surface_normals, vertex_normals};

const FOV: Projection = Projection::Perspective { fov_y: 60.0 * std::f64::consts::PI / 180.0 };
const HALF_ANGLE: f64 = 30.0;

/// A closed mesh with no symmetry, and the official camera before it.
struct Pipeline {
    points: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
    eye: [f64; 3],
}

impl Pipeline {
    fn new() -> Self {
        let sphere = shapes::icosphere(2).unwrap();
        let deformed = |p: &[f32; 3]| {
            let [x, y, z] = p.map(f64::from);
            [0.7 * x + 0.1 * (5.0 * y).sin(), 0.5 * y + 0.2 * x * z, 0.6 * z + 0.1 * (4.0 * x).cos()]
        };
        let points = sphere.positions().iter().map(deformed).collect();
        Self { points, triangles: sphere.triangles().to_vec(), eye: eye(2.732, 30.0, 40.0) }
    }

    /// The scene, its camera and settings, and its inputs in f64.
    fn scene(&self, projection: Projection, shading: Shading) -> (Scene, [Camera; 1], Settings, Parameters) {
        let rounded = self.points.iter().map(|p| p.map(|x| x as f32)).collect();
        let lights = Lights { shading, ..Lights::official() };
        let scene = Scene::new(Mesh::new(rounded, self.triangles.clone()).unwrap()).with_lights(lights);
        let cameras = [Camera::from_angles(2.732, 30.0, 40.0, projection).unwrap()];
        let settings = Settings { outputs: Outputs::ALL, ..Settings::default() };
        let mut parameters = Parameters::new(&scene, &cameras, &settings);
        parameters.values_mut()[..3 * self.points.len()].copy_from_slice(self.points.as_flattened());
        (scene, cameras, settings, parameters)
    }

    fn pieces(&self, projection: Projection, shading: Shading) -> Vec<Piece<f64>> {
        let (scene, cameras, settings, parameters) = self.scene(projection, shading);
        pieces(&scene, &cameras, &settings, &parameters, 0, &Values(parameters.values()))
    }

    /// The largest difference between what a corner has and what its vertex (or, for `by_face`, its face) should have.
    fn worst(
        &self,
        pieces: &[Piece<f64>],
        expected: &[[f64; 3]],
        by_face: bool,
        of: impl Fn(&Corner<f64>) -> [f64; 3],
    ) -> f64 {
        assert_eq!(pieces.len(), self.triangles.len());
        let corners = pieces.iter().flat_map(|piece| (0..3).map(move |k| (piece, k)));
        let differences = corners.flat_map(|(piece, k)| {
            let index = if by_face { piece.triangle } else { self.triangles[piece.triangle][k] as usize };
            let got = of(&piece.corners[k]);
            (0..3).map(move |axis| (got[axis] - expected[index][axis]).abs())
        });
        differences.fold(0.0, |worst: f64, d| if d.is_nan() { f64::INFINITY } else { worst.max(d) })
    }
}

/// The official camera mirrors the image.
fn mirrored(corner: &Corner<f64>) -> [f64; 3] {
    [-corner.screen[0], corner.screen[1], corner.z]
}

#[test]
fn cameras_are_the_official_ones_mirrored() {
    let official = Pipeline::new();
    let view = look_at(official.eye, &official.points);
    let pieces = official.pieces(FOV, Shading::Flat);
    let expected = perspective(&view, HALF_ANGLE);
    assert!(official.worst(&pieces, &expected, false, mirrored) < 1e-12);
    // The comparison sees an unmirrored image.
    assert!(official.worst(&pieces, &expected, false, |c| [c.screen[0], c.screen[1], c.z]) > 0.1);
    for scale in [0.7, 1.0] {
        let projection = Projection::Orthographic { half_height: 1.0 / scale };
        let pieces = official.pieces(projection, Shading::Flat);
        assert!(official.worst(&pieces, &orthogonal(&view, scale), false, mirrored) < 1e-12);
    }
}

#[test]
fn normals_and_lights_are_the_official_ones() {
    let official = Pipeline::new();
    let (flat, smooth) = (official.pieces(FOV, Shading::Flat), official.pieces(FOV, Shading::Smooth));
    let by_face = surface_normals(&official.points, &official.triangles);
    let by_vertex = vertex_normals(&official.points, &official.triangles);
    let normal = |c: &Corner<f64>| c.normal;
    let tint = |c: &Corner<f64>| c.tint;
    let checks = [
        ("surface normals", official.worst(&flat, &by_face, true, normal)),
        ("vertex normals", official.worst(&smooth, &by_vertex, false, normal)),
        ("surface light", official.worst(&flat, &light(&by_face), true, tint)),
        ("vertex light", official.worst(&smooth, &light(&by_vertex), false, tint)),
    ];
    for (name, difference) in checks {
        assert!(difference < 1e-12, "{name}: {difference:e}");
    }
    assert!(official.worst(&smooth, &by_face, true, normal) > 0.01);
}

#[test]
fn the_projection_has_the_official_gradient() {
    let official = Pipeline::new();
    let (scene, cameras, settings, parameters) = official.scene(FOV, Shading::Flat);
    let upstream: Vec<[f64; 3]> =
        (0..official.points.len()).map(|i| [i as f64, 0.3 * i as f64, 2.0].map(f64::sin)).collect();
    tape::clear();
    let pieces = pieces(&scene, &cameras, &settings, &parameters, 0, &Leaves(parameters.values()));
    let mut seen = vec![false; upstream.len()];
    let mut seeds = Vec::new();
    for (piece, triangle) in pieces.iter().zip(&official.triangles) {
        for (corner, vertex) in piece.corners.iter().zip(triangle.map(|v| v as usize)) {
            // Each vertex once, however many triangles share it.
            if !std::mem::replace(&mut seen[vertex], true) {
                let [x, y, z] = upstream[vertex];
                seeds.extend([(corner.screen[0], -x), (corner.screen[1], y), (corner.z, z)]);
            }
        }
    }
    let mut gradient = parameters.zeros_like();
    tape::propagate(seeds, gradient.values_mut());
    let expected = perspective_gradient(official.eye, &official.points, HALF_ANGLE, &upstream);
    let differences = gradient.positions(0).iter().zip(expected.as_flattened()).map(|(a, b)| (a - b).abs());
    let worst = differences.fold(0.0, f64::max);
    assert!(worst < 1e-12, "{worst:e}");
    assert!(expected.as_flattened().iter().any(|x| x.abs() > 0.1));
}
