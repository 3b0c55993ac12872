// Constants that the kernels and the library share; build.rs makes Rust constants of them.

// Invocations in a workgroup of the self test.
const uint SELFTEST_LOCAL_SIZE = 64u;

// What the self test adds where nothing else is asked for.
const float SELFTEST_OFFSET = 0.5;
