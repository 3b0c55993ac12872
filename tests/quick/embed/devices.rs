//! Devices of several kinds: with and without what softras can do without, with every feature enabled, and with a queue
//! that only computes and is not of the first family. The bits are the same.

use crate::common::gradient::{norm, numbers, random_upstream, same_gradient_bits};
use crate::common::scenes::{Case, Kind, random_case};
use crate::common::{tier, tolerance, validates};
use crate::host::engine::Engine;
use crate::host::{
    Host, Messages, assert_silent, difference, engine, error, images, plan_backward, plan_of, rasterizer, record, shim,
    submit,
};
use ash::vk;
use shim::adapter;
use softras::embed::{HostAdapter, HostCommands, HostDevice, Pass, Rasterizer, Requirements};
use softras::{CacheFolder, Error, GradientRequest, Gradients, Image, ImageGradient, Renderer, RendererOptions};

/// Lanes of a workgroup without shuffles, which are as many as in most processors' subgroups.
pub const USUAL_LANES: u32 = 8;

type Outcome = (Vec<(&'static str, Vec<f32>)>, Gradients);

fn cases() -> Vec<(Case, ImageGradient)> {
    let case = |seed| {
        let mut case = random_case(seed, Kind::Plain);
        case.settings.save = true;
        let upstream = random_upstream(&case, case.settings.outputs);
        (case, upstream)
    };
    (40..tier(41, 44)).map(case).collect()
}

/// Each case's images and gradients on a device.
fn outcomes(engine: &Engine, device: &HostDevice, cases: &[(Case, ImageGradient)]) -> Vec<Outcome> {
    let rasterizer = Rasterizer::new(device).unwrap();
    let outcome = |(case, upstream): &(Case, ImageGradient)| {
        let plan = plan_backward(plan_of(&rasterizer, case), upstream, GradientRequest::ALL);
        let host = Host::whole(engine, &rasterizer, plan, upstream);
        (images(case, &host), host.gradients())
    };
    cases.iter().map(outcome).collect()
}

/// The first case with different bits, and where they differ.
fn differs(a: &[Outcome], b: &[Outcome]) -> Option<String> {
    assert_eq!(a.len(), b.len());
    for (case, ((images, gradients), (others, other))) in a.iter().zip(b).enumerate() {
        assert_eq!(images.len(), others.len());
        for ((name, image), (_, other)) in images.iter().zip(others) {
            if let Some(at) = difference(image, other) {
                return Some(format!("case {case}: {name} at {at}"));
            }
        }
        if let Err(what) = same_gradient_bits(gradients, other) {
            return Some(format!("case {case}: {what}"));
        }
    }
    None
}

/// The first case that differs by more than another order of sums explains, and where.
fn strays(a: &[Outcome], b: &[Outcome]) -> Option<String> {
    for (case, ((images, gradients), (others, other))) in a.iter().zip(b).enumerate() {
        let most = tolerance::SAME_SCENE.value as f32;
        let is_off = |(x, y): (&f32, &f32)| (x - y).abs() > most * x.abs().max(1.0);
        for ((name, image), (_, other)) in images.iter().zip(others) {
            if image.len() != other.len() || image.iter().zip(other).any(is_off) {
                return Some(format!("case {case}: {name}"));
            }
        }
        let (found, due) = (numbers(gradients), numbers(other));
        for ((name, found), (_, due)) in found.iter().zip(&due) {
            let off: Vec<f64> = found.iter().zip(due).map(|(x, y)| x - y).collect();
            if found.len() != due.len() || norm(&off) > tolerance::OTHER_LANES * norm(due) {
                return Some(format!("case {case}: {name}, off by {:e} of {:e}", norm(&off), norm(due)));
            }
        }
    }
    None
}

#[test]
fn a_difference_is_noticed() {
    let outcome = |value| vec![(vec![("color", vec![0.0, value])], Gradients::default())];
    assert_eq!(differs(&outcome(1.0), &outcome(1.0)), None);
    assert_eq!(differs(&outcome(1.0), &outcome(1.5)), Some("case 0: color at 1".into()));
    assert_eq!(strays(&outcome(1.0), &outcome(1.0 + 1e-6)), None);
    assert_eq!(strays(&outcome(1.0), &outcome(1.001)), Some("case 0: color".into()));
    let gradients = |sigma| vec![(Vec::new(), Gradients { sigma, ..Default::default() })];
    assert_eq!(strays(&gradients(1.0), &gradients(1.0 + 1e-6)), None);
    assert!(strays(&gradients(1.0), &gradients(1.01)).is_some_and(|what| what.contains("sigma")));
}

#[test]
fn what_is_optional_changes_no_bit() {
    let _guard = shim::lock();
    let names: Vec<_> = Requirements::new().optional.iter().map(|(name, _)| *name).collect();
    assert_eq!(names, ["subgroup shuffle in compute", "VK_EXT_debug_utils", "timestamps"], "test the new one too");
    let cases = cases();
    let engine = engine();
    let named = engine.host_device();
    let due = outcomes(&engine, &named, &cases);

    let unnamed = unsafe { HostDevice::new(engine.host_adapter(), engine.device().handle()) };
    assert_eq!(differs(&due, &outcomes(&engine, &unnamed, &cases)), None, "without VK_EXT_debug_utils");

    let core = engine.core();
    let shown = unsafe { HostAdapter::new(shim::function(), core.instance.handle(), core.physical) };
    let limits = || Requirements::new().validate(&shown).unwrap().limits;
    let as_it_is = limits();
    assert!(as_it_is.subgroup_shuffle, "the device has no shuffles, so there is nothing to hide");
    adapter::hide_shuffles();
    assert!(!limits().subgroup_shuffle);
    let found = outcomes(&engine, &unsafe { HostDevice::new(shown, core.device.handle()) }, &cases);
    // Without shuffles workgroups have the lanes that most processors' subgroups have; with others, sums have another order.
    let what = if as_it_is.subgroup_size == USUAL_LANES { differs(&due, &found) } else { strays(&due, &found) };
    assert_eq!(what, None, "without subgroup shuffles");
    assert_silent(engine);

    let engine = Engine::with_features(validates()).unwrap();
    assert_eq!(differs(&due, &outcomes(&engine, &engine.host_device(), &cases)), None, "with every feature");
    assert_silent(engine);
}

/// A host's query pool gets a timestamp before the first stage of a frame and of its gradients, and one after each stage.
#[test]
fn a_hosts_queries_time_every_stage() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let (case, upstream) = &cases()[0];
    let plan = plan_backward(plan_of(&rasterizer, case), upstream, GradientRequest::default());
    let host = Host::new(&engine, &rasterizer, plan).with_upstream(upstream);
    const FIRST: u32 = 3;
    let count = Pass::stages().map(|stages| stages.len() + 1).iter().sum::<usize>();
    let device = engine.device();
    let info = vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP);
    let pool = unsafe { device.create_query_pool(&info.query_count(FIRST + count as u32), None) }.unwrap();
    submit(&engine, |commands| {
        unsafe { device.cmd_reset_query_pool(commands.raw(), pool, 0, FIRST + count as u32) };
        let mut timed = unsafe { HostCommands::new(commands.raw()).with_timestamps(pool, FIRST) };
        record(&host.pass, &mut timed);
    });
    let mut times = vec![0u64; count];
    // An error if one of them was not written.
    unsafe { device.get_query_pool_results(pool, FIRST, &mut times, vk::QueryResultFlags::TYPE_64) }.unwrap();
    unsafe { device.destroy_query_pool(pool, None) };
    assert!(times.is_sorted() && times[0] < times[count - 1], "{times:?}");
    drop((host, rasterizer));
    assert_silent(engine);
}

