//! A pool that lends renderers to tests, and the number of cases that a test runs.
#![allow(dead_code, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use softras::{Renderer, RendererOptions};
use std::ops::{Deref, DerefMut};
use std::sync::{Mutex, PoisonError};

/// Renderers that no test uses, with the kernels that they have compiled.
static IDLE: Mutex<Vec<Renderer>> = Mutex::new(Vec::new());

/// A renderer on loan. When it is dropped, the validation layers must have reported nothing. A renderer of the pool
/// then returns there, unless its test fails.
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

/// The first value in the quick tier, the second in the full one: `SOFTRAS_TIER=full`.
pub fn tier<T>(quick: T, full: T) -> T {
    if std::env::var("SOFTRAS_TIER").is_ok_and(|tier| tier == "full") { full } else { quick }
}

/// The number of random cases: `SOFTRAS_CASES`, else that of the tier.
pub fn case_count(quick: u64, full: u64) -> u64 {
    std::env::var("SOFTRAS_CASES").map_or(tier(quick, full), |count| count.parse().expect("SOFTRAS_CASES is a number"))
}
