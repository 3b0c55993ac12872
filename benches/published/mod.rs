//! Other renderers' run time and error, for the benchmark `error`.
//!
//! The times were measured once, all on one machine (two Zen 3 cores, no GPU), so they tell a ratio that another machine
//! shifts a little. The errors are measured here by the f64 reference, from outputs recorded beside the repository, in
//! `../shared/reference`. Only the official SoftRas has outputs there.

#[allow(dead_code, reason = "shared with the parity tests")]
#[path = "../../tests/parity/recorded.rs"]
mod recorded;

/// Milliseconds on spot, 5856 triangles, at 256², σ = γ = 1e-4, colour and silhouette.
pub struct Peer {
    pub name: &'static str,
    pub forward: f64,
    pub backward: f64,
    /// The file of its recorded outputs for that scene.
    outputs: Option<&'static str>,
}

const SCENE: &str = "spot_s0.0001_g0.0001.npz";

/// The renderers that were measured on that scene.
pub const PEERS: [Peer; 4] = [
    Peer { name: "SoftRas, official", forward: 386.0, backward: 429.0, outputs: Some(SCENE) },
    Peer { name: "PyTorch3D, K = 50", forward: 1995.0, backward: 30654.0, outputs: None },
    Peer { name: "PyTorch3D, K = 10", forward: 1859.0, backward: 10728.0, outputs: None },
    Peer { name: "deodr", forward: 5.0, backward: 4.9, outputs: None },
];

/// The largest differences of a peer's image from the model.
pub struct PeerError {
    /// The largest of any value, from the model without truncation.
    pub untruncated: f64,
    /// The largest of the silhouette alone, from the model without truncation.
    pub silhouette: f64,
    /// The largest from the peer's own equations with its own truncation: the cost of its single precision.
    pub rounding: f64,
}

impl Peer {
    /// Its error by the f64 reference; `None` where its outputs are not recorded or the records are not there.
    pub fn error(&self) -> Option<PeerError> {
        let name = self.outputs?;
        if !recorded::folder().join(name).is_file() {
            return None;
        }
        let case = recorded::Case::open(name);
        let image: Vec<f64> = case.archive.f32s("soft_colors_f32").into_iter().map(f64::from).collect();
        let (color, silhouette) = case.planes(&image);
        let own = softras_reference::render_culled(&case.scene, &case.cameras, &case.settings).expect("an image");
        let model =
            softras_reference::render_untruncated(&case.scene, &case.cameras, &case.settings).expect("an image");
        let silhouette_error = largest(&silhouette, &model.silhouette);
        Some(PeerError {
            untruncated: largest(&color, &model.color).max(silhouette_error),
            silhouette: silhouette_error,
            rounding: largest(&color, &own.color).max(largest(&silhouette, &own.silhouette)),
        })
    }
}

/// The largest difference; infinite where one is not a number or the images differ in size.
fn largest(ours: &[f64], reference: &[f64]) -> f64 {
    if ours.len() != reference.len() {
        return f64::INFINITY;
    }
    let differences = ours.iter().zip(reference).map(|(a, b)| (a - b).abs());
    differences.fold(0.0, |most, d| if d.is_nan() { f64::INFINITY } else { d.max(most) })
}

/// Renderers without a point on the curve, and why.
pub const NO_POINT: [&str; 3] = [
    "PyTorch3D, deodr: their outputs are not in ../shared/reference, so that their errors are not measured here. PyTorch3D's \
     largest error of alpha on this scene is known as 0.13 with K = 50 and 0.995 with K = 10; deodr is not soft.",
    "dressi, K = 1: 72 to 90 ms for a whole step of another task (8 silhouettes of 128², sphere of 1280 triangles), below; \
     its outputs are not there either.",
    "dressi, K = 3: neither a time nor outputs are known.",
];

/// Milliseconds of dressi with K = 1 for a step of 8 silhouettes of 128², sphere of 1280 triangles.
pub const DRESSI_STEP: [f64; 2] = [72.0, 90.0];
