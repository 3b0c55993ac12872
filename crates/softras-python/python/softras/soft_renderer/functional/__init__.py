"""The functions of the official package, on torch tensors."""

from __future__ import annotations

from .files import load_obj, save_obj, save_voxel
from .geometry import (
    face_vertices,
    get_points_from_angles,
    look,
    look_at,
    orthogonal,
    perspective,
    projection,
    vertex_normals,
)
from .light import ambient_lighting, directional_lighting
from .rasterize import rasterize_info, soft_rasterize
from .voxels import voxelization

__all__ = [
    "ambient_lighting",
    "directional_lighting",
    "face_vertices",
    "get_points_from_angles",
    "load_obj",
    "look",
    "look_at",
    "orthogonal",
    "perspective",
    "projection",
    "rasterize_info",
    "save_obj",
    "save_voxel",
    "soft_rasterize",
    "vertex_normals",
    "voxelization",
]
