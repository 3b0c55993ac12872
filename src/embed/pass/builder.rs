//! Plans a pass from a host's counts and settings. It needs no memory, so a host can ask before it allocates any.

use super::buffers::PassBuffer;
use super::memory::{Layouts, MemoryKind, MemoryRequirement, Wishes};
use crate::constants as c;
use crate::embed::host::camera::{CameraMatrices, ClipSpace, HostCamera};
use crate::embed::host::mesh::PassMesh;
use crate::embed::place::tables::Tables;
use crate::error::{Error, Result};
use crate::frame::buffers::{BufferId, Role};
use crate::frame::frame_plan::{BufferRequirement, Differentiate, FramePlan, GradientPlan};
use crate::frame::pack::camera_texels;
use crate::frame::plan::{Capacity, DepthSpan, Lenses, Rare};
use crate::frame::rasterizer::Rasterizer;
use crate::frame::shape::FrameShape;
use crate::frame::status::Status;
use crate::gradients::GradientRequest;
use crate::scene::{Background, Camera, Lights, Outputs, Scene, Settings, Shading, Support};
use crate::vulkan::{BufferRef, DeviceKind, Limits, vk};
use std::sync::Arc;

/// A pass to plan: what it renders and what of that it differentiates. Made by [`Rasterizer::pass`] or [`Rasterizer::scene_pass`].
#[derive(Clone, Debug)]
#[must_use]
pub struct PassBuilder {
    limits: Limits,
    kind: DeviceKind,
    pub(crate) content: Content,
    /// The tables of the content, if they were made already.
    tables: Option<Arc<Tables>>,
    pub(crate) settings: Settings,
    pub(crate) views: Vec<PassView>,
    pub(crate) planes: Option<[f64; 2]>,
    inside_planes: bool,
    lights: Lights,
    pub(crate) wanted: Option<GradientRequest>,
    upstream: Option<Outputs>,
    pub(crate) largest_upstream: f64,
    capacity: Option<Capacity>,
    alignment: u64,
    usages: [vk::BufferUsageFlags; 3],
    own: Vec<PassBuffer>,
    read_back: Vec<PassBuffer>,
    read_back_gradients: bool,
    device_counts: bool,
    pub(crate) rare: Rare,
    /// As [`Wishes::apart`]; all images are read back then.
    pub(crate) apart: Option<u64>,
}

/// The meshes to draw.
#[derive(Clone, Debug)]
pub(crate) enum Content {
    /// A host's meshes: all of them in every view or, if `separate`, one for each view.
    Meshes { meshes: Vec<PassMesh>, separate: bool },
    /// A scene in the host's memory; `None` where it is given anew for each frame.
    Scene(Option<Arc<Scene>>),
}

/// A camera as it was given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum PassView {
    Camera(Camera),
    Matrices(CameraMatrices, ClipSpace),
}

/// A camera as softras renders with it, and the host's own projection if it gave one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ViewCamera {
    pub camera: Camera,
    pub host: Option<HostCamera>,
}

/// Everything that binding and recording a pass needs to know.
#[derive(Clone, Debug)]
pub struct PassPlan {
    pub(crate) builder: PassBuilder,
    pub(crate) frame: FramePlan,
    pub(crate) gradients: Option<GradientPlan>,
    pub(crate) settings: Settings,
    pub(crate) cameras: Vec<ViewCamera>,
    pub(crate) tables: Arc<Tables>,
    pub(crate) layouts: Layouts,
}

impl Rasterizer {
    /// Begins the plan of a pass over a host's meshes, which every view sees all together.
    pub fn pass(&self, meshes: &[PassMesh]) -> PassBuilder {
        self.builder(Content::Meshes { meshes: meshes.to_vec(), separate: false }, Lights::unlit())
    }

    /// Begins the plan of a pass over a scene in the host's memory, with its lights. [`Pass::write_inputs`](crate::embed::Pass::write_inputs)
    /// uploads its meshes, and it is bound with no [`MeshBuffers`](crate::embed::MeshBuffers). Whether triangles cross the near or the far
    /// plane is found out from the scene.
    pub fn scene_pass(&self, scene: &Scene) -> PassBuilder {
        self.builder(Content::Scene(Some(Arc::new(scene.clone()))), scene.lights.clone())
    }

