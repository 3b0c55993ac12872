"""Rendering without a renderer of one's own: one is opened for the process when it is needed."""

from __future__ import annotations

import os
import threading

from ._softras import Frame, Gradients, Renderer

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


def render(meshes, cameras, settings=None, lights=None, *, save: bool = False, renderer: Renderer | None = None) -> Frame:
    """Renders one mesh from every camera, or a list of meshes from one camera each. See `Renderer.render`."""
    return (renderer or default_renderer()).render(meshes, cameras, settings, lights, save=save)


def backward(frame: Frame, *, by=None, mode: str = "exact", **upstream) -> Gradients:
    """The gradients of a loss from its gradients by a frame's images. See `Frame.backward`."""
    return frame.backward(by=by, mode=mode, **upstream)
