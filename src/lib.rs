//! softras: a differentiable soft mesh rasterizer (Liu et al., "Soft Rasterizer", ICCV 2019) as a Vulkan compute backend.

pub mod backward_plan;
pub mod buffers;
pub mod error;
pub mod gradients;
pub mod image;
#[cfg(feature = "obj")]
pub mod obj;
pub mod pack;
pub mod passes;
pub mod plan;
#[cfg(feature = "reference")]
pub mod reference;
pub mod renderer;
pub mod scene;
pub mod shapes;
pub mod vulkan;

pub use error::{Error, Result};
pub use gradients::{GradientMode, Gradients, ImageGradient, Wanted};
pub use image::Image;
pub use renderer::{Frame, Renderer, RendererOptions};
pub use scene::{Camera, Lights, Mesh, Projection, Scene, Settings};
pub use vulkan::constants;
