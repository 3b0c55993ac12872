//! Who takes the steps: the device as a whole, or the host around the device's images.

use crate::commands::note;
use softras::fit::{DeviceFit, ShapeFit, Step, Targets};
use softras::{Mesh, Renderer, Result, Settings};
use std::time::Instant;

/// A fit in progress.
pub struct Engine {
    kind: Kind,
    /// Steps on the host, not yet asked for, with their seconds.
    found: Vec<(Step, f64)>,
    /// The least loss with its mesh and step, counted from the engine's first.
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
    /// On the device where it can do what the fit asks for, unless the host is asked for.
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

    /// Takes a step, or submits it.
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

    /// What the steps found that were not yet asked for, with the seconds that each took; those of the device their mean.
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

    /// The mesh of least loss, and which of the engine's steps found it.
    pub fn best(&mut self, renderer: &mut Renderer) -> Result<Option<(Mesh, usize)>> {
        match &mut self.kind {
            Kind::Host(_) => Ok(self.best.as_ref().map(|(_, mesh, step)| (mesh.clone(), *step))),
            Kind::Device(fit) => fit.best(renderer),
        }
    }
}
