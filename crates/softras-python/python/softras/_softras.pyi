"""The extension module: what `softras` exports, written in Rust."""

import os
import pathlib
from typing import Any, Dict, List, Mapping, Optional, Sequence, Tuple, Union, final

import numpy as np
import numpy.typing as npt

from .settings import Lights, Settings

_Array = npt.ArrayLike
_Floats = npt.NDArray[np.float32]
_Doubles = npt.NDArray[np.float64]
_Indices = npt.NDArray[np.uint32]
_Path = Union[str, "os.PathLike[str]"]
_Names = Union[str, Sequence[str]]
# None for what was not asked for. `Any` saves those who asked a check for None.
_MaybeFloats = Union[_Floats, Any]
_MaybeDoubles = Union[_Doubles, Any]

__all__ = [
    "Camera",
    "Frame",
    "Gradients",
    "Mesh",
    "MeshGradients",
    "Renderer",
    "blurred_mask",
    "check",
    "depths_of",
    "devices",
    "fit",
    "fit_views",
    "iou",
    "is_closed",
    "load",
    "load_views",
    "mask_iou",
    "png",
    "pose",
    "reference_gradient",
    "reference_render",
    "regularizer",
    "remesh",
    "save_exr",
    "save_pictures",
    "shape",
    "solid_voxels",
    "strongest",
    "surface_cells",
    "time_steps",
    "view",
    "voxelize",
]

@final
class Mesh:
    def __new__(
        cls,
        positions: _Array,
        triangles: _Array,
        *,
        colors: Optional[_Array] = None,
        surface: Optional[_Array] = None,
        uvs: Optional[_Array] = None,
        uv_triangles: Optional[_Array] = None,
        textures: Union[None, _Array, Sequence[_Array]] = None,
        texture_of_triangle: Optional[_Array] = None,
        wrap: Union[str, Sequence[str]] = "repeat",
    ) -> Mesh: ...
    @property
    def positions(self) -> _Floats: ...
    @property
    def triangles(self) -> _Indices: ...
    @property
    def colors(self) -> Optional[_Floats]: ...
    @property
    def surface(self) -> Optional[_Floats]: ...
    @property
    def uvs(self) -> Optional[_Floats]: ...
    @property
    def uv_triangles(self) -> Optional[_Indices]: ...
    @property
    def textures(self) -> Optional[List[_Floats]]: ...
    @property
    def texture_of_triangle(self) -> Optional[_Indices]: ...
    @property
    def normals(self) -> Optional[_Floats]: ...
    @property
    def wrap(self) -> Union[str, List[str]]: ...
    @property
    def notes(self) -> List[str]: ...
    @property
    def bounds(self) -> Optional[Tuple[List[float], List[float]]]: ...
    @property
    def features(self) -> _MaybeFloats: ...
    def with_features(self, features: Optional[_Array]) -> Mesh: ...
    def with_normals(self, normals: Optional[_Array]) -> Mesh: ...
    def with_positions(self, positions: _Array) -> Mesh: ...
    def with_look(
        self,
        *,
        colors: Optional[_Array] = None,
        surface: Optional[_Array] = None,
        uvs: Optional[_Array] = None,
        uv_triangles: Optional[_Array] = None,
        textures: Union[None, _Array, Sequence[_Array]] = None,
        texture_of_triangle: Optional[_Array] = None,
        wrap: Union[str, Sequence[str]] = "repeat",
    ) -> Mesh: ...
    def save(self, path: _Path, *, srgb: bool = True) -> List[os.PathLike[str]]: ...

