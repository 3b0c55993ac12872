#!/usr/bin/env python3
"""Fits to disturbed photographs of a mesh: python3 benches/photos.py [--softras PROGRAM] [--only WORD] [--keep FOLDER] [MESH.obj ...]

Of 24 pictures of 128² pixels that the program makes of each mesh, 16 are disturbed and fitted to. The other eight judge the result, with
their true cameras. Each row is a disturbance: the mask IoU and the colour error of the eight, those that the fit itself reports
of the views that it holds out, parts and genus, seconds, and the notes. Needs nothing but Python.
"""

import argparse
import json
import math
import pathlib
import random
import shutil
import struct
import subprocess
import sys
import tempfile
import time
import zlib

HELD_OUT = range(1, 24, 3)


def read_png(path):
    """Width, height, channels and the rows of an 8-bit picture."""
    data, at, packed = path.read_bytes(), 8, b""
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at : at + 8])
        body = data[at + 8 : at + 8 + length]
        if kind == b"IHDR":
            width, height, _, color = struct.unpack(">IIBB", body[:10])
        packed += body if kind == b"IDAT" else b""
        at += 12 + length
    channels, raw = {0: 1, 2: 3, 6: 4}[color], zlib.decompress(packed)
    stride, rows = width * channels, []
    before = bytearray(stride)
    for r in range(height):
        kind, row = raw[r * (stride + 1)], bytearray(raw[r * (stride + 1) + 1 : (r + 1) * (stride + 1)])
        for i in range(stride):
            a = row[i - channels] if i >= channels else 0
            b, c = before[i], before[i - channels] if i >= channels else 0
            if kind == 4:
                p = a + b - c
                near = min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]
            else:
                near = (0, a, b, (a + b) // 2)[kind]
            row[i] = (row[i] + near) & 255
        rows.append(row)
        before = row
    return width, height, channels, rows


def write_png(path, width, height, rows):
    """Writes RGBA."""
    def chunk(kind, body):
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    head = struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)
    packed = zlib.compress(b"".join(b"\0" + bytes(row) for row in rows), 1)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", packed) + chunk(b"IEND", b""))


class Picture:
    """RGBA values as lists of [r, g, b, a]."""

    def __init__(self, path):
        self.width, self.height, channels, rows = read_png(path)
        pixel = lambda row, c: list(row[channels * c : channels * (c + 1)]) + ([255] if channels == 3 else [])
        self.pixels = [[pixel(row, c) for c in range(self.width)] for row in rows]

    def save(self, path):
        write_png(path, self.width, self.height, [[x for p in row for x in p] for row in self.pixels])

    def erase(self, row, column, radius):
        """A round hole."""
        for r, c in self.around(row, column, radius):
            self.pixels[r][c] = [0, 0, 0, 0]

    def around(self, row, column, radius):
        reach = math.ceil(radius)
        for r in range(max(0, row - reach), min(self.height, row + reach + 1)):
            for c in range(max(0, column - reach), min(self.width, column + reach + 1)):
                if (r - row) ** 2 + (c - column) ** 2 <= radius**2:
                    yield r, c

    def dilate(self, radius):
        old = [[list(p) for p in row] for row in self.pixels]
        for r in range(self.height):
            for c in range(self.width):
                if old[r][c][3] > 127:
                    continue
                near = [(old[a][b][3], a, b) for a, b in self.around(r, c, radius)]
                alpha, a, b = max(near)
                if alpha > 127:
                    self.pixels[r][c] = old[a][b][:3] + [alpha]

    def expose(self, gain):
        def one(x):
            x /= 255
            x = x / 12.92 if x <= 0.04045 else ((x + 0.055) / 1.055) ** 2.4
            x = min(1.0, gain * x)
            return round(255 * (12.92 * x if x <= 0.0031308 else 1.055 * x ** (1 / 2.4) - 0.055))

        table = [one(x) for x in range(256)]
        self.pixels = [[[table[x] for x in p[:3]] + p[3:] for p in row] for row in self.pixels]


