// The official demo's parametrisation (`fit::shape::Parametrization::Logit`): with s = 1 / (1 + odds exp(-d)) and the
// template's sign, a coordinate is sign s (1 - sign t) + t.

struct Logit {
    float position;
    float by_displacement;
    float by_shift;
};

// t = tanh(c) of the centre.
vec3 centre_shift(vec3 centre) {
    return vec3(tangent(centre.x), tangent(centre.y), tangent(centre.z));
}

// `odds` are (1 - |v|) / |v| of the template's coordinate v with its sign; 0 where v is 0, which no displacement moves.
Logit logit_of(float odds, float displacement, float shift) {
    precise float side = odds > 0.0 ? 1.0 : odds < 0.0 ? -1.0 : 0.0;
    precise float share = 1.0 / (1.0 + abs(odds) * exponential(-displacement));
    precise float size = side == 0.0 ? 0.0 : share;
    precise float stretch = 1.0 - side * shift;
    precise float position = side * size * stretch + shift;
    precise float by_displacement = side * stretch * size * (1.0 - size);
    precise float by_shift = 1.0 - size;
    return Logit(position, by_displacement, by_shift);
}
