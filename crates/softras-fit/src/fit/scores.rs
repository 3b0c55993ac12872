//! How good a mesh is that was fitted.

use super::setup::Setup;
use crate::{
    ImageLoss, Regularizer, Topology, Unseen, finer, mask_iou,
    photographs::{color::color_error, subject::Subject, unseen::hard},
    points, pooled, sized, voxel_iou,
    work::GoesOn,
};
use glam::DVec3;
use softras::{
    Camera, Error, Image, Mesh, Renderer, Result, Scene, Settings,
    parts::{self, Bands},
    scene::Outputs,
};
use softras_io::Views;

/// Voxels along a side of the grid of the 3D IoU, as in the SoftRas paper.
const VOXELS: usize = 32;
/// A smaller mask IoU than this of views is that of pictures that do not show one solid.
const FAR: f64 = 0.75;

/// The mean; 0 of nothing.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// The mean of some views.
fn mean_of(values: &[f64], views: &[usize]) -> f64 {
    mean(&views.iter().map(|view| values[*view]).collect::<Vec<f64>>())
}

/// The number of a mesh's parts, and of their handles if all are closed surfaces.
pub fn genus(mesh: &Mesh) -> Result<(usize, Option<usize>)> {
    Ok(Topology::of(mesh)?.parts_and_genus())
}

/// A mesh's parts and handles in words.
pub fn shape(mesh: &Mesh) -> Result<String> {
    genus(mesh).map(named)
}

fn named((parts, genus): (usize, Option<usize>)) -> String {
    let parts = if parts == 1 { "1 part".into() } else { format!("{parts} parts") };
    parts + &genus.map_or(String::new(), |genus| format!(" of genus {genus}"))
}

/// How good a mesh is.
#[derive(Clone, Debug, Default)]
pub struct Scores {
    /// The mask IoU of every view, fitted or not: pixels whose centre the mesh covers, against pixels of the target above
    /// ½.
    pub masks: Vec<f64>,
    /// Its mean over the fitted views.
    pub fitted: f64,
    /// The views that were held out of the fit.
    pub held_out: Vec<usize>,
    /// The mask IoU of pixels that the mesh covers by more than half, by 8 × 8 samples.
    pub covered: Vec<f64>,
    /// The mean over all views of the soft IoU of silhouettes at sigma 1e-4.
    pub soft: f64,
    /// The mean of the largest soft IoU that any image could have, which is below 1 where targets are grey.
    pub most: f64,
    /// The loss of the official demo for this mesh on the fitted views.
    pub official: f64,
    /// The connected parts of the mesh, and their genus if all are closed.
    pub parts: usize,
    /// `None` where a surface is not closed.
    pub genus: Option<usize>,
    /// Holes that the mesh covers, and parts that it leaves out.
    pub unseen: Unseen,
    /// The 3D IoU with the mesh that the views were rendered from.
    pub solid: Option<f64>,
    /// The mean difference of the colours in the fitted views.
    pub color: Option<f64>,
    /// The mean difference of the colours in the views that were held out.
    pub color_held_out: Option<f64>,
}

impl Scores {
    /// Computes the scores of a mesh over all views, some at a time.
    pub(crate) fn of(
        mesh: &Mesh,
        setup: &Setup,
        subject: &Subject,
        renderer: &mut Renderer,
        goes_on: &mut GoesOn,
    ) -> Result<Self> {
        let targets = &subject.views;
        let Some(target) = &targets.silhouette else {
            return Ok(Self::default());
        };
        let (settings, scene) = (setup.settings(0), Scene::new(mesh.clone()));
        goes_on()?;
        let (unseen, masks) = Unseen::compare(mesh, targets, &settings, renderer)?;
        let covered = covered(&scene, targets, &settings, renderer, goes_on)?;
        let bounds: Vec<f64> = (0..target.batch).map(|view| most_iou(target.view(view))).collect();
        let fitted = setup.given.fitted(subject);
        let mut soft_iou = |renderer: &mut Renderer, views: &[usize]| -> Result<f64> {
            let some = targets.some(views);
            let (sigma, outputs) = (1e-4, Outputs::SILHOUETTE);
            let settings = Settings { sigma, outputs, ..sized(&settings, targets.size()?, 1) };
            let (mut loss, count) = (0.0, some.cameras.len() as f64);
            parts::in_batches(renderer, &scene, &some.cameras, &settings, |views, frame| {
                goes_on()?;
                let share = views.len() as f64 / count;
                if let Some(target) = &some.silhouette {
                    let target = target.views(views);
                    loss += share * ImageLoss::NegativeIou.evaluate(frame.silhouette()?, &target, None)?.value;
                }
                Ok(())
            })?;
            Ok(1.0 - loss)
        };
        let all: Vec<usize> = (0..target.batch).collect();
        let official = 1.0 - soft_iou(renderer, &fitted)? + official_penalty(mesh)?;
        let soft = soft_iou(renderer, &all)?;
        let solid = subject.truth.as_ref().map(|truth| voxel_iou(mesh, truth, VOXELS)).transpose()?;
        let (parts, genus) = genus(mesh)?;
        let held_out = subject.held_out.clone();
        let mut color = |views: &[usize]| {
            goes_on()?;
            color_error(mesh, &setup.settings(setup.iterations), subject, views, renderer)
        };
        let (color, color_held_out) = (color(&fitted)?, color(&held_out)?);
        let (most, fitted) = (mean(&bounds), mean_of(&masks, &fitted));
        Ok(Self {
            masks,
            fitted,
            held_out,
            covered,
            soft,
            most,
            official,
            parts,
            genus,
            unseen,
            solid,
            color,
            color_held_out,
        })
    }
}

