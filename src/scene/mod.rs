//! Meshes, cameras, lights and settings as plain data, validated when they are made or rendered.

mod camera;
mod crop;
mod light;
mod mesh;
mod settings;
mod support;
mod texture;

pub(crate) use camera::validate_rotation;
pub use camera::{Camera, Projection};
pub use light::{DirectionalLight, Lights, Shading};
pub(crate) use mesh::first_not_finite;
pub use mesh::{Appearance, Mesh};
pub use settings::{
    Background, ColorAggregation, Distance, Faces, FrontFace, Interpolation, Outputs, Parity, Settings,
    SilhouetteAggregation, Support, SurfacePoint,
};
pub use texture::{Texture, Wrap};

use crate::error::{Error, Result};

/// One or several meshes under one set of lights.
///
/// With one mesh every camera sees that mesh; with several there is one camera per mesh. A batch's images come
/// back in the cameras' order.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The meshes; they may differ in size and appearance.
    pub meshes: Vec<Mesh>,
    /// The lights, shared by all meshes.
    pub lights: Lights,
}

impl Scene {
    /// A scene of one mesh, unlit: colours are shown as they are.
    pub fn new(mesh: Mesh) -> Self {
        Self { meshes: vec![mesh], lights: Lights::unlit() }
    }

    /// A batch of meshes, unlit, each to be seen by its own camera.
    pub fn batch(meshes: Vec<Mesh>) -> Self {
        Self { meshes, lights: Lights::unlit() }
    }

    /// Puts the meshes under these lights.
    pub fn with_lights(mut self, lights: Lights) -> Self {
        self.lights = lights;
        self
    }

    /// Index of the mesh that the camera at `view` sees.
    pub fn mesh_of_view(&self, view: usize) -> usize {
        if self.meshes.len() == 1 { 0 } else { view }
    }

    /// Checks the numbers of meshes and cameras, and the lights.
    ///
    /// # Errors
    /// [`Error::Scene`] without a mesh or a camera, or for several meshes and another number of cameras;
    /// [`Error::Light`] for a light out of range.
    pub fn validate(&self, cameras: &[Camera]) -> Result<()> {
        let (m, c) = (self.meshes.len(), cameras.len());
        if m == 0 || c == 0 {
            return Err(Error::Scene {
                what: format!("{m} meshes and {c} cameras"),
                fix: "a frame needs at least one of each (a mesh may have no triangles)".into(),
            });
        }
        if m != 1 && m != c {
            return Err(Error::Scene {
                what: format!("{m} meshes but {c} cameras"),
                fix: "give one mesh with any number of cameras, or one camera per mesh".into(),
            });
        }
        self.lights.validate()
    }
}
