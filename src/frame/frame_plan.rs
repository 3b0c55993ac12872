//! The plans of a frame and of its gradients: the buffers that they need, before any memory is allocated.

use super::shape::FrameShape;
use crate::error::{Error, Result};
use crate::frame::buffers::{BufferId, Sizes, TableLengths};
use crate::frame::pack::{MeshLayout, TableLayout};
use crate::frame::plan::{
    BackwardInput, BackwardPlan, Capacity, ForwardPlan, FramePush, PlanInput, Rare, validate_views, wants_vertices,
};
use crate::gradients::GradientRequest;
use crate::scene::{Lights, Outputs, Settings, Shading};
use crate::vulkan::{BufferDesc, DeviceKind, Limits, Location, vk};

/// The most loop passes of one invocation, over all its loops, that a software device executes correctly. Mesa before
/// 23 ends loops after 65535 passes without an error, which would leave a hole in the image.
const SOFTWARE_LOOP_PASSES: u32 = 60_000;

/// A buffer that a pass needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BufferRequirement {
    /// Its id.
    pub id: BufferId,
    /// The least number of bytes; never 0.
    pub size: u64,
    /// Its offset in the VkBuffer must be a multiple of this.
    pub alignment: u64,
    /// How softras uses it. The host adds its own usages, such as a copy into an input or from an output.
    pub usage: vk::BufferUsageFlags,
}

/// The plan of a forward frame: sizes, counts and constants.
#[derive(Clone, Debug, PartialEq)]
pub struct FramePlan {
    pub(crate) forward: ForwardPlan,
    pub(crate) shape: FrameShape,
    pub(crate) layouts: Vec<MeshLayout>,
    tables: TableLengths,
    buffers: Vec<BufferRequirement>,
    pub(crate) capacity: Capacity,
    limits: Limits,
}

/// The gradients to compute for a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Differentiate {
    /// The images that have an upstream gradient: at least one, and only images that the frame renders.
    pub upstream: Outputs,
    /// The inputs to differentiate by.
    pub wanted: GradientRequest,
    /// An upper bound of |dL/dcolour| over all channels and pixels. Only [`GradientRequest::texels`] uses it: its sums are in fixed
    /// point, so that a sum beyond the bound wraps around, and one far below it loses precision. Where textures have an
    /// alpha it also bounds |dL/dsilhouette|, |dL/dnormal|, |dL/ddepth| times the far plane, |dL/dcolour| times the
    /// largest texel and background, and Σ |dL/df| times the largest feature f.
    pub largest_upstream: f64,
}

/// The plan of a backward pass.
#[derive(Clone, Debug, PartialEq)]
pub struct GradientPlan {
    pub(crate) backward: BackwardPlan,
    buffers: Vec<BufferRequirement>,
    /// Bytes of the frame's buffers.
    pub(crate) frame_sizes: Sizes,
    pub(crate) wanted: GradientRequest,
    /// [`FrameShape::device_counts`] of the frame.
    pub(crate) device_counts: bool,
}

fn requirement(limits: &Limits, id: BufferId, size: u64) -> Result<BufferRequirement> {
    let (name, format, usage) = (id.name(), id.row().format, id.usage());
    let texels = usage.contains(vk::BufferUsageFlags::UNIFORM_TEXEL_BUFFER).then_some(format);
    BufferDesc { name, size, usage, location: Location::Device, texels }.validate(limits)?;
    // 16 bytes are a texel of four floats, and the alignment that copies to images need.
    let alignment = limits.storage_offset_alignment.max(limits.texel_offset_alignment).max(16);
    Ok(BufferRequirement { id, size, alignment, usage })
}

fn requirements(limits: &Limits, sizes: &Sizes) -> Result<Vec<BufferRequirement>> {
    sizes.iter().map(|(id, size)| requirement(limits, id, size)).collect()
}

/// The most bytes that any buffer of 4-byte elements can have.
fn largest_buffer(limits: &Limits) -> u64 {
    let texels = limits.max_texel_buffer_elements.saturating_mul(4);
    limits.max_storage_buffer_range.min(limits.max_memory_allocation_size).min(texels) / 16 * 16
}

