//! The use of Rust's heap by some work, counted for its own thread.

/// How often work allocates.
pub fn allocations(work: impl FnOnce()) -> u64 {
    allocation_counter::measure(work).count_total
}
