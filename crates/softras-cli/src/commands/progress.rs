//! Progress on stderr: on a terminal a bar for work that takes over a second, elsewhere a line every ten seconds.

use super::{Loudness, loudness};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::{IsTerminal, Write};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

const PATIENCE: Duration = Duration::from_secs(1);
/// The time between two lines where stderr is not a terminal, and before the first of them.
const INTERVAL: Duration = Duration::from_secs(10);
/// What such lines begin with.
pub const LINE: &str = "progress: ";

/// A bar or a spinner that stays invisible for its first second and goes away when dropped. Where stderr is not a terminal, a
/// bar prints lines instead.
#[derive(Debug)]
pub struct Progress {
    bar: ProgressBar,
    start: Instant,
    what: String,
    /// When the last line was printed, in time since the start.
    told: Mutex<Duration>,
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
        Self::of(bar, what)
    }

    /// A bar that counts things of any kind; a message may be shown beside it.
    pub fn counted(what: &str, count: usize) -> Self {
        let bar = ProgressBar::with_draw_target(Some(count as u64), ProgressDrawTarget::hidden());
        let template = format!("{what} {{pos}}/{{len}} {{msg}} {{wide_bar}} {{eta}} left");
        if let Ok(style) = ProgressStyle::with_template(&template) {
            bar.set_style(style);
        }
        Self::of(bar, what)
    }

    fn of(bar: ProgressBar, what: &str) -> Self {
        Self { bar, start: Instant::now(), what: what.to_string(), told: Mutex::default() }
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
        self.bar.inc(1);
        if loudness() == Loudness::Quiet {
            return;
        }
        let elapsed = self.start.elapsed();
        if !std::io::stderr().is_terminal() {
            if let Some(line) = self.line(elapsed) {
                // With stderr closed there is nowhere to report to.
                let _ = writeln!(std::io::stderr(), "{line}");
            }
        } else if self.bar.is_hidden() && elapsed > PATIENCE {
            self.bar.set_draw_target(ProgressDrawTarget::stderr());
        }
    }

    /// The line to print after some time, if the last one was printed long enough before.
    fn line(&self, elapsed: Duration) -> Option<String> {
        let mut told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        let (position, count) = (self.bar.position(), self.bar.length().unwrap_or(0));
        if elapsed < *told + INTERVAL || position >= count {
            return None;
        }
        *told = elapsed;
        let message = self.bar.message();
        let message = if message.is_empty() { message } else { format!(", {message}") };
        Some(format!("{LINE}{} {position}/{count} after {} s{message}", self.what, elapsed.as_secs()))
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_printed_every_ten_seconds_and_none_at_the_end() {
        let progress = Progress::counted("step", 300);
        progress.done(40);
        let after = |seconds: f64| progress.line(Duration::from_secs_f64(seconds));
        assert_eq!(after(9.9), None);
        assert_eq!(after(12.5).unwrap(), "progress: step 40/300 after 12 s");
        assert_eq!(after(22.4), None);
        progress.tell("loss 0.12345".into());
        progress.done(200);
        assert_eq!(after(22.6).unwrap(), "progress: step 200/300 after 22 s, loss 0.12345");
        progress.done(300);
        assert_eq!(after(60.0), None);
    }
}
