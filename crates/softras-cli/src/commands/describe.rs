//! Settings and projections as JSON.

use glam::DVec3;
use serde_json::{Value, json};
use softras::{Projection, Settings};
use softras_view::Viewpoint;

/// Every field under its own name, and the blur radius in pixels that follows from them.
pub fn settings(s: &Settings) -> Value {
    let lower = |mode: &dyn std::fmt::Debug| format!("{mode:?}").to_lowercase();
    json!({
        "width": s.width, "height": s.height,
        "sigma": s.sigma, "blur_pixels": s.blur_pixels(), "gamma": s.gamma, "epsilon": s.epsilon, "tau": s.tau,
        "support": lower(&s.support),
        "near": s.near, "far": s.far,
        "color": lower(&s.color), "silhouette": lower(&s.silhouette), "distance": lower(&s.distance),
        "background": lower(&s.background), "background_color": s.background_color,
        "faces": lower(&s.faces), "interpolation": lower(&s.interpolation),
        "surface_point": lower(&s.surface_point), "parity": lower(&s.parity),
    })
}

/// A view in the coordinates of the mesh file, where the mesh's origin is `origin`.
pub fn camera(view: &Viewpoint, origin: DVec3) -> Value {
    json!({
        "eye": (view.eye + origin).to_array(), "target": (view.target + origin).to_array(), "up": view.up.to_array(),
        "projection": projection(&view.projection),
    })
}

/// A projection with its kind and parameters.
fn projection(projection: &Projection) -> Value {
    match *projection {
        Projection::Perspective { fov_y } => json!({ "kind": "perspective", "fov_y_degrees": fov_y.to_degrees() }),
        Projection::Orthographic { half_height } => json!({ "kind": "orthographic", "half_height": half_height }),
        Projection::Pinhole { fx, fy, cx, cy } => json!({ "kind": "pinhole", "fx": fx, "fy": fy, "cx": cx, "cy": cy }),
        Projection::Official { distortion, original_size } => {
            json!({ "kind": "official", "distortion": distortion, "original_size": original_size })
        }
        Projection::Screen => json!({ "kind": "screen" }),
    }
}
