"""Losses of meshes for torch: vertices [V, 3], faces [F, 3]; `softras.torch` exports them.

With `reduction="mean"` a loss is normalised as that of PyTorch3D.
"""

from __future__ import annotations

from typing import Literal, Optional, Tuple

import torch

from . import _softras
from ._tensors import floats, host, indices, of_mesh
from .errors import InputError


def _counted_edges(faces: torch.Tensor, device: torch.device) -> Tuple[torch.Tensor, torch.Tensor]:
    """Every edge once, [E, 2], the lower vertex first, and the number of its faces."""
    faces = indices(faces, device)
    pairs = torch.cat([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    return torch.unique(pairs.sort(1)[0], dim=0, return_counts=True)


def _edges(faces: torch.Tensor, device: torch.device) -> torch.Tensor:
    return _counted_edges(faces, device)[0]


def _is_mean(reduction: str) -> bool:
    if reduction not in ("sum", "mean"):
        raise InputError(f"reduction is {reduction!r}: use sum or mean")
    return reduction == "mean"


def edge_length_loss(vertices: torch.Tensor, faces: torch.Tensor, length: float = 0.0) -> torch.Tensor:
    """The mean over edges of (their length - `length`)²; 0 without edges."""
    vertices, faces = of_mesh(vertices, faces)
    a, b = _edges(faces, vertices.device).unbind(1)
    lengths = (vertices[a] - vertices[b]).norm(dim=1)
    return (lengths - length).square().sum() / max(len(a), 1)


class _Regularizer(torch.autograd.Function):
    """A regularizer of the library, with its gradient."""

    @staticmethod
    def forward(ctx, vertices, faces, name):
        value, gradient = _softras.regularizer(name, host(faces), host(floats(vertices, "vertices")))
        ctx.save_for_backward(torch.from_numpy(gradient).to(vertices))
        return vertices.new_tensor(value)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx, upstream):
        return upstream * ctx.saved_tensors[0], None, None


def normal_consistency_loss(
    vertices: torch.Tensor, faces: torch.Tensor, reduction: Literal["sum", "mean"] = "sum"
) -> torch.Tensor:
    """Σ (1 - n·m) over edges and pairs of faces there, n and m their unit normals; that of `softras.deform`; or the mean over the pairs.
    Raises FitError."""
    vertices, faces = of_mesh(vertices, faces)
    total = _Regularizer.apply(vertices, faces, "normals")
    if not _is_mean(reduction):
        return total
    _, count = _counted_edges(faces, vertices.device)
    return total / (count * (count - 1) // 2).sum().clamp(min=1)


def flatten_loss(vertices: torch.Tensor, faces: torch.Tensor) -> torch.Tensor:
    """Σ (1 + cos θ)² over edges as in the official code; that of `softras.deform`. Raises FitError."""
    return _Regularizer.apply(*of_mesh(vertices, faces), "flatten")


def _cotangents(vertices: torch.Tensor, faces: torch.Tensor):
    """The edges opposite to the corners of faces, [3 F, 2], and half the cotangents there, at least 0."""
    faces = indices(faces, vertices.device)
    edges, weights = [], []
    for corner in range(3):
        i, j, k = (faces[:, (corner + n) % 3] for n in range(3))
        a, b = vertices[j] - vertices[i], vertices[k] - vertices[i]
        area, around = torch.linalg.cross(a, b).norm(dim=1), a.norm(dim=1) * b.norm(dim=1)
        least = torch.finfo(area.dtype)
        # The bound is relative to the edges, so that an angle has one cotangent at any scale.
        area = torch.maximum(area, (least.eps * around + least.tiny).detach())
        edges.append(torch.stack([j, k], 1))
        weights.append(((a * b).sum(1) / area / 2).clamp(min=0))
    return torch.cat(edges), torch.cat(weights)


def laplacian_loss(
    vertices: torch.Tensor,
    faces: torch.Tensor,
    weights: Literal["uniform", "cotangent"] = "uniform",
    reduction: Literal["sum", "mean"] = "sum",
) -> torch.Tensor:
    """Σ |p - mean of its neighbours|² over the vertices of a mesh; or, with `reduction="mean"`, the mean of these lengths without the
    square.

    The mean of the neighbours is the plain one as in the official code, or weighted by cotangents, of which those below 0 count as 0.
    """
    vertices, faces = of_mesh(vertices, faces)
    if weights == "uniform":
        edges = _edges(faces, vertices.device)
        shares = torch.ones_like(vertices[edges[:, 0], 0])
    elif weights == "cotangent":
        edges, shares = _cotangents(vertices, faces)
    else:
        raise InputError(f"weights is {weights!r}: use uniform or cotangent")
    edges, shares = torch.cat([edges, edges.flip(1)]), torch.cat([shares, shares])
    vertex, neighbor = edges.unbind(1)
    total = torch.zeros_like(vertices[:, 0]).index_add(0, vertex, shares)
    # Differences, since far from the origin sums of places are rounded. A vertex without neighbours has none.
    sums = torch.zeros_like(vertices).index_add(0, vertex, shares[:, None] * (vertices[neighbor] - vertices[vertex]))
    moves = sums / torch.where(total > 0, total, torch.ones_like(total))[:, None]
    return moves.norm(dim=1).mean() if _is_mean(reduction) else moves.square().sum()


def sample_surface(
    vertices: torch.Tensor, faces: torch.Tensor, count: int, generator: Optional[torch.Generator] = None
) -> torch.Tensor:
    """Random points [count, 3] of a surface, evenly by area; a `generator` of the CPU makes them the same again.

    Of vertices [B, V, 3] [B, count, 3]; their faces are [F, 3] for all or [B, F, 3].
    """
    if vertices.ndim == 3:
        each = [faces] * len(vertices) if getattr(faces, "ndim", 3) == 2 else list(faces)
        if len(each) != len(vertices):
            raise InputError(f"faces of {len(each)} meshes for {len(vertices)}: give [F, 3] for all, or one for each")
        return torch.stack([sample_surface(one, of, count, generator) for one, of in zip(vertices, each)])
    a, b, c = floats(vertices, "vertices")[indices(faces, vertices.device)].unbind(1)
    b, c = b - a, c - a
    areas = torch.linalg.cross(b.double(), c.double()).norm(dim=1).detach().cpu()
    if count < 1 or not areas.sum() > 0:
        raise InputError(f"{count} points of a surface of area {areas.sum():g}: ask for 1 or more, of a surface that has an area")
    chosen = torch.multinomial(areas, count, replacement=True, generator=generator).to(vertices.device)
    u, v = torch.rand(2, count, generator=generator).to(vertices)
    root = u.sqrt()
    # From a corner on, since far from the origin the corners' weighted sum is rounded.
    return a[chosen] + (root * (1 - v))[:, None] * b[chosen] + (root * v)[:, None] * c[chosen]


def chamfer_distance(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
    """The mean squared distance of points a [N, 3] to their nearest of b [M, 3], and that of b to a, in sum; of batches [B, N, 3] and
    [B, M, 3] the mean over the batch."""
    shapes = tuple(a.shape), tuple(b.shape)
    if a.ndim != b.ndim or a.ndim not in (2, 3) or a.shape[:-2] != b.shape[:-2] or {a.shape[-1], b.shape[-1]} != {3} or 0 in a.shape + b.shape:
        raise InputError(f"points of shapes {shapes[0]} and {shapes[1]}: give [N, 3] and [M, 3], or [B, N, 3] and [B, M, 3]")
    if a.ndim == 3:
        return torch.stack([chamfer_distance(*pair) for pair in zip(a, b)]).mean()

    def nearest(points, among):
        # Products of matrices cancel far from the origin.
        exact = {"compute_mode": "donot_use_mm_for_euclid_dist"}
        with torch.no_grad():
            return torch.cat([torch.cdist(part, among, **exact).argmin(1) for part in points.split(1024)])

    to_b, to_a = a - b[nearest(a, b)], b - a[nearest(b, a)]
    return to_b.square().sum(1).mean() + to_a.square().sum(1).mean()
