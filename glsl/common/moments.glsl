// The moments of gradients that an optimizer keeps (`fit::optimizer`), and Adam's step. Needs fit.glsl.

// Factors of the first and second moment: of the old value and of the new gradient.
struct Decay {
    float first;
    float first_share;
    float second;
    float second_share;
};

// m ← β₁ m + (1 - β₁) g, or with momentum m ← β m + g.
precise vec3 next_first(vec3 first, vec3 gradient, Decay decay) {
    precise vec3 mean = decay.first * first + decay.first_share * gradient;
    return vec3(flushed(mean.x), flushed(mean.y), flushed(mean.z));
}

// v ← β₂ v + (1 - β₂) g².
precise vec3 next_second(vec3 second, vec3 gradient, Decay decay) {
    precise vec3 scaled = decay.second_share * gradient;
    precise vec3 square = scaled * gradient;
    precise vec3 kept = decay.second * second;
    precise vec3 mean = vec3(flushed(kept.x), flushed(kept.y), flushed(kept.z));
    mean = mean + vec3(flushed(square.x), flushed(square.y), flushed(square.z));
    return mean;
}

// The change rate · m̂ / (√v̂ + ε), which is subtracted (Kingma and Ba 2015, algorithm 1).
precise vec3 adam_step(vec3 first, vec3 second, float rate, float first_bias, float second_bias, float epsilon) {
    precise vec3 mean = first / first_bias;
    precise vec3 root = sqrt(second / second_bias) + epsilon;
    precise vec3 change = rate * mean;
    change = change / root;
    return change;
}
