"""Light, camera and rasterizer in one module."""

from __future__ import annotations

from typing import Any

import torch
from torch import nn

from .lighting import Lighting
from .mesh import Mesh
from .rasterizer import Rasterizer, SoftRasterizer
from .transform import Transform


class SoftRenderer(nn.Module):
    """Meshes to images [batch, 4, size, size]: red, green, blue and alpha."""

    def __init__(
        self,
        image_size=256,
        background_color=(0, 0, 0),
        near=1,
        far=100,
        anti_aliasing=False,
        fill_back=True,
        eps=1e-3,
        sigma_val=1e-5,
        dist_func="euclidean",
        dist_eps=1e-4,
        gamma_val=1e-4,
        aggr_func_rgb="softmax",
        aggr_func_alpha="prod",
        texture_type="surface",
        camera_mode="projection",
        P=None,
        dist_coeffs=None,
        orig_size=512,
        perspective=True,
        viewing_angle=30,
        viewing_scale=1.0,
        eye=None,
        camera_direction=(0, 0, 1),
        light_mode="surface",
        light_intensity_ambient=0.5,
        light_color_ambient=(1, 1, 1),
        light_intensity_directionals=0.5,
        light_color_directionals=(1, 1, 1),
        light_directions=(0, 1, 0),
        exact_gradients=False,
        image_height=None,
        image_width=None,
    ) -> None:
        super().__init__()
        self.lighting = Lighting(
            light_mode,
            light_intensity_ambient,
            light_color_ambient,
            light_intensity_directionals,
            light_color_directionals,
            light_directions,
        )
        self.transform = Transform(
            camera_mode, P, dist_coeffs, orig_size, perspective, viewing_angle, viewing_scale, eye, camera_direction
        )
        self.rasterizer = SoftRasterizer(
            image_size,
            background_color,
            near,
            far,
            anti_aliasing,
            fill_back,
            eps,
            sigma_val,
            dist_func,
            dist_eps,
            gamma_val,
            aggr_func_rgb,
            aggr_func_alpha,
            texture_type,
            exact_gradients,
            image_height,
            image_width,
        )

    def set_sigma(self, sigma) -> None:
        """Sets the softness of edges."""
        self.rasterizer.sigma_val = sigma

    def set_gamma(self, gamma) -> None:
        """Sets the softness of the depth order."""
        self.rasterizer.gamma_val = gamma

    def set_texture_mode(self, mode) -> None:
        """Sets "surface" or "vertex" for light and textures."""
        if mode not in ("surface", "vertex"):
            raise ValueError(f"the texture mode is {mode!r}: use surface or vertex")
        self.lighting.light_mode = self.rasterizer.texture_type = mode

    def render_mesh(self, mesh, mode=None) -> torch.Tensor:
        """Renders a mesh, whose textures and vertices are then lit and on the screen; `Mesh.reset_` takes that back."""
        self.set_texture_mode(mesh.texture_type)
        return self.rasterizer(self.transform(self.lighting(mesh)), mode)

    def forward(self, vertices, faces, textures=None, mode=None, texture_type="surface") -> Any:
        return self.render_mesh(Mesh(vertices, faces, textures=textures, texture_type=texture_type), mode)


class Renderer(SoftRenderer):
    """As `SoftRenderer`, with the hard rasterizer and four samples a pixel. It has no gradient by vertices but through depth.

    The official package names it and cannot make it, since it has no `Rasterizer`.
    """

    def __init__(
        self, image_size=256, background_color=(0, 0, 0), near=1, far=100, anti_aliasing=True, fill_back=True, eps=1e-6, **rest
    ) -> None:
        super().__init__(image_size, background_color, near, far, anti_aliasing, fill_back, eps, **rest)
        self.rasterizer = Rasterizer(image_size, background_color, near, far, anti_aliasing, fill_back, eps)

    def forward(self, mesh, mode=None) -> Any:
        return self.render_mesh(mesh, mode)
