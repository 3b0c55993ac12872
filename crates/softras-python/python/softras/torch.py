"""Rendering within torch's autograd.

`render` is a differentiable function of vertices, colours, features, texels, textures, UVs, view matrices, projections, lights,
background, sigma and gamma; `Rasterizer` is the same as a module. CPU tensors are read without a copy; CUDA tensors are copied
to the host and back, since the renderer has a device of its own. Vertices in float64 are rendered by the reference device, the
model in double precision on the host, which is slow and meant for `torch.autograd.gradcheck`. A graph may hold any number of
frames, and `torch.func.grad` takes it. The function is not differentiable twice, and an input that no image of the loss depends on gets
no gradient.
"""

from __future__ import annotations

from typing import NamedTuple, Optional, Sequence, Union

import numpy as np
import torch

from . import _scene
from ._fragments import Fragments, antialias, fragments, interpolate
from ._tensors import host, mask, plain
from ._softras import Camera, Renderer
from .errors import CameraError, InputError
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
    "antialias",
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
    #: [views, height, width, N], the features of the vertices.
    features: Optional[torch.Tensor]


class _Render(torch.autograd.Function):
    @staticmethod
    def forward(scene: _scene.Scene, kept: _scene.Kept, save: bool, *tensors: torch.Tensor):
        frame = _scene.render(scene, [host(tensor) for tensor in tensors], save, kept.colored)
        kept.frame = frame if save else None
        images = [getattr(frame, name) for name in _scene.IMAGES]
        if not kept.colored:
            images[0] = np.full((*images[1].shape, 3), np.nan, np.float32)
        return tuple(torch.from_numpy(image).to(tensors[0].device) for image in images if image is not None)

    @staticmethod
    def setup_context(ctx, inputs, output):
        ctx.set_materialize_grads(False)
        ctx.scene, kept, save, *tensors = inputs
        if save:
            # Autograd frees the tensors that it saved after backward, and with this one the frame.
            owner = torch.empty(0)
            owner.kept = kept
            # A leaf that is changed in place before backward is an error, as everywhere in torch.
            ctx.save_for_backward(*tensors, owner)

    @staticmethod
    def backward(ctx, *upstream):
        names = [name for name in _scene.IMAGES if name in ctx.scene.settings.outputs]
        given = {name: gradient for name, gradient in zip(names, upstream) if gradient is not None}
        *tensors, owner = ctx.saved_tensors
        # A hook for saved tensors may have made a copy of it.
        kept = getattr(owner, "kept", None) or _scene.Kept()
        task = (ctx.scene, kept, ctx.needs_input_grad[3:], tuple(given))
        # Gradients are enabled here for a second derivative alone, which is an error of `_Gradient`'s backward.
        is_plain = plain() and not torch.is_grad_enabled()
        found = (_Gradient.forward if is_plain else _Gradient.apply)(task, *given.values(), *tensors)
        return (None, None, None, *found)


class _Gradient(torch.autograd.Function):
    """The gradients as an autograd function of their own, since `torch.func` unwraps the tensors that it passes to one."""

    @staticmethod
    def forward(task, *tensors: torch.Tensor):
        scene, kept, wanted, names = task
        given, inputs = tensors[: len(names)], tensors[len(names) :]
        upstream = dict(zip(names, map(host, given)))
        found = _scene.differentiate(scene, kept, [host(tensor) for tensor in inputs], wanted, upstream)
        # None for an input that the loss does not depend on: torch then skips the derivatives of what made the input.
        rows = zip(inputs, found)
        return tuple(None if one is None else torch.from_numpy(one).to(x).reshape(x.shape) for x, one in rows)

    @staticmethod
    def setup_context(ctx, inputs, output):
        pass

    @staticmethod
    def backward(ctx, *upstream):
        raise RuntimeError("softras is not differentiable twice: leave out create_graph")


def _rendered(scene: _scene.Scene, flat: Sequence[torch.Tensor], kept: _scene.Kept) -> Images:
    """The images of a scene with its tensors."""
    save = torch.is_grad_enabled() and any(tensor.requires_grad for tensor in flat)
    images = iter(_Render.apply(scene, kept, save, *flat))
    return Images(*(next(images) if name in scene.settings.outputs else None for name in _scene.IMAGES))


