//! Combines a pixel's fragments to its colour, silhouette, depth and normal.

use super::GradientMode;
use super::fragment::{Coverage, Fragment, Knobs};
use super::real::{Real, add, scale};
use softras::scene::{Background, ColorAggregation, Parity, SilhouetteAggregation};

/// One pixel of every image.
#[derive(Clone, Copy, Debug)]
pub struct Pixel<R> {
    /// I, RGB.
    pub color: [R; 3],
    /// A, in [0, 1].
    pub silhouette: R,
    /// Σ w z.
    pub depth: R,
    /// Σ w n.
    pub normal: [R; 3],
}

/// The softmax weights of a pixel: how much of its colour comes from each fragment and from the background.
pub struct Shares<R> {
    /// One weight per fragment, 0 for those without a surface; with the background's they sum to 1.
    pub fragments: Vec<R>,
    /// The background's weight, before any compositing.
    pub background: R,
}

impl<R: Copy> Pixel<R> {
    /// All numbers, in declaration order.
    pub fn scalars(&self) -> [R; 8] {
        let ([r, g, b], [nx, ny, nz]) = (self.color, self.normal);
        [r, g, b, self.silhouette, self.depth, nx, ny, nz]
    }
}

impl Pixel<f64> {
    /// Whether every number is 0.
    pub fn is_zero(&self) -> bool {
        self.scalars().iter().all(|&x| x == 0.0)
    }
}

/// Aggregates a pixel's fragments, given in triangle order with their [`shares`]; `triangles` is the mesh's number of
/// them.
pub fn aggregate<R: Real>(
    knobs: &Knobs<'_, R>,
    fragments: &[Fragment<R>],
    shares: &Shares<R>,
    triangles: usize,
) -> Pixel<R> {
    let settings = knobs.settings;
    let silhouette = silhouette(knobs, fragments, triangles);
    let sums = weighted_sums(fragments, &shares.fragments);
    let seen = fragments.iter().any(|f| f.surface.is_some()) && shares.background.value() < 1.0;
    let composite = settings.background == Background::Composite && seen;
    let factor = if composite { silhouette } else { R::one() };
    let background = if composite { R::one() - silhouette } else { shares.background };
    // Compositing fades only the colour of a hard image: its depth and normal stay those of the nearest surface.
    let hard = settings.color == ColorAggregation::Hard;
    let surface_factor = if hard { R::one() } else { factor };
    Pixel {
        color: add(scale(sums.color, factor), scale(knobs.background, background)),
        silhouette,
        depth: sums.depth * surface_factor,
        normal: scale(sums.normal, surface_factor),
    }
}

fn weighted_sums<R: Real>(fragments: &[Fragment<R>], weights: &[R]) -> Pixel<R> {
    let zero = R::zero();
    let start = Pixel { color: [zero; 3], silhouette: zero, depth: zero, normal: [zero; 3] };
    fragments.iter().zip(weights).fold(start, |mut sum, (fragment, &weight)| {
        if let Some(point) = &fragment.surface {
            sum.color = add(sum.color, scale(point.color, weight));
            sum.depth = sum.depth + point.z * weight;
            sum.normal = add(sum.normal, scale(point.normal, weight));
        }
        sum
    })
}

fn silhouette<R: Real>(knobs: &Knobs<'_, R>, fragments: &[Fragment<R>], triangles: usize) -> R {
    let damped = knobs.mode == GradientMode::Paper && knobs.settings.parity == Parity::Official;
    match knobs.settings.silhouette {
        SilhouetteAggregation::Product => {
            // log Π (1 - D) = -Σ softplus(x); the product is 0 where a fragment covers the pixel with certainty.
            let mut opacity = R::zero();
            for fragment in fragments.iter().filter(|f| f.opacity.is_none()) {
                match fragment.coverage {
                    Coverage::Certain => return R::one(),
                    Coverage::Soft(x) => opacity = opacity + if damped { damped_softplus(x) } else { x.softplus() },
                }
            }
            match transmittance(fragments) {
                // 1 - Π (1 - D) Π (1 - D')
                Some(faded) => (-(-opacity).exp() * faded).shift(1.0),
                None => -(-opacity).exp_m1(),
            }
        }
        SilhouetteAggregation::Sum => {
            let sum = fragments.iter().fold(R::zero(), |sum, fragment| match (fragment.coverage, fragment.opacity) {
                (Coverage::Certain, None) => sum.shift(1.0),
                (coverage, None) => sum + coverage.probability(),
                (coverage, Some(alpha)) => sum + alpha * coverage.probability(),
            });
            // The two pieces of a triangle that the near plane cuts overlap softly along their common edge, so their
            // coverages may add up to more than 1.
            let mean = sum.scale(1.0 / triangles.max(1) as f64);
            if mean.value() > 1.0 { R::one() } else { mean }
        }
        SilhouetteAggregation::Hard => {
            let mut covered = fragments.iter().filter(|f| f.is_solid()).map(|f| match f.coverage {
                Coverage::Certain => true,
                Coverage::Soft(x) => x.value() > 0.0,
            });
            if covered.any(|c| c) { R::one() } else { R::zero() }
        }
    }
}

