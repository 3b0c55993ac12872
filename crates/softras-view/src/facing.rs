//! The sides of a mesh that a camera sees.
//!
//! A triangle's front is the side from which its corners run counter-clockwise. A material may be drawn from the front alone, as
//! those of glTF are by default, and [`seen`] leaves out its other triangles. Pictures for people light what is seen: the normals
//! of both sides point to the viewer. The model itself does neither: it draws both sides, with the normals of the front.

use crate::crease::area;
use glam::DVec3;
use softras::{Camera, Mesh, Projection, Result, scene::Appearance};
use std::borrow::Cow;

/// Back faces lie farther away than they do by this share of their distance, which is more than depths are rounded by. So of two
/// faces in one place, back to back, each is seen from its own side.
const BEHIND: f64 = 1e-5;
/// Normals are turned if they lean this much away from the viewer's side of their triangle, in the mean: on grass they may point
/// straight up, along the triangle.
const LEAN: f64 = 0.1;

/// Whether each triangle shows its front to a camera.
pub fn fronts(mesh: &Mesh, camera: &Camera) -> Vec<bool> {
    let place = |p: &[f32; 3]| camera.to_view(DVec3::from(p.map(f64::from)));
    let places: Vec<DVec3> = mesh.positions().iter().map(place).collect();
    let is_parallel = matches!(camera.projection(), Projection::Orthographic { .. } | Projection::Screen);
    let is_front = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|i| places[i as usize]);
        // x is right, y up and z forward, so that a counter-clockwise triangle's product points along the line of sight.
        (b - a).cross(c - a).dot(if is_parallel { DVec3::Z } else { a }) > 0.0
    };
    mesh.triangles().iter().map(is_front).collect()
}

/// The mesh without those single-sided triangles that a camera sees from behind. `single_sided` is
/// [`Loaded::single_sided`](softras_io::Loaded::single_sided). Scenes for [`softras::Renderer`] and [`softras::embed`] take it for each
/// camera, if they are to show a glTF file's materials as the format says.
///
/// # Errors
/// As [`Mesh::part`].
pub fn seen(mesh: &Mesh, single_sided: &[bool], camera: &Camera) -> Result<Mesh> {
    mesh.part(&all_seen(mesh, single_sided, camera))
}

/// The numbers of the triangles that [`seen`] keeps.
pub fn all_seen(mesh: &Mesh, single_sided: &[bool], camera: &Camera) -> Vec<usize> {
    let fronts = if single_sided.contains(&true) { fronts(mesh, camera) } else { Vec::new() };
    let is_seen = |t: &usize| !single_sided.get(*t).is_some_and(|single| *single && !fronts[*t]);
    (0..mesh.triangles().len()).filter(is_seen).collect()
}

/// A mesh, and for each triangle whether it is seen from the front alone; none at all if all are seen from both sides.
#[derive(Debug)]
pub struct Sided {
    pub mesh: Mesh,
    pub single_sided: Vec<bool>,
}

impl Sided {
    /// Some of the triangles.
    pub fn part(&self, kept: &[usize]) -> Result<Self> {
        let single_sided = kept.iter().filter_map(|&t| self.single_sided.get(t).copied()).collect();
        Ok(Self { mesh: self.mesh.part(kept)?, single_sided })
    }

    /// The mesh without the single-sided triangles that a camera sees from behind. `turns`: its normals point to the viewer.
    pub fn shown(&self, camera: &Camera, turns: bool) -> Result<Mesh> {
        let seen = match self.single_sided.contains(&true) {
            true => Cow::Owned(seen(&self.mesh, &self.single_sided, camera)?),
            false => Cow::Borrowed(&self.mesh),
        };
        if turns { turned(&seen, camera) } else { Ok(seen.into_owned()) }
    }
}

