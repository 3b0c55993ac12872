//! The extension module `softras._softras`: meshes, cameras, renderers and fits on numpy arrays.
//!
//! Each class wraps one type of the library. What Python does as well (settings and lights as data classes, exceptions, torch)
//! is written in Python, in `python/softras`.

mod arrays;
mod camera;
mod exceptions;
mod fit;
mod frame;
mod gradients;
mod measure;
mod mesh;
mod pose;
mod reference;
mod renderer;
mod settings;
mod solid;
mod steps;
mod view;
mod views;

use pyo3::prelude::*;

#[pymodule]
mod _softras {
    #[pymodule_export]
    use super::camera::Camera;
    #[pymodule_export]
    use super::fit::fit;
    #[pymodule_export]
    use super::frame::Frame;
    #[pymodule_export]
    use super::gradients::{Gradients, MeshGradients};
    #[pymodule_export]
    use super::measure::{blurred_mask, depths_of, iou, is_closed, mask_iou, remesh, voxelize};
    #[pymodule_export]
    use super::mesh::{Mesh, load, shape};
    #[pymodule_export]
    use super::pose::pose;
    #[pymodule_export]
    use super::reference::{reference_gradient, reference_render};
    #[pymodule_export]
    use super::renderer::Renderer;
    #[pymodule_export]
    use super::solid::solid_voxels;
    #[pymodule_export]
    use super::steps::time_steps;
    #[pymodule_export]
    use super::view::{png, save_pictures, view};
    #[pymodule_export]
    use super::views::{fit_views, load_views};
}
