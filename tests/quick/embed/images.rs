//! softras stores its images into a host's storage images.
// Loops use indices as the formulas do, and comparisons count NaN as a failure.
#![allow(clippy::needless_range_loop, clippy::neg_cmp_op_on_partial_ord)]

use crate::common::scenes::{Case, Kind, random_case};
use crate::host::engine::{Buffer, Engine, Image, color_range};
use crate::host::{Host, assert_silent, engine, error, plan_of, rasterizer, run, submit};
use ash::vk;
use gpu_allocator::MemoryLocation;
use softras::embed::{FrameImage, HostCommands, ImageFormat, ImageRef, Pass, PassBuffer};
use softras::scene::Outputs;

fn image(engine: &Engine, format: ImageFormat, size: (u32, u32)) -> (Image, ImageRef) {
    let usage = vk::ImageUsageFlags::STORAGE | vk::ImageUsageFlags::TRANSFER_SRC;
    let image = engine.image_of(format.format(), size, usage).unwrap();
    let target = unsafe { ImageRef::new(image.view, format, size.0, size.1) };
    (image, target)
}

/// An image's layout, and who accesses it there at which stage.
pub type Use = (vk::ImageLayout, vk::AccessFlags, vk::PipelineStageFlags);

pub fn change_use(engine: &Engine, commands: &HostCommands, image: &Image, from: Use, to: Use) {
    let barrier = [vk::ImageMemoryBarrier::default()
        .image(image.raw)
        .subresource_range(color_range())
        .old_layout(from.0)
        .new_layout(to.0)
        .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
        .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
        .src_access_mask(from.1)
        .dst_access_mask(to.1)];
    let none = vk::DependencyFlags::empty();
    unsafe { engine.device().cmd_pipeline_barrier(commands.raw(), from.2, to.2, none, &[], &[], &barrier) };
}

/// All of an image, packed.
pub fn whole_image((width, height): (u32, u32)) -> vk::BufferImageCopy {
    let layers = vk::ImageSubresourceLayers::default().aspect_mask(vk::ImageAspectFlags::COLOR).layer_count(1);
    vk::BufferImageCopy::default().image_subresource(layers).image_extent(vk::Extent3D { width, height, depth: 1 })
}

/// The bytes of a new image of this format and size after `store` has recorded a store to it.
pub fn after_store<F: Fn(&mut HostCommands)>(
    engine: &Engine,
    format: ImageFormat,
    size: (u32, u32),
    store: impl FnOnce(&ImageRef) -> F,
) -> Vec<u8> {
    use vk::{AccessFlags as A, ImageLayout as L, PipelineStageFlags as S};
    let (image, target) = image(engine, format, size);
    // The closure keeps the bound image until the commands have run.
    let record = store(&target);
    let texel = match format {
        ImageFormat::Rgba32Float => 16,
        ImageFormat::Rgba16Float => 8,
        ImageFormat::Rgba8Unorm | ImageFormat::R32Float => 4,
    };
    let bytes = texel * u64::from(size.0 * size.1);
    let back: Buffer = engine.buffer(bytes, vk::BufferUsageFlags::TRANSFER_DST, MemoryLocation::GpuToCpu).unwrap();
    submit(engine, |commands| {
        let general = (L::GENERAL, A::SHADER_WRITE, S::COMPUTE_SHADER);
        change_use(engine, commands, &image, (L::UNDEFINED, A::empty(), S::TOP_OF_PIPE), general);
        record(commands);
        change_use(engine, commands, &image, general, (L::TRANSFER_SRC_OPTIMAL, A::TRANSFER_READ, S::TRANSFER));
        let (from, copy) = (L::TRANSFER_SRC_OPTIMAL, [whole_image(size)]);
        unsafe { engine.device().cmd_copy_image_to_buffer(commands.raw(), image.raw, from, back.raw, &copy) };
    });
    back.bytes()[..bytes as usize].to_vec()
}

/// The texels' bytes, packed, after the storing of one view.
pub fn stored(engine: &Engine, pass: &Pass, what: FrameImage, view: u32, format: ImageFormat) -> Vec<u8> {
    after_store(engine, format, pass.plan().image_size(), |target| {
        let bound = pass.bind_image(what, view, target).unwrap();
        move |commands: &mut HostCommands| pass.record_store(commands, &bound).unwrap()
    })
}

fn case(outputs: Outputs) -> Case {
    let mut case = random_case(20, Kind::Plain);
    let mesh = softras::shapes::torus(0.7, 0.3, 12, 7).unwrap();
    case.scene = softras::Scene::new(mesh).with_lights(softras::Lights::official());
    let projection = softras::Projection::Perspective { fov_y: 0.8 };
    case.cameras = [10.0, 80.0].map(|angle| softras::Camera::from_angles(3.0, 40.0, angle, projection).unwrap()).into();
    case.settings = softras::Settings { sigma: 1e-4, outputs, ..Default::default() };
    // The size is no multiple of a workgroup's.
    (case.settings.width, case.settings.height) = (37, 21);
    case
}

fn half(bits: [u8; 2]) -> f64 {
    let bits = u16::from_le_bytes(bits);
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f64::from(bits & 1023) / 1024.0);
    let size = if exponent == 0 { fraction * 2f64.powi(-14) } else { (1.0 + fraction) * 2f64.powi(exponent - 15) };
    if bits >> 15 == 1 { -size } else { size }
}

/// As sRGB encodes.
fn srgb(x: f32) -> f64 {
    let x = f64::from(x).clamp(0.0, 1.0);
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
}

