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
//! - [`Renderer`] opens a device, renders scenes and differentiates the images. [`Scene`], [`Mesh`], [`Camera`],
//!   [`Lights`] and [`Settings`] describe what it renders; [`Frame`], [`Image`] and [`Gradients`] are what comes back.
//! - [`shapes`] makes meshes, [`obj`] reads and writes them.
//! - [`fit`] turns gradients into shape, colour and pose.
//! - [`embed`] records the same frames into an engine's own command buffers, with the engine's own device and memory.
//! - `reference`, behind the feature of that name, computes images and gradients in f64 by brute force. The kernels are
//!   checked against it.

#![deny(unsafe_code)]

pub mod embed;
mod error;
#[cfg(feature = "fit")]
pub mod fit;
mod frame;
mod gradients;
mod image;
#[doc(hidden)]
pub mod internals;
#[cfg(feature = "obj")]
pub mod obj;
#[cfg(feature = "reference")]
pub mod reference;
#[cfg(feature = "renderer")]
mod renderer;
pub mod scene;
pub mod shapes;
#[allow(unsafe_code)]
mod vulkan;

pub use error::{Error, Result};
/// Vectors and matrices, as cameras take them.
pub use glam;
pub use gradients::{CameraGradient, GradientMode, Gradients, ImageGradient, LightGradients, MeshGradients, Wanted};
pub use image::Image;
#[cfg(feature = "renderer")]
pub use renderer::{Frame, FrameCounts, Renderer, RendererOptions, StageTime};
pub use scene::{Camera, Lights, Mesh, Projection, Scene, Settings};
#[cfg(feature = "renderer")]
pub use vulkan::CacheFolder;
pub use vulkan::{DeviceInfo, DeviceKind, Limits, Loader, Subgroups};

use vulkan::constants;
