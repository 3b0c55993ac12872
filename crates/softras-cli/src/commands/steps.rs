//! The loop over the steps of an optimisation, with its bar, its pauses and Ctrl-C.

use super::Failure;
use super::progress::Progress;
use softras::Renderer;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

/// What is done step by step.
pub trait Steps {
    /// Takes the step of that number, and returns the text that the bar shows after it.
    fn step(&mut self, at: usize, renderer: &mut Renderer) -> Result<String, Failure>;

    /// Whether [`Steps::pause`] has work to do before the step of that number.
    fn pauses(&self, _at: usize) -> bool {
        false
    }

    /// Does what is done between two steps, such as writing a checkpoint.
    fn pause(&mut self, _at: usize, _renderer: &mut Renderer) -> Result<(), Failure> {
        Ok(())
    }
}

/// Which steps are taken, and how the user sees and ends them.
pub struct Loop {
    steps: Range<usize>,
    bar: Option<&'static str>,
    stop: Option<&'static AtomicBool>,
}

impl Loop {
    /// The steps of these numbers, without a bar. Ctrl-C ends the process.
    pub fn over(steps: Range<usize>) -> Self {
        Self { steps, bar: None, stop: None }
    }

    /// The same with a bar that counts under this name.
    pub fn with_bar(self, what: &'static str) -> Self {
        Self { bar: Some(what), ..self }
    }

    /// The same, ended by Ctrl-C before the next step.
    pub fn until_interrupted(self) -> Result<Self, Failure> {
        Ok(Self { stop: Some(super::interrupted()?), ..self })
    }

    /// Takes the steps. Returns the number of the step that would be next, which is below the end of the
    /// range where Ctrl-C has ended the loop.
    pub fn run<S: Steps>(&self, work: &mut S, renderer: &mut Renderer) -> Result<usize, Failure> {
        let progress = self.bar.map(|what| Progress::counted(what, self.steps.end));
        if let Some(progress) = &progress {
            progress.done(self.steps.start);
        }
        let mut at = self.steps.start;
        while at < self.steps.end && !self.stop.is_some_and(|stop| stop.load(Ordering::Relaxed)) {
            if work.pauses(at) {
                work.pause(at, renderer)?;
            }
            let text = work.step(at, renderer)?;
            at += 1;
            if let Some(progress) = &progress {
                progress.tell(text);
                progress.step();
            }
        }
        Ok(at)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    static STOP: AtomicBool = AtomicBool::new(false);

    /// Notes what the loop calls, pauses before steps 4 and 7, and sets the flag in step 9.
    #[derive(Default)]
    struct Noted(Vec<(&'static str, usize)>);

    impl Steps for Noted {
        fn step(&mut self, at: usize, _renderer: &mut Renderer) -> Result<String, Failure> {
            STOP.store(at == 9, Ordering::Relaxed);
            self.0.push(("step", at));
            Ok(String::new())
        }

        fn pauses(&self, at: usize) -> bool {
            [4, 7].contains(&at)
        }

        fn pause(&mut self, at: usize, _renderer: &mut Renderer) -> Result<(), Failure> {
            self.0.push(("pause", at));
            Ok(())
        }
    }

    #[test]
    fn pauses_lie_before_their_steps() {
        let (mut renderer, mut work) = (Renderer::new().unwrap(), Noted::default());
        assert_eq!(Loop::over(2..5).run(&mut work, &mut renderer).unwrap(), 5);
        let calls = "step 2, step 3, pause 4, step 4";
        let called: Vec<String> = work.0.iter().map(|(what, at)| format!("{what} {at}")).collect();
        assert_eq!(called.join(", "), calls);
    }

    #[test]
    fn the_flag_ends_the_loop_before_the_next_step() {
        let (mut renderer, mut work) = (Renderer::new().unwrap(), Noted::default());
        let steps = Loop { stop: Some(&STOP), ..Loop::over(8..20) };
        assert_eq!(steps.run(&mut work, &mut renderer).unwrap(), 10);
        assert_eq!(work.0[work.0.len() - 2..], [("step", 8), ("step", 9)]);
    }
}