    pub(crate) fn builder(&self, content: Content, lights: Lights) -> PassBuilder {
        PassBuilder {
            limits: *self.device.limits(),
            kind: self.device.kind(),
            content,
            tables: None,
            settings: Settings::default(),
            views: Vec::new(),
            planes: None,
            inside_planes: false,
            lights,
            wanted: None,
            upstream: None,
            largest_upstream: 1.0,
            capacity: None,
            alignment: 1,
            usages: [vk::BufferUsageFlags::empty(); 3],
            own: Vec::new(),
            read_back: Vec::new(),
            read_back_gradients: false,
            device_counts: false,
            rare: Rare::ALL,
            apart: None,
        }
    }
}

impl PassBuilder {
    /// Replaces the meshes or the scene of the plan by these meshes.
    pub fn meshes(mut self, meshes: &[PassMesh]) -> Self {
        let separate = matches!(self.content, Content::Meshes { separate: true, .. });
        self.content = Content::Meshes { meshes: meshes.to_vec(), separate };
        self.tables = None;
        self
    }

    /// Each view sees one of the meshes, in their order, instead of all. With a scene it is always so.
    pub fn one_mesh_a_view(mut self) -> Self {
        if let Content::Meshes { separate, .. } = &mut self.content {
            *separate = true;
            self.tables = None;
        }
        self
    }

    /// Only the device knows how many triangles are drawn: the meshes' own counts are upper bounds, and
    /// [`Pass::bind_counts`](crate::embed::Pass::bind_counts) says where the numbers lie. Each view sees one mesh, drawn once.
    pub fn device_counts(mut self) -> Self {
        self.device_counts = true;
        self
    }

    /// The image's size, σ, γ, the background and all else; the default is [`Settings::default`].
    /// [`Settings::save`] is set where gradients are wanted.
    pub fn settings(mut self, settings: Settings) -> Self {
        self.settings = settings;
        self
    }

    /// The images' size alone, in pixels.
    pub fn image_size(mut self, width: u32, height: u32) -> Self {
        (self.settings.width, self.settings.height) = (width, height);
        self
    }

    /// Which images to make.
    pub fn outputs(mut self, outputs: Outputs) -> Self {
        self.settings.outputs = outputs;
        self
    }

    /// One view for each camera.
    pub fn cameras(mut self, cameras: &[Camera]) -> Self {
        self.views = cameras.iter().copied().map(PassView::Camera).collect();
        self
    }

    /// One view for each pair of matrices, which [`HostCamera::new`] takes apart.
    pub fn camera_matrices(mut self, matrices: &[CameraMatrices], clip: ClipSpace) -> Self {
        self.views = matrices.iter().map(|&matrices| PassView::Matrices(matrices, clip)).collect();
        self
    }

    /// The near and the far plane, as view depths. By default they are those of the matrices, the nearest near plane
    /// and the farthest far one ([`Settings::far`] if that is infinite), or, with [`cameras`](Self::cameras), those of
    /// the settings. Depth scores are relative to both, so γ stands for a larger difference of depth the farther they
    /// are apart.
    pub fn planes(mut self, near: f64, far: f64) -> Self {
        self.planes = Some([near, far]);
        self
    }

    /// Promises that no triangle of the meshes crosses the near plane and none lies beyond the far one: the frame takes
    /// half the memory and less time. If the promise is broken, the image is wrong. softras tests the meshes of a scene itself.
    pub fn inside_planes(mut self) -> Self {
        self.inside_planes = true;
        self
    }

    /// The lights; the default is [`Lights::unlit`].
    pub fn lights(mut self, lights: Lights) -> Self {
        self.lights = lights;
        self
    }

    /// The gradients to compute; without this call there is no backward pass.
    pub fn gradients(mut self, wanted: GradientRequest) -> Self {
        self.wanted = Some(wanted);
        self
    }

    /// The images that the loss depends on; the default is all that are made.
    pub fn upstream(mut self, images: Outputs) -> Self {
        self.upstream = Some(images);
        self
    }

