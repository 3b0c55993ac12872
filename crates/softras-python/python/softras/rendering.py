"""Rendering without a renderer of one's own: one is opened for the process when it is needed."""

from __future__ import annotations

import os
import threading
from typing import Any, NamedTuple, Sequence, Union

import numpy as np

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


def _after_fork() -> None:
    # Another thread of the parent process may have held the lock.
    global _lock
    _lock = threading.Lock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)


def render(
    meshes: Meshes,
    cameras: Cameras,
    settings: Settings | None = None,
    lights: Lights | None = None,
    *,
    save: bool = False,
    renderer: Renderer | None = None,
) -> Frame:
    """Renders one mesh from every camera, or a list of meshes from one camera each. See `Renderer.render`."""
    return (renderer or default_renderer()).render(meshes, cameras, settings, lights, save=save)


def backward(frame: Frame, *, by: Union[str, Sequence[str], None] = None, mode: str = "exact", **upstream: Any) -> Gradients:
    """The gradients of a loss from its gradients by a frame's images. See `Frame.backward`."""
    return frame.backward(by=by, mode=mode, **upstream)


class Fragments(NamedTuple):
    """What each pixel's centre shows."""

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
    gradient; `softras.torch.interpolate` interpolates any values of the vertices with one. Raises what `Renderer.render` raises.
    """
    return Fragments(*(renderer or default_renderer()).fragments(meshes, cameras, settings))
