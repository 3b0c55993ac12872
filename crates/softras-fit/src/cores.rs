//! Work on all cores, also in a process that was forked.

/// Does work whose parts rayon spreads over all cores, on threads that end with it.
///
/// Those of rayon's own pool do not survive a fork: where they were used before it, the new process waits for them for ever.
pub fn on_all_cores<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    match rayon::ThreadPoolBuilder::new().build() {
        Ok(pool) => pool.install(work),
        // No new threads can be had.
        Err(_) => work(),
    }
}
