"""A scene whose arrays are a framework's: what `softras.torch` and `softras.jax` share, on numpy arrays.

A framework's node hands over its arrays in the order of `Scene.inputs`; `render` makes a frame of them, and `differentiate`
returns the gradient by each of them.
"""

from __future__ import annotations

import dataclasses
import functools
import operator
import types
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple, Type, Union

import numpy as np

from . import reference
from ._softras import Camera, Frame, Mesh, Renderer
from .errors import InputError
from .rendering import batched, default_renderer
from .settings import DirectionalLight, Lights, Settings

IMAGES = ("color", "silhouette", "depth", "normal", "features")

#: Dimensions of one mesh's array; an array of one more has one for each mesh.
_OF_MESH = {"positions": 2, "colors": 2, "features": 2, "surface": 3, "uvs": 2, "textures": 3}
_OF_LIGHTS = ("ambient_color", "ambient_intensity", "light_directions", "light_colors", "light_intensities")
_OF_SETTINGS = ("background", "sigma", "gamma")
_OF_CAMERAS = ("views", "projections")
#: What `Frame.backward` calls the gradient by each input.
_BY = {"surface": "texels", "textures": "texels", "views": "cameras", "projections": "cameras", "background": "background"}
_BY.update({name: name for name in ("positions", "colors", "features", "uvs")})
_BY.update({name: "lights" for name in _OF_LIGHTS}, sigma="scalars", gamma="scalars")
#: The most features of a frame, and those that the reference device renders at once: as colours.
_FEATURES, _EXACT_FEATURES = 32, 3
#: The last row of a view matrix.
_LAST_ROW = (0.0, 0.0, 0.0, 1.0)


class Input(NamedTuple):
    """An array's name, which meshes it belongs to ("all", "each" by its first dimension, or one by its number), and for
    textures which of the mesh's."""

    name: str
    of: Union[str, int]
    texture: int = 0

    def belongs_to(self, mesh: int) -> bool:
        return self.name in _OF_MESH and self.of in ("all", "each", mesh)

    def part(self, array: np.ndarray, mesh: int) -> np.ndarray:
        """A mesh's part of the array."""
        return array[mesh] if self.of == "each" else array


class Look(NamedTuple):
    """The constants of a mesh's textures; None for what its template has, or for the defaults."""

    uv_triangles: Optional[np.ndarray]
    texture_of_triangle: Optional[np.ndarray]
    wrap: Union[None, str, Sequence[str]]


