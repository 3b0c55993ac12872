//! Small scenes for the official equations, and the same scenes for softras.

use super::equations::Triangles;
use softras::Mesh;
use softras::scene::{
    Appearance, ColorAggregation, Distance, Faces, FrontFace, Parity, Settings, SilhouetteAggregation,
};
use softras_check::random::Random;

/// One official mode: everything that changes how the official renderer aggregates.
#[derive(Clone, Copy, Debug)]
pub struct Mode {
    pub distance: Distance,
    pub silhouette: SilhouetteAggregation,
    pub color: ColorAggregation,
    pub faces: Faces,
    /// R of a surface texture; `None` for vertex colours.
    pub resolution: Option<usize>,
    /// Near and far lie within the scene, so that triangles are beyond both.
    pub narrow: bool,
}

/// Every mode that the official renderer has.
pub fn every_mode() -> Vec<Mode> {
    let mut modes = Vec::new();
    for distance in [Distance::Euclidean, Distance::Barycentric, Distance::Hard] {
        for silhouette in [SilhouetteAggregation::Product, SilhouetteAggregation::Sum, SilhouetteAggregation::Hard] {
            for color in [ColorAggregation::Softmax, ColorAggregation::Hard] {
                for faces in [Faces::Both, Faces::Front] {
                    for resolution in [None, Some(1), Some(4)] {
                        let mode = |narrow| Mode { distance, silhouette, color, faces, resolution, narrow };
                        modes.extend([mode(false), mode(true)]);
                    }
                }
            }
        }
    }
    modes
}

impl Mode {
    pub fn settings(&self, width: u32, height: u32) -> Settings {
        let (near, far) = if self.narrow { (2.4, 4.1) } else { (1.0, 10.0) };
        Settings {
            width,
            height,
            sigma: 2e-3,
            gamma: 3e-2,
            // As likely as a triangle in the middle of the range, so that the background's share can be seen.
            epsilon: 0.3,
            near,
            far,
            color: self.color,
            silhouette: self.silhouette,
            distance: self.distance,
            background_color: [0.1, 0.5, 0.3],
            faces: self.faces,
            front_face: FrontFace::Clockwise,
            parity: Parity::Official,
            ..Settings::default()
        }
    }
}

/// Random triangles that overlap, of both windings, some partly out of view.
pub fn random_triangles(seed: u64, count: usize, resolution: Option<usize>) -> Triangles {
    let random = &mut Random::new(seed);
    let corner = |random: &mut Random, [x, y]: [f64; 2], depth: f64| {
        let offset = random.direction();
        [x + 0.6 * offset.x, y + 0.6 * offset.y, depth + 0.4 * offset.z].map(|x| f64::from(x as f32))
    };
    let mut corners = Vec::new();
    while corners.len() < count {
        let centre = [random.range(-0.8, 0.8), random.range(-0.8, 0.8)];
        let depth = random.range(2.0, 4.5);
        let [a, b, c] = [(); 3].map(|()| corner(random, centre, depth));
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        // Slivers tell more of rounding than of the equations.
        if area.abs() > 0.1 {
            corners.push([a, b, c]);
        }
    }
    let colors = (0..count * resolution.map_or(3, |r| r * r)).map(|_| random.color().map(f64::from)).collect();
    Triangles { corners, colors, resolution }
}

/// The triangles as a mesh whose vertices are given on the screen.
pub fn mesh(triangles: &Triangles) -> Mesh {
    let positions = triangles.corners.concat().into_iter().map(|p| p.map(|x| x as f32)).collect();
    let indices = (0..triangles.corners.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let colors = triangles.colors.iter().map(|c| c.map(|x| x as f32)).collect();
    let appearance = match triangles.resolution {
        None => Appearance::VertexColors(colors),
        Some(resolution) => Appearance::Surface { resolution: resolution as u32, texels: colors },
    };
    Mesh::new(positions, indices).unwrap().with_appearance(appearance).unwrap()
}
