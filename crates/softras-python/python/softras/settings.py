"""Settings and lights as plain data. They are checked by the renderer, which names the field that is out of range."""

from __future__ import annotations

import dataclasses
import math
from typing import Literal, Sequence, Tuple

from ._softras import depths_of

Vector = Tuple[float, float, float]


@dataclasses.dataclass(frozen=True)
class Settings:
    """All parameters of a frame besides meshes, cameras and lights. The defaults are the official renderer's.

    A fragment is a (pixel, triangle) pair. Its coverage D = sigmoid(±d²/sigma), d the distance from the pixel's centre to
    the triangle's edge, is the probability that the triangle covers the pixel. `dataclasses.replace` changes fields.
    """

    #: Image size in pixels, 1 to 16384.
    width: int = 256
    height: int = 256
    #: Softness of edges in screen units², of which one is half the image's height.
    sigma: float = 1e-5
    #: Softness of the depth order, as a share of far - near.
    gamma: float = 1e-4
    #: Depth score of the background in the softmax, for background="weighted" only.
    epsilon: float = 1e-3
    #: A fragment outside its triangle with D < tau is dropped.
    tau: float = 1e-4
    #: Whether tau bounds the error of the silhouette alone or that of every image.
    support: Literal["probability", "guaranteed"] = "probability"
    #: Nearest and farthest view depth in world units.
    near: float = 1.0
    far: float = 100.0
    #: The images to render, of "color", "silhouette", "depth", "normal" and, of meshes that have features, "features".
    outputs: Sequence[str] = ("color", "silhouette")
    #: Depth-weighted softmax, or the nearest triangle that covers the pixel's centre.
    color: Literal["softmax", "hard"] = "softmax"
    #: 1 - Π(1 - D), the sum of D over the number of triangles, or 1 where any D > 1/2.
    silhouette: Literal["product", "sum", "hard"] = "product"
    #: What D is the sigmoid of.
    distance: Literal["euclidean", "barycentric", "hard"] = "euclidean"
    #: An entry of the softmax (the paper), or blended by the silhouette (what fits should use).
    background: Literal["weighted", "composite"] = "weighted"
    background_color: Vector = (0.0, 0.0, 0.0)
    #: Which triangles are drawn, and which winding on the image is the front.
    faces: Literal["both", "front"] = "both"
    front_face: Literal["counter_clockwise", "clockwise"] = "counter_clockwise"
    #: How corner values are interpolated over a triangle.
    interpolation: Literal["affine", "perspective"] = "affine"
    #: Where a triangle is sampled for a pixel outside it: at its nearest point, or at clipped barycentrics (the paper).
    surface_point: Literal["nearest", "clip"] = "nearest"
    #: The model of this library, or the official code's image with its deviations, among them surface_point "clip".
    parity: Literal["model", "official"] = "model"

    @classmethod
    def official(cls, **fields) -> Settings:
        """The settings of the official code: its image bit for bit where single precision allows."""
        return cls(**{"parity": "official", "front_face": "clockwise", **fields})

    def cutoff(self) -> float:
        """ln(1/tau - 1): the squared radius of a triangle's influence in units of sigma."""
        return math.log(1.0 / self.tau - 1.0)

    def blur_pixels(self) -> float:
        """How many pixels a triangle reaches beyond its edge."""
        return math.sqrt(self.sigma * self.cutoff()) * self.height / 2.0

    def with_blur_pixels(self, pixels: float) -> Settings:
        """Sets sigma such that a triangle reaches `pixels` pixels beyond its edge."""
        radius = pixels * 2.0 / self.height
        return dataclasses.replace(self, sigma=radius * radius / self.cutoff())

    def with_depths_of(self, meshes, cameras, margin: float = 0.05) -> Settings:
        """Sets near and far close around what the cameras see, so that gamma means the same for every scene.

        `margin` is the room on both sides as a share of the depths that the vertices span: 0.05 for a picture, 0.5 for a
        mesh that will move.
        """
        near, far = depths_of(meshes, cameras, margin)
        return dataclasses.replace(self, near=near, far=far)


@dataclasses.dataclass(frozen=True)
class DirectionalLight:
    """A light infinitely far away, which adds intensity · color · max(0, n · direction)."""

    #: From the surface towards the light, world space.
    direction: Vector = (0.0, 1.0, 0.0)
    color: Vector = (1.0, 1.0, 1.0)
    intensity: float = 0.5


@dataclasses.dataclass(frozen=True)
class Lights:
    """The lights of a scene. Without arguments they leave colours as they are."""

    ambient_color: Vector = (1.0, 1.0, 1.0)
    ambient_intensity: float = 1.0
    directional: Sequence[DirectionalLight] = ()
    #: One normal for each triangle, or one for each vertex.
    shading: Literal["flat", "smooth"] = "flat"

    @classmethod
    def official(cls) -> Lights:
        """The official renderer's default: ambient 0.5 and a directional light of 0.5 from straight above."""
        return cls(ambient_intensity=0.5, directional=(DirectionalLight(),))
