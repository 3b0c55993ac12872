"""Shape, colours and pose from images, by the library's own steps."""

from __future__ import annotations

import dataclasses
from typing import Any, Dict, Literal, Optional, Tuple, Union, overload

import numpy as np

from . import _softras
from ._softras import Camera, Mesh, Renderer
from .errors import InputError
from .progress import Progress, shown
from .rendering import default_renderer
from .settings import Lights, Settings
from .views import Fitted, Views


@dataclasses.dataclass(frozen=True)
class FitResult:
    """The result of a fit."""

    #: The mesh of least loss, and the number of its step.
    mesh: Mesh
    step: int
    #: The mesh after the last step.
    last: Mesh
    #: "loss", "silhouette" and "color" of every step, before it moved anything.
    losses: Dict[str, np.ndarray]

    def __repr__(self) -> str:
        return f"FitResult({self.mesh!r}, loss {self.losses['loss'][self.step]:.6g} at step {self.step})"


@overload
def fit(mesh: Views, **options: Any) -> Fitted: ...
@overload
def fit(mesh: Mesh, cameras: Any, **options: Any) -> FitResult: ...
def fit(mesh, cameras=None, **options):
    """`fit(views, ...)` is `Views.fit`; `fit(mesh, cameras, ...)` is `deform`."""
    if isinstance(mesh, Views):
        if cameras is not None:
            raise InputError("cameras of views: views have their own, give options by name")
        return mesh.fit(**options)
    return deform(mesh, cameras, **options)


def deform(
    mesh: Mesh,
    cameras: Any,
    *,
    silhouette=None,
    color=None,
    steps: int = 200,
    rate: Tuple[float, float] = (0.03, 0.005),
    color_rate: Tuple[float, float] = (0.03, 0.005),
    sigma: Tuple[float, float] = (1e-4, 1e-5),
    gamma: Tuple[float, float] = (3e-2, 3e-3),
    method: str = "smooth",
    loss: str = "iou",
    smoothing: Optional[float] = None,
    laplacian: Optional[float] = None,
    flatten: Optional[float] = None,
    normals: Optional[float] = None,
    fit_colors: Union[bool, Literal["one"], None] = None,
    fit_positions: bool = True,
    views_per_step: int = 0,
    settings: Optional[Settings] = None,
    lights: Optional[Lights] = None,
    progress: Progress = None,
    renderer: Optional[Renderer] = None,
) -> FitResult:
    """Deforms a mesh, and recolours it, until its renderings match images.

    `silhouette` is [views, height, width], bools, floats from 0 to 1, or bytes, `color` [views, height, width, 3] on the settings'
    background, linear floats, or sRGB if uint8 or uint16; at least one of them, with one camera for each view. `rate` is about the distance that a vertex moves in a step, in world
    units, from the first step to the last; sigma and gamma, too, are values at the first step and at the last. `method` is
    "smooth" (vertices move with their neighbours, for any template) or "official" (the demo's logit displacements). Colours are
    fitted if `color` is given, unless `fit_colors` is False: a mesh of one colour begins with that colour at every vertex, and
    fit_colors="one" fits a single colour. Each step compares `views_per_step` views, cycling through all of them (0: all); its
    losses are those of these views. `settings` default to depths close around the template and a composite background; size and
    outputs are the targets'. `progress(step, loss)` is called after every step; True draws a bar by tqdm. An exception in it, or
    Ctrl-C, ends the fit.

    Raises FitError for targets that do not fit together, and what `Renderer.render` raises.
    """
    # The arguments by name.
    plan = dict(locals())
    if fit_colors is None:
        fit_colors = color is not None
    plan["fit_colors"] = bool(fit_colors)
    if fit_colors is True and mesh.colors is not None and mesh.colors.ndim == 1:
        mesh = mesh.with_look(colors=np.tile(mesh.colors, (len(mesh.positions), 1)))
    with shown(progress, steps) as told:
        best, step, last, losses = _softras.fit(mesh, renderer or default_renderer(), plan, told)
    return FitResult(best, step, last, losses)


@dataclasses.dataclass(frozen=True)
class Pose:
    """A rotation about a centre, and a translation after it."""

    #: [3, 3], world axes.
    rotation: np.ndarray
    #: [3], world units.
    translation: np.ndarray
    center: np.ndarray
    #: The loss of plain colours and silhouettes at this pose.
    loss: float
    #: How many poses explain the image as well as this one, by the object's symmetry or for want of detail.
    equally_good: int = 1

    def applied(self, mesh: Mesh) -> Mesh:
        """The mesh in this pose."""
        return mesh.with_positions((mesh.positions - self.center) @ self.rotation.T + self.center + self.translation)

    def degrees_to(self, rotation) -> float:
        """Degrees between this rotation and another, 0 to 180."""
        cosine = (np.trace(self.rotation.T @ np.asarray(rotation)) - 1.0) / 2.0
        return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))


def pose(
    mesh: Mesh,
    camera: Camera,
    color,
    silhouette,
    *,
    starts: int = 24,
    steps: int = 150,
    translate: bool = True,
    start=None,
    center=None,
    settings: Optional[Settings] = None,
    progress: Progress = None,
    renderer: Optional[Renderer] = None,
) -> Pose:
    """Finds the rotation and translation of a rigid mesh from one unlit image on black.

    `color` is [1, height, width, 3], `silhouette` [1, height, width], of the types that `deform` takes. It compares the image with 512 rotations,
    fits the `starts` most likely of them and refines the best, in `steps` steps together; or refines `start`, a rotation [3, 3]
    and a translation [3], in small steps. `center` defaults to that of the mesh's box. Only near, far and tau of `settings` count.
    """
    # The arguments by name.
    plan = dict(locals())
    with shown(progress, steps) as told:
        found = _softras.pose(mesh, camera, renderer or default_renderer(), plan, told)
    rotation, translation, center, loss, equally_good = found
    return Pose(np.array(rotation), np.array(translation), np.array(center), loss, equally_good)
