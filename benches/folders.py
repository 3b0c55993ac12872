#!/usr/bin/env python3
"""Fits to folders like those that people have: python3 benches/folders.py [--softras PROGRAM] [--only WORD] [--keep FOLDER] [--large] MESH.obj

Makes look-alikes of nine public folders from renderings of a mesh, with their sizes, formats, noise, cuts, EXIF and masks, and gives
each to the shortest command of docs/photos.md. Each row: what came of it, the mask IoU of the views held out, the 3D IoU with the mesh,
seconds, processor seconds, memory, and the notes or the error. `--large` makes pictures as large as the public ones, else they are
smaller. Needs numpy and Pillow.
"""

import argparse
import json
import os
import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile
import time

import numpy as np
from PIL import Image

HOME = pathlib.Path(__file__).resolve().parent.parent


class Folder:
    """A folder of pictures in the making: RGBA pictures of the object, and OpenCV's K, R and t of each."""

    def __init__(self, path, views, size, seed):
        self.path, self.size, self.random = path, size, np.random.default_rng(seed)
        self.views, self.mirrored = views, False
        # The EXIF orientation of each picture.
        self.exif = lambda i: 1
        path.mkdir()

    def pixels(self, view):
        """The object in a picture of the folder's size, and its camera matrix."""
        picture, k = view["picture"], view["k"]
        times = max(side / own for side, own in zip(self.size, picture.size)) * view.get("zoom", 1)
        large = picture.resize([round(times * side) for side in picture.size], Image.Resampling.BICUBIC)
        left, top = [(own - side) // 2 - shift for own, side, shift in zip(large.size, self.size, view.get("shift", (0, 0)))]
        scaled = np.diag([times, times, 1]) @ k - [[0, 0, left], [0, 0, top], [0, 0, 0]]
        return np.array(large.crop((left, top, left + self.size[0], top + self.size[1]))).astype(float), scaled

    def over(self, rgba, background):
        alpha = rgba[..., 3:] / 255
        return alpha * rgba[..., :3] + (1 - alpha) * background

    def noisy(self, pixels, sigma):
        return np.clip(np.round(pixels + sigma * self.random.standard_normal(pixels.shape)), 0, 255).astype(np.uint8)

    def plain(self, color, corners=0.0, shadow=0.0):
        """A colour that darkens to the corners, with a soft shadow below the middle."""
        width, height = self.size
        y, x = np.mgrid[0:height, 0:width]
        x, y = 2 * x / width - 1, 2 * y / height - 1
        dark = (1 - corners * (x**2 + y**2) / 2) * (1 - shadow * np.exp(-(x**2 + ((y - 0.45) / 0.3) ** 2) / 0.2))
        return dark[..., None] * np.array(color, float)

    def room(self, i):
        """A cluttered background: boxes of many colours, others in each picture."""
        small = np.zeros((24, 32, 3))
        for _ in range(60):
            row, column = self.random.integers(0, 22), self.random.integers(0, 30)
            small[row : row + self.random.integers(2, 9), column : column + self.random.integers(2, 9)] = self.random.integers(0, 255, 3)
        return np.array(Image.fromarray(small.astype(np.uint8)).resize(self.size, Image.Resampling.BICUBIC)).astype(float)

    def save(self, name, pixels, exif=1, **options):
        path = self.path / name
        path.parent.mkdir(exist_ok=True, parents=True)
        if exif != 1:
            data = Image.Exif()
            data[0x0112] = exif
            options["exif"] = data
        Image.fromarray(pixels).save(path, **options)

    def mask(self, name, inside):
        self.save(name, np.where(inside, 255, 0).astype(np.uint8))

    def transforms(self, names, ks, more=lambda i: {}):
        flip = np.diag([1, -1, -1, 1])
        frames = [
            {"file_path": name, "transform_matrix": np.float32(np.linalg.inv(pose(view)) @ flip).tolist(), "fl_x": k[0, 0], "fl_y": k[1, 1], "cx": k[0, 2], "cy": k[1, 2], **more(i)}
            for i, (name, k, view) in enumerate(zip(names, ks, self.views))
        ]
        # numpy's float32 as decimal numbers, as exporters write them.
        text = json.dumps({"w": self.size[0], "h": self.size[1], "aabb_scale": 4, "frames": frames})
        (self.path / "transforms.json").write_text(text)

    def colmap(self, names, ks, binary):
        model = self.path / "sparse" / "0"
        model.mkdir(parents=True)
        # They are relative to the folder of pictures.
        names = [name.removeprefix("images/") for name in names]
        lenses = [[k[0, 0], k[1, 1], k[0, 2], k[1, 2]] for k in ks]
        poses = [[*quaternion(np.array(view["r"])), *view["t"]] for view in self.views]
        if not binary:
            lines = [f"{i} PINHOLE {self.size[0]} {self.size[1]} {' '.join(map(str, lens))}\n" for i, lens in enumerate(lenses, 1)]
            (model / "cameras.txt").write_text("".join(lines))
            lines = [f"{i} {' '.join(map(str, one))} {i} {name}\n1.5 2.5 -1\n" for i, (name, one) in enumerate(zip(names, poses), 1)]
            (model / "images.txt").write_text("# IMAGE_ID\n" + "".join(lines))
            return
        cameras, images = struct.pack("<Q", len(ks)), struct.pack("<Q", len(ks))
        for i, (lens, one, name) in enumerate(zip(lenses, poses, names), 1):
            cameras += struct.pack("<iiQQ4d", i, 1, *self.size, *lens)
            images += struct.pack("<i7di", i, *one, i) + name.encode() + b"\0" + struct.pack("<Q", 0)
        (model / "cameras.bin").write_bytes(cameras)
        (model / "images.bin").write_bytes(images)


def pose(view):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = view["r"], view["t"]
    return matrix


def quaternion(r):
    values, vectors = np.linalg.eigh(
        np.array(
            [
                [r[0, 0] - r[1, 1] - r[2, 2], 0, 0, 0],
                [r[0, 1] + r[1, 0], r[1, 1] - r[0, 0] - r[2, 2], 0, 0],
                [r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], r[2, 2] - r[0, 0] - r[1, 1], 0],
                [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], r[0, 0] + r[1, 1] + r[2, 2]],
            ]
        )
        / 3
    )
    x, y, z, w = vectors[:, np.argmax(values)]
    return np.array([w, x, y, z])


