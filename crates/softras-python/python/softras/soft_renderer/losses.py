"""Regularizers of shapes."""

from __future__ import annotations

import torch
from torch import nn

from .kinds import Number


class LaplacianLoss(nn.Module):
    """Σ |p - mean of its neighbours|² for each mesh of a batch [batch, V, 3], or their mean with `average`."""

    def __init__(self, vertex: torch.Tensor, faces: torch.Tensor, average: bool = False) -> None:
        super().__init__()
        self.nv, self.nf, self.average = len(vertex), len(faces), average
        pairs = faces.long().cpu()[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        pairs = torch.unique(torch.cat([pairs, pairs.flip(1)]), dim=0).T
        degrees = torch.bincount(pairs[0], minlength=self.nv)
        matrix = torch.zeros(self.nv, self.nv)
        matrix[pairs[0], pairs[1]] = -1.0 / degrees[pairs[0]]
        # A vertex without neighbours has no mean: its row is 0.
        matrix.diagonal().copy_((degrees > 0).float())
        self.register_buffer("laplacian", matrix)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        loss = (self.laplacian @ x).pow(2).flatten(1).sum(1)
        return loss.sum() / len(x) if self.average else loss


def _lengths(a, eps: Number) -> tuple:
    square = a.pow(2).sum(-1)
    return square, (square + eps).sqrt()


class FlattenLoss(nn.Module):
    """Σ (1 + cos θ)² over edges, θ the angle between the two faces there, π where they lie flat, for each mesh of a batch.

    As in the official code, with its small constants and over the first two edges of every face only; each edge has to
    belong to two faces.
    """

    def __init__(self, faces: torch.Tensor, average: bool = False) -> None:
        super().__init__()
        self.nf, self.average = len(faces), average
        faces = faces.detach().cpu().long().tolist()
        opposite = {}
        for a, b, c in faces:
            for edge, other in (((a, b), c), ((b, c), a), ((c, a), b)):
                opposite.setdefault(tuple(sorted(edge)), []).append(other)
        edges = sorted({tuple(sorted(edge)) for a, b, c in faces for edge in ((a, b), (b, c))})
        lone = [edge for edge in edges if len(opposite[edge]) < 2]
        if lone:
            raise ValueError(f"the edge {lone[0]} belongs to one face: the flatten loss needs a closed mesh")
        columns = [[edge[0] for edge in edges], [edge[1] for edge in edges]]
        columns += [[opposite[edge][k] for edge in edges] for k in (0, 1)]
        for name, column in zip(("v0s", "v1s", "v2s", "v3s"), columns):
            self.register_buffer(name, torch.tensor(column, dtype=torch.long))

    def forward(self, vertices: torch.Tensor, eps: Number = 1e-6) -> torch.Tensor:
        v0, v1, v2, v3 = (vertices[:, index] for index in (self.v0s, self.v1s, self.v2s, self.v3s))
        edge = v1 - v0
        edge_square, edge_length = _lengths(edge, eps)

        def side(corner):
            """The way from the edge to a corner, and its length."""
            to = corner - v0
            _, length = _lengths(to, eps)
            along = (edge * to).sum(-1)
            cosine = along / (edge_length * length + eps)
            sine = (1 - cosine.pow(2) + eps).sqrt()
            return to - edge * (along / (edge_square + eps))[..., None], length * sine

        (a, a_length), (b, b_length) = side(v2), side(v3)
        cosine = (a * b).sum(-1) / (a_length * b_length + eps)
        loss = (cosine + 1).pow(2).sum(1)
        return loss.sum() / len(vertices) if self.average else loss
