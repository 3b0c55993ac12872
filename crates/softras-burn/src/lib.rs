//! softras as a differentiable operation of the framework [burn].
//!
//! [`SoftRas::render`] renders tensors of vertex positions, colours, texture cells and camera motions to tensors of images.
//! It renders on the renderer's own Vulkan device, copies through host memory, and is a node of burn's graph like any
//! other: `loss.backward()` runs the renderer's backward pass. [`iou_loss`] and [`Smoothness`] are the losses of the paper
//! as burn functions. `examples/reconstruction` trains the paper's network with them: it sees one picture and gives a mesh.
//!
//! Two steps towards a target silhouette, for a batch of two different meshes:
//!
//! ```
//! use burn::tensor::{Device, Tensor};
//! use softras::{Camera, Projection, Renderer, Scene, Settings, scene::Outputs, shapes};
//! use softras_burn::{Inputs, SoftRas, Views, iou_loss, packed_positions};
//!
//! # fn main() -> softras::Result<()> {
//! let device = Device::flex().autodiff();
//! let softras = SoftRas::new(Renderer::new()?);
//! let camera = Camera::from_angles(2.732, 30.0, 45.0, Projection::Perspective { fov_y: 1.0 })?;
//! let settings = Settings {
//!     width: 32,
//!     height: 32,
//!     sigma: 1e-3,
//!     outputs: Outputs::SILHOUETTE,
//!     ..Settings::default()
//! };
//! let scene = Scene::batch(vec![shapes::icosphere(1)?, shapes::cube()?]);
//! let start = packed_positions(&scene, &device);
//! let views = Views { scene, cameras: vec![camera; 2], settings };
//! let target = Tensor::<3>::ones([2, 32, 32], &device);
//!
//! let mut positions = start.require_grad();
//! let mut losses = Vec::new();
//! for _ in 0..3 {
//!     let inputs = Inputs { positions: Some(positions.clone()), ..Inputs::default() };
//!     let silhouette = softras.render(&views, &inputs)?.silhouette.expect("asked for in the settings");
//!     let loss = iou_loss(silhouette, target.clone());
//!     losses.push(loss.clone().into_scalar::<f32>());
//!     let gradients = loss.backward();
//!     softras.take_fault()?;
//!     let gradient = positions.grad(&gradients).expect("tracked");
//!     positions = (positions.inner() - gradient * 0.5).autodiff().require_grad();
//! }
//! assert!(losses[2] < losses[0]);
//! # Ok(())
//! # }
//! ```

mod loss;
mod op;
mod render;
mod rendered;
mod twist;

pub use loss::{Smoothness, iou_loss};
pub use render::{Images, Inputs, SoftRas, Views, packed_positions};
