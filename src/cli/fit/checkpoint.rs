//! A fit put aside in an .npz file.

use crate::cli::npz::{self, Archive, Data};
use softras::Result;
use softras::fit::shape::{ShapeFit, State};
use std::path::Path;

/// Writes a fit whose next step is `step`.
pub fn write(path: &Path, fit: &ShapeFit, step: usize) -> Result<()> {
    let state = fit.state();
    let steps = [step as f64, f64::from(state.optimizer.0), f64::from(state.color_optimizer.0)];
    let arrays: [(&str, &[f64]); 7] = [
        ("steps", &steps),
        ("values", &state.values),
        ("mean", &state.optimizer.1),
        ("square", &state.optimizer.2),
        ("colors", &state.color_values),
        ("color_mean", &state.color_optimizer.1),
        ("color_square", &state.color_optimizer.2),
    ];
    let entries: Vec<_> = arrays.iter().map(|(key, data)| (*key, vec![data.len()], Data::F64(data))).collect();
    npz::write(path, &entries)
}

/// The next step and the state.
pub fn read(path: &Path) -> Result<(usize, State)> {
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
    Ok((next as usize, state))
}
