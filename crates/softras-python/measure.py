#!/usr/bin/env python3
"""Times a step from torch and JAX against the library's own, and watches the memory of many steps.

    python measure.py                # the ratios
    python measure.py --mesh X.obj   # with another mesh than the fish
    python measure.py --steps 10000  # resident memory in the course of as many steps
    python measure.py --features 16  # what three of 16 features cost, as a share of a frame with colour
    python measure.py --fragments 8  # the time of that many fragments of each pixel

Needs torch, and the package built with --release; JAX is timed where it is installed. A step is a forward pass with colour and
silhouette and a backward pass by the vertices, with the images as their own upstream gradients. All take turns of some steps
each in one process, so that other work on the machine disturbs all of them; the ratios are those of the medians and those of
the fastest tenths.
"""

import argparse
import importlib.util
import os
import pathlib
import statistics
import time

import numpy as np
import torch

import softras
import softras.torch as st
from softras._softras import time_steps

CASES = (("256² × 1", 256, 1), ("64² × 16", 64, 16))
TURNS, STEPS = 20, 10


def scene(shape, size, views):
    mesh = softras.Mesh(shape.positions, shape.triangles, colors=np.full_like(shape.positions, 0.5))
    cameras = [softras.Camera.from_angles(3.0, 20.0, 360.0 * i / views, fov_y=0.8) for i in range(views)]
    return mesh, cameras, softras.Settings(width=size, height=size, sigma=1e-4).with_depths_of(mesh, cameras)


def torch_step(mesh, cameras, settings):
    """A step as a function that returns its milliseconds."""
    vertices = torch.tensor(mesh.positions, requires_grad=True)

    def step():
        start = time.perf_counter()
        images = st.render(vertices, mesh, cameras, settings=settings)
        torch.autograd.backward(images[:2], [image.detach() for image in images[:2]])
        vertices.grad = None
        return 1e3 * (time.perf_counter() - start)

    return step


def jax_step(mesh, cameras, settings):
    """A step by a compiled function of JAX, as a function that returns its milliseconds."""
    import jax

    import softras.jax as sj

    @jax.jit
    def gradient(vertices):
        images, pull = jax.vjp(lambda vertices: sj.render(vertices, mesh, cameras, settings=settings)[:2], vertices)
        return pull(images)[0]

    vertices = jax.numpy.asarray(mesh.positions)

    def step():
        start = time.perf_counter()
        gradient(vertices).block_until_ready()
        return 1e3 * (time.perf_counter() - start)

    return step


def ratios(shape):
    renderer = softras.default_renderer()
    print(f"{renderer.device}, {len(shape.triangles)} triangles")
    frameworks = {"torch": torch_step}
    if importlib.util.find_spec("jax"):
        frameworks["JAX"] = jax_step
    for name, size, views in CASES:
        inputs = scene(shape, size, views)
        steps = {framework: make(*inputs) for framework, make in frameworks.items()}
        times = {"library": [], **{framework: [] for framework in steps}}
        for turn in range(TURNS + 1):
            taken = {"library": time_steps(renderer, *inputs, STEPS)}
            taken.update({framework: [step() for _ in range(STEPS)] for framework, step in steps.items()})
            for one, found in taken.items():
                # The first turn compiles and allocates.
                times[one] += found if turn > 0 else []
        tenths = {one: statistics.quantiles(found, n=10) for one, found in times.items()}
        own = tenths.pop("library")
        print(f"{name}: library {own[4]:.2f} ms", flush=True)
        for one, found in tenths.items():
            print(f"    {one} {found[4]:.2f} ms, ratios {found[4] / own[4]:.3f} and {found[0] / own[0]:.3f}", flush=True)


def features(shape, count):
    """The time of a step with features beside one without, by the vertices and the features."""
    mesh, cameras, settings = scene(shape, 256, 1)
    values = torch.rand(len(mesh.positions), count, requires_grad=True)
    vertices = torch.tensor(mesh.positions, requires_grad=True)
    times = {False: [], True: []}
    for turn in range(TURNS + 1):
        for has_features, found in times.items():
            for _ in range(STEPS):
                start = time.perf_counter()
                images = st.render(vertices, mesh, cameras, settings=settings, features=values if has_features else None)
                shown = [image for image in images if image is not None]
                torch.autograd.backward(shown, [image.detach() for image in shown])
                vertices.grad = values.grad = None
                if turn > 0:
                    found.append(1e3 * (time.perf_counter() - start))
    without, with_them = (statistics.median(found) for found in times.values())
    share = (with_them - without) / without / (count / 3)
    print(f"256² × 1: {without:.2f} ms, with {count} features {with_them:.2f} ms: three cost {share:.2f} of a frame")


def fragments(shape, k):
    """The time of a pixel's k strongest fragments, and of their gradient by the vertices."""
    mesh, cameras, settings = scene(shape, 256, 1)
    vertices, faces = torch.tensor(mesh.positions, requires_grad=True), torch.tensor(mesh.triangles.astype(np.int64))
    forward, backward = [], []
    for _ in range(TURNS):
        start = time.perf_counter()
        found = st.fragments(vertices, faces, cameras, k=k, settings=settings)
        forward.append(time.perf_counter() - start)
        found.depth.sum().backward()
        backward.append(time.perf_counter() - start - forward[-1])
    print(f"256² × 1: {k} fragments {statistics.median(forward):.2f} s, their gradient {statistics.median(backward):.2f} s")


def resident():
    """MiB of resident memory."""
    pages = int(pathlib.Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def memory(shape, steps):
    step = torch_step(*scene(shape, 64, 4))
    for i in range(steps + 1):
        if i % max(steps // 10, 1) == 0:
            print(f"after {i:6} steps: {resident():.1f} MiB resident", flush=True)
        step()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--mesh", help="a mesh file in place of the fish")
    parser.add_argument("--steps", type=int, help="watch the memory of so many steps")
    parser.add_argument("--features", type=int, help="time this number of features beside colour")
    parser.add_argument("--fragments", type=int, help="time this number of fragments of a pixel")
    args = parser.parse_args()
    shape = softras.load(args.mesh) if args.mesh else softras.shapes.fish()
    if args.steps:
        memory(shape, args.steps)
    elif args.features:
        features(shape, args.features)
    elif args.fragments:
        fragments(shape, args.fragments)
    else:
        ratios(shape)
