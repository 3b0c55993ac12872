"""From vertices to the screen: views, projections, corners of faces and normals."""

from __future__ import annotations

import math
import numbers
from typing import Any, Optional

import torch
import torch.nn.functional as F

from ..._tensors import plain
from ...errors import CameraError
from ..kinds import Number, Vector


def as_rows(value, like: torch.Tensor) -> torch.Tensor:
    """A tuple, array or tensor of one vector or one for each batch entry, as [1 or batch, 3] beside a tensor."""
    rows = torch.as_tensor(value, dtype=like.dtype, device=like.device)
    return rows[None] if rows.ndim == 1 else rows


def get_points_from_angles(distance: Number, elevation: Number, azimuth: Number, degrees: bool = True) -> Any:
    """Eyes d (cos e sin a, sin e, -cos e cos a): a tuple for numbers, [batch, 3] for tensors."""
    plain = isinstance(distance, numbers.Real)
    if degrees:
        elevation, azimuth = (math.radians(x) if plain else torch.deg2rad(x) for x in (elevation, azimuth))
    sin, cos = (math.sin, math.cos) if plain else (torch.sin, torch.cos)
    eye = (
        distance * cos(elevation) * sin(azimuth),
        distance * sin(elevation),
        -distance * cos(elevation) * cos(azimuth),
    )
    return eye if plain else torch.stack(eye, dim=1)


def _check_batch(vertices: torch.Tensor) -> None:
    if vertices.ndim != 3:
        raise ValueError(f"vertices have shape {tuple(vertices.shape)}: give [batch, V, 3]")


def look(vertices: torch.Tensor, eye: Vector, direction: Vector = (0, 1, 0), up: Optional[Vector] = None) -> torch.Tensor:
    """Vertices [batch, V, 3] in the view space of cameras at `eye` that look along `direction`.

    `up` is (0, 1, 0), or (0, 0, 1) for cameras that look straight up or down.
    """
    _check_batch(vertices)
    eye, direction = as_rows(eye, vertices), as_rows(direction, vertices)
    if up is None:
        upright = direction[:, [0, 2]].norm(dim=1, keepdim=True) < 1e-6 * direction.norm(dim=1, keepdim=True)
        up = torch.where(upright, as_rows((0, 0, 1), vertices), as_rows((0, 1, 0), vertices))
    up = as_rows(up, vertices)
    # The official code's bound on lengths.
    z = F.normalize(direction, eps=1e-5)
    x = torch.linalg.cross(*torch.broadcast_tensors(up, z))
    if plain() and not x.norm(dim=1).all():
        raise CameraError("look: up is along the view, or eye and target coincide: give another up")
    x = F.normalize(x, eps=1e-5)
    y = F.normalize(torch.linalg.cross(*torch.broadcast_tensors(z, x)), eps=1e-5)
    axes = torch.stack(torch.broadcast_tensors(x, y, z), dim=1)
    return (vertices - eye[:, None, :]) @ axes.transpose(1, 2)


def look_at(vertices: torch.Tensor, eye: Vector, at: Vector = (0, 0, 0), up: Optional[Vector] = None) -> torch.Tensor:
    """Vertices [batch, V, 3] in the view space of cameras at `eye` that look at `at`; `up` as of `look`."""
    _check_batch(vertices)
    eye, at = as_rows(eye, vertices), as_rows(at, vertices)
    return look(vertices, eye, at - eye, up)


def perspective(vertices: torch.Tensor, angle: Number = 30.0) -> torch.Tensor:
    """View space [batch, V, 3] to the screen; `angle` is half the angle of view in degrees."""
    _check_batch(vertices)
    width = torch.tan(torch.deg2rad(torch.as_tensor(angle, dtype=vertices.dtype, device=vertices.device)))
    x, y, z = vertices.unbind(2)
    return torch.stack((x / z / width, y / z / width, z), dim=2)


def orthogonal(vertices: torch.Tensor, scale: Number) -> torch.Tensor:
    """View space [batch, V, 3] to the screen without perspective."""
    _check_batch(vertices)
    x, y, z = vertices.unbind(2)
    return torch.stack((x * scale, y * scale, z), dim=2)


def projection(vertices: torch.Tensor, P: torch.Tensor, dist_coeffs: torch.Tensor, orig_size: Number) -> torch.Tensor:
    """Vertices [batch, V, 3] to the screen by matrices [batch, 3, 4] and distortions (k1, k2, p1, p2, k3) [batch, 5]."""
    x, y, z = (vertices @ P[:, :, :3].transpose(1, 2) + P[:, None, :, 3]).unbind(2)
    x, y = x / (z + 1e-5), y / (z + 1e-5)
    k1, k2, p1, p2, k3 = (coefficient[:, None] for coefficient in dist_coeffs.unbind(1))
    square = x * x + y * y
    radial = 1 + square * (k1 + square * (k2 + square * k3))
    across = x * radial + 2 * p1 * x * y + p2 * (square + 2 * x * x)
    down = y * radial + p1 * (square + 2 * y * y) + 2 * p2 * x * y
    half = orig_size / 2.0
    return torch.stack(((across - half) / half, (down - half) / half, z), dim=2)


def face_vertices(vertices: torch.Tensor, faces: torch.Tensor) -> torch.Tensor:
    """The corners [batch, F, 3, 3] of faces [batch, F, 3], of vertices or of any values [batch, V, 3]."""
    if vertices.ndim != 3 or faces.ndim != 3 or len(vertices) != len(faces) or faces.shape[2] != 3:
        shapes = f"{tuple(vertices.shape)} and {tuple(faces.shape)}"
        raise ValueError(f"vertices and faces have shapes {shapes}: give [batch, V, 3] and [batch, F, 3]")
    # One index into all rows is faster than gather, and its derivative much faster than that of two indices.
    rows = faces + torch.arange(0, vertices.shape[:2].numel(), vertices.shape[1], device=faces.device)[:, None, None]
    return vertices.flatten(0, 1).index_select(0, rows.flatten()).unflatten(0, faces.shape)


def vertex_normals(vertices: torch.Tensor, faces: torch.Tensor) -> torch.Tensor:
    """The mean normals [batch, V, 3] of the faces around each vertex, weighted by their areas."""
    a, b, c = face_vertices(vertices, faces).unbind(2)
    areas = torch.linalg.cross(c - b, a - b)
    corners = faces.long().flatten(1)[..., None].expand(-1, -1, 3)
    sums = torch.zeros_like(vertices).scatter_add(1, corners, areas.repeat_interleave(3, dim=1))
    return F.normalize(sums, eps=1e-6, dim=2)
