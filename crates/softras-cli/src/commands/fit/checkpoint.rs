//! Checkpoints: the state of a fit as an .npz file.

use crate::commands::npz::{self, Archive, Data};
use softras::fit::{ShapeFit, State};
use softras::{Mesh, Result};
use std::path::Path;

/// Writes the state of a fit whose next step is `step`.
pub fn write(path: &Path, fit: &ShapeFit, step: usize) -> Result<()> {
    let state = fit.state();
    let steps = [step as f64, f64::from(state.optimizer.0), f64::from(state.color_optimizer.0)];
    let positions: Vec<f64> = fit.mesh().positions().as_flattened().iter().map(|&x| x.into()).collect();
    let triangles: Vec<f64> = fit.mesh().triangles().as_flattened().iter().map(|&i| i.into()).collect();
    let arrays: [(&str, &[f64]); 9] = [
        ("steps", &steps),
        ("values", &state.values),
        ("mean", &state.optimizer.1),
        ("square", &state.optimizer.2),
        ("colors", &state.color_values),
        ("color_mean", &state.color_optimizer.1),
        ("color_square", &state.color_optimizer.2),
        ("positions", &positions),
        ("triangles", &triangles),
    ];
    let entries: Vec<_> = arrays.iter().map(|(key, data)| (*key, vec![data.len()], Data::F64(data))).collect();
    npz::write(path, &entries)
}

/// Reads the next step, the mesh and the state.
pub fn read(path: &Path) -> Result<(usize, Mesh, State)> {
    let archive = Archive::open(path)?;
    let numbers = |key: &str| -> Result<Vec<f64>> {
        let array = archive.require(key, "give a file that `softras fit --checkpoint` wrote")?;
        archive.numbers(key, array).map(<[f64]>::to_vec)
    };
    let steps = numbers("steps")?;
    let (Some(&next), Some(&taken), Some(&color_taken)) = (steps.first(), steps.get(1), steps.get(2)) else {
        return Err(archive.fault("steps", "has fewer than three numbers", "give a file that --checkpoint wrote"));
    };
    let state = State {
        values: numbers("values")?,
        optimizer: (taken as i32, numbers("mean")?, numbers("square")?),
        color_values: numbers("colors")?,
        color_optimizer: (color_taken as i32, numbers("color_mean")?, numbers("color_square")?),
    };
    // Numbers that are not indices are replaced by one that `Mesh::new` refuses.
    let [positions, triangles] = [numbers("positions")?, numbers("triangles")?];
    let positions = positions.as_chunks().0.iter().map(|p: &[f64; 3]| p.map(|x| x as f32)).collect();
    let index = |x: f64| if x >= 0.0 && x.fract() == 0.0 { x as u32 } else { u32::MAX };
    let mesh = Mesh::new(positions, triangles.as_chunks().0.iter().map(|t: &[f64; 3]| t.map(index)).collect())?;
    Ok((next as usize, mesh, state))
}
