"""Light, camera and rasterizer in one module."""

from __future__ import annotations

import inspect
from typing import Any, Optional

import torch
from torch import nn

from .kinds import Array, Number, Size, Vector
from .lighting import Lighting
from .mesh import Mesh
from .rasterizer import Rasterizer, SoftRasterizer
from .transform import Transform


class SoftRenderer(nn.Module):
    """Meshes to images [batch, 4, size, size]: red, green, blue and alpha."""

    def __init__(
        self,
        image_size: Size = 256,
        background_color: Vector = (0, 0, 0),
        near: Number = 1,
        far: Number = 100,
        anti_aliasing: bool = False,
        fill_back: bool = True,
        eps: Number = 1e-3,
        sigma_val: Number = 1e-5,
        dist_func: str = "euclidean",
        dist_eps: Number = 1e-4,
        gamma_val: Number = 1e-4,
        aggr_func_rgb: str = "softmax",
        aggr_func_alpha: str = "prod",
        texture_type: str = "surface",
        camera_mode: str = "projection",
        P: Optional[Array] = None,
        dist_coeffs: Optional[Array] = None,
        orig_size: Number = 512,
        perspective: bool = True,
        viewing_angle: Number = 30,
        viewing_scale: Number = 1.0,
        eye: Optional[Vector] = None,
        camera_direction: Vector = (0, 0, 1),
        light_mode: str = "surface",
        light_intensity_ambient: Number = 0.5,
        light_color_ambient: Vector = (1, 1, 1),
        light_intensity_directionals: Number = 0.5,
        light_color_directionals: Vector = (1, 1, 1),
        light_directions: Vector = (0, 1, 0),
        exact_gradients: bool = False,
        image_height: Optional[int] = None,
        image_width: Optional[int] = None,
    ) -> None:
        named = dict(locals())
        super().__init__()
        ambient, directional = (light_intensity_ambient, light_color_ambient), (light_intensity_directionals, light_color_directionals)
        self.lighting = Lighting(light_mode, *ambient, *directional, light_directions)
        self.transform = Transform(
            camera_mode, P, dist_coeffs, orig_size, perspective, viewing_angle, viewing_scale, eye, camera_direction
        )
        self.rasterizer = SoftRasterizer(**{name: named[name] for name in inspect.signature(SoftRasterizer).parameters})

    def set_sigma(self, sigma: Number) -> None:
        """Sets the softness of edges."""
        self.rasterizer.sigma_val = sigma

    def set_gamma(self, gamma: Number) -> None:
        """Sets the softness of the depth order."""
        self.rasterizer.gamma_val = gamma

    def set_texture_mode(self, mode: str) -> None:
        """Sets "surface" or "vertex" for light and textures."""
        if mode not in ("surface", "vertex"):
            raise ValueError(f"the texture mode is {mode!r}: use surface or vertex")
        self.lighting.light_mode = self.rasterizer.texture_type = mode

    def render_mesh(self, mesh: Mesh, mode: Any = None) -> torch.Tensor:
        """Renders a mesh, whose textures and vertices are then lit and on the screen; `Mesh.reset_` takes that back."""
        self.set_texture_mode(mesh.texture_type)
        return self.rasterizer(self.transform(self.lighting(mesh)), mode)

    def forward(
        self, vertices: torch.Tensor, faces: torch.Tensor, textures: Optional[torch.Tensor] = None, mode: Any = None,
        texture_type: str = "surface"
    ) -> Any:
        return self.render_mesh(Mesh(vertices, faces, textures=textures, texture_type=texture_type), mode)


class Renderer(SoftRenderer):
    """As `SoftRenderer`, with the hard rasterizer and four samples a pixel. It has no gradient by vertices but through depth.

    The official package has the class but cannot construct it, since it has no `Rasterizer`.
    """

    def __init__(
        self, image_size: Size = 256, background_color: Vector = (0, 0, 0), near: Number = 1, far: Number = 100,
        anti_aliasing: bool = True, fill_back: bool = True, eps: Number = 1e-6, **rest
    ) -> None:
        super().__init__(image_size, background_color, near, far, anti_aliasing, fill_back, eps, **rest)
        self.rasterizer = Rasterizer(image_size, background_color, near, far, anti_aliasing, fill_back, eps)

    def forward(self, mesh: Mesh, mode: Any = None) -> Any:
        return self.render_mesh(mesh, mode)
