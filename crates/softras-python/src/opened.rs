//! An opened device with its memory, used by one thread of the process that opened it at a time.

use crate::exceptions::{Raise, exception};
use pyo3::prelude::*;
use softras::Result;
use std::sync::{Mutex, PoisonError};

/// A renderer, shared with its frames, and the process that opened it.
pub struct Opened {
    /// `None` only while it is dropped.
    renderer: Mutex<Option<softras::Renderer>>,
    process: u32,
    device: String,
}

impl Opened {
    /// The renderer of a device, opened in this process.
    pub fn new(renderer: softras::Renderer, device: String) -> Self {
        Self { renderer: Mutex::new(Some(renderer)), process: std::process::id(), device }
    }

    /// The device's name.
    pub fn device(&self) -> &str {
        &self.device
    }

    /// The process that opened it.
    pub fn process(&self) -> u32 {
        self.process
    }

    /// Calls the renderer without the interpreter's lock, so that other threads of Python run meanwhile.
    ///
    /// # Errors
    /// `ForkError` in a process that was forked from the renderer's: a driver does not survive a fork.
    pub fn call<T: Send>(
        &self,
        py: Python<'_>,
        task: impl FnOnce(&mut softras::Renderer) -> Result<T> + Send,
    ) -> PyResult<T> {
        if self.process != std::process::id() {
            return Err(exception(
                "ForkError",
                "this renderer was opened before the process was forked, and Vulkan drivers do not survive that: \
                 open a renderer in each worker, or start workers with the method \"spawn\"",
            ));
        }
        let result = py.detach(|| {
            let mut renderer = self.renderer.lock().unwrap_or_else(PoisonError::into_inner);
            renderer.as_mut().map(task)
        });
        match result {
            Some(result) => result.raise(),
            None => Err(exception("Error", "the renderer is closed: open another")),
        }
    }
}

impl Drop for Opened {
    fn drop(&mut self) {
        if self.process != std::process::id() {
            // The device belongs to the parent process; destroying it here would wait for threads that do not exist.
            let renderer = self.renderer.get_mut().unwrap_or_else(PoisonError::into_inner).take();
            std::mem::forget(renderer);
        }
    }
}
