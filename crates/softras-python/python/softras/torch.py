"""Rendering within torch's autograd.

`render` is a differentiable function of vertices, colours, texels, textures, UVs, view matrices, projections, lights,
background, sigma and gamma; `Rasterizer` is the same as a module. CPU tensors are read without a copy; CUDA tensors are copied
to the host and back, since the renderer has a device of its own. Vertices in float64 are rendered by the reference device, the
model in double precision on the host, which is slow and meant for `torch.autograd.gradcheck`. A graph may hold any number of
frames. The function is not differentiable twice.
"""

from __future__ import annotations

import dataclasses
from typing import Any, Dict, List, NamedTuple, Optional, Sequence, Union

import numpy as np
import torch

from . import reference
from ._softras import Camera, Frame, Mesh, Renderer
from .errors import InputError
from .rendering import default_renderer
from .settings import DirectionalLight, Lights, Settings

Tensors = Union[torch.Tensor, Sequence[torch.Tensor]]

#: Dimensions of one mesh's array; a tensor of one more has one array for each mesh.
_OF_MESH = {"positions": 2, "colors": 2, "surface": 3, "uvs": 2, "textures": 3}
_OF_LIGHTS = ("ambient_color", "ambient_intensity", "light_directions", "light_colors", "light_intensities")
_OF_SETTINGS = ("background", "sigma", "gamma")
_OF_CAMERAS = ("views", "projections")
#: What `Frame.backward` calls the gradient by each input.
_BY = {"surface": "texels", "textures": "texels", "views": "cameras", "projections": "cameras", "background": "background"}
_BY.update({name: name for name in ("positions", "colors", "uvs")})
_BY.update({name: "lights" for name in _OF_LIGHTS}, sigma="scalars", gamma="scalars")
#: The last row of a view matrix.
_LAST_ROW = (0.0, 0.0, 0.0, 1.0)
_IMAGES = ("color", "silhouette", "depth", "normal")


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


class _Input(NamedTuple):
    """A tensor's name, and which meshes it belongs to: "all" of them, "each" by its first dimension, or one by its number."""

    name: str
    of: Union[str, int]


@dataclasses.dataclass
class _Scene:
    """What a frame is made from besides the tensors."""

    inputs: List[_Input]
    templates: List[Any]
    uv_faces: Any
    wrap: str
    cameras: List[Camera]
    settings: Settings
    lights: Lights
    mode: str
    renderer: Optional[Renderer]

    def meshes(self, arrays: List[np.ndarray]) -> List[Mesh]:
        """The meshes with the tensors' values."""
        found = []
        for i, template in enumerate(self.templates):
            given: Dict[str, Any] = {}
            for (name, of), array in zip(self.inputs, arrays):
                if name in _OF_MESH and of in ("all", "each", i):
                    given[name] = array[i] if of == "each" else array
            positions = given.pop("positions")
            if "textures" in given and self.uv_faces is not None:
                given["uv_triangles"] = self.uv_faces
            if "textures" in given:
                given["wrap"] = self.wrap
            if isinstance(template, Mesh):
                found.append(template.with_positions(positions).with_look(**given))
            else:
                found.append(Mesh(positions, template, **given))
        return found

    def seen(self, values: Dict[str, np.ndarray]) -> List[Camera]:
        """The cameras with the tensors' view matrices and projections."""
        if not any(name in values for name in _OF_CAMERAS):
            return self.cameras
        cameras = []
        count = len(values["views"] if "views" in values else values["projections"])
        if len(self.cameras) not in (1, count):
            raise InputError(f"{count} views or projections for {len(self.cameras)} cameras: give one for each")
        for i in range(count):
            camera = self.cameras[i % len(self.cameras)]
            projection = dict(camera.projection)
            if "projections" in values:
                if len(projection) != 1 or "original_size" in projection:
                    raise InputError("projections of a camera without parameters: use fov_y, half_height or pinhole")
                name = next(iter(projection))
                row = np.atleast_1d(np.asarray(values["projections"][i], np.float64))
                projection[name] = tuple(row) if name == "pinhole" else float(row[0])
            view = np.vstack([camera.view, _LAST_ROW])
            if "views" in values:
                view = np.array(values["views"][i], np.float64)
                # Products of matrices round it.
                if view.shape == (4, 4) and np.allclose(view[3], _LAST_ROW, atol=1e-6):
                    view[3] = _LAST_ROW
            cameras.append(Camera.from_matrix(view, **projection))
        return cameras

    def lit(self, values: Dict[str, np.ndarray]) -> Lights:
        """The lights with the tensors' values."""
        names = [name for name in _OF_LIGHTS if name in values]
        if not names:
            return self.lights
        fields: Dict[str, Any] = {}
        if "ambient_color" in values:
            fields["ambient_color"] = tuple(values["ambient_color"].tolist())
        if "ambient_intensity" in values:
            fields["ambient_intensity"] = float(values["ambient_intensity"])
        directional = list(self.lights.directional)
        for name, field in (("light_directions", "direction"), ("light_colors", "color"), ("light_intensities", "intensity")):
            if name not in values:
                continue
            rows = values[name].tolist()
            directional = directional or [DirectionalLight()] * len(rows)
            if len(rows) != len(directional):
                raise InputError(f"{len(rows)} {name} for {len(directional)} lights: give one for each")
            directional = [dataclasses.replace(light, **{field: row}) for light, row in zip(directional, rows)]
        return dataclasses.replace(self.lights, directional=tuple(directional), **fields)

    def set(self, values: Dict[str, np.ndarray]) -> Settings:
        """The settings with the tensors' values."""
        fields: Dict[str, Any] = {name: float(values[name]) for name in ("sigma", "gamma") if name in values}
        if "background" in values:
            fields["background_color"] = tuple(values["background"].tolist())
        return dataclasses.replace(self.settings, **fields) if fields else self.settings


