//! Saved frames that live at the same time: each keeps what its gradient needs, and what dropped ones had is used again.

use super::repeat::{EYES, ball};
use crate::common::{
    gradient::{same_gradient_bits, upstream_of},
    renderer, renderer_with,
    scenes::Case,
};
use softras::{Error, Frame, GradientRequest, Gradients, ImageGradient, Renderer, RendererOptions, Scene, shapes};

/// Frames of other meshes, sizes, numbers of cameras and modes, the first two of the same plan.
fn cases() -> Vec<Case> {
    let mut cases = vec![
        ball(0, &EYES[..1], 16),
        ball(0, &EYES[1..2], 16),
        ball(1, &EYES, 24),
        ball(5, &EYES[..2], 16),
        ball(10, &EYES[..1], 40),
    ];
    cases[3].settings.sigma = 1e-2;
    cases
}

fn render(renderer: &mut Renderer, case: &Case) -> Frame {
    renderer.render_saved(&case.scene, &case.cameras, &case.settings).unwrap()
}

fn upstream(case: &Case) -> ImageGradient {
    upstream_of(case, |_, view, pixel| [1.0, 0.5 + view as f32, 0.01 * pixel as f32])
}

fn gradient(renderer: &mut Renderer, frame: &Frame, case: &Case) -> Gradients {
    renderer.backward(frame, &upstream(case), &GradientRequest::ALL).unwrap()
}

#[test]
fn each_frame_has_its_own_gradient_in_any_order() {
    let cases = cases();
    let alone: Vec<_> = cases
        .iter()
        .map(|case| {
            let mut renderer = renderer();
            let frame = render(&mut renderer, case);
            gradient(&mut renderer, &frame, case)
        })
        .collect();
    let mut renderer = renderer();
    for turn in 0..2 {
        let frames: Vec<_> = cases.iter().map(|case| render(&mut renderer, case)).collect();
        for i in [4, 0, 2, 1, 3, 3, 0] {
            let again = gradient(&mut renderer, &frames[i], &cases[i]);
            same_gradient_bits(&alone[i], &again).unwrap_or_else(|e| panic!("turn {turn}, frame {i}: {e}"));
            // A frame that is not saved does not take the slot of a saved one.
            renderer.render(&cases[2].scene, &cases[2].cameras, &cases[0].settings).unwrap();
        }
    }
    assert!(same_gradient_bits(&alone[0], &alone[1]).is_err(), "the frames cannot be told apart");
}

#[test]
fn a_clone_keeps_the_frame_and_a_failure_takes_none() {
    let cases = cases();
    let mut renderer = renderer_with(RendererOptions::default());
    let frame = render(&mut renderer, &cases[0]);
    let first = gradient(&mut renderer, &frame, &cases[0]);
    let clone = frame.clone();
    drop(frame);
    render(&mut renderer, &cases[1]);
    assert!(renderer.render(&cases[0].scene, &[], &cases[0].settings).is_err());
    same_gradient_bits(&first, &gradient(&mut renderer, &clone, &cases[0])).unwrap();
    let elsewhere = std::thread::spawn(move || drop(clone));
    elsewhere.join().unwrap();
    let bytes = renderer.device_bytes();
    render(&mut renderer, &cases[0]);
    assert_eq!(renderer.device_bytes(), bytes, "the dropped frame's buffers were not used again");
}

#[test]
fn a_frame_whose_images_were_taken_has_its_gradient() {
    let (case, mut renderer) = (&cases()[0], renderer());
    let (whole, mut frame) = (render(&mut renderer, case), render(&mut renderer, case));
    let taken: Vec<_> = frame.take_images().collect();
    assert!(taken.len() > 1 && taken.iter().map(|(name, image)| (*name, image)).eq(whole.images()));
    assert!(frame.images().next().is_none() && frame.color().is_err());
    let [first, second] = [&whole, &frame].map(|frame| gradient(&mut renderer, frame, case));
    same_gradient_bits(&first, &second).unwrap();
}

