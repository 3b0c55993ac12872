// Division of natural numbers. Needs nothing.

// The quotient of natural numbers if it is less than 2^20, so that the division of floats errs by at most one. A software
// device divides integers lane by lane, which took a tenth of pixel_grad.comp.
int quotient(int number, int divisor) {
    int q = int(float(number) / float(divisor));
    int rest = number - q * divisor;
    return q + (rest < 0 ? -1 : rest >= divisor ? 1 : 0);
}
