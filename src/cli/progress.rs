//! Progress on stderr, for work that takes over a second.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::time::{Duration, Instant};

const PATIENCE: Duration = Duration::from_secs(1);

/// A bar or a spinner that stays invisible for its first second and goes away when dropped.
#[derive(Debug)]
pub struct Progress {
    bar: ProgressBar,
    start: Instant,
}

impl Progress {
    /// For work of which only the beginning and the end are seen.
    pub fn spinner(what: &str) -> Self {
        let bar = ProgressBar::new_spinner().with_message(what.to_string());
        if let Ok(style) = ProgressStyle::with_template("{msg} {elapsed}") {
            bar.set_style(style);
        }
        // The first tick comes after one period.
        bar.enable_steady_tick(PATIENCE);
        Self { bar, start: Instant::now() }
    }

    /// For a number of frames.
    pub fn frames(count: usize) -> Self {
        Self::counted("frame", count as u64)
    }

    /// For a number of something.
    pub fn counted(what: &str, count: u64) -> Self {
        let bar = ProgressBar::with_draw_target(Some(count), ProgressDrawTarget::hidden());
        if let Ok(style) = ProgressStyle::with_template(&format!("{what} {{pos}}/{{len}} {{wide_bar}} {{eta}} left")) {
            bar.set_style(style);
        }
        Self { bar, start: Instant::now() }
    }

    /// One of them is done.
    pub fn step(&self) {
        if self.bar.is_hidden() && self.start.elapsed() > PATIENCE {
            self.bar.set_draw_target(ProgressDrawTarget::stderr());
        }
        self.bar.inc(1);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