/// Π (1 - α D) over the fragments with an opacity; `None` without any. A product, since its reverse-mode derivative by one
/// factor is the product of the others, even where factors are 0. 1 - α D = (1 - D) + (1 - α) D does not cancel.
fn transmittance<R: Real>(fragments: &[Fragment<R>]) -> Option<R> {
    let factors = fragments.iter().filter_map(|fragment| {
        let (alpha, coverage) = (fragment.opacity?, fragment.coverage);
        Some(coverage.complement() + (R::one() - alpha) * coverage.probability())
    });
    factors.reduce(|product, factor| product * factor)
}

/// softplus with the official code's derivative: D (1 - D) / max(1 - D, 1e-6) in place of D.
fn damped_softplus<R: Real>(x: R) -> R {
    let (d, rest) = (x.value().logistic(), (-x.value()).logistic());
    x.unary(x.value().softplus(), d * rest / rest.max(1e-6))
}

/// The weights of a pixel's fragments and background; under [`Background::Composite`] the background has weight only
/// where no fragment has a surface.
pub fn shares<R: Real>(knobs: &Knobs<'_, R>, fragments: &[Fragment<R>]) -> Shares<R> {
    match knobs.settings.color {
        ColorAggregation::Softmax => softmax(knobs, fragments),
        ColorAggregation::Hard => {
            let nearest = nearest(fragments);
            let one_at = |i| if nearest == Some(i) { R::one() } else { R::zero() };
            Shares {
                fragments: (0..fragments.len()).map(one_at).collect(),
                background: if nearest.is_none() { R::one() } else { R::zero() },
            }
        }
    }
}

/// The nearest fragment that covers the pixel's centre; the first of equals.
fn nearest<R: Real>(fragments: &[Fragment<R>]) -> Option<usize> {
    let covering = fragments.iter().enumerate().filter(|(_, f)| f.inside && f.is_solid());
    let depths = covering.filter_map(|(i, f)| f.surface.map(|point| (i, point.z.value())));
    depths.reduce(|best, next| if next.1 < best.1 { next } else { best }).map(|(i, _)| i)
}

/// The limit of ∂w/∂α for a fragment's weight w. Without it a fragment of α = 0 in front of all others would have the derivative
/// D exp(Δζ/γ), which overflows. For α ≥ 1/256 the limit has no effect, since w/α ≤ 1/α.
const STEEPEST: f64 = 256.0;

/// The largest exponent: e^700 is finite. Only a fragment of α = 0 can reach it, since the maximum is taken over the others.
const HIGHEST: f64 = 700.0;

/// w ∝ α D exp(ζ / γ), by scores s = log D + ζ / γ less the maximum of those with α > 0.
fn softmax<R: Real>(knobs: &Knobs<'_, R>, fragments: &[Fragment<R>]) -> Shares<R> {
    let settings = knobs.settings;
    let scores: Vec<Option<R>> = fragments.iter().map(|f| score(knobs, f)).collect();
    let background = match settings.background {
        Background::Weighted => Some(knobs.background_score / knobs.gamma),
        Background::Composite => None,
    };
    let counts = |f: &Fragment<R>| f.opacity.is_none_or(|alpha| alpha.value() > 0.0);
    let counted = scores.iter().zip(fragments).filter(|(_, f)| counts(f)).map(|(score, _)| score);
    let values = counted.chain([&background]).flatten().map(|s| s.value());
    let maximum = values.fold(f64::NEG_INFINITY, f64::max);
    if maximum == f64::NEG_INFINITY {
        return Shares { fragments: vec![R::zero(); fragments.len()], background: R::one() };
    }
    let exponential = |score: Option<R>| score.map_or(R::zero(), |s| s.shift(-maximum).clamp(-f64::MAX, HIGHEST).exp());
    let mut terms: Vec<R> = scores.into_iter().map(exponential).collect();
    let background = exponential(background);
    let alpha = |f: &Fragment<R>| f.opacity.map_or(1.0, Real::value);
    let sum = terms.iter().zip(fragments).fold(background.value(), |sum, (term, f)| sum + alpha(f) * term.value());
    for (term, fragment) in terms.iter_mut().zip(fragments) {
        if let Some(alpha) = fragment.opacity {
            let slope = (STEEPEST * sum / term.value()).min(1.0);
            *term = alpha.unary(alpha.value(), slope) * *term;
        }
    }
    let total = terms.iter().fold(background, |sum, &term| sum + term);
    Shares { fragments: terms.into_iter().map(|term| term / total).collect(), background: background / total }
}

/// log D + ζ / γ, the logarithm of a fragment's weight without its opacity; `None` for one that no shaded image shows.
pub fn score<R: Real>(knobs: &Knobs<'_, R>, fragment: &Fragment<R>) -> Option<R> {
    let point = fragment.surface.as_ref()?;
    let (near, far) = (knobs.settings.near, knobs.settings.far);
    let zeta = (-point.z).shift(far).scale(1.0 / (far - near));
    let nearness = zeta / knobs.gamma;
    Some(match fragment.coverage {
        Coverage::Certain => nearness,
        Coverage::Soft(x) => nearness - (-x).softplus(),
    })
}