/// Samples along each side of a pixel, for the covered share of it.
const SAMPLES: usize = 8;

/// The mask IoU of every view, by the pixels that the mesh covers by more than half.
fn covered(
    scene: &Scene,
    targets: &Views,
    settings: &Settings,
    renderer: &mut Renderer,
    goes_on: &mut GoesOn,
) -> Result<Vec<f64>> {
    let Some(target) = &targets.silhouette else { return Ok(Vec::new()) };
    let fine = hard(settings, targets.size()?, SAMPLES);
    let mut bands = Bands { unit: 4 * SAMPLES, margin: 0, at_once: usize::MAX };
    let one = |(view, camera): (usize, &Camera)| {
        goes_on()?;
        let target = target.views(view..view + 1);
        let mut image = Image { data: Vec::new(), ..target };
        let render = |camera: &Camera, settings: &Settings| renderer.render(scene, &[*camera], settings);
        parts::in_bands::<_, Error>(camera, &fine, &mut bands, render, |band| {
            image.data.extend(pooled(band.frame.silhouette()?, SAMPLES)?.data);
            Ok(())
        })?;
        Ok(mean(&mask_iou(&image, &target)?))
    };
    finer(&targets.cameras, SAMPLES)?.iter().enumerate().map(one).collect()
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
    /// The mean mask IoU over all views.
    pub fn mean_mask_iou(&self) -> f64 {
        mean(&self.masks)
    }

    /// The mean mask IoU over the views that were held out; `None` where none was.
    pub fn held_out_mask_iou(&self) -> Option<f64> {
        (!self.held_out.is_empty()).then(|| mean_of(&self.masks, &self.held_out))
    }

    /// A sentence for the user where the mesh is far from what the views show; `None` where it is not.
    pub fn warning(&self) -> Option<String> {
        let iou = self.held_out_mask_iou().unwrap_or_else(|| mean(&self.masks));
        (self.masks.len() > 1 && iou < FAR).then(|| {
            format!(
                "the silhouettes do not fit one solid (mask IoU {iou:.2}): check that each camera belongs to its picture, and that masks, or \
                 what was cut out of a plain background, show the object alone"
            )
        })
    }

    /// The main scores as a sentence.
    pub fn sentence(&self) -> String {
        let text = |value: Option<f64>, before: &str| value.map_or(String::new(), |x| format!("{before}{x:.4}"));
        let (shape, count) = (named((self.parts, self.genus)), self.held_out.len());
        let masks = match self.held_out_mask_iou() {
            None if self.masks.is_empty() => "not judged".into(),
            None => format!("mask IoU {:.4} over {} views", mean(&self.masks), self.masks.len()),
            Some(iou) => format!("mask IoU {:.4} over the fitted views, {iou:.4} over {count} held out", self.fitted),
        };
        let solid = text(self.solid, ", 3D IoU ");
        let color = text(self.color, ", colour error ") + &text(self.color_held_out, ", held out ");
        format!("{masks}{solid}{color}, {shape}")
    }
}

/// The regularisers of the official demo with its weights.
fn official_penalty(mesh: &Mesh) -> Result<f64> {
    let (positions, topology) = (points(mesh), Topology::of(mesh)?);
    let mut unused = vec![DVec3::ZERO; positions.len()];
    let laplacian = Regularizer::Laplacian.add(&topology, &positions, 0.0, &mut unused)?;
    let flatten = Regularizer::Flatten.add(&topology, &positions, 0.0, &mut unused)?;
    Ok(0.03 * laplacian + 0.0003 * flatten)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_that_show_no_solid_are_told() {
        let scores = |masks: &[f64], held_out: &[usize]| Scores {
            masks: masks.to_vec(),
            held_out: held_out.to_vec(),
            ..Scores::default()
        };
        let warned = scores(&[0.95, 0.9, 0.4], &[2]).warning();
        assert!(warned.is_some_and(|text| text.contains("mask IoU 0.40")));
        assert_eq!(scores(&[0.95, 0.4, 0.9], &[2]).warning(), None, "views that are held out judge");
        assert!(scores(&[0.7, 0.7], &[]).warning().is_some() && scores(&[0.8, 0.8], &[]).warning().is_none());
        assert_eq!(scores(&[0.1], &[]).warning(), None, "one view fits many solids");
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
