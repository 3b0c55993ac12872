// The official demo's parametrisation of vertices (`fit::shape::Parametrization::Logit`): with s = 1 / (1 + odds exp(-d)), d
// the displacement, and the sign of the template's coordinate, a coordinate is sign s (1 - sign t) + t. Needs fit.glsl.

struct Logit {
    float position;
    // Derivatives of the position by d and by t.
    float by_displacement;
    float by_shift;
};

// t = tanh(centre).
vec3 centre_shift(vec3 centre) {
    return vec3(tangent(centre.x), tangent(centre.y), tangent(centre.z));
}

// `odds` is (1 - |v|) / |v| with the sign of the template's coordinate v. It is 0 where v is 0: no displacement moves such a
// coordinate.
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
