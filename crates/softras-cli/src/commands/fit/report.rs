//! The results of a fit: its log, and scores of the mesh.

use super::args::FitArgs;
use super::color_error::color_error;
use super::setup::Setup;
use super::targets::Views;
use super::unseen::Unseen;
use crate::commands::{Failure, note, say};
use glam::DVec3;
use serde_json::{Value, json};
use softras::parts::{self, Bands};
use softras::scene::{Outputs, SilhouetteAggregation};
use softras::{Camera, Error, Image, Mesh, Renderer, Result, Scene, Settings};
use softras_fit::voxel_iou;
use softras_fit::{ImageLoss, Regularizer, Step, Targets, mask_iou};
use softras_fit::{Topology, pooled};
use std::path::Path;

/// Voxels along a side of the grid of the 3D IoU, as in the SoftRas paper.
const VOXELS: usize = 32;

/// The log of all steps.
#[derive(Default)]
pub struct Log {
    steps: Vec<(usize, Step, f64)>,
}

impl Log {
    /// Adds a step and the seconds it took.
    pub fn add(&mut self, step: usize, found: Step, seconds: f64) {
        self.steps.push((step, found, seconds));
    }

    /// The mean loss of a step and those before it, `turn` steps in all; infinite where none was taken.
    pub fn loss(&self, step: usize, turn: usize) -> f64 {
        let steps = self.steps.iter().filter(|s| s.0 <= step && step < s.0 + turn);
        let losses: Vec<f64> = steps.map(|s| s.1.loss).collect();
        if losses.is_empty() { f64::INFINITY } else { mean(&losses) }
    }

    /// All steps with their losses.
    pub fn losses(&self) -> Vec<(usize, f64)> {
        self.steps.iter().map(|(step, found, _)| (*step, found.loss)).collect()
    }

    /// The median of a step's seconds; `None` without steps.
    pub fn seconds(&self) -> Option<f64> {
        let mut seconds: Vec<f64> = self.steps.iter().map(|s| s.2).collect();
        seconds.sort_by(f64::total_cmp);
        seconds.get(seconds.len() / 2).copied()
    }

    /// The whole log as JSON.
    pub fn json(&self, args: &FitArgs, setup: &Setup, scores: &Scores, device: &str, mesh: &Mesh) -> Value {
        let each = |value: fn(&Step) -> f64| self.steps.iter().map(|(_, s, _)| value(s)).collect::<Vec<f64>>();
        let names = setup.options.regularizers.iter().map(|(r, weight)| json!({ "name": name(*r), "weight": weight }));
        let penalties: Vec<_> = self.steps.iter().map(|(_, s, _)| &s.regularizers).collect();
        json!({
            "device": device,
            "preset": format!("{:?}", args.method.preset).to_lowercase(),
            "vertices": mesh.positions().len(),
            "triangles": mesh.triangles().len(),
            "views": scores.masks.len(),
            "view_stride": setup.stride,
            "first_step": self.steps.first().map_or(0, |s| s.0),
            "loss": each(|s| s.loss),
            "silhouette_loss": each(|s| s.silhouette),
            "color_loss": each(|s| s.color),
            "depth_loss": each(|s| s.depth),
            "normal_loss": each(|s| s.normal),
            "regularizers": names.collect::<Vec<_>>(),
            "regularizer_values": penalties,
            "seconds": self.steps.iter().map(|s| s.2).collect::<Vec<_>>(),
            "seconds_per_iteration": self.seconds(),
            "final": scores.json(),
        })
    }
}