def middlebury(folder, name, sigma):
    """Black with the sensor's noise, PNG, K, R and t in a text file."""
    lines = []
    for i, view in enumerate(folder.views):
        view["shift"] = (int(folder.random.integers(-40, 40)), int(folder.random.integers(-20, 20)))
        rgba, k = folder.pixels(view)
        file = f"{name}{i + 1:04}.png"
        folder.save(file, folder.noisy(folder.over(rgba, 0.0), sigma))
        numbers = [*k.ravel(), *np.array(view["r"]).ravel(), *view["t"]]
        lines.append(f"{file} {' '.join(f'{x:.9f}' for x in numbers)}\n")
    (folder.path / f"{name}_par.txt").write_text(f"{len(lines)}\n{''.join(lines)}")


def oxford(folder):
    """A blue plain wall with darker corners and noise, PPM, P of a mirrored world."""
    matrices, mirror = {}, np.diag([-1.0, 1, 1, 1])
    for i, view in enumerate(folder.views):
        rgba, k = folder.pixels(view)
        folder.save(f"viff.{i:03}.ppm", folder.noisy(folder.over(rgba, folder.plain([60, 80, 150], corners=0.25)), 2.0))
        p = np.eye(4)
        p[:3] = k @ pose(view)[:3] @ mirror
        matrices[f"world_mat_{i}"] = p * (-1) ** i
    np.savez(folder.path / "cameras.npz", **matrices)
    folder.mirrored = True