    /// An upper bound of |dL/dcolour| over all channels and pixels, for [`GradientRequest::texels`]; the default is 1. Their sums
    /// are in fixed point: a sum beyond the bound wraps around, and one far below it loses precision. Where textures have an
    /// alpha it also bounds |dL/dsilhouette|, |dL/dnormal|, |dL/ddepth| times the far plane, |dL/dcolour| times the largest
    /// texel and background, and Σ |dL/df| times the largest feature f.
    pub fn largest_upstream(mut self, bound: f64) -> Self {
        self.largest_upstream = bound;
        self
    }

    /// Room for lists. Only the time of a frame depends on it. The default is an estimate; [`PassStatus::Grow`] says
    /// what was needed.
    pub fn capacity(mut self, capacity: Capacity) -> Self {
        self.capacity = Some(capacity);
        self
    }

    /// Offsets are multiples of this power of two as well: what a host's own rules ask for (32 with wgpu).
    pub fn alignment(mut self, alignment: u64) -> Self {
        self.alignment = alignment;
        self
    }

    /// Usages that the host itself needs of one of the three buffers, besides those of softras.
    pub fn usage(mut self, kind: MemoryKind, usage: vk::BufferUsageFlags) -> Self {
        self.usages[kind as usize] |= usage;
        self
    }

    /// Buffers that the host makes and binds apart ([`PassMemory::own`](crate::embed::PassMemory::own)), for hosts that track whole
    /// buffers: wgpu refuses a kernel that reads `color` and writes `upstream_color` of one buffer.
    pub fn own_buffers(mut self, buffers: &[PassBuffer]) -> Self {
        self.own = buffers.to_vec();
        self
    }

    /// Outputs that are copied into the readback buffer, beside the status.
    pub fn read_back(mut self, buffers: &[PassBuffer]) -> Self {
        self.read_back = buffers.to_vec();
        self
    }

    /// Everything that [`Pass::decode_gradients`](crate::embed::Pass::decode_gradients) decodes is copied into the readback buffer.
    pub fn read_back_gradients(mut self) -> Self {
        self.read_back_gradients = true;
        self
    }

    /// The plan.
    ///
    /// # Errors
    /// [`Error::Camera`], [`Error::Settings`], [`Error::Light`], [`Error::Scene`] and [`Error::Mesh`] for what cannot be
    /// rendered, [`Error::Backward`] for gradients of no image, [`Error::Host`] for buffers that the plan does not
    /// have, [`Error::Limit`] for what this device cannot hold.
    pub fn build(mut self) -> Result<PassPlan> {
        if !self.alignment.is_power_of_two() {
            let what = format!("an alignment of {}", self.alignment);
            return Err(Error::Host { what, fix: "use a power of two".into() });
        }
        let size = (self.settings.width, self.settings.height);
        let cameras = self.views.iter().map(|view| view.camera(size)).collect::<Result<Vec<_>>>()?;
        let settings = self.resolved(&self.settings, cameras.iter().copied())?;
        let adjacency = settings.save || self.lights.shading == Shading::Smooth;
        let tables = match self.tables.take().filter(|made| made.adjacency == adjacency) {
            Some(made) => made,
            None => Arc::new(self.content.tables(adjacency)?),
        };
        self.tables = Some(tables.clone());
        let shape = self.shape(&tables, &cameras, &settings)?;
        self.plan(&shape, cameras, settings, tables)
    }

    /// The plan of a shape, with settings whose near and far are final.
    pub(crate) fn plan(
        self,
        shape: &FrameShape,
        cameras: Vec<ViewCamera>,
        settings: Settings,
        tables: Arc<Tables>,
    ) -> Result<PassPlan> {
        let frame = FramePlan::new(&self.limits, self.kind, shape, &settings, self.rare)?;
        let upstream = self.upstream.unwrap_or(settings.outputs);
        let differentiate = |wanted| Differentiate { upstream, wanted, largest_upstream: self.largest_upstream };
        let gradients = self.wanted.map(|wanted| GradientPlan::new(&frame, &differentiate(wanted))).transpose()?;
        let mut read_back: Vec<BufferId> = self.read_back.iter().map(|buffer| buffer.id()).collect();
        if let Some(gradients) = gradients.as_ref().filter(|_| self.read_back_gradients) {
            read_back.extend(decoded(gradients));
        }
        if self.apart.is_some() {
            read_back.extend(frame.buffers().iter().map(|b| b.id).filter(|id| id.row().role == Role::Output));
        }
        let wishes = Wishes { alignment: self.alignment, apart: self.apart, own: &self.own, read_back: &read_back };
        let added = gradients.as_ref().map_or(&[][..], GradientPlan::buffers);
        let setup = self.content.setup(&tables, &frame);
        let layouts = Layouts::new(frame.buffers(), added, (&tables, &setup), &wishes)?;
        Ok(PassPlan { builder: self, frame, gradients, settings, cameras, tables, layouts })
    }

