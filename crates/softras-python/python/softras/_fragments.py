"""The triangles at each pixel for shaders of one's own, with gradients by the vertices; `softras.torch` exports them.

The renderer says which triangles they are. All else of a fragment is computed from the vertices by torch.
"""

from __future__ import annotations

import math
from typing import NamedTuple, Optional, Sequence, Tuple, Union

import torch

from . import _scene
from ._softras import Camera, Renderer, strongest
from ._tensors import floats, host, indices
from .errors import InputError
from .rendering import batched, default_renderer
from .settings import Settings

Tensors = Union[torch.Tensor, Sequence[torch.Tensor]]


#: The most fragments of a pixel.
_MOST = 1024


class Fragments(NamedTuple):
    """The triangle at each pixel's centre, [views, height, width], or with `k` the strongest near it, [views, height, width, k], of
    which the first counts most. The names of PyTorch3D are properties; there a value is -1 where there is no triangle."""

    #: int32, the triangle's number in its mesh, -1 where there is none.
    triangle: torch.Tensor
    #: [..., 3], the weights of its corners at the point that is seen: correct in perspective, or with `k` as `Settings.interpolation` says.
    barycentrics: torch.Tensor
    #: The point's view depth in world units, 0 where there is none.
    depth: torch.Tensor
    #: With `k`: the squared distance to the triangle's boundary in screen units² (half the image's height is 1), below 0 inside.
    distance: Optional[torch.Tensor] = None
    #: With `k`: the share of the triangle in the pixel's colour, among those k and the background.
    weight: Optional[torch.Tensor] = None

    def _theirs(self, values: Optional[torch.Tensor]) -> torch.Tensor:
        if values is None:
            raise InputError("fragments without distances: ask for k of them")
        missing = self.triangle < 0
        values = torch.where(missing[..., None] if values.ndim > missing.ndim else missing, -torch.ones_like(values), values)
        return values if self.distance is not None else values.unsqueeze(3)

    @property
    def pix_to_face(self) -> torch.Tensor:
        return self._theirs(self.triangle.long())

    @property
    def bary_coords(self) -> torch.Tensor:
        return self._theirs(self.barycentrics)

    @property
    def zbuf(self) -> torch.Tensor:
        return self._theirs(self.depth)

    @property
    def dists(self) -> torch.Tensor:
        return self._theirs(self.distance)


class _Seen(NamedTuple):
    """Vertices as a camera sees them."""

    #: [V, 3] in view space.
    points: torch.Tensor
    #: [V, 3]: x w, y w and w with the place (x, y) on the screen, where half the image's height is 1; w is the depth, or 1 without perspective.
    places: torch.Tensor
    #: Whether depth is linear on the screen.
    parallel: bool


def _seen(vertices: torch.Tensor, camera: Camera, settings: Settings) -> _Seen:
    projection = camera.projection
    if "original_size" in projection:
        raise InputError("fragments of an official camera have no gradient: use another camera, or render")
    view = torch.as_tensor(camera.view).to(vertices)
    points = vertices @ view[:, :3].T + view[:, 3]
    x, y, z = points.unbind(1)
    one = torch.ones_like(z)
    if "fov_y" in projection:
        scale = 1.0 / math.tan(projection["fov_y"] / 2)
        places = [scale * x, scale * y, z]
    elif "pinhole" in projection:
        fx, fy, cx, cy = projection["pinhole"]
        half = settings.height / 2
        places = [(fx * x + (cx - settings.width / 2) * z) / half, (fy * y - (cy - half) * z) / half, z]
    elif "half_height" in projection:
        places = [x / projection["half_height"], y / projection["half_height"], one]
    else:
        places = [x * z, y * z, z]
    return _Seen(points, torch.stack(places, 1), "half_height" in projection and settings.parity != "official")


def _centres(settings: Settings, like: torch.Tensor) -> Tuple[torch.Tensor, torch.Tensor]:
    """x [width] and y [height, 1] of the pixels' centres."""
    width, height = settings.width, settings.height
    x = (2 * torch.arange(width) + 1 - width).to(like) / height
    y = (height - 1 - 2 * torch.arange(height)).to(like) / height
    return x, y[:, None]


