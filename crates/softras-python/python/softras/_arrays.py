"""Which arrays come in: one rule for all of them, by what their numbers mean."""

from __future__ import annotations

import functools

import numpy as np

from .errors import InputError

_LOOK = ("colors", "surface", "uvs", "uv_triangles", "textures", "texture_of_triangle", "wrap")
#: The least and the greatest float, with room for rounding. White is 1, and light may be brighter; that of 0 to 255 is not linear.
_RANGES = {"light": (-100.0, 100.0), "texture": (-100.0, 100.0), "picture": (-1e-3, 100.0), "mask": (-1e-3, 1.001)}
_FIXES = {
    "number": "give numbers",
    "place": "give floats",
    "mask": "give bools, floats from 0 to 1, or uint8 or uint16 up to their greatest number",
}
_OF_LIGHT = "give floats of linear light, of which 1 is white, or uint8 or uint16 in sRGB"


def look(**given):
    """All arguments of a mesh's appearance."""
    unknown = sorted(set(given) - set(_LOOK))
    if unknown:
        raise InputError(f"a mesh has no {unknown[0]!r}: use {', '.join(_LOOK)}")
    return {**dict.fromkeys(_LOOK), **given}


@functools.lru_cache(maxsize=None)
def _curve(greatest: int) -> np.ndarray:
    """The linear light of each integer of a picture in sRGB."""
    values = np.arange(greatest + 1) / greatest
    return np.where(values > 0.04045, ((values + 0.055) / 1.055) ** 2.4, values / 12.92)


def _pixels(picture) -> np.ndarray:
    """The array of one of Pillow's pictures; what only Pillow can decode becomes bytes."""
    if picture.mode.startswith("I;16") or picture.mode == "F":
        return np.repeat(np.asarray(picture)[..., None], 3, -1)
    if picture.mode == "I":
        raise InputError("a picture of Pillow's mode I: its 32-bit integers have no greatest number: convert it to I;16 or F")
    transparent = "transparency" in picture.info or picture.mode in ("LA", "PA", "La", "RGBA", "RGBa")
    return np.asarray(picture.convert("RGBA" if transparent else "RGB"))


def _decoded(array: np.ndarray, means: str):
    """The floats of an image of integers or bools; None where they are no image."""
    greatest = {"uint8": 255, "uint16": 65535}.get(array.dtype.name)
    low, high = array.min(initial=0), array.max(initial=0)
    if means == "mask":
        # Masks of 0 and 1, in whatever type. Otherwise something is inside.
        one = 1 if high <= 1 else greatest if greatest and 2 * int(high) > greatest else None
        return None if one is None or low < 0 else array / float(one)
    if greatest is None:
        # Lists such as [1, 0, 0] are black and white in any curve.
        return array if array.dtype.kind != "b" and low >= 0 and high <= 1 else None
    if greatest == 65535 and 0 < high < 256:
        return None
    light = _curve(greatest)[array]
    if means == "texture" and array.shape[-1] == 4:
        light[..., 3] = array[..., 3] / greatest
    return light


def read(value, name: str, means: str, kind: str = "float32") -> np.ndarray:
    """A contiguous array of a type. `means` says what the numbers are:

    - "number": anything that is a number.
    - "place": positions, directions, depths: floats, or a list of numbers. An array of integers was floats before, most likely.
    - "light", "texture" (light with alpha) and "picture" (an image to fit to): floats are linear and within a range; uint8 and uint16
      are sRGB.
    - "mask": how much of a pixel is covered, from 0 to 1.
    """
    if value is None:
        raise InputError(f"{name} is None: give an array of numbers")
    try:
        array = _pixels(value) if hasattr(value, "getbands") else np.asarray(value)
    except (TypeError, ValueError, RuntimeError) as error:
        raise InputError(f"{name}: {error}: give an array of numbers") from None
    if np.ma.is_masked(value):
        raise InputError(f"{name}: an array with masked values: fill them, as with .filled(0)")
    letter, found = array.dtype.kind, array
    if letter == "f" and means in _RANGES:
        least, most = _RANGES[means]
        # A NaN is in no range.
        found = array if array.size == 0 or (array.min() >= least and array.max() <= most) else None
    elif letter in "biu" and means in _RANGES:
        found = _decoded(array, means)
    elif letter != "f" and array.size > 0:
        known = letter in "biu" if means == "number" else letter in "iu" and not hasattr(value, "dtype")
        found = array if known else None
    if found is None:
        span = f" from {array.min():g} to {array.max():g}" if letter in "biuf" and array.size > 0 else ""
        raise InputError(f"{name}: an array of {array.dtype}{span}: {_FIXES.get(means, _OF_LIGHT)}")
    return np.ascontiguousarray(found, kind)
