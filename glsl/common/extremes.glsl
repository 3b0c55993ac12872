// Minimum and maximum without the rules for NaN: one instruction each, where min and max take three on a software device.
float lesser(float a, float b) {
    return a < b ? a : b;
}

float greater(float a, float b) {
    return a > b ? a : b;
}
