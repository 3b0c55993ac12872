//! Renders images and their gradient on a device or by the f64 reference.

use crate::commands::open_device;
use softras::scene::Outputs;
use softras::{Camera, Error, GradientMode, GradientRequest, Image, ImageGradient, Renderer, Result, Scene, Settings};
use softras_check::gradients;

/// The renderer to use.
pub enum Engine {
    /// The f64 reference.
    Reference,
    /// A Vulkan device.
    Device(Box<Renderer>),
}

/// The images of one view; empty if not requested.
pub struct Images {
    /// `[H, W, 3]`.
    pub color: Vec<f64>,
    /// `[H, W]`.
    pub silhouette: Vec<f64>,
    /// `[H, W]`.
    pub depth: Vec<f64>,
}

impl Engine {
    /// Opens the renderer that `--device` names.
    pub fn open(device: Option<&str>) -> Result<Self> {
        Ok(match device {
            Some("reference") => Self::Reference,
            device => Self::Device(Box::new(open_device(device, None)?)),
        })
    }

    /// The device's name.
    pub fn name(&self) -> &str {
        match self {
            Self::Reference => "reference",
            Self::Device(renderer) => renderer.device_name(),
        }
    }

    /// Depth and silhouette of one view.
    pub fn depth(&mut self, scene: &Scene, camera: Camera, settings: &Settings) -> Result<Images> {
        let outputs = Outputs { silhouette: true, depth: true, ..Outputs::NOTHING };
        let settings = Settings { outputs, save: false, ..settings.clone() };
        match self {
            Self::Reference => Ok(of_reference(softras_reference::render_culled(scene, &[camera], &settings)?)),
            Self::Device(renderer) => Ok(of_device(&renderer.render(scene, &[camera], &settings)?)),
        }
    }

    /// Renders colour and silhouette of one view and differentiates a loss of them by the vertices; `loss` returns its
    /// derivatives by the images.
    pub fn differentiate(
        &mut self,
        scene: &Scene,
        camera: Camera,
        settings: &Settings,
        mode: GradientMode,
        loss: impl FnOnce(&Images) -> Result<ImageGradient, Error>,
    ) -> Result<(Images, Vec<f64>)> {
        let outputs = Outputs { color: true, silhouette: true, ..Outputs::NOTHING };
        let settings = Settings { outputs, save: true, ..settings.clone() };
        match self {
            Self::Reference => {
                let images = of_reference(softras_reference::render_culled(scene, &[camera], &settings)?);
                let upstream = gradients::upstream(&loss(&images)?);
                let gradient = softras_reference::gradient(scene, &[camera], &settings, &upstream, mode)?;
                Ok((images, gradient.positions(0).to_vec()))
            }
            Self::Device(renderer) => {
                let frame = renderer.render(scene, &[camera], &settings)?;
                let images = of_device(&frame);
                let wanted = GradientRequest { positions: true, mode, ..GradientRequest::NOTHING };
                let gradient = renderer.backward(&frame, &loss(&images)?, &wanted)?;
                let positions = gradient.meshes.iter().flat_map(|mesh| mesh.positions.as_flattened());
                Ok((images, positions.map(|&x| x.into()).collect()))
            }
        }
    }
}

fn of_reference(frame: softras_reference::ReferenceFrame) -> Images {
    Images { color: frame.color, silhouette: frame.silhouette, depth: frame.depth }
}

fn of_device(frame: &softras::Frame) -> Images {
    let exact =
        |image: softras::Result<&Image>| image.map_or(Vec::new(), |i| i.data.iter().copied().map(f64::from).collect());
    Images { color: exact(frame.color()), silhouette: exact(frame.silhouette()), depth: exact(frame.depth()) }
}
