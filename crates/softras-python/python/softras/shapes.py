"""Built-in meshes: closed, counter-clockwise seen from outside, around the origin and within ±1.1."""

from __future__ import annotations

from ._softras import Mesh, shape
from .errors import MeshError


def icosphere(subdivisions: int = 3) -> Mesh:
    """A white sphere of radius 1 with 20·4ⁿ triangles, 0 to 9 subdivisions."""
    if not 0 <= subdivisions <= 9:
        raise MeshError(f"icosphere of {subdivisions} subdivisions: use 0 to 9")
    return shape("icosphere", [float(subdivisions)])


def cube() -> Mesh:
    """A cube of side 1.2 with another colour on each face."""
    return shape("cube", [])


def torus(ring: float = 0.7, tube: float = 0.3, around: int = 64, across: int = 32) -> Mesh:
    """A ring about the z axis in the colours of the rainbow."""
    return shape("torus", [ring, tube, float(around), float(across)])


def fish() -> Mesh:
    """A clownfish with a texture."""
    return shape("fish", [])
