// The image losses of `fit::image_loss`, each value beside its derivative. Needs constants.glsl.

// Images have colours (four channels); otherwise they are silhouettes of one channel.
layout(constant_id = 0) const bool FIT_COLOR = false;
// LOSS_ kinds.
layout(constant_id = 1) const uint SILHOUETTE_LOSS = 0;
layout(constant_id = 2) const uint COLOR_LOSS = 0;
// There is a weight for each pixel.
layout(constant_id = 3) const bool FIT_MASKED = false;

// A texel as (red, green, blue, silhouette).
vec4 channels(vec4 texel) {
    return FIT_COLOR ? texel : vec4(0.0, 0.0, 0.0, texel.x);
}

// The terms that one predicted value p with target t adds to the sums of its view: (difference, 0), or for the IoU
// (intersection, union).
precise vec2 terms(uint kind, float p, float t, float weight, float delta) {
    precise float first = 0.0;
    precise float second = 0.0;
    precise float d = p - t;
    precise float size = abs(d);
    if (kind == LOSS_IOU) {
        precise float both = p * t;
        first = weight * both;
        second = weight * (p + t - both);
    } else if (kind == LOSS_L1) {
        first = weight * size;
    } else if (kind == LOSS_L2) {
        first = weight * (d * d);
    } else if (kind == LOSS_HUBER) {
        first = weight * (size <= delta ? 0.5 * d * d : delta * (size - 0.5 * delta));
    }
    return vec2(first, second);
}

// The derivative of the view's loss by p, times the weight and the scale; `sums` are the view's sums of `terms`.
precise float slope(uint kind, float p, float t, vec2 sums, float scaled_weight, float delta) {
    precise float result = 0.0;
    precise float d = p - t;
    if (kind == LOSS_IOU) {
        // d(both / either) = (t - q (1 - t)) / either with q = both / either.
        precise float either = sums.y + LOSS_IOU_EPSILON;
        precise float quotient = sums.x / either;
        result = (quotient - t * (1.0 + quotient)) * (scaled_weight / either);
    } else if (kind == LOSS_L1) {
        result = d > 0.0 ? scaled_weight : d < 0.0 ? -scaled_weight : 0.0;
    } else if (kind == LOSS_L2) {
        result = 2.0 * d * scaled_weight;
    } else if (kind == LOSS_HUBER) {
        precise float bounded = min(max(d, -delta), delta);
        result = bounded * scaled_weight;
    }
    return result;
}
