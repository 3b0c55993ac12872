//! Pictures of meshes for people.
//!
//! [`View`] finds the camera that shows all of a mesh, lights it like a studio from whichever side it is seen, keeps its edges sharp,
//! blends its transparent triangles, leaves out the backs of single-sided ones, and smooths outlines. It makes a picture, the frames
//! of a turntable, or those of a sweep over a setting. [`Options`] say everything that can be different. [`Studio`] is what a [`View`]
//! is made of, for images of depths and normals, pictures too large for a device, and the model's own values. [`seen`] leaves out
//! backs in other scenes.
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

mod alone;
mod animation;
mod bounds;
pub mod canvas;
mod crease;
mod developed;
mod enclosing;
mod facing;
mod fill;
mod framing;
mod layers;
mod look;
mod options;
mod panes;
mod sheet;
mod shot;
mod shrink;
mod solid;
mod standing;
mod studio;
mod view;

pub use alone::alone;
pub use animation::{Moment, Step, delay, ground, looped, moments, short};
pub use bounds::Bounds;
pub use developed::{Developed, Image};
pub use facing::{fronts, seen};
pub use framing::{Viewpoint, lights};
pub use layers::Layer;
pub use look::settings;
pub use options::{Alpha, CameraOptions, Fill, HalfHeight, LightOptions, Look, Motion, Options, Output, Sweep, Swept};
pub use sheet::{sheet, text_width, write_text};
pub use shot::{Mean, Shot};
pub use shrink::shrunk;
pub use studio::{MISSED, Studio};
pub use view::View;