/// Validates that a loop of the kernels can sum over each vertex's corners in `views` views.
fn validate_corners(shape: &FrameShape, views: u32, loop_passes: u32) -> Result<()> {
    let most = shape.most_corners();
    let needed = (u64::from(most) + 1) * u64::from(views);
    if needed <= loop_passes.into() {
        return Ok(());
    }
    Err(Error::Limit {
        what: format!("one vertex of {most} triangle corners, in {views} views,"),
        needed,
        unit: "terms of a sum",
        limit_name: "passes of a loop on a software driver",
        limit: loop_passes.into(),
        fix: "split the vertex, or render fewer views at once".into(),
    })
}

/// The largest squared radius of support in units of σ. The kernels hold D in single precision; exp(-70) is about 4e-31,
/// which leaves a factor of 1e7 above the least normal number for the terms that D is multiplied with.
const FARTHEST: f64 = 70.0;

/// Validates a squared radius of support.
fn validate_cutoff(cutoff: f64) -> Result<()> {
    if !(cutoff > 0.0 && cutoff <= FARTHEST) {
        return Err(Error::Settings {
            field: "support",
            value: format!("one where D falls to exp(-{cutoff:.0})"),
            fix: format!(
                "the kernels follow D down to exp(-{FARTHEST}): use a larger gamma, bring near and far close around the \
                 scene, use the composite background, or support probability"
            ),
        });
    }
    Ok(())
}

/// Validates the counts and the radius of support of a shape.
fn validate(shape: &FrameShape) -> Result<()> {
    validate_views(shape.views.into())?;
    let fail = |what: String, fix: &str| Err(Error::Scene { what, fix: fix.into() });
    let (meshes, views) = (shape.meshes.len(), shape.views as usize);
    if meshes == 0 || views == 0 || (meshes != 1 && meshes != views) {
        let fix = "give one mesh with any number of views, or one view per mesh";
        return fail(format!("{meshes} meshes but {views} views"), fix);
    }
    let vertices = shape.vertices();
    let triangles: u64 = shape.meshes.iter().map(|m| u64::from(m.triangles)).sum();
    let (uvs, texels) = (shape.uvs(), shape.texels());
    let features = vertices * u64::from(shape.features().div_ceil(4));
    let most = [3 * vertices, features, 3 * triangles, 2 * uvs, texels, vertices + 3 * triangles + meshes as u64];
    if most.iter().any(|&count| count > i32::MAX as u64) {
        let what = format!(
            "{vertices} vertices, {triangles} triangles, {uvs} UV pairs, {texels} texels and {features} fours of features"
        );
        let fix = "render fewer meshes or features or smaller textures at once: kernels index with 32 bits";
        return fail(what, fix);
    }
    validate_cutoff(shape.cutoff)?;
    shape.lights.validate()
}

/// Validates that all meshes have the same number of features, at least one, where an image of them is asked for.
fn validate_features(shape: &FrameShape, settings: &Settings) -> Result<()> {
    let channels = shape.features();
    if settings.outputs.features && shape.meshes.iter().any(|mesh| mesh.features == 0 || mesh.features != channels) {
        let found: Vec<_> = shape.meshes.iter().map(|mesh| mesh.features.to_string()).collect();
        let what = format!("features are asked for, but the meshes have {} at a vertex", found.join(", "));
        let fix = "give every mesh the same number with Mesh::with_features, or do not ask for Outputs::features";
        return Err(Error::Scene { what, fix: fix.into() });
    }
    Ok(())
}

impl FramePlan {
    /// Plans a frame of this shape with these settings for a device of these limits, with a choice of the rarely needed kernels. It
    /// needs no device. The other kernels are neither compiled nor recorded;
    /// [`Status::next`](super::status::Status::next) says whether the frame is complete without them.
    ///
    /// # Errors
    /// [`Error::Scene`], [`Error::Settings`], [`Error::Light`] for invalid input, [`Error::Limit`] for a frame that exceeds
    /// what this device supports.
    pub(crate) fn new(
        limits: &Limits,
        kind: DeviceKind,
        shape: &FrameShape,
        settings: &Settings,
        rare: Rare,
    ) -> Result<Self> {
        settings.validate()?;
        validate(shape)?;
        validate_features(shape, settings)?;
        let views = shape.view_sizes();
        let wished = shape.capacity.unwrap_or_else(|| Capacity::estimate(settings, shape.cutoff, &views));
        let records = views.iter().map(|view| 2 * u64::from(view.triangles)).sum();
        let capacity = wished.within(largest_buffer(limits), records);
        let loop_passes = if kind == DeviceKind::Software { SOFTWARE_LOOP_PASSES } else { u32::MAX };
        let tables = TableLayout::of(&shape.meshes, settings.save || shape.lights.shading == Shading::Smooth);
        let forward = ForwardPlan::new(&PlanInput {
            settings,
            cutoff: shape.cutoff,
            views: &views,
            tables: tables.lengths,
            lights: &shape.lights,
            features: shape.features(),
            sampling: shape.sampling(),
            depth_span: shape.depth_span,
            lenses: shape.lenses,
            capacity,
            save: settings.save,
            loop_passes,
            rare,
        })?;
        let buffers = requirements(limits, &forward.sizes)?;
        if shape.lights.shading == Shading::Smooth {
            validate_corners(shape, 1, loop_passes)?;
        }
        let (layouts, tables) = (tables.meshes, tables.lengths);
        Ok(Self { forward, layouts, tables, shape: shape.clone(), buffers, capacity, limits: *limits })
    }

