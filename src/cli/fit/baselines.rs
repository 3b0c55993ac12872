//! The same fit less one thing each: what the thing is worth.

use super::args::FitArgs;
use super::report::Scores;
use super::setup::Setup;
use super::targets::{self, Views};
use crate::cli::Failure;
use crate::cli::progress::Progress;
use serde_json::{Value, json};
use softras::Renderer;
use softras::fit::shape::ShapeFit;

/// What is left out, how, and whether there is anything to leave out.
type Without = (&'static str, fn(&mut Setup), bool);

/// What a baseline came to.
pub struct Baseline {
    name: &'static str,
    scores: Scores,
}

impl Baseline {
    /// For programs.
    pub fn json(&self) -> Value {
        json!({ "without": self.name, "final": self.scores.json() })
    }

    /// For people.
    pub fn sentence(&self) -> String {
        format!("without {}: {}", self.name, self.scores.sentence())
    }
}

/// Fits without the schedule of sigma and gamma, without softness, without regularisers, and, where colours are fitted, without them.
pub fn run(args: &FitArgs, views: &Views, renderer: &mut Renderer) -> Result<Vec<Baseline>, Failure> {
    let without: [Without; 4] = [
        ("the schedule", Setup::hold_softness, true),
        ("softness", Setup::harden, true),
        ("regularisers", |setup| setup.options.regularizers.clear(), !args.texture),
        ("colours", |setup| setup.options.fit_colors = false, args.color && !args.texture),
    ];
    let mut found = Vec::new();
    for (name, change, _) in without.into_iter().filter(|(.., applies)| *applies) {
        let mut setup = Setup::new(args, views)?;
        change(&mut setup);
        let mut targets = targets::fitted(args, &views.targets);
        if !setup.options.fit_colors {
            targets.color = None;
        }
        let mut fit = ShapeFit::new(setup.template.clone(), softras::Lights::unlit(), setup.options.clone())?;
        let progress = Progress::counted("step", setup.iterations);
        progress.tell(format!("without {name}"));
        for step in 0..setup.iterations {
            if setup.remakes(step) {
                fit = setup.remade(&fit, step)?;
            }
            let (rate, color_rate) = (setup.rate.at_step(step, setup.iterations), setup.color_rate(step));
            fit.step(renderer, &setup.settings(step), &targets, rate, color_rate)?;
            progress.step();
        }
        drop(progress);
        found.push(Baseline { name, scores: Scores::of(fit.mesh(), &setup, views, renderer)? });
    }
    Ok(found)
}