@dataclasses.dataclass
class Scene:
    """The inputs of a frame besides the arrays."""

    inputs: List[Input]
    templates: List[Any]
    looks: List[Look]
    cameras: List[Camera]
    settings: Settings
    lights: Lights
    mode: str
    renderer: Optional[Renderer]

    def meshes(self, arrays: Sequence[np.ndarray], colored: bool = True) -> List[Mesh]:
        """The meshes with the arrays' values but for features, and unless `colored` without colours."""
        found = []
        # Triangles that several meshes have are read and checked once.
        bare: Dict[Any, Mesh] = {}
        for i, (template, look) in enumerate(zip(self.templates, self.looks)):
            given: Dict[str, Any] = {}
            for one, array in zip(self.inputs, arrays):
                if one.name == "features" or (not colored and one.name in ("colors", "surface")):
                    continue
                if one.belongs_to(i) and one.name == "textures":
                    given.setdefault("textures", []).append(one.part(array, i))
                elif one.belongs_to(i):
                    given[one.name] = one.part(array, i)
            positions = given.pop("positions")
            if "textures" in given or "uvs" in given:
                given.update({name: value for name, value in look._asdict().items() if value is not None})
            base = template if isinstance(template, Mesh) else bare.get((id(template), len(positions)))
            if base is None:
                base = bare[id(template), len(positions)] = Mesh(positions, template)
            moved = base.with_positions(positions)
            found.append(moved._with_part_of_look(**given) if given else moved)
        return found

    def features(self, arrays: Sequence[np.ndarray]) -> List[np.ndarray]:
        """The features [V, N] of each mesh, those that are given or its template's; none unless they are rendered."""
        if "features" not in self.settings.outputs:
            return []
        found = []
        for i, template in enumerate(self.templates):
            given = [one.part(array, i) for one, array in zip(self.inputs, arrays) if one.name == "features" and one.belongs_to(i)]
            own = template.features if isinstance(template, Mesh) else None
            found.extend(given or ([] if own is None else [own]))
        if len(found) != len(self.templates) or any(array.ndim != 2 or array.shape[1] == 0 for array in found):
            raise InputError("features are asked for: give each mesh [V, N], of 1 or more for each vertex")
        if len({array.shape[1] for array in found}) > 1:
            raise InputError("meshes with different numbers of features: give each [V, N] with one N")
        return found

    def of_meshes(self, name: str, arrays: Sequence[np.ndarray], times: int) -> List[np.ndarray]:
        """The arrays of a name that the meshes have, each as often as its mesh is in the frame; none for a mesh without."""
        inputs = list(zip(self.inputs, arrays))
        meshes = [i for i, _ in enumerate(self.templates) for _ in range(times)]
        return [one.part(array, i) for i in meshes for one, array in inputs if one.name == name and one.belongs_to(i)]

    def channels(self, arrays: Sequence[Any]) -> int:
        """The number of features, from arrays of which only the shapes are known."""
        given = [array.shape[-1] for one, array in zip(self.inputs, arrays) if one.name == "features" and array.ndim > 1]
        own = [one.features.shape[1] for one in self.templates if isinstance(one, Mesh) and one.features is not None]
        return (given or own or [0])[0]

    def seen(self, values: Dict[str, np.ndarray]) -> List[Camera]:
        """The cameras with the arrays' view matrices and projections."""
        if not any(name in values for name in _OF_CAMERAS):
            return self.cameras
        cameras = []
        count = len(values["views"] if "views" in values else values["projections"])
        if len(self.cameras) not in (1, count):
            raise InputError(f"{count} views or projections for {len(self.cameras)} cameras: give one for each")
        for i in range(count):
            camera = self.cameras[i % len(self.cameras)]
            projection = dict(camera.projection)
            if len(projection) != 1:
                raise InputError("views or projections of a camera without parameters: use fov_y, half_height or pinhole")
            if "projections" in values:
                name = next(iter(projection))
                row = np.atleast_1d(np.asarray(values["projections"][i], np.float64))
                if row.shape != np.shape(np.atleast_1d(projection[name])):
                    raise InputError(f"projections[{i}] of shape {row.shape}: {name} has {np.size(projection[name])}")
                projection[name] = tuple(row) if name == "pinhole" else float(row[0])
            if "views" not in values:
                cameras.append(Camera._restored(camera.view, projection))
                continue
            view = np.array(values["views"][i], np.float64)
            # Products of matrices round it.
            if view.shape == (4, 4) and np.allclose(view[3], _LAST_ROW, atol=1e-6):
                view[3] = _LAST_ROW
            mirrored = bool(np.linalg.det(camera.view[:, :3]) > 0)
            cameras.append(Camera.from_matrix(view, **projection, mirrored=mirrored))
        return cameras

    def lit(self, values: Dict[str, np.ndarray]) -> Lights:
        """The lights with the arrays' values."""
        names = [name for name in _OF_LIGHTS if name in values]
        if not names:
            return self.lights
        fields: Dict[str, Any] = {}
        if "ambient_color" in values:
            fields["ambient_color"] = values["ambient_color"]
        if "ambient_intensity" in values:
            fields["ambient_intensity"] = float(values["ambient_intensity"])
        directional = list(self.lights.directional)
        for name, field in (("light_directions", "direction"), ("light_colors", "color"), ("light_intensities", "intensity")):
            if name not in values:
                continue
            rows = list(values[name])
            directional = directional or [DirectionalLight()] * len(rows)
            if len(rows) != len(directional):
                raise InputError(f"{len(rows)} {name} for {len(directional)} lights: give one for each")
            directional = [dataclasses.replace(light, **{field: row}) for light, row in zip(directional, rows)]
        return dataclasses.replace(self.lights, directional=tuple(directional), **fields)

    def set(self, values: Dict[str, np.ndarray]) -> Settings:
        """The settings with the arrays' values."""
        fields: Dict[str, Any] = {name: float(values[name]) for name in ("sigma", "gamma") if name in values}
        if "background" in values:
            fields["background_color"] = values["background"]
        return dataclasses.replace(self.settings, **fields) if fields else self.settings


