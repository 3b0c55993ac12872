//! Optimisation of a mesh by gradients: what moves, what is minimised, and how steps are taken.

pub mod image_loss;
pub mod optimizer;
pub mod regularizer;
pub mod run;
pub mod schedule;
pub mod shape;
pub mod smoothed_parameters;
pub mod soft_target;
