//! The kernels `smooth`, `smooth_dense`, `step_totals`, `optimizer`, `position_step` and `color_step` on the host, and
//! the logit part of `shape_gradient`.

use super::FitState;
use crate::fit::device::arithmetic::{
    GROUP, Rates, Vec3, adam_step, add, group_sum, logit_of, next_first, next_second, scale, strided_sum, sub, tangent,
};
use crate::fit::device::plan::FitPlan;
use crate::fit::device::smoother::{Chebyshev, Smoother};
use crate::fit::device::tables::Tables;
use crate::fit::optimizer::Method;

/// One step of the vertices against their gradient.
pub fn advance(plan: &FitPlan, tables: &Tables, state: &mut FitState, mut gradient: Vec<Vec3>, rate: f64) {
    state.steps = state.steps.saturating_add(1);
    let rates = FitPlan::rates(plan.method, state.steps, rate);
    if plan.logit {
        let centre = pull(tables, &state.parameters, &mut gradient);
        gradient.push(centre);
    }
    if let Some(smoothing) = &plan.smoothing {
        gradient = smoothed(smoothing, tables, &gradient);
    }
    let mut changes = optimized(plan.method, &mut state.moments, &gradient, &rates);
    if plan.logit {
        state.parameters.iter_mut().zip(&changes).for_each(|(p, change)| *p = sub(*p, *change));
        state.positions = logit_positions(tables, &state.parameters);
        return;
    }
    if let Some(smoothing) = &plan.smoothing {
        changes = smoothed(smoothing, tables, &changes);
    }
    state.positions.iter_mut().zip(&changes).for_each(|(p, change)| *p = sub(*p, *change));
}

/// One step of the colours.
pub fn advance_colors(state: &mut FitState, gradient: &[Vec3], rate: f64) {
    state.color_steps = state.color_steps.saturating_add(1);
    let rates = FitPlan::rates(Method::ADAM, state.color_steps, rate);
    let changes = optimized(Method::ADAM, &mut state.color_moments, gradient, &rates);
    for (color, change) in state.colors.iter_mut().zip(changes) {
        *color = sub(*color, change).map(|x| x.clamp(0.0, 1.0));
    }
}

fn shift_of(centre: Vec3) -> Vec3 {
    centre.map(tangent)
}

/// The positions that logit parameters give; their last row is the centre.
pub fn logit_positions(tables: &Tables, parameters: &[Vec3]) -> Vec<Vec3> {
    let shift = shift_of(parameters.last().copied().unwrap_or_default());
    let one = |(odds, d): (&[f32; 4], &Vec3)| [0, 1, 2].map(|k| logit_of(odds[k], d[k], shift[k]).position);
    tables.logit_template.iter().zip(parameters).map(one).collect()
}

/// Converts dL by vertices to dL by displacements, in place, and returns dL by the centre.
fn pull(tables: &Tables, parameters: &[Vec3], gradient: &mut [Vec3]) -> Vec3 {
    let shift = shift_of(parameters.last().copied().unwrap_or_default());
    let mut by_centre = vec![[0.0; 3]; gradient.len().next_multiple_of(GROUP)];
    for (i, g) in gradient.iter_mut().enumerate() {
        for k in 0..3 {
            let at = logit_of(tables.logit_template[i][k], parameters[i][k], shift[k]);
            let slope = 1.0 - shift[k] * shift[k];
            by_centre[i][k] = g[k] * at.by_shift * slope;
            g[k] *= at.by_displacement;
        }
    }
    let partials: Vec<Vec3> = by_centre.as_chunks::<GROUP>().0.iter().map(|lanes| group_sum(*lanes)).collect();
    strided_sum(partials.len(), |i| partials[i])
}

/// Updates the moments and returns what is to be subtracted from the parameters.
fn optimized(method: Method, moments: &mut [[Vec3; 2]], gradient: &[Vec3], rates: &Rates) -> Vec<Vec3> {
    if let Method::Adam { .. } | Method::UniformAdam { .. } = method {
        moments.iter_mut().zip(gradient).for_each(|(m, g)| m[1] = next_second(m[1], *g, rates));
    }
    let largest = moments.iter().flat_map(|m| m[1]).fold(0.0f32, f32::max);
    let pace = rates.rate / rates.first_bias / ((largest / rates.second_bias).sqrt() + rates.epsilon);
    let one = |(m, g): (&mut [Vec3; 2], &Vec3)| {
        m[0] = next_first(m[0], *g, rates);
        match method {
            Method::Sgd { .. } => scale(rates.rate, m[0]),
            Method::Adam { .. } => adam_step(m[0], m[1], rates),
            Method::UniformAdam { .. } => scale(pace, m[0]),
        }
    };
    moments.iter_mut().zip(gradient).map(one).collect()
}

fn smoothed(smoothing: &Smoother, tables: &Tables, rough: &[Vec3]) -> Vec<Vec3> {
    match smoothing {
        Smoother::Iterated(chebyshev) => iterated(chebyshev, &tables.neighbors, rough),
        Smoother::Dense => {
            let row = |entries: &[f32]| {
                entries.iter().zip(rough).fold([0.0; 3], |sum, (entry, vector)| add(sum, scale(*entry, *vector)))
            };
            tables.inverse.chunks_exact(rough.len().max(1)).map(row).collect()
        }
    }
}

/// Solves the smoothing by Chebyshev's iteration.
fn iterated(smoothing: &Chebyshev, neighbors: &[u32], rough: &[Vec3]) -> Vec<Vec3> {
    let (mut newer, mut older) = (vec![[0.0; 3]; rough.len()], vec![[0.0; 3]; rough.len()]);
    for (iterates, omega) in smoothing.omegas.iter().enumerate() {
        let one = |i: usize| {
            let row = &neighbors[neighbors[i] as usize..neighbors[i + 1] as usize];
            let row = if iterates > 0 { row } else { &[] };
            let sum = row.iter().fold([0.0; 3], |sum, &j| add(sum, newer[j as usize]));
            let x = newer[i];
            let product = add(x, scale(smoothing.lambda, sub(scale(row.len() as f32, x), sum)));
            let next = add(x, scale(smoothing.relaxation, sub(rough[i], product)));
            let next = scale(*omega, sub(next, older[i]));
            add(next, older[i])
        };
        let next = (0..rough.len()).map(one).collect();
        older = std::mem::replace(&mut newer, next);
    }
    newer
}
