//! Takes the steps of a fit and their times.

use crate::commands::note;
use softras::fit::{Fit, ShapeFit, Step, Targets};
use softras::{Mesh, Renderer, Result, Settings};
use std::time::Instant;

/// A fit in progress.
pub struct Engine {
    fit: Fit,
    /// Finished steps of the host that were not queried yet, with their seconds.
    found: Vec<(Step, f64)>,
    /// Steps submitted to the device since `began`.
    waiting: usize,
    began: Instant,
}

impl Engine {
    /// Uses the device if it supports the fit's options, unless `host` is set.
    pub fn new(
        fit: ShapeFit,
        targets: &Targets,
        settings: &Settings,
        host: bool,
        renderer: &mut Renderer,
    ) -> Result<Self> {
        let fit = match host {
            true => Fit::on_host(fit, targets, "--host"),
            false => Fit::new(renderer, fit, targets, settings)?,
        };
        if let Some(reason) = fit.host_reason().filter(|_| !host) {
            note(&format!("steps are taken on the host: {reason}"));
        }
        Ok(Self { fit, found: Vec::new(), waiting: 0, began: Instant::now() })
    }

    /// Why the host takes the steps; `None` where the device does.
    pub fn reason(&self) -> Option<&str> {
        self.fit.host_reason()
    }

    /// Takes a step on the host, or submits it to the device.
    pub fn step(&mut self, renderer: &mut Renderer, settings: &Settings, rates: (f64, f64)) -> Result<()> {
        if self.waiting == 0 {
            self.began = Instant::now();
        }
        self.fit.step(renderer, settings, rates.0, rates.1)?;
        self.waiting += 1;
        // The host has finished its step.
        if self.reason().is_some() { self.collect(renderer) } else { Ok(()) }
    }

    /// The results of the steps since the last call, with the seconds of each; for the device, the mean of them all.
    pub fn found(&mut self, renderer: &mut Renderer) -> Result<Vec<(Step, f64)>> {
        self.collect(renderer)?;
        Ok(std::mem::take(&mut self.found))
    }

    fn collect(&mut self, renderer: &mut Renderer) -> Result<()> {
        let found = self.fit.found(renderer)?;
        let seconds = self.began.elapsed().as_secs_f64() / self.waiting.max(1) as f64;
        self.waiting = 0;
        self.found.extend(found.into_iter().map(|step| (step, seconds)));
        Ok(())
    }

    /// The fit as it is now.
    pub fn shape(&mut self, renderer: &mut Renderer) -> Result<&ShapeFit> {
        self.fit.shape(renderer)
    }

    /// The mesh of least loss, and its step counted from the engine's first.
    pub fn best(&mut self, renderer: &mut Renderer) -> Result<Option<(Mesh, usize)>> {
        self.fit.best(renderer)
    }
}
