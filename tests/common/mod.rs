//! What the tests share: renderers, random scenes, comparisons, and the tables of modes and of tolerances.
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
use std::sync::{Mutex, PoisonError};

/// Renderers that no test uses, with the kernels that they have compiled.
static IDLE: Mutex<Vec<Renderer>> = Mutex::new(Vec::new());

/// A renderer on loan. Under the validation layers these must have had nothing to say when it goes; one of the pool goes back
/// there, unless its test fails.
pub struct Loan {
    renderer: Option<Renderer>,
    pooled: bool,
}

impl Deref for Loan {
    type Target = Renderer;
    fn deref(&self) -> &Renderer {
        self.renderer.as_ref().expect("it goes when the loan ends")
    }
}

impl DerefMut for Loan {
    fn deref_mut(&mut self) -> &mut Renderer {
        self.renderer.as_mut().expect("it goes when the loan ends")
    }
}

impl Drop for Loan {
    fn drop(&mut self) {
        // A second panic would hide the first.
        if std::thread::panicking() {
            return;
        }
        assert_eq!(self.validation_messages(), [""; 0], "the validation layers complain");
        if self.pooled {
            IDLE.lock().unwrap_or_else(PoisonError::into_inner).extend(self.renderer.take());
        }
    }
}

/// A renderer of the pool, on the device that `SOFTRAS_DEVICE` names, else on the best one. It may have rendered before.
#[track_caller]
pub fn renderer() -> Loan {
    let idle = IDLE.lock().unwrap_or_else(PoisonError::into_inner).pop();
    let renderer = idle.unwrap_or_else(|| open(RendererOptions::default()));
    Loan { renderer: Some(renderer), pooled: true }
}

/// A renderer that has not rendered yet and ends with its test.
#[track_caller]
pub fn renderer_with(options: RendererOptions) -> Loan {
    Loan { renderer: Some(open(options)), pooled: false }
}

#[track_caller]
fn open(options: RendererOptions) -> Renderer {
    Renderer::with_options(&options).expect("a Vulkan device")
}

/// Whether `SOFTRAS_VALIDATION=1` asks for the validation layers.
pub fn validates() -> bool {
    std::env::var("SOFTRAS_VALIDATION").is_ok_and(|value| value == "1")
}
