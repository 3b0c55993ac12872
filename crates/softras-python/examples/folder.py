"""Renders every mesh of a folder by several processes: `python folder.py MESHES PICTURES [--workers 2]`.

Each process opens a renderer of its own, and a file that cannot be rendered is named at the end. `--shard I/N` takes every
N-th mesh, from the I-th on, so that the jobs of an array on several machines share the folder. `--ray` leaves the processes
to Ray (`pip install "ray[data]"`); with RAY_ADDRESS set they are those of a cluster, whose machines must see both folders.
"""

import argparse
import multiprocessing
import os
import pathlib

import numpy as np
from PIL import Image

import softras

ENDINGS = {".obj", ".ply", ".stl", ".gltf", ".glb"}


def render(job):
    """Renders one file to PICTURES/NAME.png; what is wrong with it, or None."""
    path, out = map(pathlib.Path, job)
    try:
        mesh = softras.load(path)
        low, high = np.array(mesh.bounds)
        center, radius = (low + high) / 2, np.linalg.norm(high - low) / 2
        eye = center + radius * np.array([1.3, 1.1, 1.9])
        camera = softras.Camera.look_at(eye, center, fov_y=0.8)
        settings = softras.Settings(width=256, height=256, sigma=1e-6).with_depths_of(mesh, camera)
        frame = softras.render(mesh, camera, settings, softras.Lights.official())
        rgba = np.concatenate([frame.color[0], frame.silhouette[0][..., None]], axis=-1)
        Image.fromarray((255 * np.clip(rgba, 0, 1)).astype(np.uint8)).save(out / f"{path.name}.png")
    except (softras.Error, OSError) as error:
        return str(error) if str(path) in str(error) else f"{path}: {error}"
    return None


def by_processes(jobs, workers):
    # Spawned processes begin without a device, whose driver a fork would not survive.
    with multiprocessing.get_context("spawn").Pool(workers) as pool:
        return pool.map(render, jobs, chunksize=1)


def by_ray(jobs, workers):
    import ray

    def batch(rows):
        return {"error": [render(job) or "" for job in zip(rows["path"], rows["out"])]}

    ray.init(num_cpus=None if "RAY_ADDRESS" in os.environ else workers, log_to_driver=False)
    rows = ray.data.from_items([{"path": str(path), "out": str(out)} for path, out in jobs])
    # Ray's processes live on between batches, and so do their renderers.
    return [row["error"] for row in rows.map_batches(batch, batch_size=4).iter_rows()]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("meshes", type=pathlib.Path)
    parser.add_argument("pictures", type=pathlib.Path)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--shard", default="0/1", help="I/N: every N-th mesh from the I-th on")
    parser.add_argument("--ray", action="store_true", help="let Ray run the processes")
    args = parser.parse_args()
    first, step = map(int, args.shard.split("/"))
    args.pictures.mkdir(parents=True, exist_ok=True)
    paths = sorted(path for path in args.meshes.iterdir() if path.suffix.lower() in ENDINGS)[first::step]
    jobs = [(path.resolve(), args.pictures.resolve()) for path in paths]
    errors = sorted(error for error in (by_ray if args.ray else by_processes)(jobs, args.workers) if error)
    print(f"{len(paths) - len(errors)} of {len(paths)} meshes rendered", *errors, sep="\n")


if __name__ == "__main__":
    main()
