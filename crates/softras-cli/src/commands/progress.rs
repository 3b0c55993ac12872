//! Progress bars on stderr for work that takes over a second.

use super::{Loudness, loudness};
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
    /// A spinner, for work whose progress is not known.
    pub fn spinner(what: &str) -> Self {
        let bar = ProgressBar::new_spinner().with_message(what.to_string());
        if loudness() == Loudness::Quiet {
            bar.set_draw_target(ProgressDrawTarget::hidden());
        }
        if let Ok(style) = ProgressStyle::with_template("{msg} {elapsed}") {
            bar.set_style(style);
        }
        // The first tick comes after one period.
        bar.enable_steady_tick(PATIENCE);
        Self { bar, start: Instant::now() }
    }

    /// A bar that counts frames.
    pub fn frames(count: usize) -> Self {
        Self::counted("frame", count)
    }

    /// A bar that counts things of any kind; a message may be shown beside it.
    pub fn counted(what: &str, count: usize) -> Self {
        let bar = ProgressBar::with_draw_target(Some(count as u64), ProgressDrawTarget::hidden());
        let template = format!("{what} {{pos}}/{{len}} {{msg}} {{wide_bar}} {{eta}} left");
        if let Ok(style) = ProgressStyle::with_template(&template) {
            bar.set_style(style);
        }
        Self { bar, start: Instant::now() }
    }

    /// Sets what has been done before.
    pub fn done(&self, count: usize) {
        self.bar.set_position(count as u64);
    }

    /// Sets the message beside the bar.
    pub fn tell(&self, message: String) {
        self.bar.set_message(message);
    }

    /// Advances the bar by one.
    pub fn step(&self) {
        if loudness() > Loudness::Quiet && self.bar.is_hidden() && self.start.elapsed() > PATIENCE {
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
