// Double floats: a number as the sum of two floats (high, low), with some 48 bits of mantissa (Dekker 1971; Knuth, TAOCP
// 4.2.2).
// They keep the positions of small and distant triangles exact relative to each other. Every function needs `precise`, which
// forbids contraction and reassociation. None uses fma, which some drivers round twice. Needs nothing.

vec2 quick_two_sum(float a, float b) {
    precise float s = a + b;
    precise float d = s - a;
    precise float e = b - d;
    return vec2(s, e);
}

vec2 two_sum(float a, float b) {
    precise float s = a + b;
    precise float v = s - a;
    precise float w = s - v;
    precise float x = a - w;
    precise float y = b - v;
    precise float e = x + y;
    return vec2(s, e);
}

vec2 split(float a) {
    precise float t = 4097.0 * a;
    precise float u = t - a;
    precise float high = t - u;
    precise float low = a - high;
    return vec2(high, low);
}

vec2 two_product(float a, float b) {
    precise float p = a * b;
    vec2 s = split(a);
    vec2 t = split(b);
    precise float e = s.x * t.x - p;
    e = e + s.x * t.y;
    e = e + s.y * t.x;
    e = e + s.y * t.y;
    return vec2(p, e);
}

vec2 df_add(vec2 a, vec2 b) {
    vec2 s = two_sum(a.x, b.x);
    precise float l = a.y + b.y;
    precise float e = s.y + l;
    return quick_two_sum(s.x, e);
}

vec2 df_sub(vec2 a, vec2 b) {
    return df_add(a, -b);
}

vec2 df_mul(vec2 a, float b) {
    vec2 p = two_product(a.x, b);
    precise float l = a.y * b;
    precise float e = p.y + l;
    return quick_two_sum(p.x, e);
}

vec2 df_mul(vec2 a, vec2 b) {
    vec2 p = two_product(a.x, b.x);
    precise float l = a.x * b.y + a.y * b.x;
    precise float e = p.y + l;
    return quick_two_sum(p.x, e);
}

vec2 df_div(vec2 a, vec2 b) {
    precise float q1 = a.x / b.x;
    vec2 r = df_sub(a, df_mul(b, q1));
    precise float q2 = r.x / b.x;
    r = df_sub(r, df_mul(b, q2));
    precise float q3 = r.x / b.x;
    precise float l = q2 + q3;
    return quick_two_sum(q1, l);
}
