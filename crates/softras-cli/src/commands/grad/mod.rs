//! `softras grad`: draws the gradient of a loss against a target image by the vertices.

pub mod args;
mod arrows;
mod engine;
mod panels;
mod target;

use super::outputs::Outputs;
use super::progress::Progress;
use super::{Failure, describe, note, say};
use args::GradArgs;
use engine::Engine;
use glam::DVec3;
use panels::Sheet;
use serde_json::json;
use softras::{Scene, Settings};
use softras_io::Budget;
use softras_view::{Bounds, MISSED, Output, Viewpoint};
use std::path::Path;
use std::time::Instant;
use target::{Loss, Target};

pub fn run(args: &GradArgs) -> Result<(), Failure> {
    let outputs = Outputs::new([&args.out], [])?;
    outputs.spare([&args.target_image])?;
    let start = Instant::now();
    let curve = args.soft.curve();
    let budget = Budget::new(args.read.memory);
    let target = Target::read(&args.target_image, curve, args.soft.background.numbers(curve), &budget)?;
    let loaded = args.read.read(&args.mesh, !args.soft.raw, &outputs, &budget)?;
    let (bounds, origin) = (Bounds::of(&loaded.mesh), DVec3::from(loaded.origin));
    let view = args.camera.view(bounds, loaded.origin, (target.width, target.height))?;
    if view.misses(bounds) {
        note(MISSED);
    }
    let mut engine = Engine::open(args.device.as_deref())?;
    let mesh = match &engine {
        Engine::Device(renderer) => super::held(loaded.mesh, renderer)?,
        Engine::Reference => loaded.mesh,
    };
    let scene = Scene::new(mesh).with_lights(softras_view::lights(&args.light.options(curve), &view)?);
    let settings = settings(args, &view, &target);
    let spinner = Progress::spinner("differentiating");
    let mut loss = Loss::default();
    let (images, gradient) =
        engine.differentiate(&scene, view.camera()?, &settings, args.gradient.into(), |images| {
            let (measured, upstream) = target.loss(images);
            loss = measured;
            Ok(upstream)
        })?;
    let sharp = Settings { gamma: 1e-4, ..settings.clone() }.with_blur_pixels(1.23);
    let depth = engine.depth(&scene, view.camera()?, &sharp)?;
    if !view.misses(bounds) && depth.silhouette.iter().all(|alpha| *alpha < 0.5 / 255.0) {
        note("nothing of the mesh is in the picture: it is not where the camera looks");
    }
    let pulls = arrows::pulls(&scene.meshes[0], &gradient, &view, [target.width, target.height], &depth)?;
    let sheet = Sheet { color: &images.color, target: &target, loss: &loss, pulls: &pulls, curve };
    let (picture, arrows) = sheet.draw();
    picture.save(&args.out)?;
    drop(spinner);
    let report = GradReport { device: engine.name(), loss: &loss, gradient: &gradient, arrows, path: &args.out };
    if args.json { say(&report.json(&view, origin, &settings, start).to_string()) } else { say(&report.text()) }
}

fn settings(args: &GradArgs, view: &Viewpoint, target: &Target) -> Settings {
    let look = args.soft.look((target.width as u32, target.height as u32), &args.modes);
    softras_view::settings(&look, view, &[Output::Color], 1, None)
}

struct GradReport<'a> {
    device: &'a str,
    loss: &'a Loss,
    gradient: &'a [f64],
    arrows: usize,
    path: &'a Path,
}

impl GradReport<'_> {
    fn norm(&self) -> f64 {
        self.gradient.iter().map(|g| g * g).sum::<f64>().sqrt()
    }

    fn text(&self) -> String {
        let Loss { color, silhouette, .. } = self.loss;
        format!(
            "{}: loss {:.6e} (colour {color:.3e}, silhouette {silhouette:.3e}), gradient norm {:.6e} over {} vertices",
            self.path.display(),
            self.loss.total(),
            self.norm(),
            self.gradient.len() / 3,
        )
    }

    fn json(&self, view: &Viewpoint, origin: DVec3, settings: &Settings, start: Instant) -> serde_json::Value {
        json!({
            "device": self.device, "path": self.path.display().to_string(),
            "loss": self.loss.total(), "color_loss": self.loss.color, "silhouette_loss": self.loss.silhouette,
            "gradient_norm": self.norm(), "vertices": self.gradient.len() / 3, "arrows": self.arrows,
            "camera": describe::camera(view, origin), "settings": describe::settings(settings),
            "total_milliseconds": start.elapsed().as_secs_f64() * 1e3,
        })
    }
}
