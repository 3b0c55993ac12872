"""Light at normals, added to what is there already."""

from __future__ import annotations

import torch
import torch.nn.functional as F

from ..kinds import Number, Vector
from .geometry import as_rows


def ambient_lighting(light: torch.Tensor, light_intensity: Number = 0.5, light_color: Vector = (1, 1, 1)) -> torch.Tensor:
    """Adds ambient light to `light` [batch, N, 3]."""
    return light + light_intensity * as_rows(light_color, light)[:, None, :]


def directional_lighting(
    light: torch.Tensor, normals: torch.Tensor, light_intensity: Number = 0.5, light_color: Vector = (1, 1, 1),
    light_direction: Vector = (0, 1, 0)
) -> torch.Tensor:
    """Adds directional light at `normals` [batch, N, 3] to `light` [batch, N, 3]."""
    cosine = F.relu(normals @ as_rows(light_direction, normals)[:, :, None])
    return torch.addcmul(light, light_intensity * as_rows(light_color, light)[:, None, :], cosine)
