"""Mesh files, with textures as surface cells."""

from __future__ import annotations

import math
import os
from typing import Optional

import numpy as np
import torch

from ..._softras import Mesh, load, surface_cells
from ...errors import FileError
from ..kinds import Path


def _cells(mesh: Mesh, resolution: int) -> np.ndarray:
    """The colours [F, R², 3] of a mesh's surface cells."""
    count = len(mesh.triangles)
    if mesh.surface is not None:
        return np.broadcast_to(mesh.surface[:, :1], (count, resolution**2, 3)).copy()
    if mesh.colors is not None:
        color = mesh.colors if mesh.colors.ndim == 1 else np.ones(3)
        return np.broadcast_to(np.float32(color), (count, resolution**2, 3)).copy()
    return surface_cells(mesh, resolution)


def load_obj(
    filename_obj: Path, normalization: bool = False, load_texture: bool = False, texture_res: int = 4,
    texture_type: str = "surface"
) -> tuple:
    """Vertices [V, 3] and faces [F, 3] (int32) of a mesh file, and with `load_texture` its textures.

    Those are [F, R², 3] for texture_type "surface", and [V, 3] for "vertex". `normalization` moves the mesh into a cube around
    the origin. Any file that `softras.load` reads is read. Raises IoError, FileError.
    """
    if texture_type not in ("surface", "vertex"):
        raise ValueError(f"texture_type is {texture_type!r}: use surface or vertex")
    mesh = load(os.fspath(filename_obj), srgb=False)
    vertices = torch.from_numpy(mesh.positions)
    faces = torch.from_numpy(mesh.triangles.astype(np.int32))
    if normalization:
        vertices -= vertices.min(0)[0]
        vertices *= 2 / vertices.abs().max()
        vertices -= vertices.max(0)[0] / 2
    if not load_texture:
        return vertices, faces
    if texture_type == "surface":
        return vertices, faces, torch.from_numpy(_cells(mesh, texture_res))
    if mesh.colors is None or mesh.colors.ndim != 2:
        raise FileError(f"{filename_obj}: no vertex colours: give a file that has them, or texture_type 'surface'")
    return vertices, faces, torch.from_numpy(mesh.colors)


def _atlas(cells: np.ndarray, side: int) -> tuple:
    """An image with a tile of `side` pixels a side for each face, and the UVs [F, 3, 2] of its corners."""
    count, resolution = len(cells), math.isqrt(cells.shape[1])
    columns = math.isqrt(count - 1) + 1
    rows = (count - 1) // columns + 1
    # Corners in the tile: in the middle of the top, at the lower left and at the lower right, a pixel from the border.
    corners = np.array([[side / 2, 1.0], [1.0, side - 2.0], [side - 2.0, side - 2.0]])
    y, x = np.divmod(np.arange(side * side), side)
    solved = np.linalg.solve(np.vstack([corners.T, np.ones(3)]), np.stack([x, y, np.ones_like(x)]))
    b = np.clip(solved, 0.0, 1.0)
    b = resolution * b / b.sum(0)
    i, j = (np.minimum(b[k].astype(int), resolution - 1) for k in (0, 1))
    lower = b[0] - i + b[1] - j <= 1.0
    last = resolution - 1
    cell = np.where(lower, j * resolution + i, (last - j) * resolution + last - i)
    tiles = np.ones((rows * columns, side, side, 3), np.float32)
    tiles[:count] = cells[:, cell].reshape(count, side, side, 3)
    image = tiles.reshape(rows, columns, side, side, 3).transpose(0, 2, 1, 3, 4).reshape(rows * side, columns * side, 3)
    row, column = np.divmod(np.arange(count), columns)
    pixels = corners[None] + np.stack([column, row], 1)[:, None] * side + 0.5
    uvs = pixels / [image.shape[1], image.shape[0]]
    uvs[..., 1] = 1.0 - uvs[..., 1]
    return image, uvs


def save_obj(
    filename: Path, vertices: torch.Tensor, faces: torch.Tensor, textures: Optional[torch.Tensor] = None, texture_res: int = 16,
    texture_type: str = "surface"
) -> None:
    """Writes vertices [V, 3] and faces [F, 3], with textures [F, R², 3] ("surface") or colours [V, 3] ("vertex").

    A surface becomes an image with a tile of `texture_res` pixels a side for each face.
    """
    if texture_res < 2 or texture_type not in ("surface", "vertex"):
        raise ValueError(f"texture_res {texture_res}, texture_type {texture_type!r}: use 2 or more, surface or vertex")
    vertices, faces = vertices.detach().cpu().numpy(), faces.detach().cpu().numpy()
    look = {}
    if textures is not None:
        colors = np.clip(textures.detach().cpu().numpy(), 0, 1)
        if texture_type == "vertex":
            look = {"colors": colors}
        else:
            image, uvs = _atlas(colors, max(texture_res, 4))
            corners = np.arange(3 * len(faces)).reshape(-1, 3)
            look = {"textures": image, "uvs": uvs.reshape(-1, 2), "uv_triangles": corners}
    Mesh(vertices, faces, **look).save(os.fspath(filename), srgb=False)


def save_voxel(filename: Path, voxel: torch.Tensor) -> None:
    """Writes the voxels [X, Y, Z] that are 1 as the vertices of a mesh without faces, in the unit cube."""
    voxel = torch.as_tensor(voxel)
    places = torch.nonzero(voxel == 1) / torch.tensor(voxel.shape, device=voxel.device)
    save_obj(filename, places, torch.zeros(0, 3, dtype=torch.int32))
