"""Voxels of meshes."""

from __future__ import annotations

import torch

from ..._softras import solid_voxels
from ..._tensors import floats


def voxelization(faces: torch.Tensor, size: int, normalize: bool = False) -> torch.Tensor:
    """Voxels [batch, size, size, size] (int32, indexed x, y, z) of faces [batch, F, 3, 3].

    A voxel is 1 where the surface touches it or it cannot be reached from outside. Coordinates run from 0 to 1, or from 0 to
    `size` with `normalize`.
    """
    corners = floats(faces, "faces").detach().float().cpu() * (1 if normalize else size)
    voxels = [torch.from_numpy(solid_voxels(one.numpy(), size)) for one in corners]
    return torch.stack(voxels).to(device=faces.device, dtype=torch.int32)
