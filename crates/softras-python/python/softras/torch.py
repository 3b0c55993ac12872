"""Rendering within torch's autograd.

`render` is a differentiable function of vertices, colours, texels, textures, UVs, view matrices, projections, lights,
background, sigma and gamma; `Rasterizer` is the same as a module. CPU tensors are read without a copy; CUDA tensors are copied
to the host and back, since the renderer has a device of its own. Vertices in float64 are rendered by the reference device, the
model in double precision on the host, which is slow and meant for `torch.autograd.gradcheck`. A graph may hold any number of
frames, and `torch.func.grad` takes it. The function is not differentiable twice, and an input that the loss does not depend on gets no
gradient.
"""

from __future__ import annotations

from typing import NamedTuple, Optional, Sequence, Union

import numpy as np
import torch

from . import _scene
from ._softras import Camera, Renderer
from .rendering import batched, default_renderer
from .losses import (
    chamfer_distance,
    edge_length_loss,
    flatten_loss,
    laplacian_loss,
    normal_consistency_loss,
    sample_surface,
)
from .settings import Lights, Settings

Tensors = Union[torch.Tensor, Sequence[torch.Tensor]]

__all__ = [
    "Fragments",
    "Images",
    "Rasterizer",
    "chamfer_distance",
    "edge_length_loss",
    "flatten_loss",
    "fragments",
    "interpolate",
    "iou_loss",
    "laplacian_loss",
    "look_at",
    "normal_consistency_loss",
    "render",
    "rigid_motion",
    "sample_surface",
]


class Images(NamedTuple):
    """The images of a batch; None for those that `Settings.outputs` does not name."""

    #: [views, height, width, 3], linear.
    color: Optional[torch.Tensor]
    #: [views, height, width], in [0, 1].
    silhouette: Optional[torch.Tensor]
    #: [views, height, width], world units, 0 where no triangle contributes.
    depth: Optional[torch.Tensor]
    #: [views, height, width, 3], world space.
    normal: Optional[torch.Tensor]


def _host(value) -> np.ndarray:
    if not isinstance(value, torch.Tensor):
        return np.asarray(value)
    # Within `torch.func` the result of a method is a wrapped tensor, so that none is called without need, and constants have no
    # `numpy`: they are read by DLPack.
    value = value.detach() if value.requires_grad else value
    value = value if value.device.type == "cpu" else value.cpu()
    # numpy has no bfloat16.
    value = value.float() if value.dtype in (torch.bfloat16, torch.float16) else value
    try:
        return value.numpy()
    except RuntimeError:
        return np.from_dlpack(value)


class _Render(torch.autograd.Function):
    @staticmethod
    def forward(scene: _scene.Scene, save: bool, *tensors: torch.Tensor):
        frame = _scene.render(scene, [_host(tensor) for tensor in tensors], save)
        scene.frame = frame if save else None
        images = [getattr(frame, name) for name in _scene.IMAGES]
        if scene.late:
            images[0] = np.full((*images[1].shape, 3), np.nan, np.float32)
        return tuple(torch.from_numpy(image).to(tensors[0].device) for image in images if image is not None)

    @staticmethod
    def setup_context(ctx, inputs, output):
        ctx.set_materialize_grads(False)
        ctx.scene, save, *tensors = inputs
        if save:
            # A leaf that is changed in place before backward is an error, as everywhere in torch.
            ctx.save_for_backward(*tensors)

    @staticmethod
    def backward(ctx, *upstream):
        names = [name for name in _scene.IMAGES if name in ctx.scene.settings.outputs]
        given = {name: gradient for name, gradient in zip(names, upstream) if gradient is not None}
        task = (ctx.scene, ctx.needs_input_grad[2:], tuple(given))
        return (None, None, *_Gradient.apply(task, *given.values(), *ctx.saved_tensors))