@torch.compiler.disable
def render(
    vertices: Tensors,
    faces,
    cameras: Union[Camera, Sequence[Camera]],
    *,
    colors: Optional[Tensors] = None,
    features: Optional[Tensors] = None,
    surface: Optional[Tensors] = None,
    uvs: Optional[Tensors] = None,
    uv_faces=None,
    textures: Union[None, Tensors, Sequence[Tensors]] = None,
    texture_of_triangle=None,
    wrap: Union[None, str, Sequence[str]] = None,
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

    `features` [V, N] are any numbers of the vertices from -1e12 to 1e12, with one more dimension or as a list those of each mesh, all with one N. The image `features`
    [views, height, width, N] has the weights of colours, 0 for the background and no light: what a shader of your own starts from.

    A mesh may have several textures: then `textures` is a list of them for one mesh, and a list of such lists for B meshes,
    and the constant `texture_of_triangle` [F] says which of them each triangle shows. `uv_faces` [F, 3] are the UVs of the
    triangles' corners (the faces unless given); both may be lists with one for each mesh. `wrap` is "repeat" or "clamp", or a list with one for each texture. If
    `faces` is a `softras.Mesh`, arguments that are left out are taken from it.

    As tensors by keyword:

    - `views`: [views, 4, 4] world-to-view matrices (view space x right, y up, z forward) in place of the cameras' own.
      Its gradient is that of rigid motions: build it from rotations and translations, as `look_at` does.
    - `projections`: [views] or [views, n] parameters of the cameras' projection: fov_y, half_height, or (fx, fy, cx, cy).
    - `ambient_color` [3], `ambient_intensity` [], `light_directions` [L, 3], `light_colors` [L, 3], `light_intensities` [L].
    - `background` [3], `sigma` [], `gamma` [].

    `mode` is "exact" or "paper" (eq. 4 of the paper alone). Raises what `Renderer.render` raises.
    """
    given = {"positions": vertices, "colors": colors, "features": features, "surface": surface, "uvs": uvs, "textures": textures}
    constants = {"uv_faces": uv_faces, "texture_of_triangle": texture_of_triangle, "wrap": wrap}
    constants.update(settings=settings, lights=lights, mode=mode, renderer=renderer)
    return _rendered(*_scene.build(given, tensors, faces, cameras, constants, torch.Tensor, host), _scene.Kept())


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
    """World-to-view matrices [..., 4, 4] of cameras at `eye` [..., 3] that look at `target`, differentiable by all three.

    Raises CameraError where `up` is along the view.
    """
    normalize = torch.nn.functional.normalize
    forward = normalize(target - eye, dim=-1)
    right = torch.linalg.cross(forward, normalize(up, dim=-1).expand_as(forward))
    if plain() and not bool((right.norm(dim=-1) > 1e-7).all()):
        raise CameraError("look_at: up is along the view, or eye and target coincide: give another up, as (0, 0, 1) for straight down")
    # Nearly along the view `right` is rounded, and made perpendicular once more.
    upward = normalize(torch.linalg.cross(normalize(right, dim=-1), forward), dim=-1)
    axes = torch.stack([torch.linalg.cross(forward, upward), upward, forward], -2)
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
    """The mean over views of 1 - IoU of soft silhouettes, [views, height, width], as the official code has it. Raises InputError for
    what is no mask from 0 to 1, and for shapes that differ."""
    prediction, target = mask(prediction, "prediction"), mask(target, "target")
    if prediction.shape != target.shape or prediction.ndim < 3:
        shapes = f"{tuple(prediction.shape)} and {tuple(target.shape)}"
        raise InputError(f"silhouettes of shapes {shapes}: give both as [views, height, width]")
    product = prediction * target
    union = (prediction + target - product).flatten(1).sum(1) + 1e-6
    return 1.0 - (product.flatten(1).sum(1) / union).mean()
