//! Meshes that are put together from prisms, each of a colour.

use softras::scene::Appearance;
use softras::{Mesh, Result};

/// A horizontal section of a prism: centre and half sizes along x and z.
#[derive(Clone, Copy, Debug)]
pub struct Section {
    pub center: [f64; 2],
    pub half: [f64; 2],
}

impl Section {
    pub fn new(center: [f64; 2], half: [f64; 2]) -> Self {
        Self { center, half }
    }
}

/// Closed parts that may overlap.
#[derive(Clone, Debug, Default)]
pub struct Solid {
    positions: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
    colors: Vec<[f32; 3]>,
}

impl Solid {
    /// Adds a prism between two horizontal sections: a box for four sides, else an ellipse with that many sides.
    pub fn prism(&mut self, sides: usize, low: (f64, Section), high: (f64, Section), color: [f32; 3]) {
        let first = self.positions.len() as u32;
        let corner = |i: usize| {
            let turn = std::f64::consts::TAU * (i as f64 + 0.5) / sides as f64;
            // The corners of a box lie on its half sizes.
            let reach = if sides == 4 { std::f64::consts::SQRT_2 } else { 1.0 };
            [reach * turn.cos(), reach * turn.sin()]
        };
        for (y, Section { center, half }) in [low, high] {
            let place = |[x, z]: [f64; 2]| [center[0] + half[0] * x, y, center[1] + half[1] * z];
            self.positions.extend((0..sides).map(|i| place(corner(i))));
            self.positions.push([center[0], y, center[1]]);
        }
        let n = sides as u32;
        for i in 0..n {
            let next = (i + 1) % n;
            let [a, b, c, d] = [i, next, n + 1 + i, n + 1 + next].map(|k| first + k);
            self.triangles.extend([[a, c, b], [b, c, d], [a, b, first + n], [d, c, first + 2 * n + 1]]);
        }
        self.colors.resize(self.positions.len(), color);
    }

    /// Adds an upright box by its lowest and its highest corner.
    pub fn block(&mut self, low: [f64; 3], high: [f64; 3], color: [f32; 3]) {
        let section = Section::new(
            [(low[0] + high[0]) / 2.0, (low[2] + high[2]) / 2.0],
            [(high[0] - low[0]) / 2.0, (high[2] - low[2]) / 2.0],
        );
        self.prism(4, (low[1], section), (high[1], section), color);
    }

    /// The mesh with vertex colours, moved and scaled so that the box around it is centred and its longest side is `size`.
    pub fn mesh(&self, size: f64) -> Result<Mesh> {
        let positions = self.positions.iter().map(|p| p.map(|x| x as f32)).collect();
        let mesh = Mesh::new(positions, self.triangles.clone())?;
        normalized(mesh, size)?.with_appearance(Appearance::VertexColors(self.colors.clone()))
    }
}

/// The mesh with the box around it centred and its longest side `size`.
pub fn normalized(mut mesh: Mesh, size: f64) -> Result<Mesh> {
    let (low, high) = mesh.bounds().unwrap_or(([0.0; 3], [0.0; 3]));
    let side = (0..3).map(|k| f64::from(high[k]) - f64::from(low[k])).fold(1e-30, f64::max);
    let place = |p: &[f32; 3]| {
        [0, 1, 2].map(|k| ((f64::from(p[k]) - (f64::from(low[k]) + f64::from(high[k])) / 2.0) * size / side) as f32)
    };
    mesh.set_positions(mesh.positions().iter().map(place).collect())?;
    Ok(mesh)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use softras_fit::{Voxels, is_closed};

    #[test]
    fn parts_are_closed_and_turned_outwards() {
        let mut solid = Solid::default();
        solid.block([0.0, 0.0, 0.0], [2.0, 1.0, 1.0], [1.0; 3]);
        let mesh = solid.mesh(1.0).unwrap();
        assert!(is_closed(&mesh).unwrap());
        let voxels = Voxels::new(&mesh, [-0.5; 3], 1.0, 20).unwrap();
        assert!((voxels.volume() - 0.25).abs() < 1e-9, "{}", voxels.volume());
        let volume = |mesh: &Mesh| {
            let corner = |i: u32| softras::glam::DVec3::from_array(mesh.positions()[i as usize].map(f64::from));
            mesh.triangles().iter().map(|t| corner(t[0]).dot(corner(t[1]).cross(corner(t[2]))) / 6.0).sum::<f64>()
        };
        assert!((volume(&mesh) - 0.25).abs() < 1e-6, "{}", volume(&mesh));
        let mut round = Solid::default();
        let section = Section::new([3.0, 1.0], [1.0, 1.0]);
        round.prism(64, (0.0, section), (1.0, section), [1.0; 3]);
        assert!((volume(&round.mesh(2.0).unwrap()) - std::f64::consts::PI).abs() < 0.01);
    }
}
