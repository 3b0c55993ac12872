"""Lights as modules, which multiply a mesh's textures."""

from __future__ import annotations

import torch
from torch import nn

from . import functional as srf
from .kinds import Number, Vector
from .mesh import Mesh


class AmbientLighting(nn.Module):
    """Light from everywhere."""

    def __init__(self, light_intensity: Number = 0.5, light_color: Vector = (1, 1, 1)) -> None:
        super().__init__()
        self.light_intensity, self.light_color = light_intensity, light_color

    def forward(self, light: torch.Tensor) -> torch.Tensor:
        return srf.ambient_lighting(light, self.light_intensity, self.light_color)


class DirectionalLighting(nn.Module):
    """Light from one direction."""

    def __init__(self, light_intensity: Number = 0.5, light_color: Vector = (1, 1, 1), light_direction: Vector = (0, 1, 0)) -> None:
        super().__init__()
        self.light_intensity, self.light_color, self.light_direction = light_intensity, light_color, light_direction

    def forward(self, light: torch.Tensor, normals: torch.Tensor) -> torch.Tensor:
        return srf.directional_lighting(light, normals, self.light_intensity, self.light_color, self.light_direction)


class Lighting(nn.Module):
    """An ambient light and directional ones, at faces ("surface") or at vertices."""

    def __init__(
        self,
        light_mode: str = "surface",
        intensity_ambient: Number = 0.5,
        color_ambient: Vector = (1, 1, 1),
        intensity_directionals: Number = 0.5,
        color_directionals: Vector = (1, 1, 1),
        directions: Vector = (0, 1, 0),
    ) -> None:
        super().__init__()
        if light_mode not in ("surface", "vertex"):
            raise ValueError(f"light_mode is {light_mode!r}: use surface or vertex")
        self.light_mode = light_mode
        self.ambient = AmbientLighting(intensity_ambient, color_ambient)
        directional = DirectionalLighting(intensity_directionals, color_directionals, directions)
        self.directionals = nn.ModuleList([directional])

    def forward(self, mesh: Mesh) -> Mesh:
        surface = self.light_mode == "surface"
        normals = mesh.surface_normals if surface else mesh.vertex_normals
        light = self.ambient(normals.new_zeros(len(normals), 1, 3))
        for directional in self.directionals:
            light = directional(light, normals)
        mesh.textures = mesh.textures * (light[:, :, None, :] if surface else light)
        return mesh
