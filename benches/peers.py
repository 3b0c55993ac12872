#!/usr/bin/env python3
"""softras beside deodr, the fastest differentiable renderer for processors that PyPI has.

    python3 benches/peers.py [MESH.obj ...] [--softras target/release/softras] [--fit]

Makes a virtual environment, installs deodr from PyPI into it, and measures both on the same meshes, cameras and sizes in
turn: a run of theirs, a run of ours, and again, so that what else the machine does hits both. A frame is an image and
the gradient to vertex positions (and colours). deodr is not soft: a z-buffer with antialiased edges in f64, one thread,
and no gradient for what is hidden. Without a mesh: softras' fish and sphere. With --fit both fit a shape and a pose instead: see
peers_fit.py. It builds and installs softras' Python package as well.
"""

import argparse
import json
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

HOME = pathlib.Path(__file__).resolve().parent.parent
PACKAGES = ["deodr", "typing_extensions", "trimesh"]
FIT_PACKAGES = ["mitsuba", "pillow", "scipy", HOME / "crates" / "softras-python"]


def environment(fit):
    """Goes on in a Python that has deodr, made on the first run; for fits softras too, as it is now."""
    folder = HOME / "target" / "peers"
    python = folder / "bin" / "python"
    if pathlib.Path(sys.prefix).resolve() == folder.resolve():
        return
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", folder], check=True)
        subprocess.run([python, "-m", "pip", "install", "-q", *PACKAGES], check=True)
    if fit:
        subprocess.run([python, "-m", "pip", "install", "-q", *FIT_PACKAGES], check=True)
    os.execv(python, [python, __file__, *sys.argv[1:]])


def framed(path):
    """Vertices and faces as `softras bench` places them: centred, 70 % of the image's height at distance 2.732."""
    import numpy as np

    vertices, faces = [], []
    for line in open(path):
        words = line.split()
        if words[:1] == ["v"]:
            vertices.append([float(x) for x in words[1:4]])
        elif words[:1] == ["f"]:
            corners = [int(word.split("/")[0]) for word in words[1:]]
            corners = [c - 1 if c > 0 else len(vertices) + c for c in corners]
            faces += [[corners[0], corners[i], corners[i + 1]] for i in range(1, len(corners) - 1)]
    v, f = np.array(vertices), np.array(faces, dtype=np.uint32)
    # As softras: only what the triangles use has a say.
    low, high = v.min(axis=0), v.max(axis=0)
    scale = 0.7 * 2 * 2.732 * np.tan(np.radians(15)) / (high[1] - low[1])
    return (v - (low + high) / 2) * scale, f


def deodr_scene(path, size, views, silhouette):
    """One frame of deodr, forward and backward over all views, as a function of no argument."""
    import numpy as np
    from deodr.triangulated_mesh import ColoredTriMesh
    from deodr.differentiable_renderer import Scene3D, Camera

    vertices, faces = framed(path)
    colors = np.clip(vertices + 0.5, 0, 1)
    mesh = ColoredTriMesh(faces, vertices=vertices, nb_colors=1 if silhouette else 3)
    mesh.set_vertices_colors(np.ones((len(vertices), 1)) if silhouette else colors)
    focal = size / 2 / np.tan(np.radians(15))
    intrinsic = np.array([[focal, 0, size / 2], [0, focal, size / 2], [0, 0, 1.0]])
    cameras = []
    for view in range(views):
        azimuth, elevation = 2 * np.pi * view / views, np.radians(30)
        eye = 2.732 * np.array([np.cos(elevation) * np.sin(azimuth), np.sin(elevation), -np.cos(elevation) * np.cos(azimuth)])
        forward = -eye / np.linalg.norm(eye)
        right = np.cross(forward, [0, 1, 0])
        right /= np.linalg.norm(right)
        down = np.cross(forward, right)
        rotation = np.stack([right, down, forward])
        extrinsic = np.column_stack([rotation, -rotation @ eye])
        cameras.append(Camera(extrinsic=extrinsic, intrinsic=intrinsic, width=size, height=size))
    scene = Scene3D(sigma=1)
    scene.set_mesh(mesh)
    scene.set_light(light_directional=None, light_ambient=1.0)
    channels = 1 if silhouette else 3
    scene.set_background_color(np.zeros(channels))
    upstream = (np.arange(size * size * channels) * 7919 % 1000 / 1000 - 0.5).reshape(size, size, channels)

    def frame():
        for camera in cameras:
            image = scene.render(camera)
            scene.clear_gradients()
            scene.render_backward(upstream)
        return image

    covered = float((frame() != 0).any(axis=2).mean())
    if not 0.05 < covered < 0.9:
        sys.exit(f"deodr covers {covered:.2f} of the image of {path}: not the scene that softras sees")
    return frame