@dataclasses.dataclass
class Kept:
    """A frame that waits for its gradients, rendered again where there is none; and, if it has no colours yet, the values to render
    them from."""

    frame: Any = None
    values: Optional[List[np.ndarray]] = None

    @property
    def colored(self) -> bool:
        return self.values is None


class _Reference:
    """A frame of the reference device: as `Frame`, in double precision."""

    def __init__(self, meshes, cameras, settings, lights, positions, colors):
        self._scene = (meshes, cameras, settings, lights)
        images = reference.render(*self._scene, positions=positions, colors=colors)
        for name in IMAGES:
            setattr(self, name, images.get(name))

    def backward(self, *, by, mode, **upstream):
        return reference.gradient(*self._scene, mode=mode, **upstream)


class _ExactFeatures:
    """Up to three features of the reference device, which are colours without light before a black background."""

    def __init__(self, meshes, cameras, settings, positions, features):
        self._channels = features[0].shape[-1]
        # Colours end at 100. A power of two changes no digit.
        most = max(np.abs(array, dtype=np.float64).max(initial=1.0) for array in features)
        self._scale = 2.0 ** np.ceil(np.log2(most))
        colors = [np.pad(array / self._scale, ((0, 0), (0, _EXACT_FEATURES - self._channels))) for array in features]
        settings = dataclasses.replace(settings, outputs=("color",), background_color=(0.0, 0.0, 0.0))
        if any(texture.shape[-1] == 4 for mesh in meshes for texture in mesh.textures or []):
            raise InputError("features in double precision beside a texture with alpha: leave out one of the two")
        colored = [Mesh(mesh.positions, mesh.triangles, colors=part) for mesh, part in zip(meshes, colors)]
        self._frame = _Reference(colored, cameras, settings, Lights(), positions, colors)
        self.features = self._scale * self._frame.color[..., : self._channels]

    def backward(self, *, by, mode, features):
        padded = np.pad(self._scale * features, ((0, 0),) * 3 + ((0, _EXACT_FEATURES - self._channels),))
        found = self._frame.backward(by=by, mode=mode, color=padded)
        kept = types.SimpleNamespace(**{name: getattr(found, name) for name in _GRADIENTS if name not in _OF_COLORS})
        meshes = [(mesh.positions, mesh.colors[:, : self._channels] / self._scale) for mesh in found.meshes]
        kept.meshes = [types.SimpleNamespace(positions=places, features=part) for places, part in meshes]
        return kept


class _Joined:
    """A frame with features from other frames, of some features each."""

    def __init__(self, frame, parts):
        self._frame, self._parts = frame, parts
        for name in IMAGES:
            setattr(self, name, getattr(frame, name, None))
        self.features = np.concatenate([part.features for part in parts], -1)

    def backward(self, *, by, mode, **upstream):
        given = upstream.pop("features", None)
        found = [self._frame.backward(by=by, mode=mode, **upstream)] if upstream else []
        ends = np.cumsum([part.features.shape[-1] for part in self._parts])
        rows = [] if given is None else zip(self._parts, np.split(given, ends[:-1], -1))
        parts = [part.backward(by=by, mode=mode, features=np.ascontiguousarray(own)) for part, own in rows]
        total = types.SimpleNamespace()
        for name in _GRADIENTS:
            setattr(total, name, _sum([getattr(one, name, None) for one in found + parts]))
        total.meshes = []
        for of_mesh in zip(*(one.meshes for one in found + parts)):
            mesh = types.SimpleNamespace()
            for name in _MESH_GRADIENTS:
                setattr(mesh, name, _sum([getattr(one, name, None) for one in of_mesh]))
            features = [getattr(one, "features", None) for one in of_mesh[len(found) :]]
            mesh.features = np.concatenate(features, -1) if features and features[0] is not None else None
            total.meshes.append(mesh)
        return total