class _Gradient(torch.autograd.Function):
    """The gradients as an autograd function of their own, since `torch.func` unwraps the tensors that it passes to one."""

    @staticmethod
    def forward(task, *tensors: torch.Tensor):
        scene, wanted, names = task
        given, inputs = tensors[: len(names)], tensors[len(names) :]
        upstream = dict(zip(names, map(_host, given)))
        found = _scene.differentiate(scene, scene.frame, [_host(tensor) for tensor in inputs], wanted, upstream)
        # None for an input that the loss does not depend on: torch then skips the derivatives of what made the input.
        rows = zip(inputs, found)
        return tuple(None if one is None else torch.from_numpy(one).to(x).reshape(x.shape) for x, one in rows)

    @staticmethod
    def setup_context(ctx, inputs, output):
        pass

    @staticmethod
    def backward(ctx, *upstream):
        raise RuntimeError("softras is not differentiable twice: leave out create_graph")


def _rendered(scene: _scene.Scene, flat: Sequence[torch.Tensor]) -> Images:
    """The images of a scene with its tensors."""
    save = torch.is_grad_enabled() and any(tensor.requires_grad for tensor in flat)
    images = iter(_Render.apply(scene, save, *flat))
    return Images(*(next(images) if name in scene.settings.outputs else None for name in _scene.IMAGES))


@torch.compiler.disable
def render(
    vertices: Tensors,
    faces,
    cameras: Union[Camera, Sequence[Camera]],
    *,
    colors: Optional[Tensors] = None,
    surface: Optional[Tensors] = None,
    uvs: Optional[Tensors] = None,
    uv_faces=None,
    textures: Union[None, Tensors, Sequence[Tensors]] = None,
    texture_of_triangle=None,
    wrap: Optional[str] = None,
    settings: Optional[Settings] = None,
    lights: Optional[Lights] = None,
    mode: str = "exact",
    renderer: Optional[Renderer] = None,
    **tensors: torch.Tensor,
) -> Images:
    """Renders meshes to tensors.

    `vertices` is [V, 3] for one mesh that all cameras see, [B, V, 3] for B meshes with one camera each, one for all, or B·N, of which each
    mesh has N in turn; or a list of tensors for meshes of different sizes. `faces` is [F, 3] integers for all meshes, [B, F, 3], a list, or a `softras.Mesh` whose
    triangles and appearance are used. `colors` is [3] or [V, 3], `surface` [F, R², 3], `uvs` [U, 2] and `textures`
    [height, width, 3 or 4 with alpha] for one mesh; with one more dimension, or as a list, each mesh has its own.

    A mesh may have several textures: then `textures` is a list of them for one mesh, and a list of such lists for B meshes,
    and the constant `texture_of_triangle` [F] says which of them each triangle shows. `uv_faces` [F, 3] are the UVs of the
    triangles' corners (the faces unless given); both may be lists with one for each mesh. `wrap` is "repeat" or "clamp". If
    `faces` is a `softras.Mesh`, arguments that are left out are taken from it.

    As tensors by keyword:

    - `views`: [views, 4, 4] world-to-view matrices (view space x right, y up, z forward) in place of the cameras' own.
      Its gradient is that of rigid motions: build it from rotations and translations, as `look_at` does.
    - `projections`: [views] or [views, n] parameters of the cameras' projection: fov_y, half_height, or (fx, fy, cx, cy).
    - `ambient_color` [3], `ambient_intensity` [], `light_directions` [L, 3], `light_colors` [L, 3], `light_intensities` [L].
    - `background` [3], `sigma` [], `gamma` [].

    `mode` is "exact" or "paper" (eq. 4 of the paper alone). Raises what `Renderer.render` raises.
    """
    given = {"positions": vertices, "colors": colors, "surface": surface, "uvs": uvs, "textures": textures}
    constants = {"uv_faces": uv_faces, "texture_of_triangle": texture_of_triangle, "wrap": wrap}
    constants.update(settings=settings, lights=lights, mode=mode, renderer=renderer)
    return _rendered(*_scene.build(given, tensors, faces, cameras, constants, torch.Tensor, _host))


