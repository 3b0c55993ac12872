//! Takes the steps of a fit, either wholly on the device or on the host around the device's images.

use crate::commands::note;
use softras::fit::{DeviceFit, ShapeFit, Step, Targets};
use softras::{Mesh, Renderer, Result, Settings};
use std::time::Instant;

/// A fit in progress.
pub struct Engine {
    kind: Kind,
    /// Finished steps of the host that were not queried yet, with their seconds.
    found: Vec<(Step, f64)>,
    /// The least loss, with its mesh and its step counted from the engine's first.
    best: Option<(f64, Mesh, usize)>,
    steps: usize,
    /// Steps submitted to the device since `began`.
    waiting: usize,
    began: Instant,
    /// Why the host takes the steps.
    reason: Option<String>,
}

enum Kind {
    Host(Box<ShapeFit>),
    Device(Box<DeviceFit>),
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
        let reason = match host {
            true => Some("--host".to_owned()),
            false => DeviceFit::unsupported(&fit).or_else(|| DeviceFit::unsupported_settings(settings)),
        };
        let kind = match &reason {
            Some(reason) => {
                if !host {
                    note(&format!("steps are taken on the host: {reason}"));
                }
                Kind::Host(Box::new(fit))
            }
            None => Kind::Device(Box::new(DeviceFit::new(renderer, fit, targets, None)?)),
        };
        Ok(Self { kind, found: Vec::new(), best: None, steps: 0, waiting: 0, began: Instant::now(), reason })
    }

    /// Why the host takes the steps; `None` where the device does.
    pub fn reason(&self) -> Option<&str> {
        self.reason.as_deref()
    }

    /// Takes a step on the host, or submits it to the device.
    pub fn step(
        &mut self,
        renderer: &mut Renderer,
        settings: &Settings,
        targets: &Targets,
        rates: (f64, f64),
    ) -> Result<()> {
        if self.waiting == 0 {
            self.began = Instant::now();
        }
        self.steps += 1;
        match &mut self.kind {
            Kind::Host(fit) => {
                let before = fit.mesh().clone();
                let found = fit.step(renderer, settings, targets, rates.0, rates.1)?;
                if self.best.as_ref().is_none_or(|(least, ..)| found.loss < *least) {
                    self.best = Some((found.loss, before, self.steps - 1));
                }
                self.found.push((found, self.began.elapsed().as_secs_f64()));
            }
            Kind::Device(fit) => {
                fit.step(renderer, settings, rates.0, rates.1)?;
                self.waiting += 1;
            }
        }
        Ok(())
    }

    /// The results of the steps since the last call, with the seconds of each; for the device, the mean of them all.
    pub fn found(&mut self, renderer: &mut Renderer) -> Result<Vec<(Step, f64)>> {
        if let Kind::Device(fit) = &mut self.kind {
            let found = fit.found(renderer)?;
            let seconds = self.began.elapsed().as_secs_f64() / self.waiting.max(1) as f64;
            self.waiting = 0;
            self.found = found.into_iter().map(|step| (step, seconds)).collect();
        }
        Ok(std::mem::take(&mut self.found))
    }

    /// The fit as it is now.
    pub fn shape(&mut self, renderer: &mut Renderer) -> Result<&ShapeFit> {
        match &mut self.kind {
            Kind::Host(fit) => Ok(fit),
            Kind::Device(fit) => fit.shape(renderer),
        }
    }

    /// The mesh of least loss, and its step counted from the engine's first.
    pub fn best(&mut self, renderer: &mut Renderer) -> Result<Option<(Mesh, usize)>> {
        match &mut self.kind {
            Kind::Host(_) => Ok(self.best.as_ref().map(|(_, mesh, step)| (mesh.clone(), *step))),
            Kind::Device(fit) => fit.best(renderer),
        }
    }
}
