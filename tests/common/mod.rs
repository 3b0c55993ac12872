//! What the tests share: renderers under validation, random scenes, comparisons, and the tables of modes and of tolerances.
#![allow(dead_code, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

pub mod blame;
pub mod compare;
pub mod gradient;
pub mod modes;
pub mod scenes;
pub mod tolerance;

pub use softras_lab::random;

use softras::{Renderer, RendererOptions};
use std::ops::{Deref, DerefMut};

/// A renderer under the validation layers; when it goes, the layers must have had nothing to say.
pub struct Validated(Renderer);

impl Deref for Validated {
    type Target = Renderer;
    fn deref(&self) -> &Renderer {
        &self.0
    }
}

impl DerefMut for Validated {
    fn deref_mut(&mut self) -> &mut Renderer {
        &mut self.0
    }
}

impl Drop for Validated {
    fn drop(&mut self) {
        // A second panic would hide the first.
        if !std::thread::panicking() {
            assert_eq!(self.0.validation_messages(), [""; 0], "the validation layers complain");
        }
    }
}

/// The device that `SOFTRAS_DEVICE` names, else the best one, under validation unless `SOFTRAS_VALIDATION=0`.
#[track_caller]
pub fn renderer() -> Validated {
    renderer_with(RendererOptions::default())
}

/// The same with other options.
#[track_caller]
pub fn renderer_with(options: RendererOptions) -> Validated {
    let validation = std::env::var("SOFTRAS_VALIDATION").map_or(true, |value| value != "0");
    Validated(Renderer::with_options(&RendererOptions { validation, ..options }).expect("a Vulkan device"))
}
