//! Checkpoints: the state of a fit as an .npz file.

use crate::{ShapeFit, State};
use softras::{Mesh, Result};
use softras_io::Budget;
use softras_io::npy::Data;
use softras_io::npz::{self, Archive};
use std::path::Path;

/// More steps than any fit has taken: a hundred times the most that a run may take.
const MAX_STEPS: f64 = 1e8;

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
///
/// # Errors
/// [`softras::Error::File`] naming the key for what no checkpoint holds.
pub fn read(path: &Path, budget: Budget) -> Result<(usize, Mesh, State)> {
    let archive = Archive::open(path, budget)?;
    let fault =
        |key: &str, what: String| archive.fault(key, &what, "give a file that `softras fit --checkpoint` wrote");
    let numbers = |key: &str| -> Result<Vec<f64>> {
        let array = archive.require(key, "give a file that `softras fit --checkpoint` wrote")?;
        let numbers = archive.numbers(key, array)?;
        match numbers.iter().position(|x| !x.is_finite()) {
            Some(i) => Err(fault(key, format!("value {i} is {:?}", numbers.at(i)))),
            None => Ok(numbers.iter().collect()),
        }
    };
    let squares = |key: &str| -> Result<Vec<f64>> {
        let numbers = numbers(key)?;
        match numbers.iter().position(|x| *x < 0.0) {
            Some(i) => Err(fault(key, format!("square {i} is {:?}", numbers[i]))),
            None => Ok(numbers),
        }
    };
    let steps = numbers("steps")?;
    let [next, taken, color_taken] = steps[..] else {
        return Err(fault("steps", format!("has {} numbers, not three", steps.len())));
    };
    let count = |x: f64| match x.fract() == 0.0 && (0.0..=MAX_STEPS).contains(&x) {
        true => Ok(x as i32),
        false => Err(fault("steps", format!("{x:?} is no number of steps"))),
    };
    let state = State {
        values: numbers("values")?,
        optimizer: (count(taken)?, numbers("mean")?, squares("square")?),
        color_values: numbers("colors")?,
        color_optimizer: (count(color_taken)?, numbers("color_mean")?, squares("color_square")?),
    };
    let triples = |key: &str| -> Result<Vec<[f64; 3]>> {
        let numbers = numbers(key)?;
        let (triples, rest) = numbers.as_chunks();
        if rest.is_empty() { Ok(triples.to_vec()) } else { Err(fault(key, "is not of three numbers each".into())) }
    };
    let positions = triples("positions")?.into_iter().map(|p| p.map(|x| x as f32)).collect();
    // Numbers that are not indices are replaced by one that `Mesh::new` refuses.
    let index = |x: f64| if x >= 0.0 && x.fract() == 0.0 { x as u32 } else { u32::MAX };
    let triangles = triples("triangles")?.into_iter().map(|t| t.map(index)).collect();
    let mesh = Mesh::new(positions, triangles).map_err(|error| fault("triangles", error.to_string()))?;
    Ok((count(next)? as usize, mesh, state))
}