/// The images and gradients of the simple API through the loader, and whether it timed its stages; the layers must be silent.
fn simple(case: &Case, upstream: &ImageGradient) -> (Vec<Image>, Gradients, bool) {
    let (loader, cache) = (Some(shim::loader()), CacheFolder::Nowhere);
    let options = RendererOptions { loader, cache, ..Default::default() };
    let mut renderer = Renderer::with_options(&options).unwrap();
    renderer.time_stages(true);
    let frame = renderer.render(&case.scene, &case.cameras, &case.settings).unwrap();
    let shown = [frame.color(), frame.silhouette(), frame.depth(), frame.normal()];
    let images = shown.into_iter().flatten().cloned().collect();
    let timed = !frame.timings().is_empty();
    let gradients = renderer.backward(&frame, upstream, &GradientRequest::ALL).unwrap();
    assert_eq!(renderer.validation_messages(), Messages::new());
    (images, gradients, timed)
}

#[test]
fn any_queue_family_that_computes_will_do() {
    let _guard = shim::lock();
    let (case, upstream) = &cases()[0];
    let (due, due_gradients, timed) = simple(case, upstream);
    assert!(timed);
    type Flags = vk::QueueFlags;
    let computing = Flags::COMPUTE | Flags::TRANSFER;
    for (before, flags, hidden) in [(0, Flags::from_raw(u32::MAX), true), (1, computing, false), (3, computing, true)] {
        adapter::show_all();
        adapter::show_family(before, flags);
        if hidden {
            adapter::hide_timestamps();
        }
        let (images, gradients, timed) = simple(case, upstream);
        assert_eq!(timed, !hidden, "timestamps of family {before}");
        assert_eq!(images, due, "family {before}");
        assert_eq!(same_gradient_bits(&gradients, &due_gradients), Ok(()), "family {before}");
        use vk::PipelineStageFlags as S;
        let of_compute = S::COMPUTE_SHADER | S::TRANSFER | S::DRAW_INDIRECT | S::HOST;
        let named = adapter::stages();
        assert!(of_compute.contains(named) && named.contains(S::COMPUTE_SHADER), "{named:?}");
    }
    // None of them computes.
    adapter::show_family(2, Flags::GRAPHICS | Flags::TRANSFER);
    let options = RendererOptions { loader: Some(shim::loader()), ..Default::default() };
    let refused = Renderer::with_options(&options);
    assert!(matches!(refused, Err(Error::NoDevice { .. })), "{refused:?}");
    let engine = engine();
    let core = engine.core();
    let host = unsafe { HostAdapter::new(shim::function(), core.instance.handle(), core.physical) };
    let refused = error(Requirements::new().validate(&host));
    assert!(refused.contains("no queue that computes"), "{refused}");
    assert_silent(engine);
}