    /// The push constants with other settings and lights; `None` where these need other kernels. Allocates only for an error.
    pub(crate) fn push_with(&self, settings: &Settings, cutoff: f64, lights: &Lights) -> Result<Option<FramePush>> {
        settings.validate()?;
        validate_cutoff(cutoff)?;
        Ok(self.forward.push_with(&PlanInput {
            settings,
            cutoff,
            views: &[],
            tables: self.tables,
            lights,
            features: self.shape.features(),
            sampling: self.shape.sampling(),
            depth_span: self.shape.depth_span,
            lenses: self.shape.lenses,
            capacity: self.capacity,
            save: settings.save,
            loop_passes: self.forward.modes.loop_passes,
            rare: self.forward.rare,
        }))
    }

    /// The buffers that it needs, in no particular order.
    pub fn buffers(&self) -> &[BufferRequirement] {
        &self.buffers
    }

    /// The requirement of one buffer; `None` if the frame has no such buffer ([`BufferId::Color`] without
    /// [`Outputs::color`]).
    pub fn buffer(&self, id: BufferId) -> Option<&BufferRequirement> {
        self.buffers.iter().find(|b| b.id == id)
    }

    /// Width and height of its images in pixels.
    pub fn image_size(&self) -> (u32, u32) {
        (self.forward.push.width, self.forward.push.height)
    }

    pub(crate) fn background(&self) -> [f32; 3] {
        let push = &self.forward.push;
        [push.background_red, push.background_green, push.background_blue]
    }

    /// The number of its views.
    pub fn views(&self) -> u32 {
        self.shape.views
    }

    pub(crate) fn has_silhouette(&self) -> bool {
        self.forward.modes.outputs & crate::constants::OUTPUT_SILHOUETTE != 0
    }

    /// The content of the buffer `view_shapes`: for each view its mesh, and its ranges in the frame's buffers
    /// (`glsl/common/mesh.glsl`).
    pub fn view_shapes(&self) -> Vec<[u32; 4 * crate::constants::SHAPE_TEXELS as usize]> {
        let meshes = &self.layouts;
        let entry = |(view, range): (usize, &crate::frame::plan::ViewRange)| {
            let m = meshes[if meshes.len() == 1 { 0 } else { view }];
            [
                m.vertex,
                m.vertices,
                m.triangle,
                m.triangles,
                range.screen_base,
                range.record_base,
                range.bin_base,
                range.word_base,
                range.records,
                range.words,
                m.color,
                m.uniform,
                m.uv,
                m.uv_index,
                m.texture,
                m.adjacency,
            ]
        };
        self.forward.views.iter().enumerate().map(entry).collect()
    }

    /// A capacity as this frame's device can bind it.
    pub(crate) fn within_limits(&self, capacity: Capacity) -> Capacity {
        let records = self.shape.view_sizes().iter().map(|view| 2 * u64::from(view.triangles)).sum();
        capacity.within(largest_buffer(&self.limits), records)
    }
}