class _Reference:
    """A frame of the reference device: as `Frame`, in double precision."""

    def __init__(self, meshes, cameras, settings, lights, positions, colors):
        self._scene = (meshes, cameras, settings, lights)
        images = reference.render(*self._scene, positions=positions, colors=colors)
        for name in _IMAGES:
            setattr(self, name, images.get(name))

    def backward(self, *, by, mode, **upstream):
        return reference.gradient(*self._scene, mode=mode, **upstream)


def _frame(scene: _Scene, arrays: List[np.ndarray], save: bool) -> Union[Frame, _Reference]:
    values = {name: array for (name, of), array in zip(scene.inputs, arrays) if name not in _OF_MESH}
    meshes, cameras = scene.meshes(arrays), scene.seen(values)
    settings, lights = scene.set(values), scene.lit(values)
    if arrays[0].dtype != np.float64:
        return (scene.renderer or default_renderer()).render(meshes, cameras, settings, lights, save=save)
    exact: Dict[str, list] = {"positions": [], "colors": []}
    for i in range(len(meshes)):
        for (name, of), array in zip(scene.inputs, arrays):
            if name in exact and of in ("all", "each", i):
                exact[name].append(array[i] if of == "each" else array)
    return _Reference(meshes, cameras, settings, lights, exact["positions"], exact["colors"] or None)


def _by_views(twists: np.ndarray, views: np.ndarray) -> np.ndarray:
    """The gradient by view matrices V from that by ξ = (v, ω) in exp(ξ) V, for rigid motions of V."""
    by_motion = np.zeros((len(twists), 4, 4))
    by_motion[:, :3, 3] = twists[:, :3]
    x, y, z = twists[:, 3] / 2, twists[:, 4] / 2, twists[:, 5] / 2
    by_motion[:, 0, 1], by_motion[:, 0, 2], by_motion[:, 1, 2] = -z, y, -x
    by_motion[:, 1, 0], by_motion[:, 2, 0], by_motion[:, 2, 1] = z, -y, x
    return by_motion @ np.linalg.inv(views.astype(np.float64)).transpose(0, 2, 1)


