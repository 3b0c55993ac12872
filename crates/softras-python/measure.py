#!/usr/bin/env python3
"""Times a step from torch against the library's own, and watches the memory of many steps.

    python measure.py                # the ratios
    python measure.py --steps 10000  # resident memory in the course of as many steps

Needs torch, and the package built with --release. A step is a forward pass with colour and silhouette and a backward pass by
the vertices, with the images as their own upstream gradients. Library and torch take turns of some steps each in one process, so
that other work on the machine disturbs both; the ratio is that of the medians.
"""

import argparse
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


def scene(size, views):
    fish = softras.shapes.fish()
    mesh = softras.Mesh(fish.positions, fish.triangles, colors=np.full_like(fish.positions, 0.5))
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


def ratios():
    renderer = softras.default_renderer()
    print(renderer.device)
    for name, size, views in CASES:
        inputs = scene(size, views)
        step, library, python = torch_step(*inputs), [], []
        for turn in range(TURNS + 1):
            own, ours = time_steps(renderer, *inputs, STEPS), [step() for _ in range(STEPS)]
            if turn > 0:
                library += own
                python += ours
        a, b = statistics.median(library), statistics.median(python)
        print(f"{name}: library {a:.2f} ms, torch {b:.2f} ms, ratio {b / a:.3f}", flush=True)


def resident():
    """MiB of resident memory."""
    pages = int(pathlib.Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def memory(steps):
    step = torch_step(*scene(64, 4))
    for i in range(steps + 1):
        if i % max(steps // 10, 1) == 0:
            print(f"after {i:6} steps: {resident():.1f} MiB resident", flush=True)
        step()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, help="watch the memory of so many steps")
    args = parser.parse_args()
    memory(args.steps) if args.steps else ratios()