def rotation(axis, angle):
    """4 × 4, about the origin."""
    length = math.sqrt(sum(x * x for x in axis))
    x, y, z = (a / length for a in axis)
    c, s = math.cos(angle), math.sin(angle)
    t = 1 - c
    rows = [
        [t * x * x + c, t * x * y - s * z, t * x * z + s * y, 0],
        [t * x * y + s * z, t * y * y + c, t * y * z - s * x, 0],
        [t * x * z - s * y, t * y * z + s * x, t * z * z + c, 0],
        [0, 0, 0, 1],
    ]
    return rows


def times(a, b):
    return [[sum(a[i][k] * b[k][j] for k in range(4)) for j in range(4)] for i in range(4)]


def shifted(by):
    return [[1, 0, 0, by[0]], [0, 1, 0, by[1]], [0, 0, 1, by[2]], [0, 0, 0, 1]]


def any_axis(rng):
    return [rng.gauss(0, 1) for _ in range(3)]


def turned(degrees):
    """Each camera turned about the object by an angle, about an axis of its own."""
    def change(views, center, rng):
        for i, view in enumerate(views):
            # Turns in opposite pairs: what all cameras do alike nobody can know.
            axis = [-x for x in axis] if i % 2 else any_axis(rng)
            turn = times(times(shifted(center), rotation(axis, math.radians(degrees))), shifted([-x for x in center]))
            view["world_to_camera"] = times(view["world_to_camera"], turn)

    return change


def pointing(pixels):
    """Each camera turned about itself, so that its picture is off by so many pixels."""
    def change(views, _, rng):
        for view in views:
            way = rng.uniform(0, 2 * math.pi)
            angle = math.atan(pixels / view["intrinsics"][0][0])
            view["world_to_camera"] = times(rotation([math.cos(way), math.sin(way), 0], angle), view["world_to_camera"])

    return change


def pictures(change, some=lambda i: True):
    """Changes some pictures."""
    def apply(views, _, rng):
        for i, view in enumerate(views):
            if some(i):
                picture = Picture(view["path"])
                change(picture, i, rng)
                picture.save(view["path"])

    return apply


def holes(picture, _, rng):
    """Holes of 2 to 5 pixels in the mask, and specks beside it."""
    inside = [(r, c) for r, row in enumerate(picture.pixels) for c, p in enumerate(row) if p[3] > 127]
    outside = [(r, c) for r, row in enumerate(picture.pixels) for c, p in enumerate(row) if p[3] == 0]
    for r, c in rng.sample(inside, 4):
        picture.erase(r, c, rng.uniform(1.0, 2.5))
    for r, c in rng.sample(outside, 4):
        for a, b in picture.around(r, c, rng.uniform(1.0, 2.0)):
            picture.pixels[a][b] = [128, 128, 128, 255]


def shift(picture, _, rng):
    """Another silhouette in place of the right one: the picture rolled aside."""
    picture.pixels = [row[-20:] + row[:-20] for row in picture.pixels[-15:] + picture.pixels[:-15]]


def fill(value):
    def change(picture, _, rng):
        picture.pixels = [[p[:3] + [value] for p in row] for row in picture.pixels]

    return change


def flip(picture, _, rng):
    picture.pixels.reverse()


def expose(picture, i, rng):
    """Gains from 0.66 to 1.5, whose mean logarithm is 0."""
    picture.expose(1.5 ** (2 * (7 * i % 16) / 15 - 1))


def nothing(views, _, rng):
    pass


def first(count):
    def change(views, _, rng):
        views[:] = [views[i * len(views) // count] for i in range(count)]

    return change


third = lambda i: i == 3
ROWS = [
    ("clean", nothing, []),
    ("clean, from a sphere", nothing, ["--template", "sphere", "--iterations", "150"]),
    ("turned by 1°", turned(1), []),
    ("turned by 2°", turned(2), []),
    ("pointing off by 3 px", pointing(3), []),
    ("masks with holes and specks", pictures(holes), []),
    ("masks dilated by 2 px", pictures(lambda picture, i, rng: picture.dilate(2)), []),
    ("one wrong mask", pictures(shift, third), []),
    ("one empty mask", pictures(fill(0), third), []),
    ("one mask upside down", pictures(flip, third), []),
    ("one white mask", pictures(fill(255), third), []),
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
            judge = f"fit --views held_out --color --template {at}.obj --keep-views --keep-cameras --hold-out 0 --iterations 1 --rate 1e-9 -o x.obj --json judge.json"
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
