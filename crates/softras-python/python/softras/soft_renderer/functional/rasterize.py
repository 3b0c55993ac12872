"""The official rasterizer: corners on the screen to images."""

from __future__ import annotations

import numbers
import warnings
import weakref
from typing import Optional

import numpy as np
import torch
from torch.utils._pytree import tree_leaves

from ... import _scene
from ... import torch as softras_torch
from ..._tensors import floats, host
from ..._softras import Camera
from ...errors import InputError, LimitError
from ...settings import Settings
from ..kinds import Number, Size, Vector

#: The nearest depth that is drawn.
_NEAREST = 1e-6
_ALPHA = {"hard": "hard", "sum": "sum", "prod": "product"}


def _sides(image_size: Size) -> tuple:
    """Height and width of an image of one side, or of (height, width)."""
    return (image_size, image_size) if isinstance(image_size, numbers.Integral) else tuple(image_size)


#: The arguments of `soft_rasterize` that say how an image is made, besides its size.
OPTIONS = ("background_color", "near", "far", "fill_back", "eps", "sigma_val", "dist_func", "dist_eps", "gamma_val")
OPTIONS += ("aggr_func_rgb", "aggr_func_alpha")


def _settings(
    image_size, background_color, near, far, fill_back, eps, sigma_val, dist_func, dist_eps, gamma_val, aggr_func_rgb,
    aggr_func_alpha
) -> Settings:
    if aggr_func_alpha not in _ALPHA:
        raise InputError(f"aggr_func_alpha is {aggr_func_alpha!r}: use hard, sum or prod")

    def number(x) -> float:
        return float(x.detach()) if isinstance(x, torch.Tensor) else float(x)

    def rounded(x) -> float:
        # The official kernels take float32.
        return float(np.float32(number(x)))

    height, width = _sides(image_size)
    near, far, gamma, eps = rounded(near), rounded(far), rounded(gamma_val), rounded(eps)
    if near < _NEAREST:
        warnings.warn(f"near = {near:g}: what lies nearer than {_NEAREST:g} in front of the eye is not drawn", stacklevel=4)
        # The kernels weigh by (far - z) / (far - near) / gamma, which stays as it is.
        scale = (far - near) / (far - _NEAREST)
        near, gamma, eps = _NEAREST, gamma * scale, eps * scale
    # They take the cut-off in place of dist_eps.
    cutoff = rounded(np.log(1.0 / number(dist_eps) - 1.0))
    return Settings.official(
        width=width,
        height=height,
        background_color=tuple(number(x) for x in background_color),
        near=near,
        far=far,
        faces="both" if fill_back else "front",
        epsilon=eps,
        sigma=rounded(sigma_val),
        distance=dist_func,
        tau=1.0 / (1.0 + float(np.exp(cutoff))),
        gamma=gamma,
        color=aggr_func_rgb,
        silhouette=_ALPHA[aggr_func_alpha],
    )


def rasterize_info(
    face_vertices: torch.Tensor, image_size: Size = 256, near: Number = 1, far: Number = 100, fill_back: bool = True,
    weights: Optional[dict] = None,
) -> tuple:
    """Two results that UMR's fork returns beside the images: p2f_info [batch, F, 2] and aggrs_info [batch, 2, size, size].

    aggrs_info is the depth of the nearest face of each pixel, 1e7 where there is none, and its number, -1 there. p2f_info is each
    face's mean place in the image, -1 to 1 with y down, by the `weights` that `soft_rasterize` takes besides, or zeros without; the
    fork's own weights depend on the order of the faces. Neither has a gradient.
    """
    with torch.no_grad():
        batch, count = face_vertices.shape[:2]
        corners = face_vertices.detach().float().reshape(batch, 3 * count, 3)
        settings = _settings(
            image_size, (0, 0, 0), near, far, fill_back, 1e-3, 1e-5, "euclidean", 1e-4, 1e-4, "hard", "prod"
        )
        found = softras_torch.fragments(corners, _apart(count), [Camera.screen()] * batch, settings=settings)
        depth = torch.where(found.triangle < 0, 1e7, found.depth)
        info = torch.stack((depth, found.triangle.to(depth)), 1)
    places = torch.zeros(batch, count, 2, device=face_vertices.device)
    if weights is None:
        return places, info
    with torch.enable_grad():
        white = torch.ones(batch, count, 1, 3, device=face_vertices.device, requires_grad=True)
        images = soft_rasterize(face_vertices.detach(), white, image_size, near=near, far=far, fill_back=fill_back, **weights)
    centres = [(2.0 * torch.arange(side, device=images.device) + 1.0) / side - 1.0 for side in _sides(image_size)]
    rows, columns = torch.meshgrid(*centres, indexing="ij")
    upstream = torch.stack((columns, rows, torch.ones_like(rows), torch.zeros_like(rows))).expand_as(images)
    # Colours are linear in the texels: their gradient is a sum of weights.
    (sums,) = torch.autograd.grad(images, white, upstream)
    return sums[:, :, 0, :2] / sums[:, :, 0, 2:].clamp(min=1e-12), info


