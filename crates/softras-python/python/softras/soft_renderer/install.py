"""Makes programs that were written for the official package, and for a GPU, find this package and a CPU."""

from __future__ import annotations

import contextlib
import sys
import threading

import torch
from torch.overrides import TorchFunctionMode


def _on_cpu(value):
    """The CPU in place of a CUDA device or of a type there."""
    if isinstance(value, torch.device):
        return torch.device("cpu") if value.type == "cuda" else value
    if not isinstance(value, str):
        return value
    return "cpu" if value.split(":")[0] == "cuda" else value.replace("torch.cuda.", "torch.")


class _WithoutCuda(TorchFunctionMode):
    """Calls of torch find the CPU where they name a CUDA device, also by its number."""

    def __torch_function__(self, function, types, args=(), kwargs=None):
        kwargs = {name: _on_cpu(value) for name, value in (kwargs or {}).items() if name != "pin_memory"}
        args = [_on_cpu(value) for value in args]
        if type(kwargs.get("device")) is int:
            kwargs["device"] = "cpu"
        if function is torch.Tensor.to and len(args) > 1 and type(args[1]) is int:
            args[1] = "cpu"
        return function(*args, **kwargs)


class _Generators(type):
    """The class of a generator that is one of the CPU."""

    def __call__(cls, device="cpu"):
        return cls.of_torch()

    def __instancecheck__(cls, instance) -> bool:
        return isinstance(instance, cls.of_torch)


def _start(start):
    """The start of a thread that calls torch as the thread that installed this does: a mode is one thread's."""

    def with_mode(self):
        run = self.run

        def inside():
            with _WithoutCuda():
                run()

        self.run = inside
        start(self)

    return with_mode


def _called_on_cpu(function):
    return lambda *args, **kwargs: function(*map(_on_cpu, args), **{name: _on_cpu(one) for name, one in kwargs.items()})


def _load(load):
    def on_cpu(file, map_location="cpu", **rest):
        if isinstance(map_location, dict):
            map_location = {name: _on_cpu(place) for name, place in map_location.items()}
        return load(file, _on_cpu(map_location), **rest)

    return on_cpu


def install() -> None:
    """Lets `import soft_renderer` find this package. Without a CUDA device it also lets CUDA devices and types mean the CPU wherever
    torch takes them, in threads that start afterwards too, and `torch.load` read what was written on a GPU. Such are `.cuda()`,
    `.to(0)`, `device="cuda"`, `torch.cuda.FloatTensor`, `torch.cuda.set_device`, `torch.Generator("cuda")` and pinned memory. For
    notebooks and tests; `python -m softras.soft_renderer` does it for a program.
    """
    own = __package__
    for name in [name for name in sys.modules if name == own or name.startswith(own + ".")]:
        sys.modules["soft_renderer" + name[len(own) :]] = sys.modules[name]
    if torch.cuda.is_available() or getattr(torch.cuda, "_softras", False):
        return
    torch.cuda._softras = True
    for kind in (torch.Tensor, torch.nn.Module):
        kind.cuda = lambda self, *args, **kwargs: self
    torch.Tensor.pin_memory = torch.Tensor.cuda
    for name in ("Float", "Double", "Half", "BFloat16", "Int", "Long", "Short", "Char", "Byte", "Bool"):
        setattr(torch.cuda, f"{name}Tensor", getattr(torch, f"{name}Tensor"))
    torch.cuda.set_device = torch.cuda.synchronize = lambda *args, **kwargs: None
    torch.cuda.current_device = lambda: 0
    torch.cuda.device = torch.cuda.device_of = torch.cuda.stream = contextlib.nullcontext
    torch.Generator = _Generators("Generator", (), {"of_torch": torch.Generator})
    for name in ("set_default_device", "set_default_tensor_type"):
        setattr(torch, name, _called_on_cpu(getattr(torch, name)))
    torch.load = _load(torch.load)
    threading.Thread.start = _start(threading.Thread.start)
    _WithoutCuda().__enter__()
