"""Makes programs that were written for the official package, and for a GPU, find this package and a CPU."""

from __future__ import annotations

import sys

import torch
from torch.overrides import TorchFunctionMode


def _on_cpu(value):
    """The CPU in place of a CUDA device."""
    if isinstance(value, torch.device) and value.type == "cuda":
        return torch.device("cpu")
    return "cpu" if isinstance(value, str) and value.split(":")[0] == "cuda" else value


class _WithoutCuda(TorchFunctionMode):
    """Calls of torch find the CPU where they name a CUDA device."""

    def __torch_function__(self, function, types, args=(), kwargs=None):
        kwargs = {name: _on_cpu(value) for name, value in (kwargs or {}).items()}
        return function(*(_on_cpu(value) for value in args), **kwargs)


def install() -> None:
    """Lets `import soft_renderer` find this package. Without a CUDA device it also lets `.cuda()`, `device="cuda"`,
    `torch.device("cuda")`, `torch.cuda.set_device` and `torch.cuda.FloatTensor` mean the CPU, and `torch.load` read what was
    written on a GPU. For notebooks and tests; `python -m softras.soft_renderer` does it for a program.
    """
    own = __package__
    for name in [name for name in sys.modules if name == own or name.startswith(own + ".")]:
        sys.modules["soft_renderer" + name[len(own) :]] = sys.modules[name]
    if torch.cuda.is_available() or getattr(torch.cuda, "_softras", False):
        return
    torch.cuda._softras = True
    for kind in (torch.Tensor, torch.nn.Module):
        kind.cuda = lambda self, *args, **kwargs: self
    for name in ("Float", "Double", "Int", "Long", "Byte", "Bool"):
        setattr(torch.cuda, f"{name}Tensor", getattr(torch, f"{name}Tensor"))
    torch.cuda.set_device = torch.cuda.synchronize = lambda *args, **kwargs: None
    load = torch.load
    torch.load = lambda file, map_location="cpu", **rest: load(file, _on_cpu(map_location), **rest)
    _WithoutCuda().__enter__()
