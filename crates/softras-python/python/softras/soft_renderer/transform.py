"""Cameras as modules, which take vertices to the screen."""

from __future__ import annotations

import math
from typing import Any, Optional

import torch
from torch import nn

from . import functional as srf
from .kinds import Array, Number, Vector
from .mesh import Mesh


class _Camera(nn.Module):
    """A camera. Called with vertices [batch, V, 3] it returns their screen coordinates; of a mesh it replaces the vertices by them."""

    def forward(self, seen) -> Any:
        if not isinstance(seen, Mesh):
            return self.on_screen(seen)
        seen.vertices = self.on_screen(seen.vertices)
        return seen


class Projection(_Camera):
    """Projection by matrices P [batch, 3, 4] with distortion [batch, 5], for images of `orig_size` pixels."""

    def __init__(self, P: Array, dist_coeffs: Optional[Array] = None, orig_size: Number = 512) -> None:
        super().__init__()
        if P is None or tuple(P.shape[1:]) != (3, 4):
            raise ValueError("P is no matrix: give [batch, 3, 4]")
        self.P, self.orig_size = torch.as_tensor(P), orig_size
        self.dist_coeffs = torch.zeros(len(self.P), 5) if dist_coeffs is None else torch.as_tensor(dist_coeffs)

    def on_screen(self, vertices: torch.Tensor) -> torch.Tensor:
        P, dist_coeffs = self.P.to(vertices), self.dist_coeffs.to(vertices)
        return srf.projection(vertices, P, dist_coeffs, self.orig_size)


class _Eye(_Camera):
    """A camera with an eye, and with perspective or without."""

    def __init__(self, perspective: bool, viewing_angle: Number, viewing_scale: Number, eye: Optional[Vector]) -> None:
        super().__init__()
        self.perspective, self.viewing_angle, self.viewing_scale = perspective, viewing_angle, viewing_scale
        self._eye = eye
        if eye is None:
            self._eye = [0, 0, -(1.0 / math.tan(math.radians(viewing_angle)) + 1)]

    def set_eyes_from_angles(self, distances: Number, elevations: Number, azimuths: Number) -> None:
        """Places the eyes at distances, and angles in degrees, around the origin."""
        self.set_eyes(srf.get_points_from_angles(distances, elevations, azimuths))

    def set_eyes(self, eyes: Vector) -> None:
        """Places the eyes: one, or one for each mesh of the batch."""
        self._eye = eyes

    @property
    def eyes(self) -> Any:
        return self._eye

    def project(self, view: torch.Tensor) -> torch.Tensor:
        if self.perspective:
            return srf.perspective(view, angle=self.viewing_angle)
        return srf.orthogonal(view, scale=self.viewing_scale)


class LookAt(_Eye):
    """A camera that looks at the origin; `viewing_angle` is half the angle of view in degrees."""

    def __init__(
        self, perspective: bool = True, viewing_angle: Number = 30, viewing_scale: Number = 1.0, eye: Optional[Vector] = None
    ) -> None:
        super().__init__(perspective, viewing_angle, viewing_scale, eye)

    def on_screen(self, vertices: torch.Tensor) -> torch.Tensor:
        return self.project(srf.look_at(vertices, self._eye))


class Look(_Eye):
    """A camera that looks along a direction."""

    def __init__(
        self, camera_direction: Vector = (0, 0, 1), perspective: bool = True, viewing_angle: Number = 30,
        viewing_scale: Number = 1.0, eye: Optional[Vector] = None
    ) -> None:
        super().__init__(perspective, viewing_angle, viewing_scale, eye)
        self.camera_direction = camera_direction

    def on_screen(self, vertices: torch.Tensor) -> torch.Tensor:
        return self.project(srf.look(vertices, self._eye, self.camera_direction))


class Transform(nn.Module):
    """A camera of one of the modes "projection", "look" and "look_at", which moves a mesh's vertices to the screen."""

    def __init__(
        self,
        camera_mode: str = "projection",
        P: Optional[Array] = None,
        dist_coeffs: Optional[Array] = None,
        orig_size: Number = 512,
        perspective: bool = True,
        viewing_angle: Number = 30,
        viewing_scale: Number = 1.0,
        eye: Optional[Vector] = None,
        camera_direction: Vector = (0, 0, 1),
    ) -> None:
        super().__init__()
        self.camera_mode = camera_mode
        if camera_mode == "projection":
            self.transformer = Projection(P, dist_coeffs, orig_size)
        elif camera_mode == "look":
            self.transformer = Look(camera_direction, perspective, viewing_angle, viewing_scale, eye)
        elif camera_mode == "look_at":
            self.transformer = LookAt(perspective, viewing_angle, viewing_scale, eye)
        else:
            raise ValueError(f"camera_mode is {camera_mode!r}: use projection, look or look_at")

    def forward(self, mesh: Mesh) -> Mesh:
        return self.transformer(mesh)

    def set_eyes_from_angles(self, distances: Number, elevations: Number, azimuths: Number) -> None:
        """Places the eyes at distances, and angles in degrees, around the origin."""
        self.set_eyes(srf.get_points_from_angles(distances, elevations, azimuths))

    def set_eyes(self, eyes: Vector) -> None:
        """Places the eyes: one, or one for each mesh of the batch."""
        if self.camera_mode == "projection":
            raise ValueError("a projection has no eyes: use camera_mode look or look_at")
        self.transformer.set_eyes(eyes)

    @property
    def eyes(self) -> Any:
        return self.transformer.eyes
