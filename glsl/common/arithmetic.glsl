// Fast forms of arithmetic that every kernel may use. Needs nothing.

// Minimum and maximum without the rules for NaN. On a software device each takes one instruction, where min and max take three.
float lesser(float a, float b) {
    return a < b ? a : b;
}

float greater(float a, float b) {
    return a > b ? a : b;
}

// x clamped to ±limit.
float between(float x, float limit) {
    return lesser(greater(x, -limit), limit);
}

// number / divisor, for natural numbers whose quotient is less than 2^20: then the quotient of the floats is wrong by at most
// one. A software device divides integers lane by lane, which took a tenth of the time of pixel_grad.comp.
int quotient(int number, int divisor) {
    int q = int(float(number) / float(divisor));
    int rest = number - q * divisor;
    return q + (rest < 0 ? -1 : rest >= divisor ? 1 : 0);
}