def _cross(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _safe(values: torch.Tensor) -> torch.Tensor:
    """Divisors without zeros, so that a fragment that is not there has no gradient."""
    return torch.where(values == 0, torch.ones_like(values), values)


def _at_centres(seen: _Seen, corners: torch.Tensor, found: torch.Tensor, settings: Settings):
    """Barycentrics and depth of the points at the pixels' centres, for corners behind the camera too: the weight of a corner is the cross
    product of the other two in homogeneous coordinates."""
    x, y = _centres(settings, seen.places)
    places = seen.places[corners]
    w = places[..., 2]
    relative = torch.stack([places[..., 0] - x[..., None] * w, places[..., 1] - y[..., None] * w], -1)
    shares = torch.stack([_cross(relative[..., (k + 1) % 3, :], relative[..., (k + 2) % 3, :]) for k in range(3)], -1)
    shares = (shares / _safe(shares.sum(-1, keepdim=True))).clamp(min=0)
    shares = shares / _safe(shares.sum(-1, keepdim=True)) * found[..., None]
    return shares, (shares * seen.points[corners][..., 2]).sum(-1)


def _near_centres(seen: _Seen, corners: torch.Tensor, found: torch.Tensor, settings: Settings):
    """Barycentrics, depth, signed squared distance and weight of triangles near the pixels."""
    x, y = _centres(settings, seen.places)
    places, z = seen.places[corners], seen.points[corners][..., 2]
    z = torch.where(found[..., None], z, torch.ones_like(z))
    w = torch.where(found[..., None], places[..., 2], torch.ones_like(z))
    q = torch.stack([places[..., 0] / w - x[..., None, None], places[..., 1] / w - y[..., None, None]], -1)
    shares = torch.stack([_cross(q[..., (k + 1) % 3, :], q[..., (k + 2) % 3, :]) for k in range(3)], -1)
    total = shares.sum(-1, keepdim=True)
    b = shares / _safe(total)
    # A triangle without area has no inside.
    inside = (b >= 0).all(-1) & (total[..., 0] != 0)
    # The nearest point of each edge, (1 - t) of its first corner and t of its second.
    edges = q.roll(-1, -2) - q
    t = (-(q * edges).sum(-1) / _safe((edges * edges).sum(-1))).clamp(0, 1)
    squared = (q + t[..., None] * edges).square().sum(-1)
    least, edge = squared.min(-1)
    on_edge = torch.nn.functional.one_hot(edge, 3).to(b)
    along = (on_edge * t).sum(-1, keepdim=True)
    nearest = (1 - along) * on_edge + along * on_edge.roll(1, -1)
    if settings.surface_point == "clip" or settings.parity == "official":
        clipped = b.clamp(0, 1)
        nearest = torch.where(total == 0, nearest, clipped / _safe(clipped.sum(-1, keepdim=True)))
    b = torch.where(inside[..., None], b, nearest)
    b = torch.where(found[..., None], b, torch.full_like(b, 1 / 3))
    depth = (b * z).sum(-1) if seen.parallel else 1 / (b / z).sum(-1)
    if settings.interpolation == "perspective" and not seen.parallel:
        b = b * depth[..., None] / z
    distance = torch.where(inside, -least, least)
    score = (settings.far - depth) / ((settings.far - settings.near) * settings.gamma)
    score = score + torch.nn.functional.logsigmoid(-distance / settings.sigma)
    least_score = torch.full_like(score, -1e30)
    # The composite background counts only where nothing else is.
    background = settings.epsilon * (2 if settings.parity == "official" else 1) / settings.gamma
    rest = least_score[..., :1] if settings.background == "composite" else torch.full_like(score[..., :1], background)
    weight = torch.cat([torch.where(found, score, least_score), rest], -1).softmax(-1)[..., :-1]
    return b * found[..., None], depth * found, distance * found, weight * found


def fragments(
    vertices: Tensors,
    faces,
    cameras: Union[Camera, Sequence[Camera]],
    *,
    k: Optional[int] = None,
    settings: Optional[Settings] = None,
    renderer: Optional[Renderer] = None,
) -> Fragments:
    """The nearest triangle of each pixel, or the `k` with the largest weights near it; arguments as of `render`.

    All floats have gradients by the vertices; which triangles they are is a constant. The k triangles are found on the host, in double
    precision, with `sigma`, `gamma`, `tau` and the planes of the settings; those that the near plane cuts are left out. Raises what
    `Renderer.render` raises, and InputError for official cameras and for distances other than "euclidean" with `k`.
    """
    settings = settings or Settings()
    if k is not None and not 1 <= k <= _MOST:
        raise InputError(f"{k} fragments of a pixel: ask for 1 to {_MOST}")
    if k is not None and settings.distance != "euclidean":
        raise InputError(f"fragments with the distance {settings.distance!r} have none: use \"euclidean\"")
    scene, flat = _scene.build({"positions": vertices}, {}, faces, cameras, {"settings": settings}, torch.Tensor, host)
    own = scene.meshes([host(tensor) for tensor in flat])
    meshes, seen = batched(own, scene.cameras)
    first = flat[0]
    if k is None:
        numbers = (renderer or default_renderer()).fragments(meshes, seen, settings)[0]
    else:
        numbers = strongest(meshes, seen, settings, k)
    each = list(flat) if len(flat) > 1 else list(first) if first.ndim == 3 else [first]
    made = []
    for i, camera in enumerate(seen):
        # One mesh for all views, or each mesh in turn.
        at = 0 if len(own) == 1 else i * len(own) // len(seen)
        triangle = torch.from_numpy(numbers[i]).to(first.device)
        of_mesh = torch.from_numpy(own[at].triangles.astype("int64")).to(first.device)
        vertices = floats(each[at], "vertices")
        if len(of_mesh) == 0:
            # A triangle that no pixel shows.
            of_mesh, vertices = of_mesh.new_zeros(1, 3), torch.cat([vertices, vertices.new_zeros(1, 3)])
        corners = of_mesh[triangle.clamp(min=0).long()]
        values = _seen(vertices, camera, settings)
        made.append((triangle, *(_at_centres if k is None else _near_centres)(values, corners, triangle >= 0, settings)))
    return Fragments(*(torch.stack(parts) for parts in zip(*made)))


def interpolate(found: Fragments, values: torch.Tensor, faces) -> torch.Tensor:
    """Values [V, N] of the vertices at each fragment of faces [F, 3]: [views, height, width, N], or [views, height, width, k, N]; 0 for no
    triangle. With gradients by the values, and by the vertices through the fragments. Raises InputError for values that are no floats."""
    values = floats(values, "values")
    faces = indices(faces, values.device)
    if len(faces) == 0:
        return values.new_zeros(*found.triangle.shape, values.shape[-1])
    corners = faces[found.triangle.clamp(min=0).long()]
    return (found.barycentrics[..., None].to(values) * values[corners]).sum(-2)


def _opposite(faces: torch.Tensor) -> torch.Tensor:
    """For edge k of each face, from its corner k to the next, the vertex of another face there that lies opposite; -1 without one."""
    ends = torch.stack([faces, faces.roll(-1, 1)], -1).reshape(-1, 2)
    apex = faces.roll(-2, 1).reshape(-1)
    key = ends.min(1).values * (int(faces.max()) + 1) + ends.max(1).values
    key, order = key.sort()
    found = torch.full_like(apex, -1)
    same = key[1:] == key[:-1]
    found[order[1:][same]] = apex[order[:-1][same]]
    found[order[:-1][same]] = apex[order[1:][same]]
    return found.reshape(-1, 3)


def _blended(color, triangle, depth, seen: _Seen, faces, opposite, settings: Settings, axis: int):
    """What the pixels of a view gain from their neighbours along an axis (0: below, 1: to the right)."""
    count = color.shape[axis] - 1
    this, other = (lambda image: image.narrow(axis, 0, count)), (lambda image: image.narrow(axis, 1, count))
    places = seen.places[:, :2] / _safe(seen.places[:, 2:])
    depth = torch.where(triangle < 0, torch.full_like(depth, math.inf), depth.detach())
    here = this(depth) <= other(depth)
    nearer = torch.where(here, this(triangle), other(triangle)).long()
    differs = this(triangle) != other(triangle)
    x, y = _centres(settings, seen.places)
    x, y = x.expand(triangle.shape), y.expand(triangle.shape)
    centre = torch.stack([x, y], -1)
    start = torch.where(here[..., None], this(centre), other(centre))
    step = torch.where(here[..., None], other(centre) - this(centre), this(centre) - other(centre))
    corners = faces[nearer.clamp(min=0)]
    first, edge = places[corners], places[corners.roll(-1, -1)] - places[corners]
    # Where the line from the nearer pixel's centre to the other's crosses each edge: a share t of the way, at a share u of the edge.
    across = _cross(step[..., None, :].expand_as(edge), edge)
    offset = first - start[..., None, :]
    t = _cross(offset, edge) / _safe(across)
    u = _cross(offset, step[..., None, :].expand_as(edge)) / _safe(across)
    # An edge of the silhouette has one face, or both on one side.
    third = opposite[nearer.clamp(min=0)]
    ahead = (seen.places[corners][..., 2] > 0) & (seen.places[corners.roll(-1, -1)][..., 2] > 0)
    sides = [_cross(edge, places[apex] - first) for apex in (corners.roll(-2, -1), third.clamp(min=0))]
    outline = (third < 0) | (sides[0] * sides[1] > 0)
    crosses = ahead & outline & (across != 0) & (t >= 0) & (t <= 1) & (u >= 0) & (u <= 1) & differs[..., None]
    share, _ = torch.where(crosses, t, torch.full_like(t, math.inf)).min(-1)
    valid = crosses.any(-1) & (nearer >= 0)
    share = torch.where(valid, share, torch.full_like(share, 0.5))
    # The nearer surface ends before the middle: its own pixel shows some of the other. Behind it: the other pixel shows some of it.
    to_nearer, to_other = (0.5 - share).clamp(min=0)[..., None], (share - 0.5).clamp(min=0)[..., None]
    gain = other(color) - this(color)
    of_this = torch.where(here[..., None], to_nearer, to_other) * gain
    of_other = -torch.where(here[..., None], to_other, to_nearer) * gain
    none = torch.zeros_like(color.narrow(axis, 0, 1))
    return torch.cat([of_this, none], axis) + torch.cat([none, of_other], axis)


def antialias(
    color: torch.Tensor,
    found: Fragments,
    vertices: torch.Tensor,
    faces,
    cameras: Union[Camera, Sequence[Camera]],
    settings: Optional[Settings] = None,
) -> torch.Tensor:
    """A picture [views, height, width, N] of `fragments` without `k`, blended where an outline runs between two pixels' centres, with
    gradients by the vertices through the outline (Laine et al., Modular primitives for high-performance differentiable rendering, 2020).

    `vertices` [V, 3] are those of all views, `settings` those of the fragments. Outlines that meet no neighbour's centre have no gradient:
    where they matter, `render`. An edge that reaches behind the camera is no outline. Raises InputError.
    """
    settings = settings or Settings()
    faces = indices(faces, vertices.device)
    seen = [cameras] if isinstance(cameras, Camera) else list(cameras)
    vertices = floats(vertices, "vertices")
    fits = color.ndim == 4 and color.shape[:3] == found.triangle.shape and len(seen) == len(color)
    if found.distance is not None or not fits or vertices.ndim != 2:
        raise InputError("antialias: give one mesh, fragments without k and a picture [views, height, width, N] of them")
    if len(faces) == 0:
        return color
    opposite = _opposite(faces)
    pictures = []
    for picture, triangle, depth, camera in zip(color, found.triangle, found.depth, seen):
        inputs = (picture, triangle, depth, _seen(vertices, camera, settings), faces, opposite, settings)
        pictures.append(picture + _blended(*inputs, 0) + _blended(*inputs, 1))
    return torch.stack(pictures)
