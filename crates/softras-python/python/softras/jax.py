"""Rendering within JAX's transformations.

`render` is a differentiable function of the same arrays as that of `softras.torch`. It calls the renderer from the host
(`jax.pure_callback`), within `jax.jit` too, and has a reverse-mode derivative (`jax.custom_vjp`): `jax.grad`, `jax.vjp` and
`jax.vmap` work, forward mode and second derivatives do not. Arrays on a GPU are copied to the host and back. Vertices in
float64 (`jax_enable_x64`) are rendered by the reference device, which is slow and meant for checks.
"""

from __future__ import annotations

import collections
import dataclasses
import functools
import itertools
import threading
from typing import NamedTuple, Optional, Sequence, Tuple, Union

import jax
import jax.numpy as jnp
import numpy as np

from . import _scene
from ._softras import Camera, Renderer
from .settings import Lights, Settings

Arrays = Union[jax.Array, np.ndarray, Sequence[Union[jax.Array, np.ndarray]]]

#: How many forward passes keep their frame for the backward pass; older frames are rendered again.
_KEPT = 4


class Images(NamedTuple):
    """The images of a batch; None for those that `Settings.outputs` does not name."""

    #: [views, height, width, 3], linear.
    color: Optional[jax.Array]
    #: [views, height, width], in [0, 1].
    silhouette: Optional[jax.Array]
    #: [views, height, width], world units, 0 where no triangle contributes.
    depth: Optional[jax.Array]
    #: [views, height, width, 3], world space.
    normal: Optional[jax.Array]
    #: [views, height, width, N], the features of the vertices.
    features: Optional[jax.Array]


class _Frames:
    """The last frames by number. JAX can keep only arrays between the passes, so it keeps the number of a frame."""

    def __init__(self):
        self._lock, self._numbers, self._frames = threading.Lock(), itertools.count(), collections.OrderedDict()

    def keep(self, frame) -> int:
        with self._lock:
            number = next(self._numbers) % 2**31
            self._frames[number] = frame
            while len(self._frames) > _KEPT:
                self._frames.popitem(last=False)
            return number

    def get(self, number: int):
        with self._lock:
            return self._frames.get(number)


_frames = _Frames()


@jax.tree_util.register_static
@dataclasses.dataclass(frozen=True)
class _Wanted:
    """The inputs to differentiate by, which are known while JAX traces."""

    inputs: Tuple[bool, ...]


def _shapes(scene: _scene.Scene, arrays):
    """The images' names, shapes and type."""
    values = {one.name: array for one, array in zip(scene.inputs, arrays)}
    counts = [len(values[name]) for name in ("views", "projections") if name in values]
    sides = (counts[0] if counts else len(scene.cameras), scene.settings.height, scene.settings.width)
    kind = np.float64 if arrays[0].dtype == np.float64 else np.float32
    names = [name for name in _scene.IMAGES if name in scene.settings.outputs]
    channels = {"color": (3,), "normal": (3,)}
    channels["features"] = (scene.channels(arrays),)
    return names, tuple(jax.ShapeDtypeStruct(sides + channels.get(name, ()), kind) for name in names)


def _images(names, frame):
    return tuple(getattr(frame, name) for name in names)


def _function(scene: _scene.Scene, names, shapes):
    """The images as a differentiable function of the scene's arrays."""

    def call(function, result, *arguments):
        return jax.pure_callback(function, result, *arguments, vmap_method="sequential")

    def host(arrays):
        return [np.asarray(array) for array in arrays]

    def look(*arrays):
        return _images(names, _scene.render(scene, host(arrays), False))

    def look_and_keep(*arrays):
        frame = _scene.render(scene, host(arrays), True)
        return (*_images(names, frame), np.int32(_frames.keep(frame)))

    def differentiate(wanted, given, number, arrays, upstream):
        arrays = host(arrays)
        kept = _scene.Kept(_frames.get(int(number)))
        found = _scene.differentiate(scene, kept, arrays, wanted, dict(zip(given, host(upstream))))
        return tuple(
            np.zeros_like(array) if gradient is None else gradient.astype(array.dtype).reshape(array.shape)
            for array, gradient, needed in zip(arrays, found, wanted)
            if needed
        )

    def forward(*primals):
        arrays = tuple(primal.value for primal in primals)
        wanted = _Wanted(tuple(primal.perturbed for primal in primals))
        number = jax.ShapeDtypeStruct((), np.int32)
        *images, kept = call(look_and_keep, (*shapes, number), *arrays)
        return tuple(images), (wanted, kept, arrays)

    def backward(saved, upstream):
        wanted, number, arrays = saved
        symbolic = jax.custom_derivatives.SymbolicZero
        given = {name: value for name, value in zip(names, upstream) if not isinstance(value, symbolic)}
        needed = [array for array, one in zip(arrays, wanted.inputs) if one]
        result = tuple(jax.ShapeDtypeStruct(array.shape, array.dtype) for array in needed)
        task = functools.partial(differentiate, wanted.inputs, tuple(given))
        found = iter(call(task, result, number, arrays, tuple(given.values())))
        return tuple(next(found) if one else None for one in wanted.inputs)

    @jax.custom_vjp
    def render(*arrays):
        return call(look, shapes, *arrays)

    render.defvjp(forward, backward, symbolic_zeros=True)
    return render


def render(
    vertices: Arrays,
    faces,
    cameras: Union[Camera, Sequence[Camera]],
    *,
    colors: Optional[Arrays] = None,
    features: Optional[Arrays] = None,
    surface: Optional[Arrays] = None,
    uvs: Optional[Arrays] = None,
    uv_faces=None,
    textures: Union[None, Arrays, Sequence[Arrays]] = None,
    texture_of_triangle=None,
    wrap: Union[None, str, Sequence[str]] = None,
    settings: Optional[Settings] = None,
    lights: Optional[Lights] = None,
    mode: str = "exact",
    renderer: Optional[Renderer] = None,
    **arrays: jax.Array,
) -> Images:
    """Renders meshes to arrays.

    All arguments are those of `softras.torch.render`, with arrays in place of tensors. `faces`, `uv_faces` and
    `texture_of_triangle` are constants, which a transformation cannot trace; cameras, settings and lights too, of which the
    keywords `views`, `projections`, `sigma` and so on replace parts by arrays. A failure on the device raises JAX's own
    error with the library's text.
    """
    given = {"positions": vertices, "colors": colors, "features": features, "surface": surface, "uvs": uvs, "textures": textures}
    given, arrays = jax.tree_util.tree_map(jnp.asarray, (given, arrays))
    constants = {"uv_faces": uv_faces, "texture_of_triangle": texture_of_triangle, "wrap": wrap}
    constants.update(settings=settings, lights=lights, mode=mode, renderer=renderer)
    scene, flat = _scene.build(given, arrays, faces, cameras, constants, jax.Array, np.asarray)
    names, shapes = _shapes(scene, flat)
    images = iter(_function(scene, names, shapes)(*flat))
    return Images(*(next(images) if name in names else None for name in _scene.IMAGES))
