// What an optimiser remembers of gradients (`fit::optimizer`), and Adam's step.

struct Decay {
    float first;
    float first_share;
    float second;
    float second_share;
};

precise vec3 next_first(vec3 first, vec3 gradient, Decay decay) {
    precise vec3 mean = decay.first * first + decay.first_share * gradient;
    return vec3(flushed(mean.x), flushed(mean.y), flushed(mean.z));
}

precise vec3 next_second(vec3 second, vec3 gradient, Decay decay) {
    precise vec3 root_free = decay.second_share * gradient;
    precise vec3 square = root_free * gradient;
    precise vec3 kept = decay.second * second;
    precise vec3 mean = vec3(flushed(kept.x), flushed(kept.y), flushed(kept.z));
    mean = mean + vec3(flushed(square.x), flushed(square.y), flushed(square.z));
    return mean;
}

precise vec3 adam_step(vec3 first, vec3 second, float rate, float first_bias, float second_bias, float epsilon) {
    precise vec3 mean = first / first_bias;
    precise vec3 root = sqrt(second / second_bias) + epsilon;
    precise vec3 change = rate * mean;
    change = change / root;
    return change;
}
