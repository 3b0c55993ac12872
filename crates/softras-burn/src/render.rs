//! Tensors into images: what is rendered, from which tensors, and the gradients back.

use crate::rendered::{Rendered, Role, Shared, lock};
use crate::{op, twist};
use burn::tensor::{Device, Tensor, TensorData};
use softras::scene::{Appearance, Outputs};
use softras::{Camera, Error, Renderer, Result, Scene, Settings};
use std::sync::{Arc, Mutex};

/// A renderer for burn's tensors. Clones share the device.
#[derive(Clone, Debug)]
pub struct SoftRas(Arc<Shared>);

/// The scene, the cameras and the settings to render; [`Inputs`] has the tensors.
#[derive(Clone, Debug)]
pub struct Views {
    /// Meshes and lights. Where [`Inputs`] has a tensor, its values take the place of the scene's.
    pub scene: Scene,
    /// As for [`Renderer::render`]: one mesh with any number of cameras, or one camera for each mesh.
    pub cameras: Vec<Camera>,
    /// Which images, how large and how soft.
    pub settings: Settings,
}

/// The tensors to render, and to differentiate by; rows follow one another in the order of the meshes, which may differ in
/// size. An input that is `None` is taken from the scene. At least one is needed.
#[derive(Clone, Debug, Default)]
pub struct Inputs {
    /// Vertex positions `[all vertices, 3]`, world units.
    pub positions: Option<Tensor<2>>,
    /// Vertex colours `[all colours, 3]`: one for each vertex of a mesh with vertex colours, one for a mesh of one colour.
    pub colors: Option<Tensor<2>>,
    /// Cells of surface textures `[all cells, 3]`.
    pub texels: Option<Tensor<2>>,
    /// Motions of the cameras `[views, 6]`: with ξ = (v, ω) a view transform V becomes exp(ξ) V, so that points in view
    /// space move by ω × p + v to first order. Zeros are the cameras themselves.
    pub cameras: Option<Tensor<2>>,
}

/// The images that the settings ask for, one batch entry for each view.
#[derive(Clone, Debug)]
pub struct Images {
    /// `[views, height, width, 3]`.
    pub color: Option<Tensor<4>>,
    /// `[views, height, width]`.
    pub silhouette: Option<Tensor<3>>,
    /// `[views, height, width]`.
    pub depth: Option<Tensor<3>>,
    /// `[views, height, width, 3]`.
    pub normal: Option<Tensor<4>>,
    /// `[views, height, width, channels]`. The meshes' features are constants.
    pub features: Option<Tensor<4>>,
}

/// How many rows of an input the views have.
fn rows(role: Role, views: &Views) -> usize {
    match role {
        Role::Cameras => views.cameras.len(),
        _ => views.scene.meshes.iter().map(|mesh| role.rows_of(mesh)).sum(),
    }
}

fn bad<T>(what: String, fix: &str) -> Result<T> {
    Err(Error::Scene { what, fix: fix.into() })
}

/// The positions of a scene's meshes as [`Inputs::positions`] takes them.
pub fn packed_positions(scene: &Scene, device: &Device) -> Tensor<2> {
    let all: Vec<f32> = scene.meshes.iter().flat_map(|mesh| mesh.positions().as_flattened().to_vec()).collect();
    let rows = all.len() / 3;
    Tensor::from_data(TensorData::new(all, [rows, 3]), device)
}

impl SoftRas {
    /// Takes a renderer over.
    pub fn new(renderer: Renderer) -> Self {
        Self(Arc::new(Shared { renderer: Mutex::new(renderer), fault: Mutex::new(None) }))
    }

    /// Renders the views, with the tensors in place of what the scene has, as a node of burn's graph if any of them is tracked.
    /// The images and gradients are those of [`Renderer::render`] and [`Renderer::backward`] to the bit.
    ///
    /// Each node keeps device memory of its own while it lives. Views that one step needs are fastest in one call.
    ///
    /// # Errors
    /// [`Error::Scene`] for a tensor of another shape than the scene needs, or without any tensor; otherwise as
    /// [`Renderer::render`].
    pub fn render(&self, views: &Views, inputs: &Inputs) -> Result<Images> {
        let given = [&inputs.positions, &inputs.colors, &inputs.texels, &inputs.cameras];
        let Some(device) = given.iter().find_map(|tensor| tensor.as_ref().map(Tensor::device)) else {
            return bad(
                "no input tensor".into(),
                "give positions, colors, texels or cameras, or use softras::Renderer",
            );
        };
        let mut values: [Option<Vec<f32>>; 4] = [const { None }; 4];
        for ((value, tensor), role) in values.iter_mut().zip(given).zip(Role::ALL) {
            *value = tensor.as_ref().map(|tensor| host_values(tensor, role, views)).transpose()?;
        }
        let settings = Settings { save: true, ..views.settings.clone() };
        let scene = with_values(&views.scene, &values)?;
        let twists = values[3].as_deref().map(twists_of);
        let cameras = moved(&views.cameras, twists.as_deref())?;
        let frame = lock(&self.0.renderer).render(&scene, &cameras, &settings)?;
        let rows = Role::ALL.map(|role| rows(role, views));
        let rendered = Rendered { shared: self.0.clone(), frame, rows, twists };
        let absent = |tensor: &Option<Tensor<2>>| tensor.clone().unwrap_or_else(|| Tensor::zeros([1, 1], &device));
        Ok(unpacked(op::images(given.map(absent), rendered), settings.outputs))
    }

