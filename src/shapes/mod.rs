//! Built-in meshes: closed, counter-clockwise seen from outside, around the origin and within ±1.1.

mod fish;
mod level_set;
mod named;
mod solids;

pub use fish::fish;
pub use level_set::Samples;
pub use named::{NAMES, by_name, finer};

use crate::{
    error::{Error, Result, shown},
    scene::{Appearance, Mesh},
};
use glam::DVec3;
use std::{collections::HashMap, f64::consts::TAU};

fn shape_error<T>(what: String, fix: String) -> Result<T> {
    Err(Error::Mesh { what, place: "shapes".into(), fix })
}

/// A cube of side 1.2, 12 triangles, with another colour on each face: red and cyan at +x and -x, green and magenta at
/// +y and -y, blue and yellow at +z and -z.
///
/// # Errors
/// Never; the result type is that of the other shapes.
pub fn cube() -> Result<Mesh> {
    let corner = |i: u32| [i & 1, i >> 1 & 1, i >> 2 & 1].map(|bit| if bit == 1 { 0.6 } else { -0.6 });
    // For each face its corners in a ring; bit 0 of a corner's number is x, bit 1 y, bit 2 z.
    let faces = [[1, 3, 7, 5], [0, 4, 6, 2], [2, 6, 7, 3], [0, 1, 5, 4], [4, 5, 7, 6], [0, 2, 3, 1]];
    let colors = [[0.9, 0.2, 0.2], [0.2, 0.8, 0.8], [0.2, 0.7, 0.2], [0.8, 0.3, 0.8], [0.2, 0.3, 0.9], [0.9, 0.8, 0.2]];
    let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let texels = colors.iter().flat_map(|&color| [color; 2]).collect();
    Mesh::new((0..8).map(corner).collect(), triangles)?.with_appearance(Appearance::Surface { resolution: 1, texels })
}

/// A white sphere of radius 1: an icosahedron whose edges are halved `subdivisions` times, so 20·4ⁿ triangles and
/// 10·4ⁿ + 2 vertices (1280 and 642 for 3, the sphere of the SoftRas paper).
///
/// # Errors
/// [`Error::Mesh`] above 9 subdivisions (5 million triangles).
pub fn icosphere(subdivisions: u32) -> Result<Mesh> {
    if subdivisions > 9 {
        return shape_error(format!("icosphere of {subdivisions} subdivisions"), "use 0 to 9".into());
    }
    let golden = (1.0 + 5f64.sqrt()) / 2.0;
    let mut points = Vec::new();
    for sign in [[-1.0, 1.0], [1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]] {
        let [a, b] = [sign[0], sign[1] * golden];
        points.extend([DVec3::new(a, b, 0.0), DVec3::new(0.0, a, b), DVec3::new(b, 0.0, a)]);
    }
    points.iter_mut().for_each(|p| *p = p.normalize());
    let mut triangles = icosahedron_faces(&points);
    for _ in 0..subdivisions {
        triangles = subdivide(&mut points, &triangles);
    }
    Mesh::new(points.iter().map(|p| p.as_vec3().to_array()).collect(), triangles)
}

/// The triples of mutually nearest points, turned outwards.
fn icosahedron_faces(points: &[DVec3]) -> Vec<[u32; 3]> {
    let adjacent = |i: usize, j: usize| points[i].dot(points[j]) > 0.4;
    let mut faces = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if adjacent(a, b) && adjacent(b, c) && adjacent(c, a) {
                    let outwards = points[a].cross(points[b]).dot(points[c]) > 0.0;
                    let face = if outwards { [a, b, c] } else { [a, c, b] };
                    faces.push(face.map(|i| i as u32));
                }
            }
        }
    }
    faces
}

/// Four triangles from each, new vertices pushed out to the unit sphere.
fn subdivide(points: &mut Vec<DVec3>, triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let mut middles = HashMap::new();
    let mut middle = |a: u32, b: u32| {
        *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
            points.push((points[a as usize] + points[b as usize]).normalize());
            points.len() as u32 - 1
        })
    };
    let mut finer = Vec::with_capacity(triangles.len() * 4);
    for &[a, b, c] in triangles {
        let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
        finer.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
    }
    finer
}