    /// The settings that a frame is rendered with: those that the user gave, with near and far as [`planes`](Self::planes) says.
    pub(crate) fn resolved(&self, given: &Settings, cameras: impl Iterator<Item = ViewCamera>) -> Result<Settings> {
        let mut settings = given.clone();
        settings.save |= self.wanted.is_some();
        let Some([near, far]) = self.planes.or_else(|| cameras.filter_map(|view| view.planes()).reduce(widest)) else {
            return Ok(settings);
        };
        if near <= 0.0 {
            let fix =
                "move the viewer back behind what is drawn, or give PassBuilder::planes that begin in front of it";
            return Err(Error::Camera { field: "near plane", value: near.to_string(), fix: fix.into() });
        }
        settings.near = near;
        // If a plane is infinite, the settings' own is used.
        settings.far = if far <= 1e12 { far } else { settings.far };
        Ok(settings)
    }

    fn shape(&self, tables: &Tables, cameras: &[ViewCamera], settings: &Settings) -> Result<FrameShape> {
        let shape = match &self.content {
            Content::Scene(None) => {
                return Err(Error::Scene { what: "a pass of no scene".into(), fix: "give one".into() });
            }
            Content::Scene(Some(scene)) => {
                let cameras: Vec<Camera> = cameras.iter().map(|view| view.camera).collect();
                FrameShape::of(scene, &cameras, settings)?
            }
            Content::Meshes { .. } => FrameShape {
                meshes: tables.shapes.clone(),
                views: cameras.len() as u32,
                lights: Lights::unlit(),
                depth_span: DepthSpan { crosses_near: !self.inside_planes, crosses_far: !self.inside_planes },
                opacity: false,
                lenses: Lenses::of(cameras.iter().map(|view| &view.camera)),
                cutoff: cutoff_of(settings),
                capacity: None,
                device_counts: false,
            },
        };
        if self.device_counts && !self.content.is_drawn_once() {
            let what = "counts of meshes that share a view, or have several draws or instances".into();
            return Err(Error::Host { what, fix: "give each view one mesh of one draw".into() });
        }
        let (lights, capacity, device_counts) = (self.lights.clone(), self.capacity, self.device_counts);
        Ok(FrameShape { lights, capacity, device_counts, ..shape })
    }
}

/// The buffers that gradients are decoded from.
pub(crate) fn decoded(gradients: &GradientPlan) -> impl Iterator<Item = BufferId> {
    gradients.buffers().iter().map(|b| b.id).filter(|id| id.row().role == Role::Output)
}

impl Content {
    fn tables(&self, adjacency: bool) -> Result<Tables> {
        match self {
            Self::Scene(_) => Ok(Tables { adjacency, ..Tables::default() }),
            Self::Meshes { meshes, separate: true } => Tables::new(&meshes.chunks(1).collect::<Vec<_>>(), adjacency),
            Self::Meshes { meshes, separate: false } => Tables::new(&[&meshes[..]], adjacency),
        }
    }

    /// The copies of the setup: a buffer, where in it, and bytes.
    fn setup(&self, tables: &Tables, frame: &FramePlan) -> Vec<(BufferId, u64, u64)> {
        const OF_FRAME: [BufferId; 3] = [BufferId::ViewShapes, BufferId::ViewCameras, BufferId::Lights];
        match self {
            Self::Scene(_) => {
                let of_meshes = |b: &&BufferRequirement| b.id.row().role == Role::Input && !OF_FRAME.contains(&b.id);
                frame.buffers().iter().filter(of_meshes).map(|b| (b.id, 0, b.size)).collect()
            }
            Self::Meshes { .. } => tables.segments.iter().map(|s| (s.id, s.at, s.bytes.len() as u64)).collect(),
        }
    }

