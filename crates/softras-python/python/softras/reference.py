"""The model once more in float64, by the host and without Vulkan. The kernels are tested against it; it is slow."""

from __future__ import annotations

from typing import Dict

import numpy as np

from ._softras import Gradients, reference_gradient, reference_render


def render(meshes, cameras, settings=None, lights=None, *, positions=None, colors=None) -> Dict[str, np.ndarray]:
    """The images of a scene as float64 arrays by name.

    `positions` and `colors` are lists with one float64 array for each mesh. They replace the mesh's own values, which are
    in single precision.
    """
    return reference_render(meshes, cameras, settings, lights, positions=positions, colors=colors)


def gradient(meshes, cameras, settings=None, lights=None, *, mode: str = "exact", **upstream) -> Gradients:
    """The gradients by every input, as float64 arrays, at the values that the meshes have."""
    return reference_gradient(meshes, cameras, settings, lights, mode=mode, **upstream)
