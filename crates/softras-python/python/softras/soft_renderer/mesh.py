"""The official package's mesh: a batch of meshes with the same number of vertices and faces."""

from __future__ import annotations

import math
from typing import Optional

import torch
import torch.nn.functional as F

from . import functional as srf
from .._tensors import floats, indices
from .kinds import Array, Path


class Mesh:
    """Vertices [batch, V, 3], faces [batch, F, 3] and textures, [batch, F, R², 3] ("surface") or [batch, V, 3] ("vertex").

    Without the batch's dimension they are a batch of one; textures are white unless given.
    """

    def __init__(
        self, vertices: Array, faces: Array, textures: Optional[Array] = None, texture_res: int = 1,
        texture_type: str = "surface"
    ) -> None:
        if texture_type not in ("surface", "vertex"):
            raise ValueError(f"texture_type is {texture_type!r}: use surface or vertex")
        self.texture_type = texture_type
        self._corners = self._normals = self._smooth_normals = None
        self._fill_back = False
        vertices = floats(vertices, "vertices")
        faces = faces if isinstance(faces, torch.Tensor) else indices(faces, kind=torch.int32)
        self._vertices = vertices[None] if vertices.ndim == 2 else vertices
        self._faces = faces[None] if faces.ndim == 2 else faces
        if len(self._faces) == 1 and len(self._vertices) > 1:
            self._faces = self._faces.expand(len(self._vertices), -1, -1)
        self.device = self._vertices.device
        self.batch_size, self.num_vertices = self._vertices.shape[:2]
        self.num_faces = self._faces.shape[1]
        surface = texture_type == "surface"
        if textures is None:
            shape = (self.num_faces, texture_res**2) if surface else (self.num_vertices,)
            textures = torch.ones(self.batch_size, *shape, 3, device=self.device)
        textures = floats(textures, "textures")
        self._textures = textures[None] if textures.ndim == (3 if surface else 2) else textures
        self.texture_res = math.isqrt(self._textures.shape[2]) if surface else 1
        # The state that `reset_` restores; programs of the official package set these attributes.
        self._origin_vertices, self._origin_faces, self._origin_textures = self._vertices, self._faces, self._textures

    @property
    def vertices(self) -> torch.Tensor:
        return self._vertices

    @vertices.setter
    def vertices(self, vertices: torch.Tensor) -> None:
        self._vertices = vertices
        self.num_vertices = vertices.shape[1]
        self._corners = self._normals = self._smooth_normals = None

    @property
    def faces(self) -> torch.Tensor:
        return self._faces

    @faces.setter
    def faces(self, faces: torch.Tensor) -> None:
        self._faces = faces
        self.num_faces = faces.shape[1]
        self._corners = self._normals = self._smooth_normals = None

    @property
    def textures(self) -> torch.Tensor:
        return self._textures

    @textures.setter
    def textures(self, textures: torch.Tensor) -> None:
        self._textures = textures

    @property
    def face_vertices(self) -> torch.Tensor:
        """The faces' corners, [batch, F, 3, 3]."""
        if self._corners is None:
            self._corners = srf.face_vertices(self.vertices, self.faces)
        return self._corners

    @property
    def surface_normals(self) -> torch.Tensor:
        """The faces' unit normals, [batch, F, 3]."""
        if self._normals is None:
            a, b, c = self.face_vertices.unbind(2)
            self._normals = F.normalize(torch.linalg.cross(c - b, a - b), dim=2, eps=1e-6)
        return self._normals

    @property
    def vertex_normals(self) -> torch.Tensor:
        """The vertices' unit normals, [batch, V, 3]."""
        if self._smooth_normals is None:
            self._smooth_normals = srf.vertex_normals(self.vertices, self.faces)
        return self._smooth_normals

    @property
    def face_textures(self) -> torch.Tensor:
        """The textures by face: [batch, F, R², 3], or the corners' colours [batch, F, 3, 3]."""
        return self.textures if self.texture_type == "surface" else srf.face_vertices(self.textures, self.faces)

    def fill_back_(self) -> None:
        """Adds the back of every face as a face of its own."""
        if not self._fill_back:
            self.faces = torch.cat((self.faces, self.faces[:, :, [2, 1, 0]]), dim=1)
            if self.texture_type == "surface":
                self.textures = torch.cat((self.textures, self.textures), dim=1)
            self._fill_back = True

    def reset_(self) -> None:
        """Takes back every change since the mesh was made."""
        self.vertices, self.faces, self.textures = self._origin_vertices, self._origin_faces, self._origin_textures
        self._fill_back = False

    @classmethod
    def from_obj(
        cls, filename_obj: Path, normalization: bool = False, load_texture: bool = False, texture_res: int = 1,
        texture_type: str = "surface"
    ) -> Mesh:
        """A mesh from a file; see `functional.load_obj`."""
        found = srf.load_obj(filename_obj, normalization, load_texture, texture_res, texture_type)
        return cls(found[0], found[1], found[2] if load_texture else None, texture_res, texture_type)

    def save_obj(self, filename_obj: Path, save_texture: bool = False, texture_res_out: int = 16) -> None:
        """Writes a batch of one; see `functional.save_obj`."""
        if self.batch_size != 1:
            raise ValueError(f"a batch of {self.batch_size} meshes: a file has one")
        textures = self.textures[0] if save_texture else None
        srf.save_obj(filename_obj, self.vertices[0], self.faces[0], textures, texture_res_out, self.texture_type)

    def voxelize(self, voxel_size: int = 32) -> torch.Tensor:
        """Voxels [batch, size, size, size] of what lies within ±1/2; see `functional.voxelization`."""
        return srf.voxelization(self.face_vertices * voxel_size / (voxel_size - 1) + 0.5, voxel_size, False)

    def __repr__(self) -> str:
        kind = f"{self.texture_type}, R = {self.texture_res}" if self.texture_type == "surface" else "vertex colours"
        return f"soft_renderer.Mesh({self.batch_size} of {self.num_vertices} vertices, {self.num_faces} faces, {kind})"
