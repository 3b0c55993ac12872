"""The rasterizer as a module."""

from __future__ import annotations

from typing import Any, Optional

import torch
import torch.nn.functional as F
from torch import nn

from . import functional as srf
from .functional.rasterize import OPTIONS, rasterized
from .kinds import Number, Size, Vector
from .mesh import Mesh


class SoftRasterizer(nn.Module):
    """A mesh on the screen to images [batch, 4, size, size]; see `functional.soft_rasterize`.

    `image_height` and `image_width` stand in for `image_size`.

    With `returns_info` it returns (images, p2f_info, aggrs_info), as the fork of UMR; see `functional.rasterize_info`.
    """

    #: Set it on the class for all rasterizers, or on one of them.
    returns_info = False
    #: Whether a program has read the colours of the last images.
    colors_are_read = False

    def __init__(
        self,
        image_size: Size = 256,
        background_color: Vector = (0, 0, 0),
        near: Number = 1,
        far: Number = 100,
        anti_aliasing: bool = False,
        fill_back: bool = False,
        eps: Number = 1e-3,
        sigma_val: Number = 1e-5,
        dist_func: str = "euclidean",
        dist_eps: Number = 1e-4,
        gamma_val: Number = 1e-4,
        aggr_func_rgb: str = "softmax",
        aggr_func_alpha: str = "prod",
        texture_type: str = "surface",
        exact_gradients: bool = False,
        image_height: Optional[int] = None,
        image_width: Optional[int] = None,
    ) -> None:
        super().__init__()
        choices = [
            ("dist_func", dist_func, ("hard", "euclidean", "barycentric")),
            ("aggr_func_rgb", aggr_func_rgb, ("hard", "softmax")),
            ("aggr_func_alpha", aggr_func_alpha, ("hard", "prod", "sum")),
            ("texture_type", texture_type, ("surface", "vertex")),
        ]
        for name, value, among in choices:
            if value not in among:
                raise ValueError(f"{name} is {value!r}: use {', '.join(among)}")
        self.image_size, self.background_color = image_size, background_color
        self.image_height, self.image_width = image_height, image_width
        self.near, self.far = near, far
        self.anti_aliasing, self.fill_back, self.eps = anti_aliasing, fill_back, eps
        self.sigma_val, self.dist_func, self.dist_eps = sigma_val, dist_func, dist_eps
        self.gamma_val, self.aggr_func_rgb, self.aggr_func_alpha = gamma_val, aggr_func_rgb, aggr_func_alpha
        self.texture_type, self.exact_gradients = texture_type, exact_gradients

    def _sides(self) -> tuple:
        return self.image_height or self.image_size, self.image_width or self.image_size

    def forward(self, mesh: Mesh, mode: Any = None) -> Any:
        images = rasterized(
            mesh.vertices,
            mesh.faces,
            mesh.textures,
            self.texture_type,
            tuple(side * (2 if self.anti_aliasing else 1) for side in self._sides()),
            {name: getattr(self, name) for name in OPTIONS},
            self.exact_gradients,
            # Neither compiled code nor `torch.func` takes images that are not plain tensors.
            None if torch.compiler.is_compiling() or torch._C._are_functorch_transforms_active() else self,
        )
        images = F.avg_pool2d(images, kernel_size=2, stride=2) if self.anti_aliasing else images
        return (images, *self._info(mesh)) if self.returns_info else images

    def _info(self, mesh: Mesh) -> tuple:
        weights = {"eps": self.eps, "sigma_val": self.sigma_val, "dist_func": self.dist_func, "dist_eps": self.dist_eps}
        weights["gamma_val"] = self.gamma_val
        given = weights if self.aggr_func_rgb == "softmax" else None
        return srf.rasterize_info(mesh.face_vertices, self._sides(), self.near, self.far, self.fill_back, given)


class Rasterizer(SoftRasterizer):
    """The hard rasterizer that the official `Renderer` asks for, which the official package lacks: hard colour and alpha."""

    def __init__(
        self,
        image_size: Size = 256,
        background_color: Vector = (0, 0, 0),
        near: Number = 1,
        far: Number = 100,
        anti_aliasing: bool = True,
        fill_back: bool = True,
        eps: Number = 1e-6,
        texture_type: str = "surface",
    ) -> None:
        hard = dict.fromkeys(("dist_func", "aggr_func_rgb", "aggr_func_alpha"), "hard")
        super().__init__(image_size, background_color, near, far, anti_aliasing, fill_back, eps, texture_type=texture_type, **hard)