def _apart(count: int) -> np.ndarray:
    """Triangles of corners that belong to one face each."""
    return np.arange(3 * count, dtype=np.uint32).reshape(count, 3)


def soft_rasterize(
    face_vertices: torch.Tensor,
    textures: torch.Tensor,
    image_size: Size = 256,
    background_color: Vector = (0, 0, 0),
    near: Number = 1,
    far: Number = 100,
    fill_back: bool = True,
    eps: Number = 1e-3,
    sigma_val: Number = 1e-5,
    dist_func: str = "euclidean",
    dist_eps: Number = 1e-4,
    gamma_val: Number = 1e-4,
    aggr_func_rgb: str = "softmax",
    aggr_func_alpha: str = "prod",
    texture_type: str = "surface",
    exact_gradients: bool = False,
) -> torch.Tensor:
    """Images [batch, 4, size, size] (red, green, blue, alpha; row 0 at the top) of faces on the screen.

    `image_size` may be (height, width). `face_vertices` is [batch, F, 3, 3]: x to the right and y up in [-1, 1], and view depth; in an
    image that is not square x reaches ±width / height. `textures` is [batch, F, R², 3] for
    texture_type "surface", [batch, F, 3, 3] for "vertex". The gradient is the official code's unless `exact_gradients`.
    """
    named = dict(locals())
    batch, count = face_vertices.shape[:2]
    if texture_type == "vertex":
        textures = textures.reshape(batch, 3 * count, 3)
    options = {name: named[name] for name in OPTIONS}
    corners = face_vertices.reshape(batch, 3 * count, 3)
    return rasterized(corners, _apart(count), textures, texture_type, image_size, options, exact_gradients)


@torch.compiler.disable
def rasterized(vertices, faces, textures, texture_type, image_size, options, exact_gradients, state=None) -> torch.Tensor:
    """The images of meshes on the screen. With a `state`, colours are rendered when they are read; at once, if those of the last
    images were read."""
    batch, count = len(vertices), faces.shape[-2]
    look = "surface" if texture_type == "surface" else "colors"
    given = {"positions": floats(vertices, "vertices").float(), look: floats(textures, "textures").float()}
    constants = {"settings": _settings(image_size, **options), "mode": "exact" if exact_gradients else "paper"}
    scene, flat = _scene.build(given, {}, faces, [Camera.screen()] * batch, constants, torch.Tensor, host)
    values = None if state is None or state.colors_are_read else [host(tensor).copy() for tensor in flat]
    kept = _scene.Kept(values=values)

    def tried(call):
        try:
            return call()
        except LimitError as error:
            if "`texels`" not in str(error):
                raise
            cells = f"{batch} × {count} faces with {textures.shape[2]} cells each"
            raise LimitError(f"{error}; {cells}: use a smaller texture_res, or softras.torch.render with textures") from None

    # The frame gets the colours, too, if it still waits for its gradients when they are read.
    waiting = weakref.ref(kept)
    found = tried(lambda: softras_torch._rendered(scene, flat, kept))
    images = torch.cat((found.color.permute(0, 3, 1, 2), found.silhouette[:, None]), dim=1).contiguous()
    if state is None:
        return images
    state.colors_are_read = False
    # `data` and not `detach()`: writing colours must not count as a change of tensors that autograd saved for alpha's derivative.
    whole = images.data

    def read():
        state.colors_are_read = True
        if values is not None:
            kept = waiting()
            save = kept is not None and kept.frame is not None
            frame = tried(lambda: _scene.render(scene, values, save))
            if save:
                kept.frame, kept.values = frame, None
            whole[:, :3] = torch.from_numpy(frame.color).permute(0, 3, 1, 2)

    images = images.as_subclass(_Images)
    images.read = read
    return images


def _is_of_alpha(index) -> bool:
    """Whether an index of images is of alpha alone."""
    if not isinstance(index, tuple) or len(index) < 2 or not isinstance(index[0], (int, slice)):
        return False
    channels = index[1]
    if isinstance(channels, slice):
        return (channels.start, channels.step) in ((3, None), (-1, None)) and channels.stop in (4, None)
    return isinstance(channels, int) and channels in (3, -1)


class _Images(torch.Tensor):
    """Images [batch, 4, height, width] that call `read` before anything but their alpha or shape is read; then they are a plain tensor.

    A reader of the memory without torch finds NaN in place of colours that have not been read by torch.
    """

    @classmethod
    def __torch_function__(cls, function, types, args=(), kwargs=None):
        with torch._C.DisableTorchFunctionSubclass():
            alpha = function is torch.Tensor.__getitem__ and _is_of_alpha(args[1])
            if not alpha and function not in (torch.Tensor.shape.__get__, torch.Tensor.device.__get__):
                for one in tree_leaves((args, kwargs)):
                    if isinstance(one, _Images):
                        one.__class__ = torch.Tensor
                        one.__dict__.pop("read")()
            return function(*args, **(kwargs or {}))
