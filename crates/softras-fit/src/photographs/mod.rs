//! The views of a fit: their cameras, colours and masks, and how far they can be believed.

pub mod agreement;
pub mod cameras;
pub mod color;
pub mod exposure;
pub mod mask_width;
pub mod refine;
pub mod seen;
pub mod subject;
pub mod unseen;
