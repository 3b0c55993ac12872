"""Tensors on their way to the library, whose values are checked as those of arrays are."""

from __future__ import annotations

import numpy as np
import torch

from . import _arrays
from .errors import InputError


def host(value) -> np.ndarray:
    """The values of a tensor, or of what numpy takes for an array."""
    if not isinstance(value, torch.Tensor):
        return np.asarray(value)
    # Within `torch.func` the result of a method is a wrapped tensor, so that none is called without need.
    value = value.detach() if value.requires_grad else value
    try:
        value = value if value.device.type == "cpu" else value.cpu()
        # numpy has no bfloat16.
        value = value.float() if value.dtype in (torch.bfloat16, torch.float16) else value
        with torch._C._DisableFuncTorch():
            return value.numpy()
    except (RuntimeError, TypeError) as error:
        what = f"a tensor of {value.dtype} on the device {value.device} whose values cannot be read ({error})"
        raise InputError(f"{what}: give a dense one of floats, integers or bools") from None


def plain() -> bool:
    """Whether Python may look at values: not while code is compiled or transformed."""
    return not (torch.compiler.is_compiling() or torch._C._are_functorch_transforms_active())


def floats(value, name: str) -> torch.Tensor:
    """Floats as a tensor, those of numpy in single precision. Integers would be rounded places, or a picture's bytes."""
    is_float = value.is_floating_point() if isinstance(value, torch.Tensor) else np.asarray(value).dtype.kind == "f"
    if not is_float:
        raise InputError(f"{name}: an array of {value.dtype}: give floats")
    return value if isinstance(value, torch.Tensor) else torch.as_tensor(value, dtype=torch.float32)


def indices(value, device=None, kind: torch.dtype = torch.int64) -> torch.Tensor:
    """Indices of any integer type."""
    if isinstance(value, torch.Tensor):
        whole, is_whole = value, not (value.is_floating_point() or value.is_complex() or value.dtype == torch.bool)
    else:
        whole = np.asarray(value)
        is_whole = whole.dtype.kind in "iu" or whole.size == 0
    if not is_whole:
        raise InputError(f"faces: an array of {whole.dtype}: give indices of an integer type")
    return torch.as_tensor(whole if whole is value else whole.astype(np.int64), device=device).to(kind)


def of_mesh(vertices, faces):
    """Vertices [V, 3] and faces [F, 3] of one mesh. Of a batch only the first would be taken, or its meshes for vertices."""
    vertices, faces = floats(vertices, "vertices"), indices(faces, vertices.device)
    for name, value in (("vertices", vertices), ("faces", faces)):
        if value.ndim != 2 or value.shape[1] != 3:
            raise InputError(f"{name} of shape {tuple(value.shape)}: give those of one mesh, [.., 3]; for a batch add the losses of its meshes")
    if plain() and len(faces) and not 0 <= int(faces.min()) <= int(faces.max()) < len(vertices):
        raise InputError(f"faces from {int(faces.min())} to {int(faces.max())}: {len(vertices)} vertices have 0 to {len(vertices) - 1}")
    return vertices, faces


def mask(value: torch.Tensor, name: str) -> torch.Tensor:
    """A mask from 0 to 1, decoded from integers."""
    if value.requires_grad or not plain():
        return value
    found = _arrays.read(host(value), name, "mask")
    return value if value.is_floating_point() else torch.from_numpy(found).to(value.device)
