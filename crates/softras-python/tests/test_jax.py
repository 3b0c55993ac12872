"""softras.jax: the renderer's own bits within JAX's transformations, and its slopes in double precision."""

import dataclasses
import subprocess
import sys

import numpy as np
import pytest

import softras

jax = pytest.importorskip("jax", reason="jax is not installed: test.sh --with jax adds it")
import jax.numpy as jnp  # noqa: E402

import softras.jax as sj  # noqa: E402


@pytest.fixture(scope="module")
def loss(bumpy, cameras, settings):
    """A function of the vertices, with its upstream gradients."""
    random = np.random.default_rng(3)
    sizes = {"color": (2, 32, 40, 3), "silhouette": (2, 32, 40), "depth": (2, 32, 40), "normal": (2, 32, 40, 3)}
    weights = {name: random.standard_normal(size).astype(np.float32) for name, size in sizes.items()}

    def loss(vertices, colors):
        images = sj.render(vertices, bumpy.triangles, cameras, colors=colors, settings=settings)
        return sum(jnp.vdot(weights[name], getattr(images, name)) for name in settings.outputs)

    return loss, weights


def test_gradients_are_the_renderers_to_the_bit(bumpy, cameras, settings, loss):
    function, weights = loss
    frame = softras.render(bumpy, cameras, settings, save=True)
    images = sj.render(bumpy.positions, bumpy, cameras, settings=settings)
    for name in settings.outputs:
        np.testing.assert_array_equal(getattr(images, name), getattr(frame, name))
    expected = frame.backward(by=("positions", "colors"), **weights).meshes[0]
    gradient = jax.grad(function, (0, 1))
    for call in (gradient, jax.jit(gradient)):
        by_vertices, by_colors = call(bumpy.positions, bumpy.colors)
        np.testing.assert_array_equal(by_vertices, expected.positions)
        np.testing.assert_array_equal(by_colors, expected.colors)


def test_features_have_gradients(bumpy, cameras, settings):
    settings = dataclasses.replace(settings, background_color=(0.0, 0.0, 0.0), outputs=("color",))
    features = np.random.default_rng(8).random((len(bumpy.positions), 35), np.float32)

    def loss(vertices, features):
        images = sj.render(vertices, bumpy.triangles, cameras, colors=features[:, 1:4], features=features, settings=settings)
        return (images.features**2).sum(), images

    (_, images), (by_vertices, by_features) = jax.jit(jax.value_and_grad(loss, (0, 1), has_aux=True))(bumpy.positions, features)
    np.testing.assert_array_equal(images.features[..., 1:4], images.color)
    assert images.features.shape == (2, 32, 40, 35) and by_features.shape == features.shape
    step = 1e-2 * by_features / jnp.abs(by_features).max()
    slope = (loss(bumpy.positions, features + step)[0] - loss(bumpy.positions, features - step)[0]) / 2
    np.testing.assert_allclose(slope, jnp.vdot(step, by_features), rtol=1e-3)
    assert float(jnp.abs(by_vertices).max()) > 0


def test_transformations(bumpy, cameras, settings, loss):
    function, _ = loss
    scales = jnp.array([1.0, 0.8])
    scaled = jax.jit(jax.value_and_grad(lambda scale: function(scale * bumpy.positions, bumpy.colors)))
    values, slopes = jax.vmap(scaled)(scales)
    for i, scale in enumerate(scales):
        value, slope = scaled(scale)
        np.testing.assert_allclose(values[i], value, rtol=1e-5)
        np.testing.assert_allclose(slopes[i], slope, rtol=1e-5)

    def areas(vertices):
        return sj.render(vertices, bumpy, cameras, settings=settings).silhouette.sum((1, 2))

    rows = jax.jacrev(areas)(jnp.asarray(bumpy.positions))
    frame = softras.render(bumpy, cameras, settings, save=True)
    for view in range(2):
        upstream = np.zeros_like(frame.silhouette)
        upstream[view] = 1.0
        np.testing.assert_array_equal(rows[view], frame.backward(silhouette=upstream).meshes[0].positions)


