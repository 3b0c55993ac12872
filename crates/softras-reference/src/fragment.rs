//! Evaluates a (pixel, piece) pair: whether it is dropped, its coverage, depth, colour and normal.

use super::GradientMode;
use super::geometry::Location;
use super::parameters::{MeshSlots, Parameters, Source};
use super::real::{Real, blend, dot, multiply};
use super::setup::Piece;
use super::texture::{opacity, sample};
use softras::scene::{Distance, Faces, Interpolation, Mesh, Parity, Settings, SurfacePoint};

/// The settings that a pixel is computed from, the differentiable ones as numbers that may carry derivatives.
#[derive(Clone, Debug)]
pub struct Knobs<'a, R> {
    /// Everything that is not differentiable, and which images to make.
    pub settings: &'a Settings,
    /// σ.
    pub sigma: R,
    /// γ.
    pub gamma: R,
    /// The background's score: ε, twice that in official parity.
    pub background_score: R,
    /// Background colour.
    pub background: [R; 3],
    /// Squared distance, screen units², from which pairs outside are dropped; infinite without truncation.
    pub support: f64,
    /// Which derivatives are left out.
    pub mode: GradientMode,
}

impl<'a, R: Real> Knobs<'a, R> {
    /// Reads the settings; `support` is [`Self::support`].
    pub fn load<S: Source<R = R>>(
        settings: &'a Settings,
        support: f64,
        mode: GradientMode,
        parameters: &Parameters,
        source: &S,
    ) -> Self {
        let start = parameters.layout().settings.start;
        let (sigma, epsilon) = (source.load(start + 3), source.load(start + 5));
        Self {
            settings,
            sigma,
            gamma: source.load(start + 4),
            background_score: match settings.parity {
                Parity::Model => epsilon,
                Parity::Official => epsilon.scale(2.0),
            },
            background: source.row(start),
            support,
            mode,
        }
    }

    /// Where a triangle is sampled outside itself: in official parity as the official code does.
    pub fn surface_point(&self) -> SurfacePoint {
        match self.settings.parity {
            Parity::Model => self.settings.surface_point,
            Parity::Official => SurfacePoint::Clip,
        }
    }
}

/// The coverage D of a fragment: the probability that its triangle covers the pixel.
#[derive(Clone, Copy, Debug)]
pub enum Coverage<R> {
    /// D = 1.
    Certain,
    /// D = sigmoid(x).
    Soft(R),
}

/// A (pixel, piece) pair that is not dropped.
#[derive(Clone, Copy, Debug)]
pub struct Fragment<R> {
    /// D.
    pub coverage: Coverage<R>,
    /// α of D' = α D; `None` where the texture is opaque.
    pub opacity: Option<R>,
    /// The pixel's centre is in the triangle.
    pub inside: bool,
    /// Depth, colour and normal; `None` for a fragment that counts in the silhouette only.
    pub surface: Option<Surface<R>>,
}

impl<R: Real> Coverage<R> {
    /// D.
    pub fn probability(self) -> R {
        match self {
            Self::Certain => R::one(),
            Self::Soft(x) => x.logistic(),
        }
    }

    /// 1 - D.
    pub fn complement(self) -> R {
        match self {
            Self::Certain => R::zero(),
            Self::Soft(x) => (-x).logistic(),
        }
    }
}

impl<R: Real> Fragment<R> {
    /// Whether the hard modes count it.
    pub fn is_solid(&self) -> bool {
        self.opacity.is_none_or(|alpha| alpha.value() >= 0.5)
    }
}

/// The point of a piece's surface that a fragment shows.
#[derive(Clone, Copy, Debug)]
pub struct Surface<R> {
    /// View depth.
    pub z: R,
    /// Lit colour.
    pub color: [R; 3],
    /// World-space normal.
    pub normal: [R; 3],
}

/// D of a pair, `None` where it is dropped.
pub fn coverage<R: Real>(
    knobs: &Knobs<'_, R>,
    piece: &Piece<R>,
    location: &Location<R>,
    pixel: [f64; 2],
) -> Option<Coverage<R>> {
    match knobs.settings.distance {
        Distance::Hard => location.inside.then_some(Coverage::Certain),
        Distance::Euclidean => {
            let x = location.distance2 / knobs.sigma;
            if location.inside {
                Some(Coverage::Soft(x))
            } else {
                (location.distance2.value() < knobs.support).then_some(Coverage::Soft(-x))
            }
        }
        Distance::Barycentric => {
            let m = smallest(location.barycentrics?);
            let x = m.square() / knobs.sigma;
            if m.value() >= 0.0 {
                return Some(Coverage::Soft(x));
            }
            let official = knobs.settings.parity == Parity::Official;
            let boxed = official && box_excess(&piece.screen(), pixel) > knobs.support.sqrt();
            (m.value().powi(2) < knobs.support && !boxed).then_some(Coverage::Soft(-x))
        }
    }
}