    /// Whether each view sees one mesh that is drawn once.
    fn is_drawn_once(&self) -> bool {
        match self {
            Self::Scene(_) => true,
            Self::Meshes { meshes, separate } => {
                let once = |mesh: &PassMesh| matches!(mesh.geometry.draws(), [draw] if draw.instances == 1);
                (*separate || meshes.len() == 1) && meshes.iter().all(once)
            }
        }
    }
}

impl PassView {
    /// The camera as softras renders with it, in images of this size.
    pub fn camera(&self, size: (u32, u32)) -> Result<ViewCamera> {
        match *self {
            Self::Camera(camera) => Ok(ViewCamera { camera, host: None }),
            Self::Matrices(matrices, clip) => {
                let host = HostCamera::new(&matrices, clip, size)?;
                Ok(ViewCamera { camera: *host.camera(), host: Some(host) })
            }
        }
    }
}

impl ViewCamera {
    /// Near and far of the matrices.
    pub fn planes(&self) -> Option<[f64; 2]> {
        self.host.map(|host| host.planes())
    }
}

/// The nearest near plane and the farthest far plane.
fn widest(planes: [f64; 2], more: [f64; 2]) -> [f64; 2] {
    [planes[0].min(more[0]), planes[1].max(more[1])]
}

/// The support that the settings promise, whatever the depths between near and far.
pub(crate) fn cutoff_of(settings: &Settings) -> f64 {
    let Outputs { color, depth, normal, features, .. } = settings.outputs;
    if settings.support == Support::Probability || !(color || depth || normal || features) {
        return settings.cutoff();
    }
    let (spread, tau) = match settings.background {
        Background::Weighted => ((1.0 - settings.epsilon).max(0.0), settings.tau),
        Background::Composite => (1.0, settings.tau / 2.0),
    };
    (1.0 / tau - 1.0).ln() + spread / settings.gamma
}

impl PassPlan {
    /// The upload, the device and the readback buffer that the pass needs.
    pub fn memory(&self) -> [MemoryRequirement; 3] {
        self.layouts.memory(self.builder.usages)
    }

    /// The requirements of the buffers that are left to the host ([`PassBuilder::own_buffers`]).
    pub fn own_buffers(&self) -> &[(PassBuffer, MemoryRequirement)] {
        &self.layouts.own
    }

    /// The builder of this plan, for a changed one: other meshes, more room.
    pub fn builder(&self) -> PassBuilder {
        // The lights may have changed since the pass was bound.
        PassBuilder { lights: self.frame.shape.lights.clone(), ..self.builder.clone() }
    }

    /// Width and height of its images.
    pub fn image_size(&self) -> (u32, u32) {
        self.frame.image_size()
    }

    /// Where a buffer that is read back lies in the readback buffer: offset and bytes. The status lies at 0.
    pub fn readback_part(&self, buffer: PassBuffer) -> Option<(u64, u64)> {
        self.part_read_back(buffer.id())
    }

    pub(crate) fn part_read_back(&self, id: BufferId) -> Option<(u64, u64)> {
        let mut copies = self.layouts.forward.iter().chain(&self.layouts.gradients.outputs);
        copies.find(|copy| copy.id == id).map(|copy| (copy.mapped, copy.size))
    }

    /// The part of the upload buffer that [`Pass::write_frame`](crate::embed::Pass::write_frame) writes, from its beginning: cameras and
    /// lights, in bytes. A host that does not wait for the frames in flight calls it with bytes of its own and records a copy of
    /// that many into the upload buffer, before [`record_forward`](crate::embed::Pass::record_forward).
    pub fn frame_bytes(&self) -> u64 {
        self.layouts.frame.iter().map(|copy| copy.mapped + copy.size).max().unwrap_or(0)
    }

    /// Whether it has gradients.
    pub fn has_gradients(&self) -> bool {
        self.gradients.is_some()
    }

    /// The cameras as the kernels read them.
    pub(crate) fn camera_inputs(&self) -> Vec<[[f32; 4]; c::CAMERA_TEXELS as usize]> {
        self.cameras.iter().map(|view| camera_texels(&view.camera, &self.settings)).collect()
    }

