"""Light at normals, added to what is there already."""

from __future__ import annotations

import torch
import torch.nn.functional as F

from .geometry import as_rows


def ambient_lighting(light, light_intensity=0.5, light_color=(1, 1, 1)) -> torch.Tensor:
    """Adds ambient light to `light` [batch, N, 3]."""
    return light + light_intensity * as_rows(light_color, light)[:, None, :]


def directional_lighting(light, normals, light_intensity=0.5, light_color=(1, 1, 1), light_direction=(0, 1, 0)) -> torch.Tensor:
    """Adds directional light at `normals` [batch, N, 3] to `light` [batch, N, 3]."""
    cosine = F.relu((normals * as_rows(light_direction, normals)[:, None, :]).sum(dim=2))
    return light + light_intensity * as_rows(light_color, light)[:, None, :] * cosine[:, :, None]
