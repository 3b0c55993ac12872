//! Normals and the light that falls on them.

use super::parameters::{Parameters, Source};
use super::real::{Real, add, cross, dot, multiply, normalize, scale, sub};
use softras::scene::{Mesh, Shading};

/// The scene's lights as numbers `R` that may carry derivatives.
pub struct Lamps<R> {
    ambient: [R; 3],
    /// Unit direction, colour · intensity.
    directional: Vec<([R; 3], [R; 3])>,
}

impl<R: Real> Lamps<R> {
    /// Reads the scene's lights.
    pub fn load<S: Source<R = R>>(parameters: &Parameters, source: &S) -> Self {
        let slots = parameters.layout().lights.clone();
        let directional = (slots.start + 4..slots.end).step_by(7).map(|slot| {
            let color = scale(source.row(slot + 3), source.load(slot + 6));
            (normalize(source.row(slot)), color)
        });
        Self {
            ambient: scale(source.row(slots.start), source.load(slots.start + 3)),
            directional: directional.collect(),
        }
    }

    /// Whether the light depends on the normal.
    pub fn need_normals(&self) -> bool {
        !self.directional.is_empty()
    }

    /// L(n) = ambient + Σ colour · intensity · max(0, n · direction).
    pub fn on(&self, normal: [R; 3]) -> [R; 3] {
        self.directional.iter().fold(self.ambient, |sum, &(direction, color)| {
            let cosine = dot(normal, direction);
            if cosine.value() > 0.0 { add(sum, scale(color, cosine)) } else { sum }
        })
    }
}

/// A unit normal for each triangle's corner, outward where triangles are counter-clockwise; zero without area. With smooth
/// shading a vertex's own normal if the mesh gives one, which is a constant.
pub fn corner_normals<R: Real>(mesh: &Mesh, world: &[[R; 3]], shading: Shading) -> Vec<[[R; 3]; 3]> {
    let faces: Vec<[R; 3]> = mesh.triangles().iter().map(|t| face_cross(t, world)).collect();
    match shading {
        Shading::Flat => faces.iter().map(|&n| [normalize(n); 3]).collect(),
        Shading::Smooth => {
            let mut sums = vec![[R::zero(); 3]; world.len()];
            for (triangle, &normal) in mesh.triangles().iter().zip(&faces) {
                for &vertex in triangle {
                    sums[vertex as usize] = add(sums[vertex as usize], normal);
                }
            }
            let mut normals: Vec<[R; 3]> = sums.into_iter().map(normalize).collect();
            for (normal, given) in normals.iter_mut().zip(mesh.normals()) {
                if given.iter().any(|&x| x != 0.0) {
                    *normal = normalize(given.map(|x| R::constant(x.into())));
                }
            }
            mesh.triangles().iter().map(|t| t.map(|v| normals[v as usize])).collect()
        }
    }
}

/// The unnormalised normal, as long as twice the triangle's area.
fn face_cross<R: Real>(triangle: &[u32; 3], world: &[[R; 3]]) -> [R; 3] {
    let [a, b, c] = triangle.map(|v| world[v as usize]);
    cross(sub(b, a), sub(c, a))
}

/// Light at each of a triangle's corners times the corner's own colour.
pub fn tint<R: Real>(lamps: &Lamps<R>, normals: [[R; 3]; 3], colors: [[R; 3]; 3]) -> [[R; 3]; 3] {
    std::array::from_fn(|k| multiply(colors[k], lamps.on(normals[k])))
}
