//! The way from vertices to pieces against the official pipeline's recorded numbers.
//!
//! Without `../shared/reference` these tests pass without testing anything, and say so.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use super::parameters::{Leaves, Parameters, Values};
use super::setup::{Corner, Piece, pieces};
use super::tape;
use crate::scene::{Camera, Lights, Mesh, Outputs, Projection, Scene, Settings, Shading};
use std::path::PathBuf;

const FOV: Projection = Projection::Perspective { fov_y: 60.0 * std::f64::consts::PI / 180.0 };

/// `pipeline.npz`: a deformed sphere on its way through the official pipeline.
struct Pipeline(PathBuf);

impl Pipeline {
    fn open() -> Option<Self> {
        let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/reference/pipeline.npz");
        if !path.exists() {
            println!("SKIPPED: {} is not there, nothing was tested", path.display());
            return None;
        }
        Some(Self(path))
    }

    fn array<T: npyz::Deserialize>(&self, key: &str) -> Vec<T> {
        let mut npz = npyz::npz::NpzArchive::open(&self.0).unwrap();
        npz.by_name(key).unwrap().unwrap().into_vec().unwrap()
    }

    fn points(&self, key: &str) -> Vec<[f64; 3]> {
        self.array::<f64>(key).chunks(3).map(|p| p.try_into().unwrap()).collect()
    }

    fn triangles(&self) -> Vec<[u32; 3]> {
        self.array::<i32>("faces").chunks(3).map(|t| [t[0], t[1], t[2]].map(|v| v as u32)).collect()
    }

    /// The scene, its camera and settings, and its inputs in f64.
    fn scene(&self, projection: Projection, shading: Shading) -> (Scene, [Camera; 1], Settings, Parameters) {
        let vertices = self.points("vertices");
        let rounded = vertices.iter().map(|p| p.map(|x| x as f32)).collect();
        let lights = Lights { shading, ..Lights::official() };
        let scene = Scene::new(Mesh::new(rounded, self.triangles()).unwrap()).with_lights(lights);
        let cameras = [Camera::from_angles(2.732, 30.0, 40.0, projection).unwrap()];
        let outputs = Outputs { color: true, silhouette: true, depth: true, normal: true };
        let settings = Settings { outputs, ..Settings::default() };
        let mut parameters = Parameters::new(&scene, &cameras, &settings);
        parameters.values_mut()[..3 * vertices.len()].copy_from_slice(vertices.as_flattened());
        (scene, cameras, settings, parameters)
    }

    fn pieces(&self, projection: Projection, shading: Shading) -> Vec<Piece<f64>> {
        let (scene, cameras, settings, parameters) = self.scene(projection, shading);
        pieces(&scene, &cameras, &settings, &parameters, 0, &Values(parameters.values()))
    }
}

/// The largest difference between what a corner has and what its vertex (or, for `by_face`, its face) should have.
fn worst(
    triangles: &[[u32; 3]],
    pieces: &[Piece<f64>],
    expected: &[[f64; 3]],
    by_face: bool,
    of: impl Fn(&Corner<f64>) -> [f64; 3],
) -> f64 {
    assert_eq!(pieces.len(), triangles.len());
    let corners = pieces.iter().flat_map(|piece| (0..3).map(move |k| (piece, k)));
    let differences = corners.flat_map(|(piece, k)| {
        let index = if by_face { piece.triangle } else { triangles[piece.triangle][k] as usize };
        let got = of(&piece.corners[k]);
        (0..3).map(move |axis| (got[axis] - expected[index][axis]).abs())
    });
    differences.fold(0.0, |worst: f64, d| if d.is_nan() { f64::INFINITY } else { worst.max(d) })
}

/// The official camera mirrors the image.
fn mirrored(corner: &Corner<f64>) -> [f64; 3] {
    [-corner.screen[0], corner.screen[1], corner.z]
}

#[test]
fn cameras_are_the_official_ones_mirrored() {
    let Some(official) = Pipeline::open() else { return };
    let triangles = official.triangles();
    let orthographic = Projection::Orthographic { half_height: 1.0 / 0.7 };
    let perspective = official.pieces(FOV, Shading::Flat);
    let orthogonal = official.pieces(orthographic, Shading::Flat);
    let expected = official.points("perspective30");
    assert!(worst(&triangles, &perspective, &expected, false, mirrored) < 1e-12);
    assert!(worst(&triangles, &orthogonal, &official.points("orthogonal_scale0p7"), false, mirrored) < 1e-12);
    // The comparison sees an unmirrored image.
    assert!(worst(&triangles, &perspective, &expected, false, |c| [c.screen[0], c.screen[1], c.z]) > 0.1);
    let view = Projection::Orthographic { half_height: 1.0 };
    assert!(
        worst(&triangles, &official.pieces(view, Shading::Flat), &official.points("look_at"), false, mirrored) < 1e-12
    );
}

#[test]
fn normals_and_lights_are_the_official_ones() {
    let Some(official) = Pipeline::open() else { return };
    let triangles = official.triangles();
    let (flat, smooth) = (official.pieces(FOV, Shading::Flat), official.pieces(FOV, Shading::Smooth));
    let normal = |c: &Corner<f64>| c.normal;
    let tint = |c: &Corner<f64>| c.tint;
    let checks = [
        ("surface normals", worst(&triangles, &flat, &official.points("surface_normals"), true, normal)),
        ("vertex normals", worst(&triangles, &smooth, &official.points("vertex_normals"), false, normal)),
        ("surface light", worst(&triangles, &flat, &official.points("light_surface"), true, tint)),
        ("vertex light", worst(&triangles, &smooth, &official.points("light_vertex"), false, tint)),
    ];
    for (name, difference) in checks {
        println!("{name}: {difference:.2e}");
        assert!(difference < 1e-9, "{name}: {difference:e}");
    }
    assert!(worst(&triangles, &smooth, &official.points("surface_normals"), true, normal) > 0.01);
}

#[test]
fn the_projection_has_the_official_gradient() {
    let Some(official) = Pipeline::open() else { return };
    let (scene, cameras, settings, parameters) = official.scene(FOV, Shading::Flat);
    let upstream = official.points("upstream_projected");
    tape::clear();
    let pieces = pieces(&scene, &cameras, &settings, &parameters, 0, &Leaves(parameters.values()));
    let mut seen = vec![false; upstream.len()];
    let mut seeds = Vec::new();
    for (piece, triangle) in pieces.iter().zip(official.triangles()) {
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
    let expected = official.points("grad_vertices");
    let differences = gradient.positions(0).iter().zip(expected.as_flattened()).map(|(a, b)| (a - b).abs());
    let worst = differences.fold(0.0, f64::max);
    println!("projection gradient: {worst:.2e}");
    assert!(worst < 1e-12, "{worst:e}");
}
