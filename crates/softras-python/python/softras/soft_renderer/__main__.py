"""Runs a script that was written for the official package: `python -m softras.soft_renderer SCRIPT.py ARGUMENTS`.

`import soft_renderer` finds this package. Without a CUDA device `.cuda()` leaves tensors and modules where they are, and
`torch.load` reads checkpoints that were written on a GPU.
"""

from __future__ import annotations

import os
import runpy
import sys

import torch

from .. import soft_renderer


def main() -> int:
    if len(sys.argv) < 2:
        print("usage: python -m softras.soft_renderer SCRIPT.py [ARGUMENTS]", file=sys.stderr)
        return 2
    own = soft_renderer.__name__
    for name in [name for name in sys.modules if name == own or name.startswith(own + ".")]:
        sys.modules["soft_renderer" + name[len(own) :]] = sys.modules[name]
    if not torch.cuda.is_available():
        for kind in (torch.Tensor, torch.nn.Module):
            setattr(kind, "cuda", lambda self, *args, **kwargs: self)
        load = torch.load
        torch.load = lambda file, map_location="cpu", **rest: load(file, map_location, **rest)
    sys.argv = sys.argv[1:]
    sys.path.insert(0, os.path.dirname(os.path.abspath(sys.argv[0])))
    runpy.run_path(sys.argv[0], run_name="__main__")
    return 0


if __name__ == "__main__":
    sys.exit(main())