_MESH_GRADIENTS = ("positions", "colors", "surface", "textures", "alphas", "uvs")
_OF_COLORS = (*_OF_LIGHTS, "background")
_GRADIENTS = ("twists", "projections", "epsilon", "sigma", "gamma") + _OF_COLORS


def _sum(values):
    """The sum of arrays, or of lists of arrays, of which some may be None."""
    given = [value for value in values if value is not None]
    if not given:
        return None
    return [_sum(each) for each in zip(*given)] if isinstance(given[0], list) else functools.reduce(operator.add, given)


def render(scene: Scene, arrays: Sequence[np.ndarray], save: bool, colored: bool = True) -> Union[Frame, _Reference, _Joined]:
    """A frame of the arrays' values, by the reference device where the positions are in double precision; the silhouette alone unless
    it is `colored`."""
    values = {one.name: array for one, array in zip(scene.inputs, arrays) if one.name not in _OF_MESH}
    own = scene.meshes(arrays, colored)
    meshes, cameras = batched(own, scene.seen(values))
    settings, lights = scene.set(values), scene.lit(values)
    if not colored:
        settings = dataclasses.replace(settings, outputs=("silhouette",))
    times = len(meshes) // len(own)
    features = [array for array in scene.features(arrays) for _ in range(times)] if colored else []
    if arrays[0].dtype == np.float64:
        exact = [scene.of_meshes(name, arrays, times) for name in ("positions", "colors")]
        return _exact(meshes, cameras, settings, lights, exact, features)
    renderer = scene.renderer or default_renderer()
    if not features or features[0].shape[1] <= _FEATURES:
        meshes = [mesh.with_features(part) for mesh, part in zip(meshes, features)] or meshes
        return renderer.render(meshes, cameras, settings, lights, save=save)
    alone, others = _apart(settings)
    frame = renderer.render(meshes, cameras, others, lights, save=save) if others.outputs else None
    parts = []
    for part in _blocks(features, _FEATURES):
        moved = [mesh.with_features(own) for mesh, own in zip(meshes, part)]
        parts.append(renderer.render(moved, cameras, alone, lights, save=save))
    return _Joined(frame, parts)


def _exact(meshes, cameras, settings, lights, exact, features) -> Union[_Reference, _Joined]:
    """A frame of the reference device at the `exact` positions and colours of the meshes."""
    positions, colors = exact
    if not features:
        return _Reference(meshes, cameras, settings, lights, positions, colors or None)
    alone, others = _apart(settings)
    frame = _Reference(meshes, cameras, others, lights, positions, colors or None) if others.outputs else None
    blocks = _blocks(features, _EXACT_FEATURES)
    return _Joined(frame, [_ExactFeatures(meshes, cameras, alone, positions, part) for part in blocks])


def _apart(settings: Settings) -> Tuple[Settings, Settings]:
    """The settings of features alone, and those of all other images."""
    others = tuple(name for name in settings.outputs if name != "features")
    return dataclasses.replace(settings, outputs=("features",)), dataclasses.replace(settings, outputs=others)


def _blocks(features: List[np.ndarray], most: int) -> List[List[np.ndarray]]:
    """The features of all meshes in blocks of at most `most` channels."""
    return [[array[:, first : first + most] for array in features] for first in range(0, features[0].shape[1], most)]


def _by_views(twists: np.ndarray, views: np.ndarray) -> np.ndarray:
    """The gradient by view matrices V from that by ξ = (v, ω) in exp(ξ) V, for rigid motions of V."""
    by_motion = np.zeros((len(twists), 4, 4))
    by_motion[:, :3, 3] = twists[:, :3]
    x, y, z = twists[:, 3] / 2, twists[:, 4] / 2, twists[:, 5] / 2
    by_motion[:, 0, 1], by_motion[:, 0, 2], by_motion[:, 1, 2] = -z, y, -x
    by_motion[:, 1, 0], by_motion[:, 2, 0], by_motion[:, 2, 1] = z, -y, x
    return by_motion @ np.linalg.inv(views.astype(np.float64)).transpose(0, 2, 1)