def _gradient(scene: _Scene, index: int, found, arrays: List[np.ndarray]) -> np.ndarray:
    """The gradient by one of the inputs."""
    name, of = scene.inputs[index]
    if name in _OF_MESH:
        chosen = [found.meshes[of]] if isinstance(of, int) else found.meshes
        parts = [mesh.textures[0] if name == "textures" else getattr(mesh, name) for mesh in chosen]
        if name == "textures" and arrays[index].shape[-1] == 4:
            alphas = [mesh.alphas[0] if mesh.alphas else np.zeros(part.shape[:2]) for mesh, part in zip(chosen, parts)]
            parts = [np.concatenate([part, alpha[..., None]], -1) for part, alpha in zip(parts, alphas)]
        return np.stack(parts) if of == "each" else parts[0] if len(parts) == 1 else np.sum(parts, 0)
    if name == "views":
        return _by_views(found.twists, arrays[index])
    if name == "projections":
        shape = arrays[index].shape
        return found.projections[:, : shape[1] if len(shape) == 2 else 1].reshape(shape)
    return np.asarray(getattr(found, name))


def _any(array: np.ndarray) -> bool:
    """Whether a value differs from 0; most gradients differ in some of a few places."""
    return bool(array.reshape(-1)[::101].any() or array.any())


def _matters(name: str, upstream: Dict[str, np.ndarray]) -> bool:
    """Whether a loss of these images can depend on an input."""
    return "color" in upstream if name in ("colors", "surface", "background") + _OF_LIGHTS else bool(upstream)


class _Render(torch.autograd.Function):
    @staticmethod
    def forward(ctx, scene: _Scene, *tensors: torch.Tensor):
        arrays = [tensor.detach().cpu().numpy() for tensor in tensors]
        ctx.set_materialize_grads(False)
        ctx.scene, ctx.save = scene, any(ctx.needs_input_grad)
        frame = _frame(scene, arrays, ctx.save)
        if ctx.save:
            # A leaf that is changed in place before backward is an error, as everywhere in torch.
            ctx.save_for_backward(*tensors)
            ctx.frame = frame
        images = [(name, getattr(frame, name)) for name in _IMAGES]
        ctx.names = [name for name, image in images if image is not None]
        device = tensors[0].device
        return tuple(torch.from_numpy(image).to(device) for _, image in images if image is not None)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx, *upstream):
        arrays = {name: g.detach().cpu().numpy() for name, g in zip(ctx.names, upstream) if g is not None}
        given = {name: array for name, array in arrays.items() if _any(array)}
        tensors, scene = ctx.saved_tensors, ctx.scene
        needed = [wanted and _matters(name, given) for (name, _), wanted in zip(scene.inputs, ctx.needs_input_grad[1:])]
        if any(needed):
            by = sorted({_BY[name] for (name, _), wanted in zip(scene.inputs, needed) if wanted})
            found = ctx.frame.backward(by=by, mode=scene.mode, **given)
            arrays = [tensor.detach().cpu().numpy() for tensor in tensors]

        def one(index: int):
            if not needed[index]:
                return torch.zeros_like(tensors[index]) if ctx.needs_input_grad[1 + index] else None
            gradient = np.ascontiguousarray(_gradient(scene, index, found, arrays))
            return torch.from_numpy(gradient).to(tensors[index]).reshape(tensors[index].shape)

        return (None, *(one(index) for index in range(len(tensors))))


def _collect(name: str, value: Tensors, meshes: int, inputs: List[_Input], tensors: List[torch.Tensor]) -> None:
    """Appends an argument's tensors."""
    if isinstance(value, torch.Tensor):
        stacked = name in _OF_MESH and value.ndim > _OF_MESH[name]
        if stacked and len(value) != meshes:
            raise InputError(f"{name} has shape {tuple(value.shape)} for {meshes} meshes: give one array for each")
        inputs.append(_Input(name, "each" if stacked else "all"))
        tensors.append(value)
        return
    if name not in _OF_MESH or len(value) != meshes or not all(isinstance(one, torch.Tensor) for one in value):
        raise InputError(f"{name} is no tensor: give a tensor, or for meshes a list with one tensor for each")
    inputs.extend(_Input(name, i) for i in range(meshes))
    tensors.extend(value)


