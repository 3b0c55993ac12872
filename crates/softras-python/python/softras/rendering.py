"""Rendering without a renderer of one's own: one is opened for the process when it is needed."""

from __future__ import annotations

import os
import pathlib
import threading
from typing import Any, Dict, List, NamedTuple, Sequence, Tuple, Union

import numpy as np

from . import _softras
from ._softras import Camera, Frame, Gradients, Mesh, Renderer
from .settings import Lights, Settings

Meshes = Union[Mesh, Sequence[Mesh]]
Cameras = Union[Camera, Sequence[Camera]]

_lock = threading.Lock()
_opened: Renderer | None = None


def default_renderer() -> Renderer:
    """The renderer that `render`, `fit` and `softras.torch` use unless they are given one.

    It is opened when it is first asked for, on the device that the variable SOFTRAS_DEVICE names or else on the best one. A
    process that was forked since opens its own.
    """
    global _opened
    with _lock:
        if _opened is None or _opened.process != os.getpid():
            _opened = Renderer()
        return _opened


class Device(NamedTuple):
    """A Vulkan device. `Renderer` takes its index or a part of its name."""

    index: int
    name: str
    #: discrete, integrated, virtual, software or other.
    kind: str
    driver: str
    driver_version: str
    #: The driver's file, if it was opened without the Vulkan loader: that of SOFTRAS_DRIVER or of the package softras-lavapipe.
    file: pathlib.Path | None
    #: Why softras cannot run on it.
    why_not: str | None


def devices() -> List[Device]:
    """The devices that `Renderer` chooses from: those of the system, or of the package softras-lavapipe where these are none.

    Raises NoDeviceError, which names the package to install, and FileError for a driver's file of SOFTRAS_DRIVER.
    """
    return [Device(*found) for found in _softras.devices()]


def _after_fork() -> None:
    # Another thread of the parent process may have held the lock.
    global _lock
    _lock = threading.Lock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)


def batched(meshes: Sequence[Mesh], cameras: Sequence[Camera]) -> Tuple[List[Mesh], List[Camera]]:
    """A mesh and a camera for each view: one camera is repeated for all meshes, or each of B meshes N times for B·N cameras."""
    meshes, cameras = list(meshes), list(cameras)
    if len(meshes) > 1 and len(cameras) == 1:
        cameras = cameras * len(meshes)
    each, rest = divmod(len(cameras), max(len(meshes), 1))
    if len(meshes) > 1 and each > 1 and not rest:
        meshes = [mesh for mesh in meshes for _ in range(each)]
    return meshes, cameras


def render(
    meshes: Meshes,
    cameras: Cameras,
    settings: Settings | None = None,
    lights: Lights | None = None,
    *,
    save: bool = False,
    renderer: Renderer | None = None,
) -> Frame:
    """Renders one mesh from every camera, or a list of B meshes from one camera each. See `Renderer.render`.

    B meshes may also have one camera for all, or B·N cameras, the first N for the first mesh and so on: then the frame has B·N
    meshes.
    """
    if not isinstance(meshes, Mesh) and not isinstance(cameras, Camera):
        meshes, cameras = batched(meshes, cameras)
    elif not isinstance(meshes, Mesh):
        meshes, cameras = batched(meshes, [cameras])
    return (renderer or default_renderer()).render(meshes, cameras, settings, lights, save=save)


def backward(frame: Frame, *, by: Union[str, Sequence[str], None] = None, mode: str = "exact", **upstream: Any) -> Gradients:
    """The gradients of a loss from its gradients by a frame's images. See `Frame.backward`."""
    return frame.backward(by=by, mode=mode, **upstream)


class Fragments(NamedTuple):
    """The triangle at each pixel's centre, and the point of it that is seen."""

    #: [views, height, width] int32: the triangle's number in its mesh, -1 where there is none.
    triangle: np.ndarray
    #: [views, height, width, 3] float32: the weights of its corners at the point that is seen, also under perspective.
    barycentrics: np.ndarray
    #: [views, height, width] float32: the point's view depth in world units, 0 where there is none.
    depth: np.ndarray


def fragments(
    meshes: Meshes, cameras: Cameras, settings: Settings | None = None, *, renderer: Renderer | None = None
) -> Fragments:
    """The nearest triangle of each pixel, for one mesh and every camera, or a list of meshes with one camera each.

    Nothing is blurred: of the settings the size, near, far, faces and the parity count. Textures count as opaque. There is no
    gradient; the fragments of `softras.torch` have one. Raises what `Renderer.render` raises.
    """
    return Fragments(*(renderer or default_renderer()).fragments(meshes, cameras, settings))


class Check(NamedTuple):
    """A device beside the reference in one small scene."""

    name: str
    #: The largest error of color, silhouette, depth and normal; those that the scene has.
    images: Dict[str, float]
    #: The relative error of the gradients by vertices, colours and so on.
    gradients: Dict[str, float]
    #: Whether a second run gave the same bits.
    repeats: bool
    #: Whether the bits repeat and all errors are small enough.
    passes: bool


_IMAGES = ("color", "silhouette", "depth", "normal")
_GRADIENTS = ("positions", "colors", "texels", "uvs", "cameras", "lights", "background", "scalars")


def check(renderer: Renderer | None = None) -> List[Check]:
    """Compares the device with the reference on small scenes that cover the model, as `softras check` does."""

    def named(names, errors) -> Dict[str, float]:
        return {name: error for name, error in zip(names, errors) if error is not None}

    found = _softras.check(renderer or default_renderer())
    return [Check(name, named(_IMAGES, images), named(_GRADIENTS, by), *rest) for name, images, by, *rest in found]