class Fragments(NamedTuple):
    """What each pixel's centre shows; see `softras.Fragments`. Tensors without gradient, beside the vertices."""

    triangle: torch.Tensor
    barycentrics: torch.Tensor
    depth: torch.Tensor


def fragments(
    vertices: Tensors,
    faces,
    cameras: Union[Camera, Sequence[Camera]],
    *,
    settings: Optional[Settings] = None,
    renderer: Optional[Renderer] = None,
) -> Fragments:
    """The nearest triangle of each pixel; arguments as of `render`. Raises what `Renderer.render` raises."""
    first = vertices if isinstance(vertices, torch.Tensor) else vertices[0]
    constants = {"settings": settings, "renderer": renderer}
    scene, flat = _scene.build({"positions": vertices}, {}, faces, cameras, constants, torch.Tensor, _host)
    meshes, seen = batched(scene.meshes([_host(tensor) for tensor in flat]), scene.cameras)
    found = (renderer or default_renderer()).fragments(meshes, seen, scene.settings)
    return Fragments(*(torch.from_numpy(array).to(first.device) for array in found))


def interpolate(found: Fragments, values: torch.Tensor, faces) -> torch.Tensor:
    """Values [V, N] of the vertices at each pixel of fragments of faces [F, 3]: [views, height, width, N], 0 for no triangle.

    With a gradient by the values; the fragments are constants.
    """
    corners = torch.as_tensor(_host(faces).astype(np.int64), device=values.device)[found.triangle.clamp(min=0).long()]
    return (found.barycentrics[..., None].to(values) * values[corners]).sum(-2)


class Rasterizer(torch.nn.Module):
    """`render` as a module with its settings and lights."""

    def __init__(
        self,
        settings: Optional[Settings] = None,
        lights: Optional[Lights] = None,
        *,
        mode: str = "exact",
        renderer: Optional[Renderer] = None,
    ):
        super().__init__()
        self.settings, self.lights, self.mode, self.renderer = settings, lights, mode, renderer

    def forward(self, vertices: Tensors, faces, cameras, **inputs) -> Images:
        """See `render`."""
        given = {"settings": self.settings, "lights": self.lights, "mode": self.mode, "renderer": self.renderer}
        return render(vertices, faces, cameras, **{**given, **inputs})

    def extra_repr(self) -> str:
        return f"{self.settings or Settings()}, mode={self.mode!r}"


def look_at(eye: torch.Tensor, target: torch.Tensor, up: torch.Tensor) -> torch.Tensor:
    """World-to-view matrices [..., 4, 4] of cameras at `eye` [..., 3] that look at `target`, differentiable by all three."""
    forward = torch.nn.functional.normalize(target - eye, dim=-1)
    right = torch.nn.functional.normalize(torch.linalg.cross(forward, up.expand_as(forward)), dim=-1)
    axes = torch.stack([right, torch.linalg.cross(right, forward), forward], -2)
    shift = -(axes @ eye[..., None])
    last = torch.zeros_like(axes[..., :1, :])
    last = torch.cat([last, torch.ones_like(last[..., :1])], -1)
    return torch.cat([torch.cat([axes, shift], -1), last], -2)


def rigid_motion(twist: torch.Tensor) -> torch.Tensor:
    """The matrices [..., 4, 4] of motions ξ = (v, ω) [..., 6]: `rigid_motion(twist) @ view` moves a camera."""
    v, (x, y, z) = twist[..., :3], twist[..., 3:].unbind(-1)
    zero = torch.zeros_like(x)
    turn = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).unflatten(-1, (3, 3))
    rows = torch.cat([turn, v[..., None]], -1)
    return torch.linalg.matrix_exp(torch.cat([rows, torch.zeros_like(rows[..., :1, :])], -2))


def iou_loss(prediction: torch.Tensor, target: torch.Tensor) -> torch.Tensor:
    """The mean over views of 1 - IoU of soft silhouettes, [views, height, width], as the official code has it."""
    product = prediction * target
    union = (prediction + target - product).flatten(1).sum(1) + 1e-6
    return 1.0 - (product.flatten(1).sum(1) / union).mean()
