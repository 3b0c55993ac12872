#!/usr/bin/env python3
"""Fits to disturbed photographs of a mesh: python3 benches/photos.py [--softras PROGRAM] [--only WORD] [--keep FOLDER] [MESH.obj ...]

For each mesh the program makes 24 pictures of 128² pixels: 16 are disturbed and fitted to, the other eight judge the result, with
their true cameras. Each row is a disturbance: the mask IoU and the colour error of the eight, those that the fit itself reports
of the views that it holds out, parts and genus, seconds, and the notes. Needs numpy and Pillow.
"""

import argparse
import json
import math
import pathlib
import random
import shutil
import subprocess
import sys
import tempfile
import time

import numpy as np
from PIL import Image

HELD_OUT = range(1, 24, 3)


def disc(radius):
    """The offsets of pixels within a radius."""
    reach = range(-math.ceil(radius), math.ceil(radius) + 1)
    return [(r, c) for r in reach for c in reach if r * r + c * c <= radius**2]


def paint(pixels, row, column, radius, color):
    """A round spot, cut off at the border."""
    for r, c in disc(radius):
        if 0 <= row + r < len(pixels) and 0 <= column + c < len(pixels[0]):
            pixels[row + r, column + c] = color


def rotation(axis, angle):
    """4 × 4, about the origin."""
    length = math.sqrt(sum(x * x for x in axis))
    x, y, z = (a / length for a in axis)
    c, s = math.cos(angle), math.sin(angle)
    t = 1 - c
    return np.array(
        [
            [t * x * x + c, t * x * y - s * z, t * x * z + s * y, 0],
            [t * x * y + s * z, t * y * y + c, t * y * z - s * x, 0],
            [t * x * z - s * y, t * y * z + s * x, t * z * z + c, 0],
            [0, 0, 0, 1],
        ]
    )


def shifted(by):
    matrix = np.eye(4)
    matrix[:3, 3] = by
    return matrix


def any_axis(rng):
    return [rng.gauss(0, 1) for _ in range(3)]


def turned(degrees):
    """Each camera turned about the object by an angle, about an axis of its own."""
    def change(views, center, rng):
        for i, view in enumerate(views):
            # Turns in opposite pairs: what all cameras do alike nobody can know.
            axis = [-x for x in axis] if i % 2 else any_axis(rng)
            turn = shifted(center) @ rotation(axis, math.radians(degrees)) @ shifted(-np.array(center))
            view["world_to_camera"] = (view["world_to_camera"] @ turn).tolist()

    return change


def pointing(pixels):
    """Each camera turned about itself, so that its picture is off by `pixels` pixels."""
    def change(views, center, rng):
        poses = [np.array(view["world_to_camera"]) for view in views]
        ways = [rng.uniform(0, 2 * math.pi) for _ in views]
        # How far the object seems to move, in the world, and less what all cameras do alike, which nobody can know.
        depths = [(pose @ [*center, 1])[2] for pose in poses]
        angle = math.atan(pixels / views[0]["intrinsics"][0][0])
        moves = [pose[:3, :3].T @ [z * angle * math.cos(w), z * angle * math.sin(w), 0] for pose, w, z in zip(poses, ways, depths)]
        across = [np.eye(3) - np.outer(pose[2, :3], pose[2, :3]) for pose in poses]
        alike = np.linalg.solve(sum(across), sum(moves))
        for view, pose, move, plane, z in zip(views, poses, moves, across, depths):
            x, y, _ = pose[:3, :3] @ (move - plane @ alike) / z
            view["world_to_camera"] = (rotation([-y, x, 0], math.hypot(x, y)) @ pose).tolist()

    return change


def pictures(change, some=lambda i: True):
    """Changes some pictures."""
    def apply(views, _, rng):
        for i, view in enumerate(views):
            if some(i):
                pixels = np.array(Image.open(view["path"]).convert("RGBA"))
                Image.fromarray(change(pixels, i, rng)).save(view["path"])

    return apply


def holes(pixels, _, rng):
    """Holes of 2 to 5 pixels in the mask, and specks beside it."""
    inside, outside = (np.argwhere(where).tolist() for where in (pixels[..., 3] > 127, pixels[..., 3] == 0))
    for row, column in rng.sample(inside, 4):
        paint(pixels, row, column, rng.uniform(1.0, 2.5), [0, 0, 0, 0])
    for row, column in rng.sample(outside, 4):
        paint(pixels, row, column, rng.uniform(1.0, 2.0), [128, 128, 128, 255])
    return pixels


def dilate(pixels, _, rng):
    """The mask wider by two pixels, in the colours beside them."""
    wide = pixels.copy()
    for by in disc(2):
        near = np.roll(pixels, by, (0, 1))
        taken = (wide[..., 3] <= 127) & (near[..., 3] > 127)
        wide[taken] = near[taken]
    return wide


def shift(pixels, _, rng):
    """Another silhouette in place of the right one: the picture rolled aside."""
    return np.roll(pixels, (15, 20), (0, 1))


def fill(value):
    def change(pixels, _, rng):
        pixels[..., 3] = value
        return pixels

    return change


def flip(pixels, _, rng):
    return pixels[::-1]


