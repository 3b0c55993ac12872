//! Changes of topology while a fit runs: a mesh that covers a hole of the pictures, leaves out one of their parts, or overlaps
//! itself is cut anew to the silhouettes.
//!
//! Steps only move vertices: they cannot tear a film of triangles over a hole. So at fixed shares of the steps the holes and parts
//! of the mesh's silhouettes are compared with those of the pictures. Where they differ, the mesh's solid is cut to the
//! silhouettes, meshed and remeshed to edges as long as those it had (or shorter), and the fit goes on with the new mesh, if that is
//! no worse: at once, or after some steps of its own. It gets these steps because those before have moved only the old mesh to the
//! outlines.

use super::scores::{genus, mean, shape};
use crate::{
    Fitting, ShapeFit, ShapeOptions, Topology, bad, evened,
    mesh::{regions::holes, specks::without_specks},
    overlap,
    photographs::unseen::{LEAST_PIXELS, Unseen},
    points,
    solid::{carved::cut_to, hull::samples},
    work::Work,
};
use softras::{Mesh, Renderer, Result, Settings};
use softras_io::Views;
use std::ops::Range;

/// A mesh overlaps itself if it encloses more than this share of its solid twice or inside out. In most fits the share is 0 at 64
/// voxels a side. It was 1.3 % of a chair that was drawn out of a sphere, in folds that steps may still smooth.
const GROSS: f64 = 0.02;
/// Voxels along a side of the mesh's cube in which this share is counted.
const VOXELS: usize = 64;

/// Lengths of the new mesh's edges as shares of the old one's, tried in this order until a mesh is better: long edges cut off thin
/// parts that a cut leaves, such as a handle. A quarter gives sixteen times the triangles, some 20000 for the sphere.
const EDGES: [f64; 3] = [1.0, 0.5, 0.25];
/// After the first ones no edges shorter than this many pixels are tried: pictures do not show what they add.
const LEAST_EDGE: f64 = 0.75;
/// A cut mesh has at most this many handles more than the pictures have holes, or as many as before: noise in masks makes hundreds.
const MORE_HANDLES: usize = 8;
/// The length of a trial as a share of all steps. A new mesh with fewer faults that is farther from the silhouettes takes that many
/// steps, and then its loss is compared with that of the old mesh after as many steps. The optimiser has settled by then.
const TRIAL: f64 = 0.05;
/// The most steps that compare all views once and that a trial takes: those of more views are judged by as many of them.
const MOST_TRIED: usize = 12;

/// The faults of a mesh's topology, and how near its silhouettes are.
struct MeshFaults {
    unseen: Unseen,
    /// The share of the solid that is enclosed other than once.
    overlap: f64,
    /// The mean mask IoU of the fitted views.
    iou: f64,
}

impl MeshFaults {
    fn of(mesh: &Mesh, targets: &Views, settings: &Settings, renderer: &mut Renderer) -> Result<Self> {
        let (unseen, ious) = Unseen::compare(mesh, targets, settings, renderer)?;
        Ok(Self { unseen, overlap: overlap(mesh, VOXELS)?, iou: mean(&ious) })
    }

    fn views(&self) -> usize {
        self.unseen.covered.len() + self.unseen.missed.len()
    }

    fn is_wrong(&self) -> bool {
        self.views() > 0 || self.overlap > GROSS
    }

    /// Whether a mesh of these findings has fewer faults than another.
    fn is_less_wrong(&self, old: &Self) -> bool {
        let fewer = self.views() < old.views() || old.overlap > GROSS && self.overlap <= GROSS;
        self.views() <= old.views() && fewer
    }

    /// Whether a mesh of these findings replaces another at once: it is at least as near to the silhouettes, and has fewer faults.
    fn replaces(&self, old: &Self) -> bool {
        self.iou >= old.iou && self.is_less_wrong(old)
    }

    /// The faults in words, with the names of the views that show them.
    fn reasons(&self, name: impl Fn(usize) -> String) -> String {
        let mut reasons = self.unseen.reasons(name);
        if self.overlap > GROSS {
            reasons.push(format!("overlaps itself in {:.0} % of its volume", 100.0 * self.overlap));
        }
        reasons.join(" and ")
    }
}

