//! Progress on stderr: on a terminal a bar for work that takes over a second, elsewhere lines.

use super::{Loudness, loudness};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::{IsTerminal, Write};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

const PATIENCE: Duration = Duration::from_secs(1);
/// How often it is looked whether there is something to show.
const TICK: Duration = Duration::from_millis(100);
/// The least and the most time between two lines where stderr is not a terminal.
const INTERVALS: [Duration; 2] = [Duration::from_secs(2), Duration::from_secs(10)];

/// A bar or a spinner that stays invisible for its first second and goes away when dropped. Where stderr is not a terminal, lines are
/// printed instead. A thread shows it, however long a part of the work takes.
#[derive(Debug)]
pub struct Progress {
    shown: Arc<Shown>,
}

#[derive(Debug)]
struct Shown {
    bar: ProgressBar,
    start: Instant,
    state: Mutex<State>,
}

#[derive(Debug)]
struct State {
    what: String,
    /// When the last line was printed, in time since the start.
    told: Duration,
    is_over: bool,
}

impl Progress {
    /// A spinner, for work whose progress is not known.
    pub fn spinner(what: &str) -> Self {
        Self::counted(what, 0)
    }

    /// A bar that counts things of any kind, or a spinner for none; a message may be shown beside it.
    pub fn counted(what: &str, count: usize) -> Self {
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::hidden());
        let state = State { what: String::new(), told: Duration::ZERO, is_over: false };
        let shown = Arc::new(Shown { bar, start: Instant::now(), state: Mutex::new(state) });
        let progress = Self { shown: shown.clone() };
        progress.begin(what, count);
        if loudness() > Loudness::Quiet {
            std::thread::spawn(move || {
                while shown.show() {
                    std::thread::sleep(TICK);
                }
            });
        }
        progress
    }

    /// Goes on with other work.
    fn begin(&self, what: &str, count: usize) {
        let template = match count {
            0 => format!("{what} {{elapsed}}"),
            _ => format!("{what} {{pos}}/{{len}} {{msg}} {{wide_bar}} {{eta}} left"),
        };
        if let Ok(style) = ProgressStyle::with_template(&template) {
            self.shown.bar.set_style(style);
        }
        self.shown.bar.set_length(count as u64);
        self.shown.bar.set_message("");
        self.shown.bar.reset();
        self.shown.state().what = what.to_string();
    }

    /// Sets what is worked on, how much of it is done, and the loss beside the bar.
    pub fn at(&self, what: &str, done: usize, count: usize, loss: Option<f64>) {
        if self.shown.state().what != what || self.shown.bar.length() != Some(count as u64) {
            self.begin(what, count);
        }
        self.shown.bar.set_position(done as u64);
        if let Some(loss) = loss {
            self.shown.bar.set_message(format!("loss {loss:.5}"));
        }
    }

    /// Advances the bar by one.
    pub fn step(&self) {
        self.shown.bar.inc(1);
    }

    /// Prints a note above the bar.
    pub fn note(&self, text: &str) {
        let _shown = self.shown.state();
        self.shown.bar.suspend(|| super::note(text));
    }
}

impl Shown {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Shows how far the work is, and returns whether it goes on.
    fn show(&self) -> bool {
        let (mut state, elapsed) = (self.state(), self.start.elapsed());
        if state.is_over {
            return false;
        }
        if !std::io::stderr().is_terminal() {
            if let Some(line) = self.line(&mut state, elapsed) {
                // With stderr closed there is nowhere to report to.
                let _ = writeln!(std::io::stderr(), "{line}");
            }
        } else if elapsed > PATIENCE {
            if self.bar.is_hidden() {
                self.bar.set_draw_target(ProgressDrawTarget::stderr());
            }
            self.bar.tick();
        }
        true
    }

    /// The line to print after some time, if the last one was printed long enough before: lines of long work are rarer.
    fn line(&self, state: &mut State, elapsed: Duration) -> Option<String> {
        let (position, count) = (self.bar.position(), self.bar.length().unwrap_or(0));
        let is_done = count > 0 && position >= count;
        if is_done || elapsed < state.told + (state.told / 2).clamp(INTERVALS[0], INTERVALS[1]) {
            return None;
        }
        state.told = elapsed;
        let message = self.bar.message();
        let message = if message.is_empty() { message } else { format!(", {message}") };
        let place = if count > 0 { format!(" {position}/{count}") } else { String::new() };
        Some(format!("progress: {}{place} after {} s{message}", state.what, elapsed.as_secs()))
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.shown.state().is_over = true;
        self.shown.bar.finish_and_clear();
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_printed_every_two_to_ten_seconds_and_none_at_the_end() {
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::hidden());
        let state = State { what: "hull".into(), told: Duration::ZERO, is_over: false };
        let progress = Progress { shown: Arc::new(Shown { bar, start: Instant::now(), state: Mutex::new(state) }) };
        let after = |seconds: f64| progress.shown.line(&mut progress.shown.state(), Duration::from_secs_f64(seconds));
        assert_eq!(after(1.9), None);
        assert_eq!(after(2.1).unwrap(), "progress: hull after 2 s");
        progress.at("step", 40, 300, None);
        assert_eq!(after(4.0), None);
        assert_eq!(after(12.5).unwrap(), "progress: step 40/300 after 12 s");
        assert_eq!(after(18.7), None);
        progress.at("step", 200, 300, Some(0.123_451));
        assert_eq!(after(60.2).unwrap(), "progress: step 200/300 after 60 s, loss 0.12345");
        assert_eq!(after(70.1), None);
        progress.at("step", 300, 300, None);
        assert_eq!(after(90.0), None);
    }
}
