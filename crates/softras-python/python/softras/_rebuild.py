"""What pickled meshes and cameras are made from, and the defaults of a mesh's appearance."""

from __future__ import annotations

import numpy as np

from .errors import InputError

_LOOK = {
    "colors": None,
    "surface": None,
    "uvs": None,
    "uv_triangles": None,
    "textures": None,
    "texture_of_triangle": None,
    "wrap": "repeat",
}


def look(**given):
    """All arguments of a mesh's appearance."""
    unknown = sorted(set(given) - set(_LOOK))
    if unknown:
        raise InputError(f"a mesh has no {unknown[0]!r}: use {', '.join(_LOOK)}")
    return {**_LOOK, **given}


def mesh(positions, triangles, given, normals=None):
    """A mesh from its arrays."""
    from ._softras import Mesh

    return Mesh(positions, triangles, **given).with_normals(normals)


def camera(view, projection):
    """A camera from its view and its projection's fields."""
    from ._softras import Camera

    if not projection:
        return Camera.screen()
    if "original_size" in projection:
        return Camera.official(view, **projection)
    return Camera.from_matrix(view, **projection, mirrored=True)


def linear(texture):
    """Linear floats of a picture of bytes, as numpy or Pillow have it; anything else as it is."""
    if hasattr(texture, "getbands"):
        texture = np.asarray(texture.convert("RGBA" if "A" in texture.getbands() else "RGB"))
    if getattr(texture, "dtype", None) != np.uint8:
        return texture
    values = texture.astype(np.float32) / 255.0
    rgb = values[..., :3]
    values[..., :3] = np.where(rgb > 0.04045, ((rgb + 0.055) / 1.055) ** 2.4, rgb / 12.92)
    return values
