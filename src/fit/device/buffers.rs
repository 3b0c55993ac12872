//! The table of the fit's own buffers: a new buffer is a new row.

use super::arithmetic::GROUP;
use super::memory::ROWS;
use super::plan::FitPlan;
use super::tables::Tables;
use crate::constants as c;
pub use crate::frame::buffers::BufferId;
use crate::frame::buffers::{Entry, Key, Role, is_binding_of};
use crate::vulkan::TexelFormat;

/// A buffer that a fit's kernels bind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FitBuffer {
    /// One of the frame's or of its gradients'.
    Frame(BufferId),
    /// One of the fit's own.
    Own(Own),
}

impl From<BufferId> for FitBuffer {
    fn from(id: BufferId) -> Self {
        Self::Frame(id)
    }
}

impl From<Own> for FitBuffer {
    fn from(own: Own) -> Self {
        Self::Own(own)
    }
}

impl Key for FitBuffer {
    fn name(self) -> &'static str {
        match self {
            Self::Frame(id) => id.name(),
            Self::Own(own) => own.name(),
        }
    }
}

impl FitBuffer {
    /// The buffer that a kernel's binding of this name is.
    pub fn of_binding(binding: &str) -> Option<Self> {
        let own = Own::ALL.into_iter().find(|own| is_binding_of(binding, own.name()));
        own.map(Self::Own).or_else(|| BufferId::of_binding(binding).map(Self::Frame))
    }
}

macro_rules! table {
    ($($id:ident($name:literal, $format:ident, $role:ident, $size:expr);)*) => {
        /// One of the fit's own buffers.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Own {
            $($id,)*
        }

        impl Own {
            /// All of them.
            pub const ALL: [Self; [$($name),*].len()] = [$(Self::$id),*];

            /// Its name, as in the kernels.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$id => $name,)*
                }
            }

            /// What it is in a fit, and its bytes.
            pub fn of(self, plan: &FitPlan, tables: &Tables) -> (Entry<FitBuffer>, u64) {
                type Size = fn(&FitPlan, &Tables) -> u64;
                let (format, role, size) = match self {
                    $(Self::$id => (Format::$format, Role::$role, $size as Size),)*
                };
                (Entry { id: self.into(), format: format.texels(plan), role }, size(plan, tables))
            }
        }
    };
}

/// What an element is.
#[derive(Clone, Copy)]
enum Format {
    Float,
    Float4,
    Uint,
    Uint4,
    /// A pixel: one float, or four with colours.
    Pixel,
}

impl Format {
    fn texels(self, plan: &FitPlan) -> TexelFormat {
        match self {
            Self::Float => TexelFormat::Float,
            Self::Float4 => TexelFormat::Float4,
            Self::Uint => TexelFormat::Uint,
            Self::Uint4 => TexelFormat::Uint4,
            Self::Pixel if plan.has_color => TexelFormat::Float4,
            Self::Pixel => TexelFormat::Float,
        }
    }
}

fn bytes(words: usize) -> u64 {
    4 * words.max(4) as u64
}

fn vec4(count: u64) -> u64 {
    16 * count.max(1)
}

/// Three floats for each vertex.
fn vectors(plan: &FitPlan) -> u64 {
    12 * u64::from(plan.vertices).max(2)
}

fn rows(plan: &FitPlan) -> u64 {
    plan.rows().into()
}

fn groups(plan: &FitPlan) -> u64 {
    rows(plan).div_ceil(GROUP as u64)
}

fn pixels(plan: &FitPlan) -> u64 {
    4 * (plan.channels() as u64 * u64::from(plan.pyramid_pixels())).max(4)
}

fn partials(plan: &FitPlan) -> u64 {
    plan.levels.iter().map(|level| u64::from(level.blocks * plan.views)).sum()
}

table! {
    Neighbors("neighbors", Uint, Input, |_, t| bytes(t.neighbors.len()));
    Flaps("flaps", Uint4, Input, |_, t| bytes(4 * t.flaps.len()));
    FlapCorners("flap_corners", Uint, Input, |_, t| bytes(t.flap_corners.len()));
    LossTargets("loss_targets", Pixel, Input, |_, t| bytes(t.targets.len()));
    LossWeights("loss_weights", Float, Input, |_, t| bytes(t.weights.len()));
    LossScales("loss_scales", Float4, Input, |p, _| vec4(p.levels.len() as u64));
    LogitTemplate("logit_template", Float4, Input, |_, t| bytes(4 * t.logit_template.len()));
    InverseEntries("inverse_entries", Float, Input, |_, t| bytes(t.inverse.len()));
    Parameters("parameters", Float4, Output, |p, _| vec4(rows(p)));
    Moments("moments", Float4, Output, |p, _| vec4(2 * rows(p)));
    ColorMoments("color_moments", Float4, Output,
        |p, _| vec4(if p.fit_colors { 2 * u64::from(p.vertices) } else { 1 }));
    BestPositions("best_positions", Float, Output, |p, _| vectors(p));
    BestColors("best_colors", Float, Output, |p, _| if p.fit_colors { vectors(p) } else { 16 });
    FitState("fit_state", Uint, Output, |_, _| u64::from(4 * c::FIT_STATE_WORDS));
    Records("records", Uint, Output, |_, _| u64::from(4 * c::RECORD_WORDS) * ROWS as u64);
    Pyramid("pyramid", Pixel, Workspace, |p, _| pixels(p));
    LossPartials("loss_partials", Float4, Workspace, |p, _| vec4(partials(p)));
    LossSums("loss_sums", Float4, Workspace, |p, _| vec4(u64::from(p.views) * p.levels.len() as u64));
    VertexPenalties("vertex_penalties", Float4, Workspace, |p, _| vec4(2 * u64::from(p.vertices)));
    FlapGradients("flap_gradients", Float4, Workspace, |p, _| vec4(4 * u64::from(p.flaps)));
    ShapeGradients("shape_gradients", Float4, Workspace, |p, _| vec4(rows(p)));
    CentrePartials("centre_partials", Float4, Workspace, |p, _| vec4(groups(p)));
    SquarePartials("square_partials", Float4, Workspace, |p, _| vec4(groups(p)));
    StepTotals("step_totals", Float4, Workspace, |_, _| vec4(2));
    Steps("steps", Float4, Workspace, |p, _| vec4(rows(p)));
    SmoothOdd("smooth_odd", Float4, Workspace, |p, _| vec4(rows(p)));
    SmoothEven("smooth_even", Float4, Workspace, |p, _| vec4(rows(p)));
}
