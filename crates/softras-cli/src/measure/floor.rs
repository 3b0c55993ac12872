//! The least that a frame can cost: pairs needed × least operations a pair ÷ the device's measured peak.
//!
//! Pairs needed are those that the model keeps (`softras::internals::reference::pairs`): inside their triangle, or with D ≥ τ. Operations are
//! counted on the model's formulas in the cheapest form known for a record that is prepared once a triangle (edges as
//! unit normal, offset and tangent; inverse heights; reciprocal depths): an addition, multiplication, comparison with
//! select, minimum or maximum is one, and so are a division and an exponential, although no device does those at that
//! rate. Nothing is counted for finding the pairs, loading records, loops, or writing images. So no implementation of the
//! model by pairs reaches this floor, and one at three times it is a good one.

use super::Mode;

/// Offset from the triangle's origin 2; for each of three edges height and place along it 2 × 4, distance beyond its ends
/// 2, square sum 3; nearest edge 2, inside 3, within the radius 1.
const DISTANCE: f64 = 2.0 + 3.0 * (8.0 + 2.0 + 3.0) + 2.0 + 3.0 + 1.0;
/// Exponential 1, sigmoid 2, the side's choice 2.
const PROBABILITY: f64 = 5.0;
/// One factor of Π (1 - D).
const PRODUCT: f64 = 1.0;
/// Barycentrics 3, clamped 6, their sum 2; depth: excess 3, sum 1, division 1, log weight 2.
const PLACE: f64 = 11.0 + 7.0;
/// Difference to the running maximum 2, exponential 2, choices 3, weight 2, sum 2, maximum 2; share of each corner 5.
const SOFTMAX: f64 = 13.0 + 5.0;
/// Three channels of three corners, and the running sums' rescaling.
const THREE_CHANNELS: f64 = 15.0 + 6.0;
/// Depth times weight, and the running sum's rescaling.
const ONE_CHANNEL: f64 = 4.0;
/// Heights over three edges 12, inside 3, nearest so far 2.
const COVERED: f64 = 2.0 + 12.0 + 3.0 + 2.0;

/// ∂A/∂x 1, dL/dx added up 1.
const PRODUCT_GRADIENT: f64 = 2.0;
/// dL/dd² 1; offset from the nearest point 4; the two ends' shares 3, their products 4, sums 4; the edge's choice 3.
const DISTANCE_GRADIENT: f64 = 19.0;
/// Weight relative to the pixel's sum.
const RELATIVE_WEIGHT: f64 = 4.0;
/// The same 4; dL/dx = w (1 - D) (g·C - v) 4; dL/dζ 2.
const SOFTMAX_GRADIENT: f64 = 10.0;
/// g·C by corners 3 × 5, their mixture 5, less the pixel's value 1.
const THREE_CHANNELS_VALUE: f64 = 21.0;
/// w b̂ 3, times g into nine sums 18.
const CORNER_GRADIENT: f64 = 21.0;
/// Depth's share in the value.
const ONE_CHANNEL_VALUE: f64 = 3.0;
/// dL/db̂ by depth 6, through the clamp and the sum 11, by three corners' pixels and depths 3 × 9.
const PLACE_GRADIENT: f64 = 6.0 + 11.0 + 27.0;

/// Least operations of a pair in a forward frame.
pub fn forward_operations(mode: Mode) -> f64 {
    let pair = DISTANCE + PROBABILITY;
    match mode {
        Mode::Silhouette => pair + PRODUCT,
        Mode::Color | Mode::Normal => pair + PLACE + SOFTMAX + THREE_CHANNELS,
        Mode::ColorSilhouette | Mode::ToColors | Mode::ToCamera => pair + PRODUCT + PLACE + SOFTMAX + THREE_CHANNELS,
        Mode::Depth => pair + PLACE + SOFTMAX + ONE_CHANNEL,
        Mode::Hard => COVERED + PLACE,
    }
}

/// Least operations of a pair in the gradient by what the mode is differentiated by ([`Mode::wanted`]).
pub fn backward_operations(mode: Mode) -> f64 {
    let pair = DISTANCE + PROBABILITY;
    let soft = pair + DISTANCE_GRADIENT + PLACE + SOFTMAX_GRADIENT + PLACE_GRADIENT;
    match mode {
        Mode::Silhouette => pair + PRODUCT_GRADIENT + DISTANCE_GRADIENT,
        Mode::Color => soft + THREE_CHANNELS_VALUE + CORNER_GRADIENT,
        Mode::ColorSilhouette => soft + PRODUCT_GRADIENT + THREE_CHANNELS_VALUE + CORNER_GRADIENT,
        Mode::Normal => soft + THREE_CHANNELS_VALUE + CORNER_GRADIENT,
        Mode::ToColors => pair + PLACE + RELATIVE_WEIGHT + CORNER_GRADIENT,
        Mode::ToCamera => soft + PRODUCT_GRADIENT + THREE_CHANNELS_VALUE,
        Mode::Depth => soft + ONE_CHANNEL_VALUE,
        // Only the nearest triangle of a pixel has a gradient, by its colours and through its barycentrics.
        Mode::Hard => COVERED + PLACE + CORNER_GRADIENT + PLACE_GRADIENT,
    }
}