    /// The first error of the backward passes since the last call. burn's `backward` cannot return one: after an error the
    /// gradients of that node are NaN.
    ///
    /// # Errors
    /// As [`Renderer::backward`].
    pub fn take_fault(&self) -> Result<()> {
        lock(&self.0.fault).take().map_or(Ok(()), Err)
    }
}

/// The values of an input, one for each that the scene has.
fn host_values(tensor: &Tensor<2>, role: Role, views: &Views) -> Result<Vec<f32>> {
    let (shape, expected) = (tensor.dims(), [rows(role, views), role.columns()]);
    if shape != expected {
        let what = format!("{} of shape {shape:?}, the scene has {expected:?}", role.name());
        return bad(what, "pack the rows of all meshes after one another, in the order of the meshes");
    }
    let read = |error: &dyn std::fmt::Display| Error::Scene {
        what: format!("{} cannot be read ({error})", role.name()),
        fix: "give tensors of 32-bit floats on a device that works".into(),
    };
    tensor.clone().try_into_vec_as::<f32>().map_err(|e| read(&e))
}

fn with_values(scene: &Scene, values: &[Option<Vec<f32>>; 4]) -> Result<Scene> {
    let mut rest = [0, 1, 2].map(|i| values[i].as_deref().map(|values| values.as_chunks::<3>().0));
    let mut meshes = Vec::with_capacity(scene.meshes.len());
    for mesh in &scene.meshes {
        let [positions, colors, texels] = [0, 1, 2].map(|i| {
            let (now, later) = rest[i]?.split_at_checked(Role::ALL[i].rows_of(mesh))?;
            rest[i] = Some(later);
            Some(now.to_vec())
        });
        let appearance = match (mesh.appearance(), colors, texels) {
            (Appearance::Uniform(_), Some(colors), _) => colors.first().copied().map(Appearance::Uniform),
            (Appearance::VertexColors(_), Some(colors), _) => Some(Appearance::VertexColors(colors)),
            (&Appearance::Surface { resolution, .. }, _, Some(texels)) => {
                Some(Appearance::Surface { resolution, texels })
            }
            _ => None,
        };
        let mut mesh = mesh.clone();
        if let Some(positions) = positions {
            mesh.set_positions(positions)?;
        }
        meshes.push(match appearance {
            Some(appearance) => mesh.with_appearance(appearance)?,
            None => mesh,
        });
    }
    Ok(Scene { meshes, lights: scene.lights.clone() })
}

fn twists_of(values: &[f32]) -> Vec<[f64; 6]> {
    values.as_chunks::<6>().0.iter().map(|twist| twist.map(f64::from)).collect()
}

fn moved(cameras: &[Camera], twists: Option<&[[f64; 6]]>) -> Result<Vec<Camera>> {
    let Some(twists) = twists else { return Ok(cameras.to_vec()) };
    let one = |(camera, &twist): (&Camera, &[f64; 6])| {
        // The last row of a product of rigid motions is (0, 0, 0, 1) exactly: its terms are zeros and ones.
        Camera::from_affine(twist::exponential(twist) * camera.matrix(), *camera.projection())
    };
    cameras.iter().zip(twists).map(one).collect()
}

/// Takes the images of a frame apart, which are packed in the order of the settings' fields.
fn unpacked(packed: Tensor<4>, outputs: Outputs) -> Images {
    let [views, height, width, all] = packed.dims();
    let channels = [(outputs.color, 3), (outputs.silhouette, 1), (outputs.depth, 1), (outputs.normal, 3)];
    let others: usize = channels.iter().filter(|(rendered, _)| *rendered).map(|(_, channels)| channels).sum();
    let features = outputs.features.then(|| packed.clone().narrow(3, others, all - others));
    let mut from = 0;
    let [color, silhouette, depth, normal] = channels.map(|(rendered, channels)| {
        rendered.then(|| {
            from += channels;
            packed.clone().narrow(3, from - channels, channels)
        })
    });
    let flat = |image: Tensor<4>| image.reshape([views, height, width]);
    Images { color, silhouette: silhouette.map(flat), depth: depth.map(flat), normal, features }
}
