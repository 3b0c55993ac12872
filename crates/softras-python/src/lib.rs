//! The extension module `softras._softras`: meshes, cameras, renderers and fits on numpy arrays.
//!
//! Each class wraps one type of the library. Parts that Python does as well (settings and lights as data classes, exceptions, torch)
//! are written in Python, in `python/softras`.

mod arrays;
mod camera;
mod cells;
mod exceptions;
mod fit;
mod frame;
mod gradients;
mod measure;
mod mesh;
mod opened;
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
    use super::{
        camera::Camera,
        cells::surface_cells,
        fit::fit,
        frame::Frame,
        gradients::{Gradients, MeshGradients},
        measure::{blurred_mask, check, depths_of, iou, is_closed, mask_iou, regularizer, remesh, voxelize},
        mesh::{Mesh, load, shape},
        pose::pose,
        reference::{reference_gradient, reference_render, strongest},
        renderer::{Renderer, devices},
        solid::solid_voxels,
        steps::time_steps,
        view::{png, save_exr, save_pictures, view},
        views::{fit_views, load_views},
    };
}
