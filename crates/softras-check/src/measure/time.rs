//! Times of frames and of their stages.

use super::Mode;
use crate::agreement::upstream_of;
use softras::StageTime;
use softras::{Camera, ImageGradient, Renderer, Result, Scene, Settings};
use std::time::Instant;

/// Median milliseconds of forward, of backward and of both.
#[derive(Clone, Debug, PartialEq)]
pub struct Times {
    /// `render` without [`Settings::save`], so that nothing is kept for backward.
    pub forward: f64,
    /// `backward` of a saved frame.
    pub backward: f64,
    /// `render` with [`Settings::save`] and `backward`, one after the other.
    pub frame: f64,
    /// Device time of the stages of such a forward frame; empty where the device has no timestamps.
    pub forward_stages: Vec<StageTime>,
    /// Device time of the stages of backward.
    pub backward_stages: Vec<StageTime>,
    /// Device time of the stages of a forward frame with [`Settings::save`], and of backward.
    pub frame_stages: Vec<StageTime>,
    /// The number of runs of each.
    pub repeats: usize,
}

/// Upstream weights of all values of the images, the same in every run.
pub fn upstream(mode: Mode, batch: usize, settings: &Settings) -> ImageGradient {
    let shape = [batch, settings.height as usize, settings.width as usize];
    upstream_of(mode.outputs(), shape, |_, _, i| (i * 7919 % 1000) as f32 / 1000.0 - 0.5)
}

/// Renders and differentiates `repeats` times each, after one run to warm up. `settings` are those of [`Mode::of`]. As in
/// an optimisation, the vertices of each frame differ from those of the last, by a millionth. The stages are timed in
/// separate frames, because timing them takes time.
///
/// # Errors
/// As [`Renderer::render`] and [`Renderer::backward`].
pub fn times(
    renderer: &mut Renderer,
    scene: &Scene,
    cameras: &[Camera],
    settings: &Settings,
    mode: Mode,
    repeats: usize,
) -> Result<Times> {
    let look = Settings { save: false, ..settings.clone() };
    let save = Settings { save: true, ..settings.clone() };
    let (upstream, wanted) = (upstream(mode, cameras.len(), settings), mode.wanted());
    let scenes = [scene.clone(), nudged(scene)?];
    let milliseconds = |start: Instant| start.elapsed().as_secs_f64() * 1e3;
    let repeats = repeats.max(1);
    let (mut forward, mut backward, mut frames) = (Vec::new(), Vec::new(), Vec::new());
    // The first run, which compiles kernels and creates buffers, is not counted.
    for run in 0..=repeats {
        let start = Instant::now();
        renderer.render(&scenes[run % 2], cameras, &look)?;
        forward.push(milliseconds(start));
    }
    for run in 0..=repeats {
        let start = Instant::now();
        let frame = renderer.render(&scenes[run % 2], cameras, &save)?;
        let middle = Instant::now();
        renderer.backward(&frame, &upstream, &wanted)?;
        backward.push(milliseconds(middle));
        frames.push(milliseconds(start));
    }
    let [forward, backward, frame] = [forward, backward, frames].map(|times| median(times[1..].to_vec()));
    let (mut forward_stages, mut backward_stages, mut frame_stages) = (Vec::new(), Vec::new(), Vec::new());
    renderer.time_stages(true);
    for run in 0..=repeats.div_ceil(2) {
        forward_stages.push(renderer.render(&scenes[run % 2], cameras, &look)?.timings().to_vec());
    }
    for run in 0..=repeats.div_ceil(2) {
        let frame = renderer.render(&scenes[run % 2], cameras, &save)?;
        renderer.backward(&frame, &upstream, &wanted)?;
        let stages = renderer.backward_timings().to_vec();
        frame_stages.push([frame.timings(), &stages].concat());
        backward_stages.push(stages);
    }
    renderer.time_stages(false);
    Ok(Times {
        forward,
        backward,
        frame,
        forward_stages: medians(&forward_stages[1..]),
        backward_stages: medians(&backward_stages[1..]),
        frame_stages: medians(&frame_stages[1..]),
        repeats,
    })
}

/// The scene with all positions larger by a millionth.
fn nudged(scene: &Scene) -> Result<Scene> {
    let mut scene = scene.clone();
    for mesh in &mut scene.meshes {
        mesh.set_positions(mesh.positions().iter().map(|p| p.map(|x| x * (1.0 + 1e-6))).collect())?;
    }
    Ok(scene)
}

/// The median, NaN for no values.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// The median of each stage over several runs.
fn medians(runs: &[Vec<StageTime>]) -> Vec<StageTime> {
    let stages = runs.first().map_or(&[][..], Vec::as_slice).iter().enumerate();
    let of = |i: usize| median(runs.iter().filter_map(|run| run.get(i)).map(|t| t.milliseconds).collect());
    stages.map(|(i, first)| StageTime { stage: first.stage, milliseconds: of(i) }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_are_stage_by_stage() {
        let run = |a: f64, b: f64| vec![("a", a), ("b", b)].into_iter();
        let run = |a, b| run(a, b).map(|(stage, milliseconds)| StageTime { stage, milliseconds }).collect::<Vec<_>>();
        let all = medians(&[run(1.0, 9.0), run(3.0, 7.0), run(2.0, 100.0)]);
        assert_eq!(all, run(2.0, 9.0));
        assert!(median(Vec::new()).is_nan());
    }
}