def _templates(faces, meshes: int) -> List[Any]:
    """The triangles, or the mesh to take them from, of each mesh."""
    if isinstance(faces, Mesh):
        return [faces] * meshes
    if isinstance(faces, (list, tuple)) and len(faces) == meshes and not isinstance(faces[0], (list, tuple)):
        return [one.detach().cpu().numpy() if isinstance(one, torch.Tensor) else one for one in faces]
    array = faces.detach().cpu().numpy() if isinstance(faces, torch.Tensor) else np.asarray(faces)
    if array.ndim == 3 and len(array) != meshes:
        raise InputError(f"faces has shape {array.shape} for {meshes} meshes: give [F, 3], or one array for each")
    return list(array) if array.ndim == 3 else [array] * meshes


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
    textures: Optional[Tensors] = None,
    wrap: str = "repeat",
    settings: Optional[Settings] = None,
    lights: Optional[Lights] = None,
    mode: str = "exact",
    renderer: Optional[Renderer] = None,
    **tensors: torch.Tensor,
) -> Images:
    """Renders meshes to tensors.

    `vertices` is [V, 3] for one mesh that all cameras see, [B, V, 3] for B meshes with one camera each, or a list of tensors
    for meshes of different sizes. `faces` is [F, 3] integers for all meshes, [B, F, 3], a list, or a `softras.Mesh` whose
    triangles and appearance are used. `colors` is [3] or [V, 3], `surface` [F, R², 3], `uvs` [U, 2] and `textures`
    [height, width, 3 or 4 with alpha] for one mesh; with one more dimension, or as a list, each mesh has its own.

    As tensors by keyword:

    - `views`: [views, 4, 4] world-to-view matrices (view space x right, y up, z forward) in place of the cameras' own.
      Its gradient is that of rigid motions: build it from rotations and translations, as `look_at` does.
    - `projections`: [views] or [views, n] parameters of the cameras' projection: fov_y, half_height, or (fx, fy, cx, cy).
    - `ambient_color` [3], `ambient_intensity` [], `light_directions` [L, 3], `light_colors` [L, 3], `light_intensities` [L].
    - `background` [3], `sigma` [], `gamma` [].

    `mode` is "exact" or "paper" (eq. 4 of the paper alone). Raises what `Renderer.render` raises.
    """
    known = _OF_CAMERAS + _OF_LIGHTS + _OF_SETTINGS
    unknown = sorted(set(tensors) - set(known))
    if unknown:
        raise InputError(f"no input is called {unknown[0]!r}: use {', '.join(known)}")
    batched = not isinstance(vertices, torch.Tensor) or vertices.ndim == 3
    meshes = len(vertices) if batched else 1
    inputs: List[_Input] = []
    flat: List[torch.Tensor] = []
    given = {"positions": vertices, "colors": colors, "surface": surface, "uvs": uvs, "textures": textures, **tensors}
    for name, value in given.items():
        if value is not None:
            _collect(name, value, meshes, inputs, flat)
    cameras = [cameras] if isinstance(cameras, Camera) else list(cameras)
    uv_faces = uv_faces.detach().cpu().numpy() if isinstance(uv_faces, torch.Tensor) else uv_faces
    scene = _Scene(
        inputs, _templates(faces, meshes), uv_faces, wrap, cameras, settings or Settings(), lights or Lights(), mode, renderer
    )
    images = iter(_Render.apply(scene, *flat))
    return Images(*(next(images) if name in scene.settings.outputs else None for name in _IMAGES))


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


def laplacian_loss(vertices: torch.Tensor, faces: torch.Tensor) -> torch.Tensor:
    """Σ |p - mean of its neighbours|² over the vertices [V, 3] of a mesh, as in the official code."""
    edges = torch.cat([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).long().to(vertices.device)
    edges = torch.unique(torch.cat([edges, edges.flip(1)]), dim=0)
    count = torch.bincount(edges[:, 0], minlength=len(vertices)).clamp(min=1)
    sums = torch.zeros_like(vertices).index_add(0, edges[:, 0], vertices[edges[:, 1]])
    alone = torch.bincount(edges[:, 0], minlength=len(vertices)) == 0
    offsets = vertices - torch.where(alone[:, None], vertices, sums / count[:, None].to(vertices))
    return offsets.pow(2).sum()