/// The first value that is farther than `absolute` plus `relative` of it.
fn far(made: &[f64], due: &[f64], absolute: f64, relative: f64) -> Option<usize> {
    assert_eq!(made.len(), due.len());
    made.iter().zip(due).position(|(a, b)| !((a - b).abs() <= absolute + relative * b.abs()))
}

#[test]
fn a_far_value_is_noticed() {
    assert_eq!(far(&[1.0, 2.0], &[1.0, 2.01], 0.0, 0.01), None);
    assert_eq!(far(&[1.0, 2.0], &[1.0, 2.03], 0.0, 0.01), Some(1));
    assert_eq!(far(&[f64::NAN], &[0.0], 1.0, 0.0), Some(0));
    assert_eq!((half([0x00, 0x3c]), half([0x00, 0xc0]), half([1, 0])), (1.0, -2.0, 2f64.powi(-24)));
}

#[test]
fn images_are_stored_as_they_are() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let case = case(Outputs::ALL);
    let host = Host::new(&engine, &rasterizer, plan_of(&rasterizer, &case));
    run(&engine, &host.pass);
    let pixels = 37 * 21;
    for view in 0..case.cameras.len() as u32 {
        let part = |id: PassBuffer, channels: usize| {
            host.floats(id)[view as usize * pixels * channels..][..pixels * channels].to_vec()
        };
        let (color, depth, normal) =
            (part(PassBuffer::Color, 4), part(PassBuffer::Depths, 1), part(PassBuffer::Normals, 4));
        let alpha: Vec<f32> = color.iter().skip(3).step_by(4).copied().collect();
        assert!(alpha.iter().any(|&a| a > 0.1), "an empty image");
        let plain = FrameImage::Color { srgb: false };
        let floats = |what, format| stored(&engine, &host.pass, what, view, format);
        use ImageFormat::{R32Float, Rgba8Unorm, Rgba16Float, Rgba32Float};
        assert_eq!(floats(plain, Rgba32Float), bytemuck::cast_slice::<f32, u8>(&color));
        assert_eq!(floats(FrameImage::Normal, Rgba32Float), bytemuck::cast_slice::<f32, u8>(&normal));
        assert_eq!(floats(FrameImage::Silhouette, R32Float), bytemuck::cast_slice::<f32, u8>(&alpha));
        assert_eq!(floats(FrameImage::Depth, R32Float), bytemuck::cast_slice::<f32, u8>(&depth));
        // Eleven bits of a half, eight of a byte.
        let halves: Vec<f64> = floats(plain, Rgba16Float).chunks_exact(2).map(|b| half([b[0], b[1]])).collect();
        let due: Vec<f64> = color.iter().map(|&x| f64::from(x)).collect();
        assert_eq!(far(&halves, &due, 1e-7, 1.0 / 1024.0), None);
        let bytes = |what| -> Vec<f64> { floats(what, Rgba8Unorm).iter().map(|&b| f64::from(b) / 255.0).collect() };
        let due: Vec<f64> = due.iter().map(|x| x.clamp(0.0, 1.0)).collect();
        // Vulkan allows a conversion to fixed point an error of 0.6 of its last place.
        assert_eq!(far(&bytes(plain), &due, 0.61 / 255.0, 0.0), None);
        let encoded = |(i, &x): (usize, &f32)| if i % 4 == 3 { f64::from(x) } else { srgb(x) };
        let due: Vec<f64> = color.iter().enumerate().map(encoded).collect();
        assert_eq!(far(&bytes(FrameImage::Color { srgb: true }), &due, 0.61 / 255.0, 0.0), None);
    }
    drop((host, rasterizer));
    assert_silent(engine);
}

/// A silhouette without colour has its own buffer. Errors name an image that does not exist or does not fit.
#[test]
fn images_that_do_not_fit_are_errors() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let case = case(Outputs::SILHOUETTE);
    let host = Host::new(&engine, &rasterizer, plan_of(&rasterizer, &case));
    run(&engine, &host.pass);
    let silhouette = stored(&engine, &host.pass, FrameImage::Silhouette, 0, ImageFormat::R32Float);
    assert_eq!(silhouette, bytemuck::cast_slice::<f32, u8>(&host.floats(PassBuffer::Silhouette)[..37 * 21]));

    let (kept, target) = image(&engine, ImageFormat::R32Float, (37, 21));
    let (small, small_target) = image(&engine, ImageFormat::R32Float, (36, 21));
    let (four, four_target) = image(&engine, ImageFormat::Rgba32Float, (37, 21));
    let bind = |what, view, target| error(host.pass.bind_image(what, view, target));
    assert_eq!(bind(FrameImage::Silhouette, 0, &target), "no error");
    assert!(bind(FrameImage::Depth, 0, &target).contains("no image Depth"));
    assert!(bind(FrameImage::Color { srgb: false }, 0, &four_target).contains("no image Color"));
    assert!(bind(FrameImage::Silhouette, case.cameras.len() as u32, &target).contains("no view"));
    assert!(bind(FrameImage::Silhouette, 0, &small_target).contains("(36, 21)"));
    assert!(bind(FrameImage::Silhouette, 0, &four_target).contains("channels"));
    let null = unsafe { ImageRef::from_raw(0, ImageFormat::R32Float, 37, 21) };
    assert!(bind(FrameImage::Silhouette, 0, &null).contains("null"));
    drop((kept, small, four, host, rasterizer));
    assert_silent(engine);
}
