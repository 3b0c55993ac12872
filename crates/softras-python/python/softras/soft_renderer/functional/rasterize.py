"""The official rasterizer: corners on the screen to images."""

from __future__ import annotations

import warnings

import numpy as np
import torch

from ... import torch as softras_torch
from ..._softras import Camera
from ...errors import InputError
from ...settings import Settings

#: The nearest depth that is drawn.
_NEAREST = 1e-6
_ALPHA = {"hard": "hard", "sum": "sum", "prod": "product"}


def _settings(image_size, background_color, near, far, fill_back, eps, sigma_val, dist_func, dist_eps, gamma_val, rgb, alpha):
    if alpha not in _ALPHA:
        raise InputError(f"aggr_func_alpha is {alpha!r}: use hard, sum or prod")

    def number(x) -> float:
        return float(x.detach()) if isinstance(x, torch.Tensor) else float(x)

    def rounded(x) -> float:
        # The official kernels take float32.
        return float(np.float32(number(x)))

    near, far, gamma, eps = rounded(near), rounded(far), rounded(gamma_val), rounded(eps)
    if near < _NEAREST:
        warnings.warn(f"near = {near:g}: what lies nearer than {_NEAREST:g} in front of the eye is not drawn", stacklevel=4)
        # The kernels weigh by (far - z) / (far - near) / gamma, which stays as it is.
        scale = (far - near) / (far - _NEAREST)
        near, gamma, eps = _NEAREST, gamma * scale, eps * scale
    # They take the cut-off in place of dist_eps.
    cutoff = rounded(np.log(1.0 / number(dist_eps) - 1.0))
    return Settings.official(
        width=image_size,
        height=image_size,
        background_color=tuple(number(x) for x in background_color),
        near=near,
        far=far,
        faces="both" if fill_back else "front",
        epsilon=eps,
        sigma=rounded(sigma_val),
        distance=dist_func,
        tau=1.0 / (1.0 + float(np.exp(cutoff))),
        gamma=gamma,
        color=rgb,
        silhouette=_ALPHA[alpha],
    )


def soft_rasterize(
    face_vertices,
    textures,
    image_size=256,
    background_color=(0, 0, 0),
    near=1,
    far=100,
    fill_back=True,
    eps=1e-3,
    sigma_val=1e-5,
    dist_func="euclidean",
    dist_eps=1e-4,
    gamma_val=1e-4,
    aggr_func_rgb="softmax",
    aggr_func_alpha="prod",
    texture_type="surface",
    exact_gradients=False,
):
    """Images [batch, 4, size, size] (red, green, blue, alpha; row 0 at the top) of faces on the screen.

    `face_vertices` is [batch, F, 3, 3]: x to the right and y up in [-1, 1], and view depth. `textures` is [batch, F, R², 3] for
    texture_type "surface", [batch, F, 3, 3] for "vertex". The gradient is the official code's unless `exact_gradients`.
    """
    batch, count = face_vertices.shape[:2]
    settings = _settings(
        image_size,
        background_color,
        near,
        far,
        fill_back,
        eps,
        sigma_val,
        dist_func,
        dist_eps,
        gamma_val,
        aggr_func_rgb,
        aggr_func_alpha,
    )
    look = {"surface": textures} if texture_type == "surface" else {"colors": textures.reshape(batch, 3 * count, 3)}
    images = softras_torch.render(
        face_vertices.float().reshape(batch, 3 * count, 3),
        np.arange(3 * count, dtype=np.uint32).reshape(count, 3),
        [Camera.screen()] * batch,
        settings=settings,
        mode="exact" if exact_gradients else "paper",
        **{name: value.float() for name, value in look.items()},
    )
    return torch.cat((images.color, images.silhouette[..., None]), dim=3).permute(0, 3, 1, 2).contiguous()