impl Fitting {
    /// Cuts the mesh anew to the silhouettes if its topology is wrong and the new mesh is better.
    pub(crate) fn recut(&mut self, step: usize, work: &mut Work) -> Result<()> {
        let settings = self.setup.settings(step);
        if self.run.targets.silhouette.is_none() {
            return Ok(());
        }
        let old = self.mesh().clone();
        let before = MeshFaults::of(&old, &self.run.targets, &settings, work.renderer)?;
        if !before.is_wrong() {
            return Ok(());
        }
        let fitted = self.setup.given.fitted(&self.subject);
        let what = format!("step {step}: the mesh {}", before.reasons(|view| self.subject.views.name(fitted[view])));
        let made = match self.cut(&old, &before, &settings, work) {
            Ok(made) => made,
            Err(error) if work.is_stopped() => return Err(error),
            Err(error) => {
                let why = format!("since it cannot be cut to the silhouettes: {error}");
                work.notes.push(format!("{what}; it stays as it is, {why}"));
                return Ok(());
            }
        };
        let (better, why) = self.better(&made, &before, step, work)?;
        let Some(fit) = better else {
            let whole =
                format!("{what}; cut anew to the silhouettes it would be no better ({why}), and it stays as it is");
            work.notes.push(whole);
            return Ok(());
        };
        let shape = shape(fit.mesh())?;
        work.notes.push(format!("{what}; it was cut anew to the silhouettes, and is now {shape} ({why})"));
        self.run.go_on_with(fit, step);
        Ok(())
    }

    /// The fit that goes on with one of the new meshes: with the last if it is better at once, else with the first that has fewer
    /// faults and a lower loss after a trial; `None` if the old mesh stays. And the figures that decided, for a note.
    fn better(
        &self,
        made: &[(Mesh, MeshFaults)],
        before: &MeshFaults,
        step: usize,
        work: &mut Work,
    ) -> Result<(Option<ShapeFit>, String)> {
        let setup = &self.setup;
        // As many views in a step as the mesh is compared with that it may replace.
        let views_per_step = self.run.shape().options().views_per_step;
        let begin = |mesh: &Mesh| {
            let options = ShapeOptions { views_per_step, ..setup.options_of(mesh) };
            ShapeFit::new(mesh.clone(), self.subject.lights.clone(), options)
        };
        let ious = |after: &MeshFaults| format!("mask IoU {:.4}, before {:.4}", after.iou, before.iou);
        let mut why = String::new();
        if let Some((mesh, after)) = made.last() {
            why = ious(after);
            if after.replaces(before) {
                return Ok((Some(begin(mesh)?), why));
            }
        }
        let candidates: Vec<_> = made.iter().filter(|(_, after)| after.is_less_wrong(before)).collect();
        if candidates.is_empty() {
            return Ok((None, why));
        }
        let trial = step..step + setup.share(TRIAL).max(self.run.turn().min(MOST_TRIED));
        let kept = self.run.shape().clone();
        let uncut = self.tried(kept, &trial, work)?;
        for (mesh, after) in candidates {
            let fit = begin(mesh)?;
            let loss = self.tried(fit.clone(), &trial, work)?;
            why = format!("{}; after {} steps loss {loss:.4}, uncut {uncut:.4}", ious(after), trial.len());
            if loss < uncut {
                return Ok((Some(fit), why));
            }
        }
        Ok((None, why))
    }

    /// The loss of a fit after the steps of a trial: the mean over the last steps that together compare all views once, or of very many
    /// views some of them.
    fn tried(&self, mut fit: ShapeFit, trial: &Range<usize>, work: &mut Work) -> Result<f64> {
        let (setup, turn) = (&self.setup, self.run.turn().min(MOST_TRIED));
        let mut losses = Vec::new();
        // A step returns the loss before it moves anything, so one more is taken.
        for at in trial.start..=trial.end {
            // Beyond the fit's last step a trial keeps the settings of that step.
            let at = at.min(setup.iterations - 1);
            let (rate, color_rate) = setup.rates(at);
            work.goes_on()?;
            losses.push(fit.step(work.renderer, &setup.settings(at), &self.run.targets, rate, color_rate)?.loss);
        }
        Ok(losses.iter().rev().take(turn).sum::<f64>() / turn as f64)
    }

