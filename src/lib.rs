//! softras: a differentiable soft mesh rasterizer (Liu et al., "Soft Rasterizer", ICCV 2019) as a Vulkan compute backend.

pub mod error;
pub mod image;
#[cfg(feature = "reference")]
pub mod reference;
pub mod renderer;
pub mod scene;
pub mod vulkan;

pub use error::{Error, Result};
pub use image::Image;
pub use renderer::{Frame, Renderer};
pub use scene::{Camera, Lights, Mesh, Projection, Scene, Settings};