/// The smallest barycentric; the first of equals.
pub fn smallest<R: Real>(b: [R; 3]) -> R {
    b[1..].iter().fold(b[0], |least, &next| if next.value() < least.value() { next } else { least })
}

/// How far a pixel is outside a triangle's box, the largest over the axes; negative inside.
pub fn box_excess<R: Real>(corners: &[[R; 2]; 3], pixel: [f64; 2]) -> f64 {
    let excess = |axis: usize| {
        let values = corners.map(|c| c[axis].value());
        let low = values.into_iter().fold(f64::INFINITY, f64::min);
        let high = values.into_iter().fold(f64::NEG_INFINITY, f64::max);
        (low - pixel[axis]).max(pixel[axis] - high)
    };
    excess(0).max(excess(1))
}

/// View depth at b̂: 1/z = Σ b̂ₖ / zₖ, or z = Σ b̂ₖ zₖ where the camera is orthographic.
pub fn depth<R: Real>(piece: &Piece<R>, b: [R; 3]) -> R {
    if piece.parallel {
        return dot(b, piece.corners.map(|c| c.z));
    }
    dot(b, piece.corners.map(|c| c.z.recip())).recip()
}

/// Whether a fragment of depth `z` lies within [near, far]. Under [`Parity::Model`] pieces are clipped at the near
/// plane beforehand; comparing with near once more would drop fragments on the clipped edge by rounding.
pub fn in_range(settings: &Settings, z: f64) -> bool {
    match settings.parity {
        Parity::Model => z <= settings.far,
        Parity::Official => (settings.near..=settings.far).contains(&z),
    }
}

/// A pixel and piece as one fragment, `None` where the pair is dropped.
pub fn fragment<S: Source>(
    knobs: &Knobs<'_, S::R>,
    mesh: &Mesh,
    slots: &MeshSlots,
    source: &S,
    piece: &Piece<S::R>,
    location: &Location<S::R>,
    pixel: [f64; 2],
) -> Option<Fragment<S::R>> {
    let coverage = coverage(knobs, piece, location, pixel)?;
    let paper = knobs.mode == GradientMode::Paper;
    let b = if paper { location.sampled.map(Real::detach) } else { location.sampled };
    let z = depth(piece, b);
    let seen = in_range(knobs.settings, z.value());
    let weights = weights(knobs.settings, piece, b, z);
    let uv = blend(weights, piece.corners.map(|c| c.uv));
    let opacity = opacity(source, slots, mesh.appearance(), piece.triangle, uv);
    let (coverage, opacity) = match (knobs.settings.parity, coverage) {
        (Parity::Model, _) if !seen => return None,
        // The official forward pass counts these in the silhouette, its backward pass gives them no gradient.
        (Parity::Official, Coverage::Soft(x)) if !seen && paper => {
            (Coverage::Soft(x.detach()), opacity.map(Real::detach))
        }
        (_, coverage) => (coverage, opacity),
    };
    let drawn = seen && (piece.front || knobs.settings.faces == Faces::Both);
    let surface = drawn.then(|| surface_point(knobs.settings, mesh, slots, source, piece, weights, z));
    Some(Fragment { coverage, opacity, inside: location.inside, surface })
}

/// The weight of each corner in interpolated values.
fn weights<R: Real>(settings: &Settings, piece: &Piece<R>, b: [R; 3], z: R) -> [R; 3] {
    match settings.interpolation {
        Interpolation::Perspective if !piece.parallel => std::array::from_fn(|k| b[k] * z / piece.corners[k].z),
        _ => b,
    }
}

fn surface_point<S: Source>(
    settings: &Settings,
    mesh: &Mesh,
    slots: &MeshSlots,
    source: &S,
    piece: &Piece<S::R>,
    weights: [S::R; 3],
    z: S::R,
) -> Surface<S::R> {
    let corners = &piece.corners;
    let mut point = Surface { z, color: [S::R::zero(); 3], normal: [S::R::zero(); 3] };
    if settings.outputs.color {
        let original = blend(weights, corners.map(|c| c.original));
        let uv = blend(weights, corners.map(|c| c.uv));
        let texel =
            sample(source, slots, mesh.appearance(), piece.triangle, original, uv, settings.parity == Parity::Official);
        point.color = multiply(blend(weights, corners.map(|c| c.tint)), texel);
    }
    if settings.outputs.normal {
        point.normal = blend(weights, corners.map(|c| c.normal));
    }
    point
}