    /// The region of one view for vkCmdCopyBufferToImage, from a buffer with the layout of the pass's own buffer.
    ///
    /// | buffer | format of the image | texel |
    /// | --- | --- | --- |
    /// | `color` | R32G32B32A32_SFLOAT | linear r, g, b, silhouette |
    /// | `silhouette` | R32_SFLOAT | only if colour is not rendered |
    /// | `depths` | R32_SFLOAT | Σ w z in world units |
    /// | `normals` | R32G32B32A32_SFLOAT | Σ w n, world space, and 0 |
    ///
    /// Rows are packed, row 0 at the top. The host brings the image into the layout TRANSFER_DST_OPTIMAL or GENERAL.
    pub fn image_copy(&self, image: PassBuffer, view: u32, at: &BufferRef) -> Option<vk::BufferImageCopy> {
        let texel = match image {
            PassBuffer::Color | PassBuffer::Normals => 16,
            PassBuffer::Silhouette | PassBuffer::Depths => 4,
            _ => return None,
        };
        if self.frame.buffer(image.id()).is_none() || view >= self.frame.views() {
            return None;
        }
        let (width, height) = self.image_size();
        let subresource = vk::ImageSubresourceLayers::default()
            .aspect_mask(vk::ImageAspectFlags::COLOR)
            .mip_level(0)
            .base_array_layer(0)
            .layer_count(1);
        let copy = vk::BufferImageCopy::default()
            .buffer_offset(at.offset() + u64::from(view) * u64::from(width) * u64::from(height) * texel)
            .image_subresource(subresource)
            .image_extent(vk::Extent3D { width, height, depth: 1 });
        Some(copy)
    }

    /// The status of a frame of this plan, from the readback buffer's bytes.
    ///
    /// # Errors
    /// [`Error::Host`] for fewer bytes than a status has; [`Error::NotFinite`] where the device's arithmetic
    /// overflowed: the frame's images mean nothing.
    pub fn status(&self, readback: &[u8]) -> Result<PassStatus> {
        let Some(bytes) = readback.first_chunk() else {
            let what = format!("a readback buffer of {} bytes", readback.len());
            return Err(Error::Host { what, fix: "give the whole readback buffer's bytes".into() });
        };
        let next = Status::from_bytes(bytes).next(&self.frame)?;
        Ok(if next.capacity == self.frame.capacity { PassStatus::Whole } else { PassStatus::Grow(next.capacity) })
    }

    /// A plan with more room, for the frames to come to be faster, where [`status`](Self::status) says that the lists of a frame
    /// had too little; `None` where they had room, or cannot have more on this device. A host that binds each plan that it gets so
    /// comes to an end: the room of lists has a limit, and each plan has more than the one before.
    ///
    /// # Errors
    /// As [`status`](Self::status) and [`PassBuilder::build`].
    pub fn next_plan(&self, readback: &[u8]) -> Result<Option<Self>> {
        match self.status(readback)? {
            PassStatus::Whole => Ok(None),
            PassStatus::Grow(capacity) => self.with_room(capacity, self.builder.rare).map(Some),
        }
    }

    /// The plan with other room for lists and other kernels.
    pub(crate) fn with_room(&self, capacity: Capacity, rare: Rare) -> Result<Self> {
        let builder = PassBuilder { capacity: Some(capacity), rare, ..self.builder() };
        let shape = FrameShape { capacity: Some(capacity), ..self.frame.shape.clone() };
        builder.plan(&shape, self.cameras.clone(), self.settings.clone(), self.tables.clone())
    }
}

/// The outcome of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PassStatus {
    /// Its images and gradients are valid, and its lists had room.
    Whole,
    /// Its images and gradients are valid, but some of its lists had no room, so that it took longer. A plan with this
    /// [`capacity`](PassBuilder::capacity) is faster: [`PassPlan::next_plan`] makes it, [`rebind`](crate::embed::Pass::rebind) binds it.
    Grow(Capacity),
}

impl PassStatus {
    /// Where in the `status` buffer the word lies that tells the device itself, a 32-bit unsigned integer: 1 once
    /// [`Pass::record_backward`](crate::embed::Pass::record_backward) has found every vertex of the frame to be finite, else 0. Every
    /// gradient of a frame with 0 is zero; an optimiser on the device that has momentum should step only where the word is 1.
    pub const WHOLE_OFFSET: u64 = 4 * crate::constants::STATUS_WHOLE as u64;
}