/// A ring about the z axis in the colours of the rainbow: `tube` is the radius of the tube, `ring` that of its centre
/// line; `around` and `across` are the quads along and around the tube.
///
/// # Errors
/// [`Error::Mesh`] unless 0 < tube < ring, both finite, and 3 to 4096 quads each way.
pub fn torus(ring: f64, tube: f64, around: u32, across: u32) -> Result<Mesh> {
    if !(tube > 0.0 && tube < ring && ring < 1e9) {
        return shape_error(
            format!("torus of radii {} and {}", shown(ring), shown(tube)),
            "use 0 < tube < ring".into(),
        );
    }
    if !((3..=4096).contains(&around) && (3..=4096).contains(&across)) {
        return shape_error(format!("torus of {around}×{across} quads"), "use 3 to 4096 each way".into());
    }
    let (mut positions, mut colors, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..around {
        let a = TAU * f64::from(i) / f64::from(around);
        let index = |i: u32, j: u32| (i % around) * across + j % across;
        for j in 0..across {
            let b = TAU * f64::from(j) / f64::from(across);
            let radius = ring + tube * b.cos();
            positions.push([radius * a.cos(), radius * a.sin(), tube * b.sin()].map(|x| x as f32));
            colors.push(rainbow(a));
            let quad = [index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)];
            triangles.extend([[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]]);
        }
    }
    Mesh::new(positions, triangles)?.with_appearance(Appearance::VertexColors(colors))
}

/// A colour of the rainbow by its angle.
fn rainbow(angle: f64) -> [f32; 3] {
    [0.0, 1.0, 2.0].map(|third| (0.5 + 0.45 * (angle - TAU * third / 3.0).cos()) as f32)
}

#[cfg(test)]
mod tests {
    use super::named::{NAMES, by_name, finer};
    use super::*;
    use std::collections::HashSet;

    /// Vertices that triangles use - edges + triangles, of a closed mesh; `None` unless each edge is met exactly once
    /// in each direction.
    fn euler_characteristic(mesh: &Mesh) -> Option<i64> {
        let mut edges = HashSet::new();
        for &[a, b, c] in mesh.triangles() {
            if ![(a, b), (b, c), (c, a)].into_iter().all(|edge| edges.insert(edge)) {
                return None;
            }
        }
        let closed = edges.iter().all(|&(a, b)| a != b && edges.contains(&(b, a)));
        let used: HashSet<u32> = mesh.triangles().iter().flatten().copied().collect();
        closed.then_some(used.len() as i64 - edges.len() as i64 / 2 + mesh.triangles().len() as i64)
    }

    fn corners(mesh: &Mesh, triangle: &[u32; 3]) -> [DVec3; 3] {
        triangle.map(|i| DVec3::from(mesh.positions()[i as usize].map(f64::from)))
    }

    fn volume(mesh: &Mesh) -> f64 {
        let six_times = |t| corners(mesh, t)[0].cross(corners(mesh, t)[1]).dot(corners(mesh, t)[2]);
        mesh.triangles().iter().map(six_times).sum::<f64>() / 6.0
    }

    /// Whether the first triangle that a ray along -x from outside hits shows its front; `None` if it hits none.
    fn first_hit_is_front(mesh: &Mesh, y: f64, z: f64) -> Option<bool> {
        let side = |a: DVec3, b: DVec3| (b.y - a.y) * (z - a.z) - (b.z - a.z) * (y - a.y);
        let mut hit: Option<(f64, bool)> = None;
        for triangle in mesh.triangles() {
            let [a, b, c] = corners(mesh, triangle);
            let sides = [side(b, c), side(c, a), side(a, b)];
            let area: f64 = sides.iter().sum();
            if sides.iter().all(|s| s * area > 0.0) {
                let x = (sides[0] * a.x + sides[1] * b.x + sides[2] * c.x) / area;
                if hit.is_none_or(|(nearest, _)| x > nearest) {
                    hit = Some((x, area > 0.0));
                }
            }
        }
        hit.map(|(_, front)| front)
    }