impl GradientPlan {
    /// Plans the gradients of a frame. It needs no device.
    ///
    /// # Errors
    /// [`Error::Backward`] for a frame without [`Settings::save`], or an upstream gradient of an image that it does not
    /// render; [`Error::Limit`] for gradients that exceed what the device supports.
    pub fn new(frame: &FramePlan, differentiate: &Differentiate) -> Result<Self> {
        let fail = |what: &str, fix: &str| Err(Error::Backward { what: what.into(), fix: fix.into() });
        if frame.forward.modes.save == 0 {
            return fail("the frame keeps nothing for it", "plan it with Settings::save = true");
        }
        let up = differentiate.upstream;
        let rendered = frame.forward.modes.outputs;
        use crate::constants as c;
        let images = [
            (up.color, c::OUTPUT_COLOR),
            (up.silhouette, c::OUTPUT_SILHOUETTE),
            (up.depth, c::OUTPUT_DEPTH),
            (up.normal, c::OUTPUT_NORMAL),
            (up.features, c::OUTPUT_FEATURES),
        ];
        if !images.iter().any(|(given, _)| *given) {
            return fail("no image has an upstream gradient", "give dL/dimage of at least one rendered image");
        }
        if images.iter().any(|(given, bit)| *given && rendered & bit == 0) {
            return fail("an upstream gradient is of an image that the frame does not have", "ask for it in outputs");
        }
        let shape = &frame.shape;
        if wants_vertices(&differentiate.wanted) {
            let views = if shape.meshes.len() == 1 { shape.views } else { 1 };
            validate_corners(shape, views, frame.forward.modes.loop_passes)?;
        }
        let backward = BackwardPlan::new(&BackwardInput {
            forward: &frame.forward,
            upstream: up,
            wanted: &differentiate.wanted,
            lit: !shape.lights.is_unlit(),
            vertices: shape.vertices(),
            largest_mesh: shape.meshes.iter().map(|m| m.vertices).max().unwrap_or(0),
            most_corners: shape.most_corners(),
            texels: shape.texels(),
            texel_scale: texel_scale(&frame.forward, &shape.lights, differentiate.largest_upstream),
        });
        let buffers = requirements(&frame.limits, &backward.sizes)?;
        let (frame_sizes, device_counts) = (frame.forward.sizes, shape.device_counts);
        Ok(Self { backward, buffers, frame_sizes, wanted: differentiate.wanted, device_counts })
    }

    /// Takes over changed push constants and lights of the frame.
    pub(crate) fn set_push(&mut self, push: FramePush, frame: &FramePlan, lights: &Lights, largest_upstream: f64) {
        let texel_scale = texel_scale(&frame.forward, lights, largest_upstream);
        self.backward.push = FramePush { texel_scale, ..push };
    }

    /// The buffers that it needs beyond the frame's.
    pub fn buffers(&self) -> &[BufferRequirement] {
        &self.buffers
    }

    /// Units per 1.0 of the 64-bit sums in `texel_sums`: the gradient is the signed sum divided by this.
    pub fn texel_scale(&self) -> f32 {
        self.backward.push.texel_scale
    }
}

