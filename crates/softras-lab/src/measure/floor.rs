//! The least time that a frame can take: pairs needed × least operations a pair ÷ the device's measured peak rate.
//!
//! Pairs needed are the (pixel, triangle) pairs that the model keeps (`softras_reference::pairs`): the pixel lies
//! inside the triangle, or D ≥ τ. Operations are counted on the model's formulas in the cheapest known form, with a record
//! that is prepared once per triangle (edges as unit normal, offset and tangent; inverse heights; reciprocal depths). An
//! addition, a multiplication, a comparison with select, a minimum and a maximum count as one operation each, and so do a
//! division and an exponential, although no device reaches its peak rate with those. Finding the pairs, loading records,
//! loops and writing images count as nothing. So no implementation of the model by pairs reaches this floor, and one that
//! takes three times as long is a good one.

use super::Mode;

/// Offset from the triangle's origin 2; for each of three edges the signed distance and the position along it 2 × 4, the
/// distance beyond its ends 2, the sum of squares 3; nearest edge 2, inside test 3, radius test 1.
const DISTANCE: f64 = 2.0 + 3.0 * (8.0 + 2.0 + 3.0) + 2.0 + 3.0 + 1.0;
/// Exponential 1, sigmoid 2, selection of the side 2.
const PROBABILITY: f64 = 5.0;
/// One factor of Π (1 - D).
const PRODUCT: f64 = 1.0;
/// Barycentrics 3, clamping 6, their sum 2; depth: products 3, sum 1, division 1, log weight 2.
const BARYCENTRICS: f64 = 11.0 + 7.0;
/// Difference to the running maximum 2, exponential 2, selections 3, weight 2, sum 2, maximum 2; share of each corner 5.
const SOFTMAX: f64 = 13.0 + 5.0;
/// Three channels of three corners, and the running sums' rescaling.
const THREE_CHANNELS: f64 = 15.0 + 6.0;
/// Depth times weight, and the running sum's rescaling.
const ONE_CHANNEL: f64 = 4.0;
/// Signed distances to three edges 12, inside test 3, nearest so far 2.
const COVERED: f64 = 2.0 + 12.0 + 3.0 + 2.0;

/// ∂A/∂x 1, adding it to dL/dx 1.
const PRODUCT_GRADIENT: f64 = 2.0;
/// dL/dd² 1; offset from the nearest point 4; the shares of the two ends 3, their products 4, sums 4; selection of the
/// edge 3.
const DISTANCE_GRADIENT: f64 = 19.0;
/// The weight relative to the pixel's sum.
const RELATIVE_WEIGHT: f64 = 4.0;
/// [`RELATIVE_WEIGHT`] 4; dL/dx = w (1 - D) (g·C - v) 4; dL/dζ 2.
const SOFTMAX_GRADIENT: f64 = 10.0;
/// g·C at the corners 3 × 5, their interpolation 5, minus the pixel's value 1.
const THREE_CHANNELS_VALUE: f64 = 21.0;
/// w b̂ 3, times g added to nine sums 18.
const CORNER_GRADIENT: f64 = 21.0;
/// The share of depth in the value.
const ONE_CHANNEL_VALUE: f64 = 3.0;
/// dL/db̂ by depth 6, through the clamp and the sum 11, by three corners' pixels and depths 3 × 9.
const BARYCENTRICS_GRADIENT: f64 = 6.0 + 11.0 + 27.0;

/// The least operations of a pair in a forward frame.
pub fn forward_operations(mode: Mode) -> f64 {
    let pair = DISTANCE + PROBABILITY;
    match mode {
        Mode::Silhouette => pair + PRODUCT,
        Mode::Color | Mode::Normal => pair + BARYCENTRICS + SOFTMAX + THREE_CHANNELS,
        Mode::ColorSilhouette | Mode::ToColors | Mode::ToCamera => {
            pair + PRODUCT + BARYCENTRICS + SOFTMAX + THREE_CHANNELS
        }
        Mode::Depth => pair + BARYCENTRICS + SOFTMAX + ONE_CHANNEL,
        Mode::Hard => COVERED + BARYCENTRICS,
    }
}

/// The least operations of a pair in the gradient by the inputs of the mode ([`Mode::wanted`]).
pub fn backward_operations(mode: Mode) -> f64 {
    let pair = DISTANCE + PROBABILITY;
    let soft = pair + DISTANCE_GRADIENT + BARYCENTRICS + SOFTMAX_GRADIENT + BARYCENTRICS_GRADIENT;
    match mode {
        Mode::Silhouette => pair + PRODUCT_GRADIENT + DISTANCE_GRADIENT,
        Mode::Color => soft + THREE_CHANNELS_VALUE + CORNER_GRADIENT,
        Mode::ColorSilhouette => soft + PRODUCT_GRADIENT + THREE_CHANNELS_VALUE + CORNER_GRADIENT,
        Mode::Normal => soft + THREE_CHANNELS_VALUE + CORNER_GRADIENT,
        Mode::ToColors => pair + BARYCENTRICS + RELATIVE_WEIGHT + CORNER_GRADIENT,
        Mode::ToCamera => soft + PRODUCT_GRADIENT + THREE_CHANNELS_VALUE,
        Mode::Depth => soft + ONE_CHANNEL_VALUE,
        // Only the nearest triangle of a pixel has a gradient: by its colours, and by its positions through barycentrics.
        Mode::Hard => COVERED + BARYCENTRICS + CORNER_GRADIENT + BARYCENTRICS_GRADIENT,
    }
}
