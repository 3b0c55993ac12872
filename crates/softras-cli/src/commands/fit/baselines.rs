//! Baselines of a fit: the same fit with one part left out at a time, and with a hard renderer.

use super::args::FitArgs;
use super::report::Scores;
use super::setup::Setup;
use super::targets::{self, Views};
use crate::commands::Failure;
use crate::commands::steps::{Loop, each};
use serde_json::{Value, json};
use softras::scene::{Appearance, ColorAggregation, Outputs, SilhouetteAggregation};
use softras::{ImageGradient, MeshGradients};
use softras::{Mesh, Projection, Renderer, Result, Scene, Settings};
use softras_fit::flow_by_vertex;
use softras_fit::{ShapeFit, Targets};
use std::time::Instant;

/// A baseline's name, the change of the setup, and whether it applies to the fit.
type Without = (&'static str, fn(&mut Setup), bool);

/// The result of a baseline.
pub struct Baseline {
    pub name: &'static str,
    pub mesh: Mesh,
    pub seconds: f64,
    scores: Scores,
}

impl Baseline {
    fn new(
        (name, began): (&'static str, Instant),
        mesh: &Mesh,
        setup: &Setup,
        views: &Views,
        renderer: &mut Renderer,
    ) -> Result<Self, Failure> {
        let seconds = began.elapsed().as_secs_f64();
        Ok(Self { name, mesh: mesh.clone(), seconds, scores: Scores::of(mesh, setup, views, renderer)? })
    }

    /// The result as JSON.
    pub fn json(&self) -> Value {
        json!({ "method": self.name, "final": self.scores.json() })
    }

    /// The result as a sentence.
    pub fn sentence(&self) -> String {
        format!("{}: {}", self.name, self.scores.sentence())
    }
}

/// Fits without the schedule of sigma and gamma, without softness, without regularisers, and, if colours are fitted, without
/// colours. If the cameras have perspective, it also fits silhouettes with the gradients of a hard renderer.
pub fn run(args: &FitArgs, views: &Views, renderer: &mut Renderer) -> Result<Vec<Baseline>, Failure> {
    let moves = !views.keeps_shape(args);
    let without: [Without; 4] = [
        ("without the schedule", Setup::hold_softness, true),
        ("without softness", Setup::harden, true),
        ("without regularisers", |setup| setup.options.regularizers.clear(), moves),
        ("without colours", |setup| setup.options.fit_colors = false, args.colored() && moves),
    ];
    let mut found = Vec::new();
    for (name, change, _) in without.into_iter().filter(|(.., applies)| *applies) {
        let began = Instant::now();
        let mut setup = Setup::new(args, views, renderer)?;
        change(&mut setup);
        let mut targets = targets::fitted(args, &views.targets);
        if !setup.options.fit_colors {
            targets.color = None;
        }
        let mut fit = ShapeFit::new(setup.template.clone(), views.lights.clone(), setup.options.clone())?;
        let steps = each(|step, renderer| {
            if setup.remakes(step) {
                fit = setup.remade(&fit, step)?;
            }
            let (rate, color_rate) = setup.rates(step);
            Ok::<_, Failure>(fit.step(renderer, &setup.settings(step), &targets, rate, color_rate)?)
        });
        Loop::over(0..setup.iterations).with_bar("step").run(&mut steps.named(name), renderer)?;
        found.push(Baseline::new((name, began), fit.mesh(), &setup, views, renderer)?);
    }
    found.extend(hard(args, views, renderer)?);
    Ok(found)
}

/// Fits silhouettes alone, rendered hard, with gradients from differences between pixels ([`flow_by_vertex`]); `None`
/// where there is no silhouette to fit or the method does not apply.
fn hard(args: &FitArgs, views: &Views, renderer: &mut Renderer) -> Result<Option<Baseline>, Failure> {
    let (name, began) = ("hard, image-space differences", Instant::now());
    let mut setup = Setup::new(args, views, renderer)?;
    setup.options.fit_colors = false;
    let targets = Targets { color: None, ..targets::fitted(args, &views.targets) };
    let mut fit = ShapeFit::new(setup.template.clone(), views.lights.clone(), setup.options.clone())?;
    let perspective = |camera: &softras::Camera| matches!(camera.projection(), Projection::Perspective { .. });
    let possible = targets.silhouette.is_some() && targets.cameras.iter().all(perspective);
    if views.keeps_shape(args) || !possible {
        return Ok(None);
    }
    let steps = each(|step, renderer| {
        if setup.remakes(step) {
            fit = setup.remade(&fit, step)?;
        }
        let by_vertex = hard_gradient(fit.mesh(), &setup, &targets, renderer)?;
        let mesh = MeshGradients { positions: by_vertex, ..MeshGradients::default() };
        Ok::<_, Failure>(fit.advance(&mesh, setup.rate.at_step(step, setup.iterations), 0.0)?)
    });
    Loop::over(0..setup.iterations).with_bar("step").run(&mut steps.named(name), renderer)?;
    Baseline::new((name, began), fit.mesh(), &setup, views, renderer).map(Some)
}

/// The gradient of the silhouettes' loss by every vertex, with the mesh rendered hard.
fn hard_gradient(mesh: &Mesh, setup: &Setup, targets: &Targets, renderer: &mut Renderer) -> Result<Vec<[f32; 3]>> {
    let (height, width) = targets.size()?;
    let settings = Settings {
        width: width as u32,
        height: height as u32,
        color: ColorAggregation::Hard,
        silhouette: SilhouetteAggregation::Hard,
        outputs: Outputs { color: true, silhouette: true, depth: true, normal: false },
        save: true,
        ..setup.settings(0)
    };
    let colors = vec![[0.0; 3]; mesh.positions().len()];
    let colored = mesh.clone().with_appearance(Appearance::VertexColors(colors))?;
    let frame = renderer.render(&Scene::new(colored), &targets.cameras, &settings)?;
    let (Some(rendered), Some(target)) = (frame.silhouette(), &targets.silhouette) else { return Ok(Vec::new()) };
    let (loss, weight) = setup.options.silhouette;
    let mut gradient = loss.evaluate(rendered, target, None)?.gradient;
    gradient.data.iter_mut().for_each(|g| *g *= weight as f32);
    flow_by_vertex(renderer, &frame, &ImageGradient::silhouette(gradient), &targets.cameras)
}