    /// The mesh cut to the silhouettes, with the parts that it leaves out, several times with ever shorter edges until one is better
    /// at once.
    fn cut(
        &self,
        mesh: &Mesh,
        before: &MeshFaults,
        settings: &Settings,
        work: &mut Work,
    ) -> Result<Vec<(Mesh, MeshFaults)>> {
        let missing = self.run.targets.silhouette.as_ref().and_then(|silhouette| before.unseen.missing(silhouette));
        let hull = match &self.setup.hull {
            Some(hull) => hull.clone(),
            None => {
                let (center, side) = self.subject.cube();
                samples(&self.run.targets, center, side, self.subject.samples()?, &mut || work.goes_on())?
            }
        };
        let raw = cut_to(hull, &self.run.targets, mesh, missing.as_ref())?;
        let (mut made, edge): (Vec<(Mesh, MeshFaults)>, f64) = (Vec::new(), edge(mesh)?);
        let (raw, _) = without_specks(raw, edge)?;
        self.check_handles(&raw, mesh)?;
        for share in EDGES {
            if share < 1.0 && share * edge < LEAST_EDGE * self.subject.pixel {
                break;
            }
            work.goes_on()?;
            let new = evened(&raw, share * edge)?;
            let found = MeshFaults::of(&new, &self.run.targets, settings, work.renderer)?;
            let is_better = found.replaces(before);
            made.push((new, found));
            if is_better {
                break;
            }
        }
        Ok(made)
    }

    /// Refuses a mesh of more handles than the one that it replaces, and than the pictures' holes account for.
    fn check_handles(&self, new: &Mesh, old: &Mesh) -> Result<()> {
        let Some(silhouettes) = &self.run.targets.silhouette else { return Ok(()) };
        let handles = |mesh: &Mesh| Ok::<_, softras::Error>(genus(mesh)?.1.unwrap_or_default());
        let seen = |view: usize| {
            let mask = silhouettes.view(view);
            let all = holes((silhouettes.height, silhouettes.width), |pixel| mask[pixel] > 0.5);
            all.iter().filter(|hole| hole.len() >= LEAST_PIXELS).count()
        };
        let (new, seen) = (handles(new)?, (0..silhouettes.batch).map(seen).sum::<usize>());
        if new > handles(old)?.max(seen + MORE_HANDLES) {
            return bad(
                format!("a mesh of genus {new}, where the silhouettes show {seen} holes"),
                "give cleaner masks",
            );
        }
        Ok(())
    }
}

/// The mean length of a mesh's edges.
fn edge(mesh: &Mesh) -> Result<f64> {
    let (topology, at) = (Topology::of(mesh)?, points(mesh));
    let whole: f64 = topology.edges().iter().map(|&[a, b]| at[a as usize].distance(at[b as usize])).sum();
    Ok(whole / topology.edges().len().max(1) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(covered: &[usize], overlap: f64, iou: f64) -> MeshFaults {
        let mut unseen = Unseen::default();
        unseen.covered.extend(covered);
        MeshFaults { unseen, overlap, iou }
    }

    #[test]
    fn a_mesh_replaces_another_at_once_where_less_is_wrong_and_nothing_is_worse() {
        let old = found(&[1, 4], 0.0, 0.9);
        assert!(old.is_wrong() && found(&[4], 0.0, 0.9).replaces(&old));
        for no_better in [found(&[1, 4], 0.0, 0.95), found(&[], 0.0, 0.89), found(&[0, 1, 4], 0.0, 0.99)] {
            assert!(!no_better.replaces(&old), "{:?} {}", no_better.unseen, no_better.iou);
        }
        // A mesh that is farther from the silhouettes gets a trial only if it has fewer faults.
        assert!(found(&[4], 0.0, 0.89).is_less_wrong(&old));
        assert!(![found(&[1, 4], 0.0, 0.89), found(&[0, 1, 4], 0.0, 0.99)].iter().any(|new| new.is_less_wrong(&old)));
        assert_eq!(old.reasons(|view| format!("{view}.png")), "covers a hole that is seen in 1.png, 4.png");
        let folded = found(&[], 2.0 * GROSS, 0.9);
        assert!(folded.is_wrong() && found(&[], 0.5 * GROSS, 0.9).replaces(&folded));
        assert!(!found(&[2], 0.0, 0.95).replaces(&folded) && !found(&[], 0.0, 0.9).is_wrong());
        assert_eq!(folded.reasons(|_| String::new()), "overlaps itself in 4 % of its volume");
    }
}
