//! Pictures of meshes for people.
//!
//! [`View`] finds the camera that shows all of a mesh, lights it like a studio, keeps its edges sharp, blends its transparent
//! triangles, and smooths outlines. It makes a picture, the frames of a turntable, or those of a sweep over a setting.
//! [`Options`] say everything that can be different. [`Studio`] is what a [`View`] is made of, for images of depths and normals,
//! pictures too large for a device, and the model's own values.
//!
//! ```
//! # fn main() -> softras::Result<()> {
//! # let folder = tempfile::tempdir().expect("a folder");
//! # let path = folder.path().join("fish.png");
//! let mut renderer = softras::Renderer::new()?;
//! let mesh = softras::shapes::fish()?;
//! softras_view::View::of(&mesh).size(96, 64).render(&mut renderer)?.save(&path)?;
//! # Ok(())
//! # }
//! ```

mod animation;
mod bounds;
pub mod canvas;
mod crease;
mod developed;
mod enclosing;
mod fill;
mod framing;
mod layers;
mod look;
mod options;
mod sheet;
mod shot;
mod shrink;
mod solid;
mod standing;
mod studio;
mod view;

pub use animation::{Moment, Step, delay, ground, looped, moments, short};
pub use bounds::Bounds;
pub use developed::{Developed, Image};
pub use framing::{Viewpoint, lights};
pub use layers::Layer;
pub use look::settings;
pub use options::{Alpha, CameraOptions, Fill, HalfHeight, LightOptions, Look, Motion, Options, Output, Sweep, Swept};
pub use sheet::{sheet, text_width, write_text};
pub use shot::{Mean, Shot};
pub use shrink::shrunk;
pub use studio::{MISSED, Studio};
pub use view::View;
