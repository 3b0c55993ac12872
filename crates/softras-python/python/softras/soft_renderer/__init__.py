"""The interface of the official SoftRas package, on softras: `import softras.soft_renderer as sr`.

Images and gradients are the official code's, its deviations from the paper's mathematics included; `exact_gradients=True`,
which rasterizers and renderers take as well, gives the exact gradient of the same image. Tensors stay on their device, also on
the CPU. Colours are rendered when torch first reads more of an image than its alpha; until then their memory holds NaN.
`python -m softras.soft_renderer SCRIPT.py` runs a script of the official package as it is, without a GPU; `install()` does
the same for a notebook.
"""

from __future__ import annotations

from . import functional
from .install import install
from .lighting import AmbientLighting, DirectionalLighting, Lighting
from .losses import FlattenLoss, LaplacianLoss
from .mesh import Mesh
from .rasterizer import Rasterizer, SoftRasterizer
from .renderer import Renderer, SoftRenderer
from .transform import Look, LookAt, Projection, Transform

__version__ = "1.0.0"

__all__ = [
    "AmbientLighting",
    "DirectionalLighting",
    "FlattenLoss",
    "LaplacianLoss",
    "Lighting",
    "Look",
    "LookAt",
    "Mesh",
    "Projection",
    "Rasterizer",
    "Renderer",
    "SoftRasterizer",
    "SoftRenderer",
    "Transform",
    "functional",
    "install",
]
