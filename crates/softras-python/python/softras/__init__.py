"""softras: a differentiable soft mesh rasterizer (Liu et al., "Soft Rasterizer", ICCV 2019) on any Vulkan device.

`softras.Renderer` renders meshes to numpy arrays and differentiates a loss on these images. `softras.torch` does so within
torch's autograd, `softras.jax` within JAX's transformations, and `softras.soft_renderer` has the official package's interface.
World space is right-handed with y up, row 0 of an image is its top, colours are linear, and the same call gives the same bits.
"""

from __future__ import annotations

from . import errors, reference, shapes
from ._softras import (
    Camera,
    Frame,
    Gradients,
    Mesh,
    MeshGradients,
    Renderer,
    blurred_mask,
    iou,
    is_closed,
    load,
    mask_iou,
    remesh,
    voxelize,
)
from .errors import Error
from .fitting import FitResult, Pose, deform, fit, pose
from .rendering import Check, Device, Fragments, backward, check, default_renderer, devices, fragments, render
from .settings import DirectionalLight, Lights, Settings
from .views import Fitted, Picture, Views, load_views, view

__version__ = "0.1.0"

__all__ = [
    "Camera",
    "Check",
    "Device",
    "DirectionalLight",
    "Error",
    "FitResult",
    "Fitted",
    "Fragments",
    "Frame",
    "Gradients",
    "Lights",
    "Mesh",
    "MeshGradients",
    "Picture",
    "Pose",
    "Renderer",
    "Settings",
    "Views",
    "backward",
    "blurred_mask",
    "check",
    "deform",
    "default_renderer",
    "devices",
    "errors",
    "fit",
    "fragments",
    "iou",
    "is_closed",
    "load",
    "load_views",
    "mask_iou",
    "pose",
    "reference",
    "remesh",
    "render",
    "shapes",
    "view",
    "voxelize",
]