/// The power of two that scales the largest sum a texel can have to about 2⁶¹ units, so that the units are as fine as 64
/// bits allow. Scaling by a power of two is exact.
fn texel_scale(plan: &ForwardPlan, lights: &Lights, largest_upstream: f64) -> f32 {
    let ambient: f64 = lights.ambient_color.iter().map(|x| (x * lights.ambient_intensity).abs()).sum();
    let directional =
        lights.directional.iter().map(|l| l.color.iter().map(|x| (x * l.intensity).abs()).sum::<f64>()).sum::<f64>();
    // A pixel's weights sum to at most 1, and a texel's share of each weight is at most 1. Perspective correction at most
    // doubles them; a further factor of 8 is a margin.
    let mut most = 16.0 * plan.totals.pixels as f64 * largest_upstream * (ambient + directional);
    if plan.modes.opacity != 0 {
        // |v - V| is at most 14 times the bound and the light, and what multiplies it at most 256 (STEEPEST).
        most = 16.0 * plan.totals.pixels as f64 * largest_upstream * (ambient + directional).max(1.0) * 4096.0;
    }
    if most > 0.0 { ((61.0 - most.log2().ceil()).clamp(-100.0, 100.0)).exp2() as f32 } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::pack::{AppearanceShape, MeshShape};
    use crate::frame::plan::{DepthSpan, Lenses};
    use proptest::prelude::*;

    const UNLIMITED: Limits = Limits {
        max_storage_buffer_range: u64::MAX,
        max_texel_buffer_elements: u64::MAX,
        max_memory_allocation_size: u64::MAX,
        max_workgroup_count: [65535; 3],
        max_workgroup_size: [1024; 3],
        max_workgroup_invocations: 1024,
        max_shared_memory: 32768,
        max_push_constants: 256,
        max_storage_buffers: 16,
        max_texel_buffers: 16,
        storage_offset_alignment: 16,
        texel_offset_alignment: 16,
        timestamp_period: 1.0,
        device_heap: u64::MAX,
        subgroup_size: 8,
        subgroup_shuffle: true,
    };
    /// The limits of lavapipe.
    const LIMITED: Limits =
        Limits { max_storage_buffer_range: 1 << 27, max_texel_buffer_elements: 1 << 27, ..UNLIMITED };

    fn shape(meshes: Vec<MeshShape>, views: u32) -> FrameShape {
        FrameShape {
            meshes,
            views,
            lights: Lights::unlit(),
            depth_span: DepthSpan { crosses_near: false, crosses_far: false },
            opacity: false,
            lenses: Lenses::default(),
            cutoff: 9.0,
            capacity: None,
            device_counts: false,
        }
    }

    fn count() -> impl Strategy<Value = u32> {
        prop::sample::select(vec![0, 1, 2, 3, 100, 70_000, 1 << 20, (1 << 31) - 1, 1 << 31, u32::MAX])
    }

    fn appearance() -> impl Strategy<Value = AppearanceShape> {
        prop_oneof![
            Just(AppearanceShape::Uniform),
            Just(AppearanceShape::VertexColors),
            count().prop_map(|resolution| AppearanceShape::Surface { resolution }),
            (count(), prop::collection::vec((count(), count()), 2), any::<bool>())
                .prop_map(|(uvs, textures, of_triangle)| AppearanceShape::Textured { uvs, textures, of_triangle }),
        ]
    }

    fn mesh() -> impl Strategy<Value = MeshShape> {
        (count(), count(), count(), appearance(), any::<bool>(), 0..=32u32).prop_map(
            |(vertices, triangles, most_corners, appearance, normals, features)| MeshShape {
                vertices,
                triangles,
                most_corners,
                appearance,
                normals,
                features,
            },
        )
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 5000, failure_persistence: None, ..ProptestConfig::default() })]

        /// For any counts of a host a plan is made or refused; no count overflows.
        #[test]
        fn counts_of_any_size_are_planned_or_refused(
            meshes in prop::collection::vec(mesh(), 0..4), views in count(), capacity in prop::option::of((count(), count(), count())),
            flags in any::<[bool; 4]>(), size in prop::sample::select(vec![1u32, 8, 640, 16384]), save in any::<bool>(),
        ) {
            let views = if meshes.len() == 1 { views } else { meshes.len() as u32 };
            let [crosses_near, crosses_far, opacity, device_counts] = flags;
            let capacity = capacity.map(|(coarse, list, cells)| Capacity { coarse, list, cells });
            let depth_span = DepthSpan { crosses_near, crosses_far };
            let shape = FrameShape { depth_span, opacity, capacity, device_counts, lights: Lights::official(), ..shape(meshes, views) };
            let settings = Settings { width: size, height: 16384 / size, save, ..Settings::default() };
            for limits in [&LIMITED, &UNLIMITED] {
                let Ok(plan) = FramePlan::new(limits, DeviceKind::Discrete, &shape, &settings, Rare::ALL) else { continue };
                prop_assert_eq!(plan.view_shapes().len(), views as usize);
                let (upstream, wanted) = (settings.outputs, GradientRequest::ALL);
                let gradients = GradientPlan::new(&plan, &Differentiate { upstream, wanted, largest_upstream: 1.0 });
                prop_assert!(save || gradients.is_err());
            }
        }
    }

    /// Kernels index texels with 32 bits, the sign one of them.
    #[test]
    fn records_beyond_32_bits_are_refused() {
        let plan = |views: u32| {
            let (appearance, normals, features) = (AppearanceShape::Uniform, false, 0);
            let mesh = MeshShape { vertices: 3, triangles: 4_000_000, most_corners: 3, appearance, normals, features };
            FramePlan::new(&UNLIMITED, DeviceKind::Discrete, &shape(vec![mesh], views), &Settings::default(), Rare::ALL)
        };
        // Nine texels a triangle: 36 million a view.
        assert!(plan(59).is_ok());
        let error = plan(60).map(drop).map_err(|error| error.to_string());
        assert!(error.as_ref().is_err_and(|e| e.contains("32-bit index") && e.contains("2160000000")), "{error:?}");
    }
}