def ours(program, path, size, views, mode, repeats):
    """Median milliseconds of a frame by `softras bench`."""
    with tempfile.TemporaryDirectory() as folder:
        rows = pathlib.Path(folder) / "rows.json"
        command = [program, "bench", path, "--no-errors", "--size", size, "--batch", views, "--modes", mode]
        command += ["--repeats", repeats, "--json", rows]
        subprocess.run([str(word) for word in command], check=True, stdout=subprocess.DEVNULL)
        row = next(row for row in json.loads(rows.read_text()) if row["pass"] == "frame")
        return row["median_ms"], row


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", nargs="*", help="Wavefront OBJ files")
    parser.add_argument("--softras", default=str(HOME / "target" / "release" / "softras"), help="the program")
    parser.add_argument("--fit", action="store_true", help="seconds until a shape and a pose are found")
    parser.add_argument("--rounds", type=int, default=5, help="turns of each")
    parser.add_argument("--repeats", type=int, default=15, help="frames a turn")
    parser.add_argument("--sizes", default="256,512", help="sides of the images")
    arguments = parser.parse_args()
    environment(arguments.fit)
    with tempfile.TemporaryDirectory() as folder:
        meshes = arguments.meshes
        sphere = pathlib.Path(folder) / "icosphere.obj"
        made = [("icosphere", sphere), ("fish", pathlib.Path(folder) / "fish.obj")]
        for name, path in made:
            subprocess.run([arguments.softras, "mesh", name, "-o", path], check=True, stdout=subprocess.DEVNULL)
        meshes = meshes or [str(made[1][1])]
        if arguments.fit:
            return fits(arguments, meshes)
        sizes = [int(size) for size in arguments.sizes.split(",")]
        cases = [(str(sphere), 64, 1, "silhouette"), (str(sphere), 64, 16, "silhouette")]
        cases += [(m, s, 1, mode) for m in meshes for s in sizes for mode in ("silhouette", "color+silhouette")]
        table(arguments, cases)


def fits(arguments, meshes):
    import numpy as np
    import peers_fit

    for path in meshes:
        vertices, faces = framed(path)
        colors = np.clip(vertices + 0.5, 0, 1)
        print(f"{pathlib.Path(path).stem}:")
        peers_fit.shapes(arguments.softras, vertices, faces.astype(np.int64), colors, arguments.rounds)
        peers_fit.poses(vertices, faces.astype(np.int64), colors)


def table(arguments, cases):
    print(f"{'mesh':>12} {'size':>5} {'views':>5} {'images':>17} {'deodr':>9} {'softras':>9} {'deodr / softras':>16}")
    for path, size, views, mode in cases:
        frame = deodr_scene(path, size, views, mode == "silhouette")
        frame()
        pairs = []
        for _ in range(arguments.rounds):
            times = []
            for _ in range(arguments.repeats):
                start = time.perf_counter()
                frame()
                times.append((time.perf_counter() - start) * 1e3)
            pairs.append((statistics.median(times), ours(arguments.softras, path, size, views, mode, arguments.repeats)[0]))
        theirs, mine = (statistics.median(column) for column in zip(*pairs))
        ratio = statistics.median(a / b for a, b in pairs)
        name = pathlib.Path(path).stem
        print(f"{name:>12} {size:>5} {views:>5} {mode:>17} {theirs:>9.2f} {mine:>9.2f} {ratio:>16.2f}", flush=True)


if __name__ == "__main__":
    main()