def _of_texture(mesh, index: int, channels: int) -> Optional[np.ndarray]:
    """The gradient by one of a mesh's textures, with alpha for four channels; None where no image depends on it."""
    if mesh.textures is None:
        return None
    texels = mesh.textures[index]
    if channels == 3:
        return texels
    alpha = mesh.alphas[index] if mesh.alphas else None
    return np.concatenate([texels, np.zeros((*texels.shape[:2], 1)) if alpha is None else alpha[..., None]], -1)


def _gradient(one: Input, found, array: np.ndarray, meshes: int) -> np.ndarray:
    """The gradient by one of the inputs."""
    if one.name in _OF_MESH:
        # How often each mesh is in the frame.
        times = len(found.meshes) // meshes

        def part(i: int) -> np.ndarray:
            seen = found.meshes[i * times : (i + 1) * times]
            if one.name == "textures":
                parts = [_of_texture(mesh, one.texture, array.shape[-1]) for mesh in seen]
            else:
                parts = [getattr(mesh, one.name) for mesh in seen]
            # None of a frame that no image with an upstream gradient belongs to.
            parts = [np.zeros(one.part(array, i).shape) if value is None else value for value in parts]
            return parts[0] if times == 1 else np.sum(parts, 0)

        parts = [part(one.of)] if isinstance(one.of, int) else [part(i) for i in range(meshes)]
        return np.stack(parts) if one.of == "each" else parts[0] if len(parts) == 1 else np.sum(parts, 0)
    if one.name == "views":
        return _by_views(found.twists, array)
    if one.name == "projections":
        shape = array.shape
        return found.projections[:, : shape[1] if len(shape) == 2 else 1].reshape(shape)
    return np.asarray(getattr(found, one.name))


def _any(array: np.ndarray) -> bool:
    """Whether a value differs from 0; most gradients differ in some of a few places."""
    return bool(array.reshape(-1)[::101].any() or array.any())


def _matters(name: str, upstream: Dict[str, np.ndarray]) -> bool:
    """Whether a loss of these images can depend on an input."""
    if name == "features":
        return "features" in upstream
    return "color" in upstream if name in ("colors", "surface", "background") + _OF_LIGHTS else bool(upstream)


def differentiate(
    scene: Scene, kept: Kept, arrays: Sequence[np.ndarray], wanted: Sequence[bool], upstream: Dict[str, np.ndarray]
) -> List[Optional[np.ndarray]]:
    """The gradients by the inputs that are wanted, in their shapes; None for the others and for what no image with an upstream gradient
    depends on, whatever the values are."""
    given = {name: array for name, array in upstream.items() if _any(array)}
    by = sorted({_BY[input.name] for input, one in zip(scene.inputs, wanted) if one and _matters(input.name, given)})
    found = None
    if by:
        if kept.frame is None or ("color" in given and not kept.colored):
            kept.frame, kept.values = render(scene, arrays if kept.values is None else kept.values, True), None
        found = kept.frame.backward(by=by, mode=scene.mode, **given)

    def one(input: Input, array: np.ndarray) -> np.ndarray:
        if not _matters(input.name, given):
            return np.zeros(array.shape, np.float32)
        return np.ascontiguousarray(_gradient(input, found, array, len(scene.templates)))

    rows = zip(scene.inputs, wanted, arrays)
    return [one(input, array) if needed and _matters(input.name, upstream) else None for input, needed, array in rows]


def _collect(name: str, value, meshes: int, kind: Type[Any]) -> List[Tuple[Input, Any]]:
    """An argument's arrays with their meanings."""
    if isinstance(value, kind):
        stacked = name in _OF_MESH and value.ndim > _OF_MESH[name]
        if stacked and len(value) != meshes:
            raise InputError(f"{name} has shape {tuple(value.shape)} for {meshes} meshes: give one array for each")
        return [(Input(name, "each" if stacked else "all"), value)]
    wrong = InputError(f"{name} is no {kind.__name__}: give one, or for meshes a list with one for each")
    if name not in _OF_MESH or not isinstance(value, (list, tuple)):
        raise wrong
    if name == "textures":
        of_meshes = [one if isinstance(one, (list, tuple)) else [one] for one in value]
        found = [(Input(name, i, t), one) for i, textures in enumerate(of_meshes) for t, one in enumerate(textures)]
    else:
        found = [(Input(name, i), one) for i, one in enumerate(value)]
    if len(value) != meshes or not all(isinstance(one, kind) for _, one in found):
        raise wrong
    return found