    #[test]
    fn shapes_are_closed_and_face_outwards() -> Result<()> {
        let shapes = [
            ("cube", 2, 1.7),
            ("icosphere", 2, 4.0),
            ("torus", 0, 1.2),
            ("fish", 2, 0.3),
            ("double-torus", -2, 0.4),
            ("mug", 0, 0.6),
            ("chair", 2, 0.3),
        ];
        assert_eq!(shapes.map(|(name, ..)| name), NAMES);
        for (name, euler, least_volume) in shapes {
            let mesh = by_name(name)?;
            assert_eq!(euler_characteristic(&mesh), Some(euler), "{name}");
            assert!(volume(&mesh) > least_volume, "{name}: {}", volume(&mesh));
            let mut hits = 0;
            for i in 0..400 {
                let (y, z) = (f64::from(i % 20) / 10.0 - 0.9513, f64::from(i / 20) / 10.0 - 0.9531);
                if let Some(front) = first_hit_is_front(&mesh, y, z) {
                    assert!(front, "{name} at y {y}, z {z}");
                    hits += 1;
                }
            }
            assert!(hits > 20, "{name}: {hits}");
            let (low, high) = mesh.bounds().unwrap_or_default();
            assert!(low.iter().chain(&high).all(|x| x.abs() <= 1.1), "{name}: {low:?} {high:?}");
            let flat =
                mesh.triangles().iter().map(|t| corners(&mesh, t)).map(|[a, b, c]| (b - a).cross(c - a).length());
            assert!(flat.fold(1.0, f64::min) > 1e-7, "{name} has a triangle without area");
        }
        Ok(())
    }

    #[test]
    fn the_checks_see_a_hole_and_a_turned_triangle() -> Result<()> {
        let cube = cube()?;
        let mut triangles = cube.triangles().to_vec();
        triangles[3].swap(0, 1);
        let turned = Mesh::new(cube.positions().to_vec(), triangles.clone())?;
        triangles.remove(3);
        let open = Mesh::new(cube.positions().to_vec(), triangles)?;
        let inside_out = cube.triangles().iter().map(|&[a, b, c]| [a, c, b]).collect();
        let inside_out = Mesh::new(cube.positions().to_vec(), inside_out)?;
        assert_eq!([&turned, &open].map(euler_characteristic), [None; 2]);
        assert!(volume(&inside_out) < 0.0);
        assert_eq!(first_hit_is_front(&inside_out, 0.1, 0.2), Some(false));
        Ok(())
    }

    #[test]
    fn counts_are_those_of_the_documentation() -> Result<()> {
        let count = |mesh: Mesh| (mesh.positions().len(), mesh.triangles().len());
        assert_eq!(count(icosphere(0)?), (12, 20));
        assert_eq!(count(icosphere(3)?), (642, 1280));
        assert_eq!(count(torus(1.0, 0.5, 3, 4)?), (12, 24));
        assert!((volume(&icosphere(5)?) / (TAU * 2.0 / 3.0) - 1.0).abs() < 0.01);
        let (triangles, vertices) = (fish()?.triangles().len(), fish()?.positions().len());
        assert!((3000..6000).contains(&triangles) && vertices == triangles / 2 + 2);
        Ok(())
    }

    /// Finer meshes are the same shapes: closed, of nearly the same volume, and with the coarse one's points.
    #[test]
    fn finer_shapes_are_the_same_shapes() -> Result<()> {
        for (name, euler) in [("fish", 2), ("torus", 0)] {
            let [coarse, fine] = [finer(name, 1)?, finer(name, 3)?];
            assert_eq!(coarse.positions(), by_name(name)?.positions());
            assert_eq!(euler_characteristic(&fine), Some(euler), "{name}");
            assert!(fine.triangles().len() > 8 * coarse.triangles().len(), "{name}");
            assert!((volume(&fine) / volume(&coarse) - 1.0).abs() < 0.02, "{name}: {}", volume(&fine));
            let near = |p: &[f32; 3]| fine.positions().iter().any(|q| (0..3).all(|k| (p[k] - q[k]).abs() < 1e-6));
            assert!(coarse.positions().iter().step_by(37).all(near), "{name}");
        }
        Ok(())
    }

    #[test]
    fn what_cannot_be_made_is_said() {
        for (shape, word) in [
            (by_name("teapot"), "cube, icosphere, torus, fish, double-torus, mug, chair"),
            (finer("teapot", 2), "use one of"),
            (finer("mug", 2), "fish or torus"),
            (finer("fish", 17), "1 to 16"),
            (icosphere(10), "0 to 9"),
            (torus(1.0, 2.0, 9, 9), "0 < tube < ring"),
            (torus(1.0, f64::NAN, 9, 9), "0 < tube < ring"),
            (torus(1.0, 0.5, 2, 9), "3 to 4096"),
        ] {
            assert!(shape.is_err_and(|error| error.to_string().contains(word)), "{word}");
        }
    }
}
