//! What work takes of Rust's heap, counted for its own thread.

/// What comes of work, and the most bytes that it had at a time.
pub fn peak_of<T>(work: impl FnOnce() -> T) -> (T, usize) {
    let mut outcome = None;
    let info = allocation_counter::measure(|| outcome = Some(work()));
    (outcome.expect("the work is done"), info.bytes_max as usize)
}

/// How often work allocates.
pub fn allocations(work: impl FnOnce()) -> u64 {
    allocation_counter::measure(work).count_total
}