@final
class Camera:
    @staticmethod
    def look_at(
        eye: _Array,
        target: _Array,
        up: Optional[_Array] = None,
        *,
        fov_y: Optional[float] = None,
        half_height: Optional[float] = None,
        pinhole: Optional[Sequence[float]] = None,
    ) -> Camera: ...
    @staticmethod
    def from_angles(
        distance: float,
        elevation: float,
        azimuth: float,
        *,
        fov_y: Optional[float] = None,
        half_height: Optional[float] = None,
        pinhole: Optional[Sequence[float]] = None,
    ) -> Camera: ...
    @staticmethod
    def from_matrix(
        view: _Array,
        *,
        fov_y: Optional[float] = None,
        half_height: Optional[float] = None,
        pinhole: Optional[Sequence[float]] = None,
        mirrored: bool = False,
    ) -> Camera: ...
    @staticmethod
    def from_opencv(intrinsics: _Array, rotation: _Array, translation: _Array) -> Camera: ...
    @staticmethod
    def from_opengl(view: _Array, projection: _Array, size: Tuple[int, int]) -> Camera: ...
    @staticmethod
    def from_pytorch3d(
        R: _Array,
        T: _Array,
        *,
        fov_y: Optional[float] = None,
        half_height: Optional[float] = None,
        pinhole: Optional[Sequence[float]] = None,
    ) -> Camera: ...
    @staticmethod
    def official(matrix: _Array, distortion: Sequence[float] = ..., original_size: float = 512.0) -> Camera: ...
    @staticmethod
    def screen() -> Camera: ...
    @property
    def view(self) -> _Doubles: ...
    @property
    def projection(self) -> Dict[str, Any]: ...

@final
class MeshGradients:
    @property
    def positions(self) -> _MaybeFloats: ...
    @property
    def colors(self) -> _MaybeFloats: ...
    @property
    def features(self) -> _MaybeFloats: ...
    @property
    def surface(self) -> _MaybeFloats: ...
    @property
    def textures(self) -> Optional[List[_Floats]]: ...
    @property
    def alphas(self) -> Optional[List[Optional[_Floats]]]: ...
    @property
    def uvs(self) -> _MaybeFloats: ...

@final
class Gradients:
    @property
    def meshes(self) -> List[MeshGradients]: ...
    @property
    def twists(self) -> _MaybeDoubles: ...
    @property
    def projections(self) -> _MaybeDoubles: ...
    @property
    def ambient_color(self) -> _MaybeDoubles: ...
    @property
    def ambient_intensity(self) -> Optional[float]: ...
    @property
    def light_directions(self) -> _MaybeDoubles: ...
    @property
    def light_colors(self) -> _MaybeDoubles: ...
    @property
    def light_intensities(self) -> _MaybeDoubles: ...
    @property
    def background(self) -> _MaybeDoubles: ...
    @property
    def epsilon(self) -> Optional[float]: ...
    @property
    def sigma(self) -> Optional[float]: ...
    @property
    def gamma(self) -> Optional[float]: ...

@final
class Frame:
    @property
    def color(self) -> _MaybeFloats: ...
    @property
    def silhouette(self) -> _MaybeFloats: ...
    @property
    def depth(self) -> _MaybeFloats: ...
    @property
    def normal(self) -> _MaybeFloats: ...
    @property
    def features(self) -> _MaybeFloats: ...
    def backward(
        self,
        *,
        color: Optional[_Array] = None,
        silhouette: Optional[_Array] = None,
        depth: Optional[_Array] = None,
        normal: Optional[_Array] = None,
        features: Optional[_Array] = None,
        by: Optional[_Names] = None,
        mode: str = "exact",
    ) -> Gradients: ...

@final
class Renderer:
    def __new__(
        cls, device: Optional[str] = None, *, validation: bool = False, memory: Optional[int] = None
    ) -> Renderer: ...
    def render(
        self,
        meshes: Union[Mesh, Sequence[Mesh]],
        cameras: Union[Camera, Sequence[Camera]],
        settings: Optional[Settings] = None,
        lights: Optional[Lights] = None,
        *,
        save: bool = False,
    ) -> Frame: ...
    def fragments(
        self,
        meshes: Union[Mesh, Sequence[Mesh]],
        cameras: Union[Camera, Sequence[Camera]],
        settings: Optional[Settings] = None,
    ) -> Tuple[npt.NDArray[np.int32], _Floats, _Floats]: ...
    @property
    def device(self) -> str: ...
    @property
    def device_bytes(self) -> int: ...
    @property
    def process(self) -> int: ...
    def validation_messages(self) -> List[str]: ...