/// Frames that are dropped in each turn take no more memory. If later turns need fewer, the rest is freed.
#[test]
fn memory_follows_the_frames_that_live() {
    let case = ball(0, &EYES[..1], 16);
    let mut renderer = renderer_with(RendererOptions::default());
    let mut step = |count: usize| {
        let frames: Vec<_> = (0..count).map(|_| render(&mut renderer, &case)).collect();
        frames.iter().for_each(|frame| drop(gradient(&mut renderer, frame, &case)));
        drop(frames);
        renderer.device_bytes()
    };
    let one = step(1);
    assert_eq!([step(1), step(1)], [one; 2]);
    let six = step(6);
    assert_eq!([step(6), step(6), step(6)], [six; 3]);
    assert_eq!(six, 6 * one);
    let later = (0..40).map(|_| step(1)).collect::<Vec<_>>();
    assert_eq!((later[0], later[39]), (six, one), "{later:?}");
}

#[test]
fn living_frames_count_towards_the_limit_of_memory() {
    let case = ball(0, &EYES[..1], 16);
    let mut measured = renderer_with(RendererOptions::default());
    let frame = render(&mut measured, &case);
    gradient(&mut measured, &frame, &case);
    let one = measured.device_bytes();
    let limited = || renderer_with(RendererOptions { memory: Some(one * 5 / 2), ..RendererOptions::default() });
    let mut renderer = limited();
    let frames = [render(&mut renderer, &case), render(&mut renderer, &case)];
    frames.iter().for_each(|frame| drop(gradient(&mut renderer, frame, &case)));
    // This frame needs more than the saved frames leave, but less than the limit.
    let large = Scene::new(shapes::icosphere(3).unwrap());
    limited().render_saved(&large, &case.cameras, &case.settings).unwrap();
    match renderer.render_saved(&large, &case.cameras, &case.settings) {
        Err(error @ Error::OutOfMemory { .. }) => assert!(error.to_string().contains("drop saved frames"), "{error}"),
        other => panic!("{other:?}"),
    }
    let [kept, _] = frames;
    gradient(&mut renderer, &kept, &case);
    render(&mut renderer, &case);
}

/// Timing changes later commands, not frames that live.
#[test]
fn a_frame_outlives_a_change_of_timing() {
    let case = ball(0, &EYES[..1], 16);
    let mut renderer = renderer_with(RendererOptions::default());
    let frame = render(&mut renderer, &case);
    let first = gradient(&mut renderer, &frame, &case);
    for on in [true, false] {
        renderer.time_stages(on);
        same_gradient_bits(&first, &gradient(&mut renderer, &frame, &case)).unwrap();
        assert_eq!(renderer.backward_timings().is_empty(), !on);
        let again = render(&mut renderer, &case);
        assert_eq!(again.timings().is_empty(), !on);
    }
}

/// A frame that needed much room leaves nothing to the smaller ones after it.
#[test]
fn a_small_frame_is_small_after_a_large_one() {
    let small = ball(0, &EYES[..1], 16);
    let mut large = ball(0, &EYES, 200);
    large.settings.sigma = 1e-2;
    let mut renderer = renderer_with(RendererOptions::default());
    let alone = (render(&mut renderer, &small), renderer.device_bytes()).1;
    let mut renderer = renderer_with(RendererOptions::default());
    render(&mut renderer, &large);
    assert!(renderer.device_bytes() > 50 * alone);
    let later: Vec<u64> = (0..8).map(|_| (render(&mut renderer, &small), renderer.device_bytes()).1).collect();
    assert_eq!(later.last(), Some(&alone), "{later:?}");
}

/// The limit is of what the renderer holds, whatever it rendered before.
#[test]
fn no_more_memory_is_held_than_the_limit() {
    let cases = cases();
    let alone = cases.iter().map(|case| {
        let mut renderer = renderer_with(RendererOptions::default());
        let frame = render(&mut renderer, case);
        gradient(&mut renderer, &frame, case);
        renderer.device_bytes()
    });
    let limit = alone.max().unwrap();
    let mut renderer = renderer_with(RendererOptions { memory: Some(limit), ..RendererOptions::default() });
    for i in [4, 0, 2, 4, 1, 3, 4, 0, 4] {
        let frame = render(&mut renderer, &cases[i]);
        gradient(&mut renderer, &frame, &cases[i]);
        assert!(renderer.device_bytes() <= limit, "{} of {limit} after frame {i}", renderer.device_bytes());
    }
}