/// The mesh with all normals on the viewer's side of their triangles, and back faces a little behind their places. Vertices are
/// repeated for triangles that need them otherwise.
///
/// # Errors
/// As [`Mesh::new`].
pub fn turned(mesh: &Mesh, camera: &Camera) -> Result<Mesh> {
    let [right, up, forward] = camera.axes();
    let is_parallel = matches!(camera.projection(), Projection::Orthographic { .. });
    let behind = |p: [f32; 3]| {
        let p = DVec3::from(p.map(f64::from));
        let DVec3 { x, y, z } = camera.to_view(p);
        let sight = z * forward + if is_parallel { DVec3::ZERO } else { x * right + y * up };
        (p + BEHIND * sight).as_vec3().to_array()
    };
    let (mut positions, mut normals) = (mesh.positions().to_vec(), mesh.normals().to_vec());
    let mut appearance = mesh.appearance().clone();
    let lean = |front: bool, triangle: [u32; 3]| {
        let sum: DVec3 = triangle.iter().map(|&v| DVec3::from(mesh.normals()[v as usize].map(f64::from))).sum();
        let side = if front { 1.0 } else { -1.0 };
        side * area(mesh, triangle).normalize_or_zero().dot(sum) / 3.0
    };
    // Each vertex's copies: with its normal turned, farther away, and both.
    let mut copies = vec![[u32::MAX; 3]; positions.len()];
    let mut copy = |v: u32, is_turned: bool, is_back: bool| {
        let known = &mut copies[v as usize][usize::from(is_turned) + 2 * usize::from(is_back) - 1];
        if *known == u32::MAX {
            *known = positions.len() as u32;
            let position = positions[v as usize];
            positions.push(if is_back { behind(position) } else { position });
            if let Some(normal) = normals.get(v as usize).copied() {
                normals.push(if is_turned { normal.map(|x| -x) } else { normal });
            }
            if let Appearance::VertexColors(colors) = &mut appearance {
                colors.push(colors[v as usize]);
            }
        }
        *known
    };
    let of_triangle = |(&triangle, front): (&[u32; 3], bool)| {
        let is_turned = !mesh.normals().is_empty() && lean(front, triangle) < -LEAN;
        if front && !is_turned { triangle } else { triangle.map(|v| copy(v, is_turned, !front)) }
    };
    let triangles = mesh.triangles().iter().zip(fronts(mesh, camera)).map(of_triangle).collect();
    Mesh::new(positions, triangles)?.with_appearance(appearance)?.with_normals(normals)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use softras::shapes;

    fn camera(z: f64, half_height: Option<f64>) -> Camera {
        let projection = half_height
            .map_or(Projection::Perspective { fov_y: 0.9 }, |half_height| Projection::Orthographic { half_height });
        Camera::look_direction(DVec3::new(0.3, 0.2, z), DVec3::new(0.0, 0.0, -z), DVec3::Y, projection).unwrap()
    }

    fn vector(all: &[[f32; 3]], at: u32) -> DVec3 {
        DVec3::from(all[at as usize].map(f64::from))
    }

    #[test]
    fn single_sided_triangles_are_seen_from_their_front() {
        let cube = shapes::cube().unwrap();
        let [single, double] = [[true; 12], [false; 12]];
        let count = |single: &[bool], z: f64, flat| seen(&cube, single, &camera(z, flat)).unwrap().triangles().len();
        for z in [5.0, -5.0] {
            assert_eq!([count(&single, z, None), count(&single, z, Some(2.0))], [2, 2]);
            assert_eq!([count(&double, z, None), count(&[], z, None)], [12, 12]);
        }
        // From inside, all of them face away.
        assert_eq!(count(&single, 0.1, None), 0);
        let front = seen(&cube, &single, &camera(5.0, None)).unwrap();
        assert!(front.positions().iter().all(|p| p[2] > 0.5));
    }

    #[test]
    fn normals_are_on_the_viewers_side_and_backs_are_behind() {
        // Two triangles of one place, back to back, and a third whose normal points up along it.
        let places = vec![
            [-1.0, -1.0, 0.0],
            [1.0, -1.0, 0.0],
            [0.0, 1.0, 0.0],
            [-1.0, -1.0, 0.0],
            [1.0, -1.0, 0.0],
            [0.0, 1.0, 0.0],
        ];
        let normals = [[[0.0, 0.0, 1.0]; 3], [[0.0, 1.0, 0.0]; 3]].concat();
        let colors = Appearance::VertexColors((0..6).map(|i| [i as f32; 3]).collect());
        let mesh = Mesh::new(places, vec![[0, 1, 2], [2, 1, 0], [3, 4, 5]]).unwrap();
        let mesh = mesh.with_appearance(colors).unwrap().with_normals(normals).unwrap();
        for (camera, side) in [(camera(5.0, None), 1.0), (camera(-5.0, None), -1.0), (camera(-5.0, Some(2.0)), -1.0)] {
            let turned = turned(&mesh, &camera).unwrap();
            let Appearance::VertexColors(colors) = turned.appearance() else { unreachable!() };
            for (t, (old, new)) in mesh.triangles().iter().zip(turned.triangles()).enumerate() {
                let is_back = !fronts(&mesh, &camera)[t];
                for (&old, &new) in old.iter().zip(new) {
                    let expected = if t == 2 { DVec3::Y } else { side * DVec3::Z };
                    assert_eq!(vector(turned.normals(), new), expected, "{t}");
                    assert_eq!(colors[new as usize], [old as f32; 3]);
                    let [before, after] = [(&mesh, old), (&turned, new)].map(|(mesh, v)| vector(mesh.positions(), v));
                    let [before, after] = [before, after].map(|p| camera.project(p, (200, 200)).unwrap());
                    assert!((after[2] / before[2] - if is_back { 1.0 + BEHIND } else { 1.0 }).abs() < 1e-6);
                    assert!((0..2).all(|k| (after[k] - before[k]).abs() < 1e-3), "{before:?} {after:?}");
                }
            }
        }
    }
}