def devices() -> List[Tuple[int, str, str, str, str, Optional[pathlib.Path], Optional[str]]]: ...
def load_views(
    path: _Path,
    *,
    cameras: Optional[_Path],
    masks: Optional[_Path],
    fov: float,
    depths: Optional[_Path],
    depth_unit: float,
    normals: Optional[_Path],
    allow_outside: bool,
) -> Tuple[List[Camera], List[_MaybeFloats], List[str]]: ...
def fit_views(
    renderer: Renderer, plan: Mapping[str, Any], progress: Any
) -> Tuple[Mesh, Dict[str, Any], Dict[str, Any], List[str]]: ...
def view(subject: Union[Mesh, str], renderer: Renderer, plan: Mapping[str, Any]) -> npt.NDArray[np.uint8]: ...
def save_pictures(path: _Path, frames: npt.NDArray[np.uint8], delay: int) -> None: ...
def save_exr(path: _Path, picture: _Floats) -> None: ...
def png(picture: npt.NDArray[np.uint8]) -> bytes: ...
def load(path: _Path, *, srgb: bool = True, allow_outside: bool = False, strict: bool = False) -> Mesh: ...
def iou(a: Mesh, b: Mesh, resolution: int = 64) -> float: ...
def mask_iou(prediction: _Array, target: _Array) -> _Doubles: ...
def blurred_mask(mask: _Array, sigma: float, sheets: float = 2.0) -> _Floats: ...
def remesh(mesh: Mesh, edge_length: float) -> Mesh: ...
def regularizer(name: str, triangles: _Array, positions: _Array) -> Tuple[float, _Doubles]: ...
def check(renderer: Renderer) -> List[Tuple[str, List[Optional[float]], List[Optional[float]], bool, bool]]: ...
def surface_cells(mesh: Mesh, resolution: int) -> _Floats: ...
def is_closed(mesh: Mesh) -> bool: ...
def voxelize(mesh: Mesh, resolution: int, low: _Array, side: float) -> npt.NDArray[np.bool_]: ...
def solid_voxels(faces: _Array, size: int) -> npt.NDArray[np.bool_]: ...
def time_steps(
    renderer: Renderer, mesh: Mesh, cameras: Sequence[Camera], settings: Settings, steps: int
) -> List[float]: ...
def depths_of(
    meshes: Union[Mesh, Sequence[Mesh]], cameras: Union[Camera, Sequence[Camera]], margin: float
) -> Tuple[float, float]: ...
def shape(name: str, numbers: Sequence[float]) -> Mesh: ...
def fit(
    mesh: Mesh, renderer: Renderer, plan: Mapping[str, object], progress: object
) -> Tuple[Mesh, int, Mesh, Dict[str, _Doubles], Optional[str]]: ...
def pose(
    mesh: Mesh, camera: Camera, renderer: Renderer, plan: Mapping[str, object], progress: object
) -> Tuple[List[List[float]], List[float], List[float], float, int]: ...
def strongest(
    meshes: Union[Mesh, Sequence[Mesh]],
    cameras: Union[Camera, Sequence[Camera]],
    settings: Optional[Settings],
    count: int,
) -> npt.NDArray[np.int32]: ...
def reference_render(
    meshes: Union[Mesh, Sequence[Mesh]],
    cameras: Union[Camera, Sequence[Camera]],
    settings: Optional[Settings] = None,
    lights: Optional[Lights] = None,
    *,
    positions: Optional[Sequence[_Array]] = None,
    colors: Optional[Sequence[_Array]] = None,
) -> Dict[str, _Doubles]: ...
def reference_gradient(
    meshes: Union[Mesh, Sequence[Mesh]],
    cameras: Union[Camera, Sequence[Camera]],
    settings: Optional[Settings] = None,
    lights: Optional[Lights] = None,
    *,
    color: Optional[_Array] = None,
    silhouette: Optional[_Array] = None,
    depth: Optional[_Array] = None,
    normal: Optional[_Array] = None,
    mode: str = "exact",
) -> Gradients: ...