def each(folder, name, background, sigma=3.0, **options):
    """Saves each view over a background as a picture with noise. Returns all names, camera matrices and masks."""
    names, ks, masks = [], [], []
    for i, view in enumerate(folder.views):
        rgba, k = folder.pixels(view)
        folder.save(name.format(i), folder.noisy(folder.over(rgba, background(i)), sigma), exif=folder.exif(i), **options)
        names.append(name.format(i))
        ks.append(k)
        masks.append(rgba[..., 3] > 127)
    return names, ks, masks


def statue(folder):
    """A tall object that the lower border cuts in most pictures, COLMAP's model in binary and COLMAP's masks."""
    for i, view in enumerate(folder.views):
        if i % 8:
            view["zoom"], view["shift"] = 1.25, (0, folder.size[1] // 6)
    names, ks, masks = each(folder, "images/{:04}.jpg", folder.room, 2.0, quality=90)
    for name, inside in zip(names, masks):
        folder.mask(name.replace("images", "masks") + ".png", inside)
    folder.colmap(names, ks, binary=True)


def fox(folder):
    """Frames of a video in a room, some deleted, without masks."""
    names, ks, _ = each(folder, "images/{:04}.jpg", folder.room, quality=85)
    for name in names[3::4]:
        (folder.path / name).unlink()
    folder.transforms(names, ks)


def figure(folder):
    """A few large pictures before white paper with a soft shadow, stored upside down by a phone, COLMAP's text."""
    folder.exif = lambda i: 3 if i % 3 else 1
    paper = folder.plain([228, 226, 220], corners=0.12, shadow=0.15)
    names, ks, _ = each(folder, "images/IMG_{:04}.JPG", lambda i: paper, 1.5, quality=92)
    folder.colmap(names, ks, binary=False)


def mouse(folder):
    """A phone's pictures of a cluttered table, without masks."""
    folder.exif = lambda i: 6
    names, ks, _ = each(folder, "images/IMG_{:04}.jpg", folder.room, quality=85)
    folder.colmap(names, ks, binary=False)


def frames(folder):
    """Frames of a video with masks of 0 and 1 in a folder of their own."""
    names, ks, masks = each(folder, "frame_{:05}.jpg", folder.room, quality=80)
    for name, inside in zip(names, masks):
        folder.save(f"mask/{name[:-4]}.png", inside.astype(np.uint8))
    folder.transforms(names, ks)


def phone(folder):
    """A phone's pictures, turned by EXIF, with masks that a program made of the turned pictures."""
    folder.exif = lambda i: 6
    names, ks, masks = each(folder, "images/PXL_{:04}.jpg", folder.room, 2.0, quality=88)
    for name, inside in zip(names, masks):
        folder.mask(name.replace("images", "silhouettes")[:-4] + ".png", np.rot90(inside, -1))
    folder.colmap(names, ks, binary=True)


# Name, how it is made, views, the size of the public ones and a smaller one, and whether it is refused.
FOLDERS = [
    ("dino", lambda f: middlebury(f, "dinoSR", 2.5), 16, (640, 480), (640, 480), False),
    ("temple", lambda f: middlebury(f, "templeSR", 4.0), 16, (640, 480), (640, 480), False),
    ("oxford", oxford, 36, (720, 576), (720, 576), False),
    ("statue", statue, 24, (800, 1200), (800, 1200), False),
    ("fox", fox, 67, (1080, 1920), (540, 960), True),
    ("figure", figure, 16, (5184, 3888), (1296, 972), False),
    ("mouse", mouse, 59, (1920, 1440), (960, 720), True),
    ("frames", frames, 40, (1280, 720), (1280, 720), False),
    ("phone", phone, 45, (4032, 3024), (1008, 756), False),
]


def run(program, folder, *arguments):
    """The program's output, its exit code, seconds, processor seconds and the peak of memory in MB."""
    began = time.time()
    with tempfile.TemporaryFile() as told:
        process = subprocess.Popen([program, *map(str, arguments)], cwd=folder, stdout=told, stderr=told)
        done, memory = 0, 0.0
        while not done:
            memory = max(memory, peak(process.pid))
            time.sleep(0.01)
            done, status, used = os.wait4(process.pid, os.WNOHANG)
        process.returncode = os.waitstatus_to_exitcode(status)
        told.seek(0)
        text = told.read().decode()
    return text, process.returncode, time.time() - began, used.ru_utime + used.ru_stime, memory


def peak(process):
    """The most memory of a running process so far, in MB; `ru_maxrss` would count what this program held when it forked."""
    lines = pathlib.Path(f"/proc/{process}/status").read_text().splitlines()
    return sum(int(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1000


def rendered(program, home, mesh, count, large):
    """Views of a mesh: their pictures and cameras."""
    size = "1200x900" if large else "600x450"
    target = home / f"views{count}"
    if not target.exists():
        arguments = f"fit --from {mesh} --views {count} --size {size} --fov 25 --color --shading none --iterations 1 --template sphere --write-views {target} -o x.obj"
        text, code, *_ = run(program, home, *arguments.split())
        if code:
            sys.exit(text)
    entries = json.loads((target / "cameras.json").read_text())
    poses = [np.array(entry["world_to_camera"]) for entry in entries]
    return [
        {"picture": Image.open(target / entry["file"]).convert("RGBA"), "k": np.array(entry["intrinsics"]), "r": one[:3, :3], "t": one[:3, 3]}
        for entry, one in zip(entries, poses)
    ]


def mirrored(path):
    lines = [line.split() for line in path.read_text().splitlines()]
    for words in lines:
        if words and words[0] == "v":
            words[1] = str(-float(words[1]))
        if words and words[0] == "f":
            words[1:] = reversed(words[1:])
    path.write_text("\n".join(" ".join(words) for words in lines) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--softras", default=str(HOME / "target/release/softras"))
    parser.add_argument("--only", default="", help="folders whose name has one of these words, with commas between")
    parser.add_argument("--keep", help="keep the folders and meshes in this new folder")
    parser.add_argument("--large", action="store_true", help="pictures as large as the public ones")
    parser.add_argument("--fit", default="--texture", help="options of every fit")
    parser.add_argument("mesh", type=pathlib.Path)
    arguments = parser.parse_args()
    program, mesh = str(pathlib.Path(arguments.softras).resolve()), arguments.mesh.resolve()
    home = pathlib.Path(arguments.keep or tempfile.mkdtemp()).resolve()
    home.mkdir(exist_ok=True, parents=True)
    print("| folder | came | held-out mask IoU | 3D IoU | seconds | processor | MB | notes |\n|---|---|---|---|---|---|---|---|")
    bad = 0
    for seed, (name, make, count, size, smaller, is_refused) in enumerate(FOLDERS):
        if not any(word in name for word in arguments.only.split(",")):
            continue
        folder = Folder(home / name, rendered(program, home, mesh, count, arguments.large), size if arguments.large else smaller, seed)
        make(folder)
        out, log = home / f"{name}.obj", home / f"{name}.json"
        told, code, seconds, processor, memory = run(program, home, "fit", "--views", name, *arguments.fit.split(), "-o", out, "--json", log)
        held_out = solid = None
        if code == 0:
            held_out = json.loads(log.read_text())["final"]["mask_iou"]["mean_of_held_out"]
            if folder.mirrored:
                mirrored(out)
            solid = float(run(program, home, "iou", out, mesh, "--resolution", "64")[0].split()[-1])
        good = code == 1 and seconds < 2 if is_refused else held_out is not None and held_out >= 0.96
        bad += not good
        number = lambda x: "–" if x is None else f"{x:.4f}"
        came = ("refused" if code else "fitted") + ("" if good else " (BAD)")
        lines = [line.removeprefix("note: ") for line in told.splitlines() if line.startswith(("note", "error"))]
        row = [name, came, number(held_out), number(solid), f"{seconds:.1f}", f"{processor:.0f}", f"{memory:.0f}", "; ".join(lines)]
        print("| " + " | ".join(row) + " |", flush=True)
    if not arguments.keep:
        shutil.rmtree(home)
    sys.exit(bad > 0)


main()