def expose(pixels, i, rng):
    """Gains from 0.66 to 1.5, whose mean logarithm is 0."""
    x = np.arange(256) / 255
    linear = np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)
    y = np.minimum(1.0, 1.5 ** (2 * (7 * i % 16) / 15 - 1) * linear)
    table = np.round(255 * np.where(y <= 0.0031308, 12.92 * y, 1.055 * y ** (1 / 2.4) - 0.055)).astype(np.uint8)
    return np.concatenate((table[pixels[..., :3]], pixels[..., 3:]), -1)


def nothing(views, _, rng):
    pass


def first(count):
    def change(views, _, rng):
        views[:] = [views[i * len(views) // count] for i in range(count)]

    return change


def white(pixels, _, rng):
    """All of the picture in the mask, before a grey wall."""
    pixels[pixels[..., 3] == 0] = 128
    return fill(255)(pixels, _, rng)


third = lambda i: i == 3
ROWS = [
    ("clean", nothing, []),
    ("clean, from a sphere", nothing, ["--template", "sphere", "--iterations", "150"]),
    ("turned by 1°", turned(1), []),
    ("turned by 2°", turned(2), []),
    ("pointing off by 3 px", pointing(3), []),
    ("masks with holes and specks", pictures(holes), []),
    ("masks dilated by 2 px", pictures(dilate), []),
    ("one wrong mask", pictures(shift, third), []),
    ("one empty mask", pictures(fill(0), third), []),
    ("one mask upside down", pictures(flip, third), []),
    ("one white mask", pictures(white, third), []),
    ("exposure from 0.66 to 1.5", pictures(expose), []),
    ("eight views", first(8), []),
    ("six views", first(6), []),
]


def run(program, folder, *arguments):
    done = subprocess.run([program, *map(str, arguments)], cwd=folder, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{program} {' '.join(map(str, arguments))}\n{done.stderr}")
    return done.stdout + done.stderr


def subset(source, target, numbers, change=nothing, center=(0, 0, 0)):
    """A folder of some of the views, changed."""
    target.mkdir()
    views = json.loads((source / "cameras.json").read_text())
    views = [views[i] for i in numbers]
    for view in views:
        view["path"] = pathlib.Path(shutil.copy(source / view["file"], target))
    change(views, center, random.Random(1))
    for view in views:
        del view["path"]
    (target / "cameras.json").write_text(json.dumps(views))


def middle(mesh):
    points = [[float(x) for x in line.split()[1:4]] for line in mesh.read_text().splitlines() if line.startswith("v ")]
    return [(min(p[k] for p in points) + max(p[k] for p in points)) / 2 for k in range(3)]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--softras", default=str(pathlib.Path(__file__).parent.parent / "target/release/softras"))
    parser.add_argument("--only", default="", help="rows whose name has one of these words, with commas between")
    parser.add_argument("--keep", help="keep the pictures and meshes in this new folder")
    parser.add_argument("--fit", default="--color", help="options of every fit")
    parser.add_argument("meshes", nargs="*", help="meshes to make pictures of [default: those of `softras mesh`]")
    arguments = parser.parse_args()
    softras = str(pathlib.Path(arguments.softras).resolve())
    home = pathlib.Path(arguments.keep or tempfile.mkdtemp())
    home.mkdir(exist_ok=True, parents=True)
    meshes = [pathlib.Path(mesh).resolve() for mesh in arguments.meshes]
    for name in [] if meshes else ["fish", "torus"]:
        run(softras, home, "mesh", name, "-o", f"{name}.obj")
        meshes.append(home / f"{name}.obj")
    print("| mesh | pictures | mask IoU | colour error | by the fit itself | shape | seconds | notes |\n|---|---|---|---|---|---|---|---|")
    for mesh in meshes:
        folder = home / mesh.stem
        folder.mkdir()
        run(softras, folder, *f"fit --from {mesh} --views 24 --color --shading none --iterations 1 --template sphere --write-views all -o x.obj".split())
        subset(folder / "all", folder / "held_out", HELD_OUT)
        center = middle(mesh)
        for name, change, options in ROWS:
            if not any(word in name for word in arguments.only.split(",")):
                continue
            at = name.replace(" ", "_").replace(",", "")
            subset(folder / "all", folder / at, [i for i in range(24) if i not in HELD_OUT], change, center)
            began = time.time()
            told = run(softras, folder, "fit", "--views", at, *arguments.fit.split(), "-o", f"{at}.obj", "--json", f"{at}.json", *options)
            seconds = time.time() - began
            log = json.loads((folder / f"{at}.json").read_text())["final"]
            judge = f"fit --views held_out --color --template {at}.obj --keep-views --keep-cameras --keep-exposure --crop 0 --hold-out 0 --iterations 1 --rate 1e-9 -o x.obj --json judge.json"
            run(softras, folder, *judge.split())
            judged = json.loads((folder / "judge.json").read_text())["final"]
            number = lambda x: "–" if x is None else f"{x:.4f}"
            own = f"{number(log['mask_iou']['mean_of_fitted'])}, {number(log['mask_iou'].get('mean_of_held_out'))}"
            shape = f"{log['parts']} of genus {log['genus']}"
            notes = "; ".join(line.removeprefix("note: ") for line in told.splitlines() if line.startswith("note"))
            row = [mesh.stem, name, number(judged["mask_iou"]["mean"]), number(judged["color_error"]), own, shape, f"{seconds:.0f}", notes]
            print("| " + " | ".join(row) + " |", flush=True)
    if not arguments.keep:
        shutil.rmtree(home)


main()