def _for_each(name: str, value, meshes: int, dimensions: int, host: Callable) -> List[Optional[np.ndarray]]:
    """A constant array for all meshes, or one for each."""
    if value is None:
        return [None] * meshes
    if isinstance(value, (list, tuple)) and len(value) == meshes:
        each = [None if one is None else host(one) for one in value]
        if all(one is None or one.ndim == dimensions for one in each):
            return each
    array = host(value)
    if array.ndim == dimensions:
        return [array] * meshes
    if array.ndim != dimensions + 1 or len(array) != meshes:
        raise InputError(f"{name} has shape {array.shape} for {meshes} meshes: give one array, or one for each")
    return list(array)


def _templates(faces, meshes: int, host: Callable) -> List[Any]:
    """The triangles, or the mesh to take them from, of each mesh."""
    if isinstance(faces, Mesh):
        return [faces] * meshes
    if isinstance(faces, (list, tuple)) and any(isinstance(one, Mesh) for one in faces):
        if len(faces) != meshes:
            raise InputError(f"{len(faces)} templates for {meshes} meshes: give one for each")
        return [one if isinstance(one, Mesh) else host(one) for one in faces]
    each = _for_each("faces", faces, meshes, 2, host)
    return [each[0] if np.array_equal(one, each[0]) else one for one in each]


def build(
    given: Dict[str, Any],
    tensors: Dict[str, Any],
    faces,
    cameras,
    constants: Dict[str, Any],
    kind: Type[Any],
    host: Callable,
) -> Tuple[Scene, List[Any]]:
    """The scene of a framework's `render`, and its arrays in the order of the inputs.

    `given` are the arrays of meshes and `tensors` the others, of type `kind`; `host` makes numpy arrays of the framework's.
    """
    known = _OF_CAMERAS + _OF_LIGHTS + _OF_SETTINGS
    unknown = sorted(set(tensors) - set(known))
    if unknown:
        raise InputError(f"no input is called {unknown[0]!r}: use {', '.join(known)}")
    vertices, textures = given["positions"], given.get("textures")
    batched = not isinstance(vertices, kind) or vertices.ndim == 3
    meshes = len(vertices) if batched else 1
    if meshes == 0:
        raise InputError("vertices of no mesh: give [V, 3], [meshes, V, 3] or a list of arrays")
    if not batched and isinstance(textures, (list, tuple)) and all(isinstance(one, kind) for one in textures):
        # The textures of the one mesh.
        given = {**given, "textures": [textures]}
    collected: List[Tuple[Input, Any]] = []
    for name, value in {**given, **tensors}.items():
        if value is not None:
            collected.extend(_collect(name, value, meshes, kind))
    uv_faces = _for_each("uv_faces", constants.get("uv_faces"), meshes, 2, host)
    of_triangle = _for_each("texture_of_triangle", constants.get("texture_of_triangle"), meshes, 1, host)
    looks = [Look(uvs, of, constants.get("wrap")) for uvs, of in zip(uv_faces, of_triangle)]
    seen = [cameras] if isinstance(cameras, Camera) else list(cameras)
    if not any(name in tensors for name in _OF_CAMERAS) and len(seen) == 1:
        seen = seen * meshes
    settings = constants.get("settings") or Settings()
    outputs = (settings.outputs,) if isinstance(settings.outputs, str) else tuple(settings.outputs)
    if given.get("features") is not None and "features" not in outputs:
        outputs = (*outputs, "features")
    if outputs != settings.outputs:
        settings = dataclasses.replace(settings, outputs=outputs)
    scene = Scene(
        inputs=[one for one, _ in collected],
        templates=_templates(faces, meshes, host),
        looks=looks,
        cameras=seen,
        settings=settings,
        lights=constants.get("lights") or Lights(),
        mode=constants.get("mode", "exact"),
        renderer=constants.get("renderer"),
    )
    return scene, [array for _, array in collected]
