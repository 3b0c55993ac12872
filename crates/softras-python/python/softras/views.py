"""Pictures of meshes, and meshes from pictures: what the commands `softras render` and `softras fit` do."""

from __future__ import annotations

import dataclasses
import numbers
import os
import warnings
from typing import Any, Dict, List, Optional, Sequence, Tuple, Union

import numpy as np

from . import _arrays, _softras
from ._softras import Camera, Mesh, Renderer
from .errors import InputError
from .progress import Progress, shown
from .rendering import default_renderer

Range = Tuple[float, float]


class Picture(np.ndarray):
    """A picture, [height, width, 4] bytes in sRGB with straight alpha, or frames of an animation, [frames, height, width, 4].

    It shows itself in a notebook, and `save` writes it.
    """

    #: Hundredths of a second between frames.
    delay = 4

    def save(self, path: Union[str, "os.PathLike[str]"]) -> None:
        """Writes a picture as .png, or as .exr of its linear light (premultiplied), or frames as .gif. Raises IoError, InputError."""
        if self.ndim == 3 and os.fspath(path).lower().endswith(".exr"):
            light = _arrays.read(self._bytes(), "picture", "texture")
            light[..., :3] *= light[..., 3:]
            return _softras.save_exr(os.fspath(path), light)
        _softras.save_pictures(os.fspath(path), self._bytes() if self.ndim == 4 else self._bytes()[None], self.delay)

    def _bytes(self) -> np.ndarray:
        """The pixels, which arithmetic may have turned into other numbers."""
        if self.dtype != np.uint8 or self.ndim not in (3, 4) or self.shape[-1] != 4:
            raise InputError(f"a picture of {self.dtype} with shape {self.shape}: give uint8, [height, width, 4] or one for each frame")
        return np.ascontiguousarray(self.view(np.ndarray))

    def _repr_png_(self) -> bytes:
        return _softras.png(self._bytes() if self.ndim == 3 else self._bytes()[0])


def view(
    subject: Union[Mesh, str, "os.PathLike[str]"],
    *,
    size: Union[int, Tuple[int, int]] = 256,
    azimuth: float = 145.0,
    elevation: float = 20.0,
    fov: float = 30.0,
    up: Optional[Sequence[float]] = None,
    background: Optional[Sequence[float]] = None,
    sigma: Optional[float] = None,
    gamma: float = 3e-6,
    samples: Optional[int] = None,
    shading: str = "smooth",
    crease: Optional[float] = None,
    unlit: bool = False,
    faces: Optional[str] = None,
    turntable: Optional[int] = None,
    renderer: Optional[Renderer] = None,
) -> Picture:
    """A picture of a mesh, or of a mesh file, as `softras render` makes it: framed, lit, with sharp creases.

    `size` is a side or (width, height) in pixels; angles are in degrees; `background` is linear light from 0 to 1, and
    transparent without. Edges are sharp unless `sigma` or `gamma` asks for the soft model. Surfaces are lit on the side that is seen.
    `faces` is "both" or "front"; without it a glTF material that is not doubleSided is seen from its front alone, and everything else from
    both sides. `turntable` is the number of frames of one turn. Raises what `load` and `Renderer.render` raise.
    """
    # The arguments by name.
    plan = dict(locals())
    plan["size"] = (size, size) if isinstance(size, numbers.Integral) else tuple(size)
    plan["up"] = None if up is None else [float(x) for x in up]
    given = subject if isinstance(subject, Mesh) else os.fspath(subject)
    frames = _softras.view(given, renderer or default_renderer(), plan)
    return (frames[0] if turntable is None else frames).view(Picture)


@dataclasses.dataclass(frozen=True)
class Fitted:
    """A mesh that was fitted to views."""

    mesh: Mesh
    #: "loss", "silhouette" and "color" of every step, before it moved anything.
    losses: Dict[str, np.ndarray]
    #: "mask_iou" and "covered_mask_iou" of each view that was kept, "soft_iou", "parts", "genus", "color_error", and of the views
    #: "held_out" the "held_out_mask_iou" and "held_out_color_error", None where there are none.
    measures: Dict[str, Any]
    #: Which views were left out, where the mesh was cut anew, and why it began with what it did.
    notes: List[str]

    def __repr__(self) -> str:
        return f"Fitted({self.mesh!r}, mask IoU {np.mean(self.measures['mask_iou']):.4f})"


