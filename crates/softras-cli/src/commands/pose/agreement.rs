//! How far a picture and the mesh in the pose that was found agree.

use super::{PoseTarget, View};
use softras::{Image, Mesh, Renderer, Result};

/// Samples along each side of a pixel. Pictures of more than [`MOST_SAMPLED`] pixels a side have one.
const SAMPLES: u32 = 3;
const MOST_SAMPLED: u32 = 1024;

/// The least that silhouettes agree and the most that colours differ where a pose is right, with room for pictures of few
/// pixels: right poses of the built-in meshes and of spot in pictures of 64 pixels had 0.93 or more and 0.12 or less.
const LEAST_IOU: f64 = 0.85;
const MOST_COLOR: f64 = 0.3;

/// How far the picture and the posed mesh agree.
#[derive(Clone, Copy, Debug)]
pub struct Agreement {
    /// Intersection over union of their silhouettes.
    pub iou: f64,
    /// The sum of the differences of their colours, in linear light where both show the object, as a share of the sum of the
    /// picture's colours there.
    pub color: f64,
}

impl Agreement {
    /// Renders the posed mesh and compares.
    pub fn of(view: &View, posed: &Mesh, target: &PoseTarget, renderer: &mut Renderer) -> Result<Self> {
        let side = view.settings.width.max(view.settings.height);
        let shown = view.picture(posed, if side <= MOST_SAMPLED { SAMPLES } else { 1 }, renderer)?;
        Ok(Self::between([&target.color, &target.silhouette], [&shown.color, &shown.silhouette]))
    }

    /// Whether picture and mesh agree as well as in a right pose.
    pub fn is_near(&self) -> bool {
        self.iou >= LEAST_IOU && self.color <= MOST_COLOR
    }

    /// The agreement in words.
    pub fn sentence(&self) -> String {
        let verdict = if self.is_near() { "the pose explains the picture: " } else { "" };
        let color = 100.0 * self.color;
        format!("{verdict}silhouettes agree by {:.3} (IoU), colours differ by {color:.0} %", self.iou)
    }

    /// A note on likely reasons, if the mesh in this pose is not what the picture shows.
    pub fn doubt(&self) -> Option<String> {
        if self.is_near() {
            return None;
        }
        Some(format!(
            "this pose does not explain the picture ({}): is the picture without light, as `softras render --unlit` makes \
             it, and seen by this camera, as with --frame sphere and the same --fov, --eye or --distance?",
            self.sentence()
        ))
    }

    /// The agreement of two pictures of one size, each given by its colour and its silhouette.
    fn between(a: [&Image; 2], b: [&Image; 2]) -> Self {
        let (mut both, mut either, mut differing, mut bright) = (0.0, 0.0, 0.0, 0.0);
        for (i, (x, y)) in a[1].data.iter().zip(&b[1].data).enumerate() {
            both += f64::from(x.min(*y));
            either += f64::from(x.max(*y));
            if x.min(*y) > 0.5 {
                for (x, y) in a[0].data[3 * i..3 * i + 3].iter().zip(&b[0].data[3 * i..3 * i + 3]) {
                    differing += f64::from((x - y).abs());
                    bright += f64::from(*x);
                }
            }
        }
        let share = |part: f64, whole: f64| if whole > 0.0 { part / whole } else { 0.0 };
        Self { iou: if either > 0.0 { both / either } else { 1.0 }, color: share(differing, bright) }
    }
}
