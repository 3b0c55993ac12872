"""Fixtures that the tests share: a renderer, a scene, and the recorded outputs of the official code where they are."""

import os
import pathlib

import numpy as np
import pytest

import softras


@pytest.fixture(scope="session")
def renderer():
    return softras.default_renderer()


@pytest.fixture(scope="session")
def recorded():
    """The folder of the official code's outputs, which are not in the repository."""
    folder = pathlib.Path(os.environ.get("SOFTRAS_RECORDED", "/nonexistent"))
    if not folder.is_dir():
        pytest.skip("SOFTRAS_RECORDED names no folder: the official code's outputs are not in the repository")
    return folder


@pytest.fixture(scope="session")
def bumpy():
    """A sphere with vertex colours and no symmetry."""
    sphere = softras.shapes.icosphere(2)
    random = np.random.default_rng(1)
    positions = sphere.positions * (1.0 + 0.2 * random.standard_normal((len(sphere.positions), 1)))
    colors = random.random((len(positions), 3))
    return softras.Mesh(positions, sphere.triangles, colors=colors)


@pytest.fixture(scope="session")
def cameras():
    return [softras.Camera.from_angles(3.5, 20.0, azimuth, fov_y=0.8) for azimuth in (10.0, 130.0)]


@pytest.fixture(scope="session")
def settings():
    return softras.Settings(
        width=40, height=32, sigma=1e-3, gamma=1e-2, near=2.0, far=5.0, outputs=("color", "silhouette", "depth", "normal")
    )