@dataclasses.dataclass(frozen=True)
class Views:
    """Views of an object: cameras, and at least one kind of image, [views, height, width] or [views, height, width, 3].

    Silhouettes are bools, floats from 0 to 1, or bytes. Colours are over black, linear floats, or sRGB if they are uint8 or uint16.
    Depths are view depths in world units, normals unit vectors in world space, both floats; 0 where one is not known.
    """

    cameras: Sequence[Camera]
    silhouette: Optional[np.ndarray] = None
    color: Optional[np.ndarray] = None
    depth: Optional[np.ndarray] = None
    normal: Optional[np.ndarray] = None

    def fit(
        self,
        *,
        color: bool = False,
        texture: Optional[int] = None,
        template: Optional[Mesh] = None,
        begin: str = "auto",
        method: str = "smooth",
        steps: Optional[int] = None,
        rate: Optional[Range] = None,
        sigma: Optional[Range] = None,
        gamma: Optional[Range] = None,
        loss: str = "iou",
        masks: bool = False,
        front_faces: bool = False,
        samples: int = 1,
        views_per_step: int = 0,
        smoothing: Optional[float] = None,
        keep_topology: bool = False,
        keep_views: bool = False,
        keep_cameras: bool = False,
        keep_exposure: bool = False,
        crop: int = 192,
        hold_out: Optional[int] = None,
        edge: Optional[Range] = None,
        report: Union[str, "os.PathLike[str]", None] = None,
        progress: Progress = None,
        renderer: Optional[Renderer] = None,
    ) -> Fitted:
        """Finds the mesh that looks like the views, as `softras fit` does.

        `color` fits a colour for each vertex, `texture` a texture of at most that many texels a side. The fit begins with `template`, or
        with `begin`: a "hull", a "sphere", or "auto", a hull from eight views on. The default of an argument of None depends on the
        method and on the mesh that the fit begins with. `method` is "smooth", "quick" (a first look: 20 steps, with cameras, masks and
        topology as they are) or "official" (the demo's). Views that disagree with the others are left out, and holes that only one mask
        shows are filled, each with a note, unless `keep_views`. Cameras that disagree with the silhouettes are refined, with a note,
        unless `keep_cameras`. Exposures that differ are leveled unless `keep_exposure`. Large pictures are cropped to the object, to at
        most `crop` pixels a side; 0 keeps them as they are. A texture is taken from the pictures as given. `hold_out` views are not
        fitted and judge the result; None is one of every twelve views, at most three. `report` is a file of HTML: each view
        beside the mesh, the cameras and the losses. `progress(step, loss)` is called after every step, and before the first one with
        (0, nan); its attribute `note`, if it has one, is called with each note as it comes. True draws a bar by tqdm. An exception
        in it, or Ctrl-C, ends the fit.

        Raises FitError, IoError, and what `Renderer.render` raises.
        """
        # The arguments by name, and the views' images, whose colours take the place of the argument's name.
        plan = {**locals(), "fit_colors": color, **vars(self)}
        with shown(progress, steps) as told:
            return Fitted(*_softras.fit_views(renderer or default_renderer(), plan, told))


def load_views(
    path: Union[str, "os.PathLike[str]"],
    *,
    cameras: Union[str, "os.PathLike[str]", None] = None,
    masks: Union[str, "os.PathLike[str]", None] = None,
    fov: float = 30.0,
    depths: Union[str, "os.PathLike[str]", None] = None,
    depth_unit: float = 0.001,
    normals: Union[str, "os.PathLike[str]", None] = None,
    allow_outside: bool = False,
) -> Views:
    """Reads a folder of pictures with a file of their cameras, or a .npy file of images, as `softras fit --views` does.

    Cameras are in cameras.json, transforms.json (NeRF), a COLMAP model, cameras.npz (IDR, NeuS) or a _par.txt (Middlebury); `fov`
    is the vertical angle of view in degrees where the file does not give one. `masks`, `depths` and `normals` are folders of maps.
    Without `masks` the silhouettes are alpha, masks beside the pictures, or what stands out of a plain background; FileError is raised
    where there is none of these. Notes of the reader become warnings. Raises IoError, FileError.
    """
    read, images, notes = _softras.load_views(
        path,
        cameras=cameras,
        masks=masks,
        fov=fov,
        depths=depths,
        depth_unit=depth_unit,
        normals=normals,
        allow_outside=allow_outside,
    )
    for note in notes:
        warnings.warn(note, stacklevel=2)
    return Views(read, *images)
