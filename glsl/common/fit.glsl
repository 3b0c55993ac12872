// Arithmetic of the fitting kernels. `src/fit/device/arithmetic.rs` repeats it in Rust, operation by operation, with equal
// bits: every result is `precise`, so that no compiler fuses or reorders, and what Vulkan leaves to the driver (dot, length,
// exp) is written out. Needs nothing.

precise float dot3(vec3 a, vec3 b) {
    precise float sum = a.x * b.x;
    sum = sum + a.y * b.y;
    sum = sum + a.z * b.z;
    return sum;
}

precise vec3 cross3(vec3 a, vec3 b) {
    precise vec3 product;
    product.x = a.y * b.z - a.z * b.y;
    product.y = a.z * b.x - a.x * b.z;
    product.z = a.x * b.y - a.y * b.x;
    return product;
}

precise float length3(vec3 a) {
    precise float square = dot3(a, a);
    precise float root = sqrt(square);
    return root;
}

// exp(x) for x clamped to ±80, with a relative error of some 1e-7: 2^n times a polynomial (Cephes, expf).
precise float exponential(float x) {
    precise float bounded = min(max(x, -80.0), 80.0);
    precise float whole = floor(bounded * 1.44269504 + 0.5);
    precise float rest = bounded - whole * 0.693359375;
    rest = rest + whole * 2.12194440e-4;
    precise float sum = 1.9875691500e-4;
    sum = sum * rest + 1.3981999507e-3;
    sum = sum * rest + 8.3334519073e-3;
    sum = sum * rest + 4.1665795894e-2;
    sum = sum * rest + 1.6666665459e-1;
    sum = sum * rest + 5.0000001201e-1;
    sum = sum * (rest * rest);
    sum = sum + rest;
    sum = sum + 1.0;
    precise float scaled = sum * uintBitsToFloat(uint(int(whole) + 127) << 23);
    return scaled;
}

// The hyperbolic tangent.
precise float tangent(float x) {
    precise float e = exponential(2.0 * x);
    precise float t = (e - 1.0) / (e + 1.0);
    return t;
}

// 0 for subnormal numbers, which some devices keep and others flush.
float flushed(float x) {
    return abs(x) < 1.2e-38 ? 0.0 : x;
}