def test_many_passes_may_wait_for_their_gradients(bumpy, cameras, settings):
    # More than the number of frames that are kept.
    def areas(vertices):
        scales = (1, 0.9, 0.8, 0.7, 0.6, 0.5)
        return [sj.render(s * vertices, bumpy, cameras, settings=settings).silhouette.sum() for s in scales]

    vertices = jnp.asarray(bumpy.positions)
    together = jax.grad(lambda vertices: sum(areas(vertices)))(vertices)
    alone = sum(jax.grad(lambda vertices, i=i: areas(vertices)[i])(vertices) for i in range(6))
    np.testing.assert_allclose(together, alone, rtol=1e-4, atol=1e-5 * np.abs(alone).max())


def test_every_input_has_a_gradient(cameras, settings):
    fish = softras.shapes.fish()
    lights = softras.Lights.official()
    inputs = {
        "uvs": fish.uvs,
        "textures": fish.textures,
        "views": np.stack([np.vstack([camera.view, [0, 0, 0, 1]]) for camera in cameras]),
        "projections": np.array([0.8, 0.8]),
        "light_directions": np.array([[0.1, 1.0, 0.2]]),
        "background": np.array([0.2, 0.3, 0.4]),
        "sigma": 1e-3,
        "gamma": 1e-2,
    }

    @jax.jit
    def loss(inputs):
        images = sj.render(fish.positions, fish, cameras[:1], settings=settings, lights=lights, **inputs)
        return jnp.square(images.color).sum() + images.depth.sum()

    found = jax.grad(loss)(jax.tree.map(jnp.asarray, inputs))
    for name, gradient in jax.tree_util.tree_leaves_with_path(found):
        assert np.isfinite(gradient).all() and np.any(gradient), name


def test_mistakes_are_named(bumpy, cameras, settings):
    with pytest.raises(softras.errors.InputError, match="'colour'"):
        sj.render(bumpy.positions, bumpy, cameras, colour=bumpy.colors)
    with pytest.raises(jax.errors.JaxRuntimeError, match="sigma = -1"):
        jax.block_until_ready(sj.render(bumpy.positions, bumpy, cameras, sigma=-1.0))

    def area(vertices):
        return sj.render(vertices, bumpy, cameras, settings=settings).silhouette.sum()

    with pytest.raises(ValueError, match="do not support JVP"):
        jax.hessian(area)(jnp.asarray(bumpy.positions))
    # The renderer still renders.
    np.testing.assert_allclose(area(bumpy.positions), softras.render(bumpy, cameras, settings).silhouette.sum(), rtol=1e-5)


DOUBLE = """
import jax, numpy as np, softras, softras.jax as sj
jax.config.update("jax_enable_x64", True)
from jax.test_util import check_grads
random = np.random.default_rng(4)
vertices, colors = random.uniform(-0.7, 0.7, (6, 3)), random.random((6, 3))
camera = softras.Camera.look_at((0, 0, 3), (0, 0, 0), fov_y=0.8)
settings = softras.Settings(width=6, height=6, sigma=1e-2, gamma=0.05, near=1.0, far=5.0, tau=1e-12)

def loss(vertices, colors):
    images = sj.render(vertices, np.array([[0, 1, 2], [3, 4, 5]]), camera, colors=colors, settings=settings)
    assert images.color.dtype == np.float64
    return (images.color ** 2).sum() + (images.silhouette ** 2).sum()

check_grads(loss, (vertices, colors), order=1, modes=["rev"], atol=1e-6, rtol=1e-6, eps=1e-6)
print("agree")
"""


def test_slopes_in_double_precision():
    # A process of its own, since double precision is JAX's state.
    result = subprocess.run([sys.executable, "-c", DOUBLE], capture_output=True, text=True, timeout=300)
    assert result.stdout.strip() == "agree", result.stdout + result.stderr
