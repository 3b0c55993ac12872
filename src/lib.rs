//! softras: a differentiable soft mesh rasterizer (Liu et al., "Soft Rasterizer", ICCV 2019) as a Vulkan compute backend.
//!
//! A triangle's influence on a pixel is a probability, the sigmoid of its signed squared distance over σ. A pixel's colour is a
//! softmax, by depth over γ, of all triangles near it; its silhouette is one minus the product of their complements. So
//! an image has a gradient to every vertex, colour, texel, light and camera, occluded ones too.
//!
//! ```
//! use softras::{Camera, Image, ImageGradient, Projection, Renderer, Scene, Settings, Wanted, shapes};
//!
//! # fn main() -> softras::Result<()> {
//! let mut renderer = Renderer::new()?;
//! let scene = Scene::new(shapes::icosphere(2)?);
//! let camera = Camera::from_angles(3.0, 30.0, 45.0, Projection::Perspective { fov_y: 1.0 })?;
//! let settings = Settings { sigma: 1e-4, save: true, ..Settings::default() };
//!
//! let frame = renderer.render(&scene, &[camera], &settings)?;
//! // The loss is the mean silhouette: its gradient is the same everywhere.
//! let silhouette = frame.silhouette().expect("asked for by default");
//! let weight = 1.0 / silhouette.data.len() as f32;
//! let upstream = Image { data: vec![weight; silhouette.data.len()], ..silhouette.clone() };
//! let gradients = renderer.backward(&frame, &ImageGradient::silhouette(upstream), &Wanted::default())?;
//! assert_eq!(gradients.meshes[0].positions.len(), scene.meshes[0].positions().len());
//! # Ok(())
//! # }
//! ```
//!
//! # Conventions
//! World space is right-handed, y up. View space has x right, y up and depth z growing forward. On the screen y runs from
//! -1 to 1 upwards and x from -a to a, a = width / height: one unit is half the image's height on both axes. Row 0 of an
//! image is its top. Images are not mirrored.
//!
//! # Where things are
//! both; [`fit`] turns gradients into shape, colour and pose; `measure` says what a frame costs and must cost; `stress`
//! draws scenes to break it. Below them, [`rasterizer`] is the same for an engine with a device of its own, and what
//! [`renderer`] is built on; [`plan`] turns sizes into buffers and dispatches, [`passes`] records a frame, and [`vulkan`]
//! is where `unsafe` lives.

mod blank;
pub mod buffers;
pub mod error;
pub mod fit;
pub mod gradients;
pub mod image;
#[cfg(feature = "reference")]
pub mod measure;
#[cfg(feature = "obj")]
pub mod obj;
pub mod pack;
pub mod passes;
pub mod pipelines;
pub mod plan;
pub mod rasterizer;
#[cfg(feature = "reference")]
pub mod reference;
pub mod renderer;
pub mod scene;
pub mod shapes;
#[cfg(feature = "reference")]
pub mod stress;
pub mod vulkan;

pub use error::{Error, Result};
/// Vectors and matrices, as cameras take them.
pub use glam;
pub use gradients::{GradientMode, Gradients, ImageGradient, Wanted};
pub use image::Image;
pub use rasterizer::Rasterizer;
pub use renderer::{Frame, FrameCounts, Renderer, RendererOptions};
pub use scene::{Camera, Lights, Mesh, Projection, Scene, Settings};
pub use vulkan::constants;
