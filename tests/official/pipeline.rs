//! The official renderer's way from vertices to the screen, recomputed from its published formulas: the camera at an eye
//! that looks at the origin, its two projections, normals, and its default light. Nothing here is shared with `src`.
//!
//! The official camera mirrors: its x axis points to the left of the image.

pub type Vector = [f64; 3];

fn minus(a: Vector, b: Vector) -> Vector {
    [0, 1, 2].map(|k| a[k] - b[k])
}

fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(a: Vector) -> Vector {
    a.map(|x| x / dot(a, a).sqrt())
}

/// The eye at a distance, elevation and azimuth (degrees) around the origin.
pub fn eye(distance: f64, elevation: f64, azimuth: f64) -> Vector {
    let (e, a) = (elevation.to_radians(), azimuth.to_radians());
    [distance * e.cos() * a.sin(), distance * e.sin(), -distance * e.cos() * a.cos()]
}

/// The view's axes x, y (up) and z (forward).
fn axes(eye: Vector) -> [Vector; 3] {
    let z = unit(eye.map(|x| -x));
    let x = unit(cross([0.0, 1.0, 0.0], z));
    [x, unit(cross(z, x)), z]
}

/// View space of a camera at `eye` that looks at the origin.
pub fn look_at(eye: Vector, points: &[Vector]) -> Vec<Vector> {
    let axes = axes(eye);
    points.iter().map(|&p| axes.map(|axis| dot(axis, minus(p, eye)))).collect()
}

/// The perspective projection of half the opening angle, in degrees.
pub fn perspective(view: &[Vector], half_angle: f64) -> Vec<Vector> {
    let width = half_angle.to_radians().tan();
    view.iter().map(|&[x, y, z]| [x / z / width, y / z / width, z]).collect()
}

pub fn orthogonal(view: &[Vector], scale: f64) -> Vec<Vector> {
    view.iter().map(|&[x, y, z]| [x * scale, y * scale, z]).collect()
}

/// Each face's normal, not normalised: as long as twice the face's area.
fn areas(points: &[Vector], faces: &[[u32; 3]]) -> Vec<Vector> {
    let area = |face: &[u32; 3]| {
        let [a, b, c] = face.map(|v| points[v as usize]);
        cross(minus(c, b), minus(a, b))
    };
    faces.iter().map(area).collect()
}

pub fn surface_normals(points: &[Vector], faces: &[[u32; 3]]) -> Vec<Vector> {
    areas(points, faces).into_iter().map(unit).collect()
}

pub fn vertex_normals(points: &[Vector], faces: &[[u32; 3]]) -> Vec<Vector> {
    let mut sums = vec![[0.0; 3]; points.len()];
    for (face, area) in faces.iter().zip(areas(points, faces)) {
        for &vertex in face {
            sums[vertex as usize] = [0, 1, 2].map(|k| sums[vertex as usize][k] + area[k]);
        }
    }
    sums.into_iter().map(unit).collect()
}

/// White light: 0.5 from everywhere and 0.5 from straight above.
pub fn light(normals: &[Vector]) -> Vec<Vector> {
    normals.iter().map(|n| [0.5 + 0.5 * n[1].max(0.0); 3]).collect()
}

/// The derivative of Σ upstream · perspective(look_at(points)) by the points.
pub fn perspective_gradient(eye: Vector, points: &[Vector], half_angle: f64, upstream: &[Vector]) -> Vec<Vector> {
    let (axes, width) = (axes(eye), half_angle.to_radians().tan());
    let by_point = |(&[x, y, z], &[ux, uy, uz]): (&Vector, &Vector)| {
        let by_view = [ux / z / width, uy / z / width, uz - (ux * x + uy * y) / (z * z * width)];
        [0, 1, 2].map(|k| (0..3).map(|axis| by_view[axis] * axes[axis][k]).sum())
    };
    look_at(eye, points).iter().zip(upstream).map(by_point).collect()
}
