"""Renders every mesh of a folder by several processes: `python folder.py MESHES PICTURES [--workers 2] [--shard 0/4]`.

Each process opens a renderer of its own. `--shard I/N` takes every N-th mesh, from the I-th on, so that the jobs of an array
on several machines share the folder.
"""

import argparse
import multiprocessing
import pathlib

import numpy as np
from PIL import Image

import softras

ENDINGS = {".obj", ".ply", ".stl", ".gltf", ".glb"}


def render(job):
    path, out = job
    try:
        mesh = softras.load(path)
        low, high = np.array(mesh.bounds)
        center, radius = (low + high) / 2, np.linalg.norm(high - low) / 2
        eye = center + radius * np.array([1.3, 1.1, 1.9])
        camera = softras.Camera.look_at(eye, center, fov_y=0.8)
        settings = softras.Settings(width=256, height=256, sigma=1e-6).with_depths_of(mesh, camera)
        frame = softras.render(mesh, camera, settings, softras.Lights.official())
    except softras.Error as error:
        return f"{path}: {error}"
    rgba = np.concatenate([frame.color[0], frame.silhouette[0][..., None]], axis=-1)
    Image.fromarray((255 * np.clip(rgba, 0, 1)).astype(np.uint8)).save(out / f"{path.stem}.png")
    return None


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("meshes", type=pathlib.Path)
    parser.add_argument("pictures", type=pathlib.Path)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--shard", default="0/1", help="I/N: every N-th mesh from the I-th on")
    args = parser.parse_args()
    first, step = map(int, args.shard.split("/"))
    args.pictures.mkdir(parents=True, exist_ok=True)
    paths = sorted(path for path in args.meshes.iterdir() if path.suffix.lower() in ENDINGS)[first::step]
    # Spawned processes begin without a device, whose driver a fork would not survive.
    with multiprocessing.get_context("spawn").Pool(args.workers) as pool:
        errors = [error for error in pool.imap_unordered(render, [(path, args.pictures) for path in paths]) if error]
    print(f"{len(paths) - len(errors)} of {len(paths)} meshes rendered", *errors, sep="\n")


if __name__ == "__main__":
    main()
