//! softras is a differentiable soft mesh rasterizer (Liu et al., "Soft Rasterizer", ICCV 2019) that runs as Vulkan compute.
//!
//! It renders triangle meshes to images of colour, silhouette, depth and normals, and differentiates a loss on these images
//! by the vertices, colours, texels, lights and cameras. A triangle covers a pixel not with yes or no but with a
//! probability, the sigmoid of its signed squared edge distance over σ. The silhouette is the probability that any triangle
//! covers the pixel; the colour is a softmax over the triangles, weighted by coverage and depth. So every triangle near a
//! pixel, hidden ones too, gets a gradient from it.
//!
//! ```
//! use softras::{Camera, Image, ImageGradient, Projection, Renderer, Scene, Settings, GradientRequest, shapes};
//!
//! # fn main() -> softras::Result<()> {
//! let mut renderer = Renderer::new()?;
//! let scene = Scene::new(shapes::icosphere(2)?);
//! let camera = Camera::from_angles(3.0, 30.0, 45.0, Projection::Perspective { fov_y: 1.0 })?;
//! let settings = Settings { sigma: 1e-4, ..Settings::default() };
//!
//! let frame = renderer.render_saved(&scene, &[camera], &settings)?;
//! // The loss is the mean silhouette: its gradient is the same everywhere.
//! let silhouette = frame.silhouette()?;
//! let weight = 1.0 / silhouette.data.len() as f32;
//! let upstream = Image { data: vec![weight; silhouette.data.len()], ..silhouette.clone() };
//! let gradients = renderer.backward(&frame, &ImageGradient::silhouette(upstream), &GradientRequest::default())?;
//! assert_eq!(gradients.meshes[0].positions.len(), scene.meshes[0].positions().len());
//! # Ok(())
//! # }
//! ```
//!
//! # Conventions
//! World space is right-handed with y up. View space has x right, y up, and the depth z growing forward. On the screen y
//! runs from -1 to 1 upwards and x from -a to a, a = width / height; one screen unit is half the image's height on both
//! axes. Row 0 of an image is its top. Images are not mirrored. Colours are linear. Equal input gives equal bits.
//!
//! # Glossary
//! - *fragment*: a (pixel, triangle) pair. Its coverage is D = sigmoid(±d²/σ), d the distance to the edge, plus inside.
//! - *σ* (sigma): softness of edges, screen units². *γ* (gamma): softness of the depth order, a fraction of far - near.
//! - *τ* (tau): fragments outside their triangle with D < τ are dropped; the others are the triangle's *support*.
//! - *log weight*: log D + ζ/γ, the logarithm of a fragment's softmax weight; its depth score ζ is 1 at near, 0 at far.
//! - *transmittance*: Π(1 - D) over a pixel's fragments; the silhouette is one minus it.
//! - *tile list*: the triangles whose support meets a tile of 8×4 pixels.
//! - *upstream gradient*: dL/dimage of a loss L; the caller computes it and gives it to the backward pass.
//! - *saved frame*: one rendered with [`Renderer::render_saved`] or [`Settings::save`], which keeps what the backward pass needs.
//!
//! # Where things are
//! - [`Renderer`] opens a device, renders a [`Scene`] and differentiates the images. A scene is made of [`Mesh`]es and
//!   [`Lights`] and is seen by [`Camera`]s under [`Settings`]; rendering returns a [`Frame`] of [`Image`]s, the backward
//!   pass [`Gradients`]. [`scene`] has the types that these are made of.
//! - [`shapes`] makes simple meshes.
//! - [`embed`] records the same frames into an engine's own command buffers, with the engine's device and memory.
//!
//! Built on this crate: `softras-io` reads and writes meshes and pictures, `softras-view` makes pictures of meshes, `softras-fit`
//! finds shape, colours and pose from images, `softras-reference` computes images and gradients on the host in f64, which the
//! kernels are tested against.

#![deny(unsafe_code)]

pub mod embed;
mod error;
// Without the feature `renderer`, some items of this folder and of `vulkan` are unused.
#[cfg_attr(not(feature = "renderer"), allow(dead_code, unused_imports))]
mod frame;
mod gradients;
mod image;
#[cfg(feature = "renderer")]
mod renderer;
pub mod scene;
pub mod shapes;
#[allow(unsafe_code)]
#[cfg_attr(not(feature = "renderer"), allow(dead_code, unused_imports))]
mod vulkan;

pub use error::{Error, Result};
/// Vectors and matrices, as cameras take them.
pub use glam;
pub use gradients::{
    CameraGradient, GradientMode, GradientRequest, Gradients, ImageGradient, LightGradients, MeshGradients,
};
pub use image::Image;
#[cfg(feature = "renderer")]
pub use renderer::{Fragment, Fragments, Frame, FrameCounts, Renderer, RendererOptions, StageTime, parts};
pub use scene::{Camera, Lights, Mesh, Projection, Scene, Settings};
#[cfg(feature = "renderer")]
pub use vulkan::{CacheFolder, Loader};
pub use vulkan::{DeviceInfo, DeviceKind, Limits};

use vulkan::constants;

/// Makes the Rust examples of README.md doctests.
#[cfg(all(doctest, feature = "renderer"))]
#[doc = include_str!("../README.md")]
struct Readme;
