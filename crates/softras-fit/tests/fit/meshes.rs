//! Meshes of the tests, what is measured of them, and their silhouettes.

use glam::DVec3;
use softras::{Camera, Mesh, Projection, Renderer, Scene, Settings, shapes};
use softras_fit::Topology;
use softras_io::Views;

pub const PERSPECTIVE: Projection = Projection::Perspective { fov_y: 0.6 };

/// Cameras that look at the origin from a distance, at angles of elevation and azimuth in degrees.
pub fn cameras(projection: Projection, distance: f64, angles: impl IntoIterator<Item = [f64; 2]>) -> Vec<Camera> {
    let one = |[elevation, azimuth]: [f64; 2]| Camera::from_angles(distance, elevation, azimuth, projection).unwrap();
    angles.into_iter().map(one).collect()
}

/// The hard silhouettes of a mesh, in pictures of a width and a height.
pub fn silhouettes(renderer: &mut Renderer, mesh: &Mesh, cameras: Vec<Camera>, (width, height): (u32, u32)) -> Views {
    let settings = Settings { width, height, sigma: 1e-7, ..Settings::default() };
    let frame = renderer.render(&Scene::new(mesh.clone()), &cameras, &settings).unwrap();
    Views { silhouette: frame.silhouette().ok().cloned(), cameras, ..Views::default() }
}

/// The mesh in one colour with its vertices elsewhere.
pub fn mapped(mesh: &Mesh, place: impl Fn([f32; 3]) -> [f32; 3]) -> Mesh {
    Mesh::new(mesh.positions().iter().map(|p| place(*p)).collect(), mesh.triangles().to_vec()).unwrap()
}

/// The mesh scaled and then moved.
pub fn moved(mesh: &Mesh, scale: f32, by: [f32; 3]) -> Mesh {
    mapped(mesh, |p| [0, 1, 2].map(|k| scale * p[k] + by[k]))
}

/// The mesh scaled along each axis.
pub fn scaled(mesh: &Mesh, by: [f32; 3]) -> Mesh {
    mapped(mesh, |p| [0, 1, 2].map(|k| by[k] * p[k]))
}

/// Two meshes as one.
pub fn both(a: &Mesh, b: &Mesh) -> Mesh {
    let count = a.positions().len() as u32;
    let positions = [a.positions(), b.positions()].concat();
    let triangles = a.triangles().iter().copied().chain(b.triangles().iter().map(|t| t.map(|v| v + count)));
    Mesh::new(positions, triangles.collect()).unwrap()
}

/// The cube in one colour.
pub fn cube() -> Mesh {
    mapped(&shapes::cube().unwrap(), |p| p)
}

/// The mesh without some of its triangles.
pub fn without(mesh: &Mesh, gone: impl Fn(usize) -> bool) -> Mesh {
    let kept = mesh.triangles().iter().enumerate().filter(|(t, _)| !gone(*t)).map(|(_, triangle)| *triangle);
    Mesh::new(mesh.positions().to_vec(), kept.collect()).unwrap()
}

/// A flat square of `cells` cells a side, two triangles each, with corners at whole numbers, moved by `place`.
pub fn grid(cells: u32, place: impl Fn(f32, f32) -> [f32; 3]) -> Mesh {
    let side = cells + 1;
    let positions = (0..side * side).map(|i| place((i % side) as f32, (i / side) as f32)).collect();
    let cell = |i: u32| {
        let low = i / cells * side + i % cells;
        [[low, low + 1, low + side + 1], [low, low + side + 1, low + side]]
    };
    Mesh::new(positions, (0..cells * cells).flat_map(cell).collect()).unwrap()
}

pub fn point(mesh: &Mesh, vertex: u32) -> DVec3 {
    DVec3::from(mesh.positions()[vertex as usize].map(f64::from))
}

pub fn points(mesh: &Mesh) -> Vec<DVec3> {
    (0..mesh.positions().len() as u32).map(|v| point(mesh, v)).collect()
}

pub fn topology(mesh: &Mesh) -> Topology {
    Topology::of(mesh).unwrap()
}

/// Parts, and handles where it is closed.
pub fn genus(mesh: &Mesh) -> (usize, Option<usize>) {
    topology(mesh).parts_and_genus()
}

/// Vertices less edges plus triangles: 2 for a ball, 0 for a torus, 1 for a disc.
pub fn euler(mesh: &Mesh) -> i64 {
    mesh.positions().len() as i64 - topology(mesh).edges().len() as i64 + mesh.triangles().len() as i64
}

/// The volume of a closed mesh, below 0 where it is inside out.
pub fn volume(mesh: &Mesh) -> f64 {
    let six = |t: &[u32; 3]| point(mesh, t[0]).dot(point(mesh, t[1]).cross(point(mesh, t[2])));
    mesh.triangles().iter().map(six).sum::<f64>() / 6.0
}
