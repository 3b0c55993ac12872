#!/usr/bin/env python3
"""Makes fit.png, the picture of README.md: python3 docs/pictures/fit.py, after cargo build --release -p softras-cli.

A fit films itself beside its target. This lays five pictures of the film in a row: the target, the mesh at steps 0, 30 and 150, and the
result with its texture. Needs Pillow.
"""

import pathlib
import subprocess
import tempfile

from PIL import Image, ImageDraw, ImageFont

HOME = pathlib.Path(__file__).resolve().parents[2]
SOFTRAS = HOME / "target/release/softras"
FIT = "fit --from fish --template sphere --size 160 --texture --iterations 150 --remesh-at 50,100 --edge 3..1.5"
#: Of 150 steps the film shows every fifth, the last one and the textured mesh.
FRAMES = {"step 0": 0, "step 30": 6, "step 150": 30, "with its texture": 31}
MARGIN, LABEL = 8, 26

with tempfile.TemporaryDirectory() as folder:
    subprocess.run([SOFTRAS, *FIT.split(), "-o", "fitted.obj", "--gif", "fit.gif"], cwd=folder, check=True)
    film = Image.open(pathlib.Path(folder) / "fit.gif")
    half, top, bottom = film.width // 2, film.height // 6, film.height * 5 // 6
    pictures = []
    for label, frame in FRAMES.items():
        film.seek(frame)
        shown = film.convert("RGB")
        if not pictures:
            pictures.append(("target", shown.crop((0, top, half, bottom))))
        pictures.append((label, shown.crop((half, top, film.width, bottom))))

height = bottom - top
row = Image.new("RGB", (len(pictures) * (half + MARGIN) - MARGIN, height + LABEL), "white")
draw = ImageDraw.Draw(row)
for at, (label, picture) in enumerate(pictures):
    left = at * (half + MARGIN)
    row.paste(picture, (left, 0))
    draw.text((left + half / 2, height + 4), label, "black", ImageFont.load_default(16), "ma")
row.save(HOME / "docs/pictures/fit.png", optimize=True)