fn name(regularizer: Regularizer) -> &'static str {
    match regularizer {
        Regularizer::Laplacian => "laplacian",
        Regularizer::Flatten => "flatten",
        Regularizer::EdgeLength { .. } => "edge_length",
        Regularizer::NormalConsistency => "normals",
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// The number of a mesh's parts, and of their handles if all are closed surfaces.
pub fn genus(mesh: &Mesh) -> Result<(usize, Option<usize>)> {
    Ok(Topology::new(mesh.positions().len(), mesh.triangles())?.parts_and_genus())
}

/// A mesh's parts and handles in words.
pub fn shape(mesh: &Mesh) -> Result<String> {
    genus(mesh).map(named)
}

fn named((parts, genus): (usize, Option<usize>)) -> String {
    let parts = if parts == 1 { "1 part".into() } else { format!("{parts} parts") };
    parts + &genus.map_or(String::new(), |genus| format!(" of genus {genus}"))
}

/// Scores of a mesh.
#[derive(Default)]
pub struct Scores {
    /// The mask IoU of every view, fitted or not: pixels whose centre the mesh covers, against pixels of the target above
    /// ½.
    masks: Vec<f64>,
    /// Its mean over the fitted views.
    fitted: f64,
    /// The mask IoU of pixels that the mesh covers by more than half, by 8 × 8 samples.
    covered: Vec<f64>,
    /// The mean over all views of the soft IoU of silhouettes at sigma 1e-4.
    soft: f64,
    /// The mean of the largest soft IoU that any image could have, which is below 1 where targets are grey.
    most: f64,
    /// The loss of the official demo for this mesh on the fitted views.
    official: f64,
    /// The connected parts of the mesh, and their genus if all are closed.
    parts: usize,
    genus: Option<usize>,
    unseen: Unseen,
    /// The 3D IoU with the mesh that the views were rendered from.
    solid: Option<f64>,
    /// The mean difference of the colours.
    color: Option<f64>,
}

impl Scores {
    /// Computes the scores of a mesh over all views.
    pub fn of(mesh: &Mesh, setup: &Setup, views: &Views, renderer: &mut Renderer) -> Result<Self> {
        let targets = &views.targets;
        let (height, width) = targets.size()?;
        let outputs = Outputs { color: false, silhouette: true, depth: false, normal: false };
        let settings = Settings { height: height as u32, width: width as u32, outputs, ..setup.settings(0) };
        let hard = Settings { silhouette: SilhouetteAggregation::Hard, sigma: 1e-7, ..settings.clone() };
        let scene = Scene::new(mesh.clone());
        let Some(target) = &targets.silhouette else {
            return Ok(Self::default());
        };
        let (mut masks, mut unseen) = (Vec::new(), Unseen::default());
        parts::in_batches(renderer, &scene, &targets.cameras, &hard, |views, frame| {
            let first = views.start;
            let some = super::targets::some(target, views);
            if let Some(image) = frame.silhouette() {
                unseen.add(first, image, &some);
            }
            masks.extend(frame.silhouette().map(|image| mask_iou(image, &some)).transpose()?.unwrap_or_default());
            Ok(())
        })?;
        let covered = covered(&scene, targets, &hard, renderer)?;
        let bounds: Vec<f64> = (0..target.batch).map(|view| most_iou(target.view(view))).collect();
        let soft_iou = |renderer: &mut Renderer, stride: usize| -> Result<f64> {
            let some = super::targets::every(targets, stride);
            let settings = Settings { sigma: 1e-4, ..settings.clone() };
            let (mut loss, count) = (0.0, some.cameras.len() as f64);
            parts::in_batches(renderer, &scene, &some.cameras, &settings, |views, frame| {
                let share = views.len() as f64 / count;
                if let (Some(image), Some(target)) = (frame.silhouette(), &some.silhouette) {
                    let target = super::targets::some(target, views);
                    loss += share * ImageLoss::NegativeIou.evaluate(image, &target, None)?.value;
                }
                Ok(())
            })?;
            Ok(1.0 - loss)
        };
        let fitted: Vec<f64> = masks.iter().step_by(setup.stride).copied().collect();
        let official = 1.0 - soft_iou(renderer, setup.stride)? + official_penalty(mesh)?;
        let soft = soft_iou(renderer, 1)?;
        let solid = views.truth.as_ref().map(|truth| voxel_iou(mesh, truth, VOXELS)).transpose()?;
        let (parts, genus) = genus(mesh)?;
        let (most, fitted) = (mean(&bounds), mean(&fitted));
        let color = color_error(mesh, setup, views, renderer)?;
        Ok(Self { fitted, masks, covered, soft, most, official, parts, genus, unseen, solid, color })
    }
}

/// Samples along each side of a pixel, for the covered share of it.
const SAMPLES: u32 = 8;

/// The mask IoU of every view, by the pixels that the mesh covers by more than half.
fn covered(scene: &Scene, targets: &Targets, hard: &Settings, renderer: &mut Renderer) -> Result<Vec<f64>> {
    let Some(target) = &targets.silhouette else { return Ok(Vec::new()) };
    let fine = Settings { height: hard.height * SAMPLES, width: hard.width * SAMPLES, ..hard.clone() };
    let mut bands = Bands { unit: 4 * SAMPLES as usize, margin: 0, at_once: usize::MAX };
    let one = |(view, camera): (usize, &Camera)| {
        let target = super::targets::some(target, view..view + 1);
        let mut image = Image { data: Vec::new(), ..target };
        let render = |camera: &Camera, settings: &Settings| renderer.render(scene, &[*camera], settings);
        parts::in_bands::<_, Error>(camera, &fine, &mut bands, render, |band| {
            let pooled = band.frame.silhouette().map(|image| pooled(image, SAMPLES as usize)).transpose()?;
            image.data.extend(pooled.into_iter().flat_map(|pooled| pooled.data));
            Ok(())
        })?;
        Ok(mean(&mask_iou(&image, &target)?))
    };
    targets.cameras.iter().enumerate().map(one).collect()
}

/// The largest soft IoU Σ P T / Σ (P + T - P T) that any P in [0, 1] has with a target T. Numerator and denominator are
/// linear in every pixel of P, so the maximum is reached by a P of zeros and ones, with ones where T is largest.
fn most_iou(target: &[f32]) -> f64 {
    let mut values: Vec<f64> = target.iter().map(|t| f64::from(*t)).collect();
    values.sort_by(|a, b| b.total_cmp(a));
    let all: f64 = values.iter().sum();
    if all <= 0.0 {
        return 1.0;
    }
    let (mut both, mut most) = (0.0, 0.0f64);
    for (count, value) in values.into_iter().enumerate() {
        both += value;
        most = most.max(both / ((count + 1) as f64 + all - both));
    }
    most
}

impl Scores {
    /// The scores as JSON.
    pub fn json(&self) -> Value {
        json!({
            "mask_iou": { "per_view": self.masks, "mean": mean(&self.masks), "mean_of_fitted": self.fitted },
            "covered_mask_iou": { "per_view": self.covered, "mean": mean(&self.covered) },
            "soft_iou": self.soft,
            "most_soft_iou": self.most,
            "official_loss": self.official,
            "parts": self.parts,
            "genus": self.genus,
            "covered_holes_in_views": self.unseen.covered,
            "missed_parts_in_views": self.unseen.missed,
            "iou_3d": self.solid,
            "color_error": self.color,
        })
    }

    /// The main scores as a sentence.
    pub fn sentence(&self) -> String {
        let solid = self.solid.map_or(String::new(), |iou| format!(", 3D IoU {iou:.4}"));
        let shape = named((self.parts, self.genus));
        let color = self.color.map_or(String::new(), |error| format!(", colour error {error:.4}"));
        format!("mask IoU {:.4} over {} views{solid}{color}, {shape}", mean(&self.masks), self.masks.len())
    }
}

/// The regularisers of the official demo with its weights.
fn official_penalty(mesh: &Mesh) -> Result<f64> {
    let positions: Vec<DVec3> = mesh.positions().iter().map(|p| DVec3::from(p.map(f64::from))).collect();
    let topology = Topology::new(positions.len(), mesh.triangles())?;
    let mut unused = vec![DVec3::ZERO; positions.len()];
    let laplacian = Regularizer::Laplacian.add(&topology, &positions, 0.0, &mut unused)?;
    let flatten = Regularizer::Flatten.add(&topology, &positions, 0.0, &mut unused)?;
    Ok(0.03 * laplacian + 0.0003 * flatten)
}

/// Prints the result of a fit.
pub fn tell(out: &Path, log: &Log, scores: &Scores, mesh: &Mesh) -> Result<(), Failure> {
    let (vertices, triangles) = (mesh.positions().len(), mesh.triangles().len());
    let least = log.losses().iter().map(|l| l.1).fold(f64::INFINITY, f64::min);
    for reason in scores.unseen.reasons(1) {
        note(&format!("the mesh {reason} (--template hull begins with the holes and parts of the silhouettes)"));
    }
    let time = log.seconds().map_or(String::new(), |s| format!(", {:.1} ms a step", s * 1e3));
    say(&format!(
        "{}: {vertices} vertices, {triangles} triangles; loss {least:.5}, {}{time}",
        out.display(),
        scores.sentence(),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_loss_of_a_step_is_a_mean_over_a_turn() {
        let mut log = Log::default();
        for (step, loss) in [(4, 3.0), (5, 1.0), (6, 5.0), (7, 2.0)] {
            let [silhouette, color, depth, normal] = [0.0; 4];
            log.add(step, Step { loss, silhouette, color, depth, normal, regularizers: Vec::new() }, 0.0);
        }
        assert_eq!((log.loss(6, 1), log.loss(7, 3), log.loss(5, 3)), (5.0, 8.0 / 3.0, 2.0));
        assert_eq!(log.loss(3, 1), f64::INFINITY);
    }

    #[test]
    fn no_image_overlaps_a_grey_target_more_than_this() {
        assert_eq!(most_iou(&[0.0, 1.0, 1.0, 0.0]), 1.0);
        assert_eq!(most_iou(&[0.0; 4]), 1.0);
        let target = [0.9f32, 0.5, 0.3, 0.1];
        let iou = |p: [f64; 4]| {
            let pairs = || p.iter().zip(target.map(f64::from));
            pairs().map(|(p, t)| p * t).sum::<f64>() / pairs().map(|(p, t)| p + t - p * t).sum::<f64>()
        };
        let grid = |i: usize| [0, 1, 2, 3].map(|k| (i / 5usize.pow(k) % 5) as f64 / 4.0);
        let best = (0..625).map(|i| iou(grid(i))).fold(0.0, f64::max);
        assert!((most_iou(&target) - best).abs() < 1e-12, "{best}");
        assert!(iou(target.map(f64::from)) < best - 0.05, "the target itself is not the best");
    }
}
