//! The results of a fit, as text and as JSON.

use super::args::FitArgs;
use crate::commands::{Failure, note, say};
use serde_json::{Value, json};
use softras_fit::{Fitted, Painted, Regularizer, Scores, StepLosses};
use std::path::Path;

/// Everything as JSON.
pub fn json(args: &FitArgs, fitted: &Fitted, device: &str) -> Value {
    let Fitted { mesh, scores, steps, options, .. } = fitted;
    let each = |value: fn(&StepLosses) -> f64| steps.iter().map(|taken| value(&taken.losses)).collect::<Vec<f64>>();
    let names = options.regularizers.iter().map(|(r, weight)| json!({ "name": name(*r), "weight": weight }));
    let penalties: Vec<_> = steps.iter().map(|taken| &taken.losses.regularizers).collect();
    json!({
        "device": device,
        "preset": format!("{:?}", args.method.preset).to_lowercase(),
        "vertices": mesh.positions().len(),
        "triangles": mesh.triangles().len(),
        "views": scores.masks.len(),
        "view_stride": fitted.view_stride,
        "first_step": steps.first().map_or(0, |taken| taken.at),
        "loss": each(|s| s.loss),
        "silhouette_loss": each(|s| s.silhouette),
        "color_loss": each(|s| s.color),
        "depth_loss": each(|s| s.depth),
        "normal_loss": each(|s| s.normal),
        "regularizers": names.collect::<Vec<_>>(),
        "regularizer_values": penalties,
        "seconds": steps.iter().map(|taken| taken.seconds).collect::<Vec<_>>(),
        "seconds_per_iteration": fitted.seconds_per_step(),
        "final": of_scores(scores),
        "texture": fitted.painted.as_ref().map(of_painted),
    })
}

fn of_scores(scores: &Scores) -> Value {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    json!({
        "mask_iou": { "per_view": scores.masks, "mean": mean(&scores.masks), "mean_of_fitted": scores.fitted,
                      "held_out": scores.held_out, "mean_of_held_out": scores.held_out_mask_iou() },
        "covered_mask_iou": { "per_view": scores.covered, "mean": mean(&scores.covered) },
        "soft_iou": scores.soft,
        "most_soft_iou": scores.most,
        "official_loss": scores.official,
        "parts": scores.parts,
        "genus": scores.genus,
        "covered_holes_in_views": scores.unseen.covered,
        "missed_parts_in_views": scores.unseen.missed,
        "iou_3d": scores.solid,
        "color_error": scores.color,
        "color_error_held_out": scores.color_held_out,
    })
}

fn of_painted(painted: &Painted) -> Value {
    json!({
        "side": painted.side, "texel_pixels": painted.texel, "color_loss": painted.losses,
        "color_error_by_vertices": painted.errors[0], "color_error": painted.errors[1],
    })
}

fn name(regularizer: Regularizer) -> &'static str {
    match regularizer {
        Regularizer::Laplacian => "laplacian",
        Regularizer::Flatten => "flatten",
        Regularizer::NormalConsistency => "normals",
    }
}

/// Prints the result of a fit.
pub fn tell(out: &Path, fitted: &Fitted, begins_with_hull: bool) -> Result<(), Failure> {
    let (vertices, triangles) = (fitted.mesh.positions().len(), fitted.mesh.triangles().len());
    let least = fitted.losses().iter().map(|l| l.1).fold(f64::INFINITY, f64::min);
    for reason in fitted.scores.unseen.reasons(|view| fitted.views.name(view)) {
        let remedy = " (--template hull begins with the holes and parts of the silhouettes)";
        note(&format!("the mesh {reason}{}", if begins_with_hull { "" } else { remedy }));
    }
    if let Some(warning) = fitted.scores.warning().filter(|_| fitted.is_complete && begins_with_hull) {
        note(&warning);
    }
    let time = fitted.seconds_per_step().map_or(String::new(), |s| format!(", {:.1} ms a step", s * 1e3));
    say(&format!(
        "{}: {vertices} vertices, {triangles} triangles; loss {least:.5}, {}{time}",
        out.display(),
        fitted.scores.sentence(),
    ))
}
