"""A cube's vertices and colours from pictures of a few pixels, each from another side, as in nvdiffrast's sample. Writes cube.png.

    python cube.py          # soft pictures
    python cube.py --hard   # hard ones, whose outlines are antialiased
"""

import argparse
import dataclasses
import time

import numpy as np
import torch
from PIL import Image

import softras
import softras.torch as st

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--hard", action="store_true", help="draw hard pictures with antialiased outlines")
parser.add_argument("--size", type=int, default=16, help="pixels of a side")
parser.add_argument("--steps", type=int, default=1000)
args = parser.parse_args()

cube = softras.shapes.cube()
faces = torch.tensor(cube.triangles.astype(np.int64))
true = 0.5 * torch.tensor(cube.positions).sign()
true_colors = true + 0.5
field = 2 * np.arctan(0.4)
start = torch.tensor(np.vstack([softras.Camera.look_at((0, 0, 3.5), (0, 0, 0), fov_y=field).view, [0, 0, 0, 1]])).float()
still = softras.Camera.from_matrix(np.eye(4), fov_y=field, mirrored=True)
settings = softras.Settings(width=args.size, height=args.size, gamma=1e-2, near=1.0, far=6.0, outputs=("color",))
settings = dataclasses.replace(settings, background="composite", interpolation="perspective")
# A triangle reaches a pixel beyond its edge.
settings = dataclasses.replace(settings, sigma=(2 / args.size) ** 2 / settings.cutoff())


def draw(vertices, colors, view, settings=settings):
    moved = vertices @ view[:3, :3].T + view[:3, 3]
    if not args.hard:
        return st.render(moved, faces, still, colors=colors, settings=settings).color
    found = st.fragments(moved, faces, still, settings=settings)
    return st.antialias(st.interpolate(found, colors, faces), found, moved, faces, still, settings)


torch.manual_seed(0)
vertices = (true + torch.rand(8, 3) - 0.5).requires_grad_()
colors = torch.rand(8, 3).requires_grad_()
optimizer = torch.optim.Adam([vertices, colors], lr=1e-2)
schedule = torch.optim.lr_scheduler.LambdaLR(optimizer, lambda step: max(0.01, 10 ** (-step * 0.0005)))
first, begun = vertices.detach().clone(), time.time()
for step in range(args.steps + 1):
    # A random turn, and a shift of up to a quarter.
    motion = st.rigid_motion(torch.cat([torch.zeros(3), 3 * torch.randn(3)]))
    motion[:3, 3] = 0.5 * torch.rand(3) - 0.25
    with torch.no_grad():
        target = draw(true, true_colors, start @ motion)
    loss = (draw(vertices, colors, start @ motion) - target).square().mean()
    optimizer.zero_grad()
    loss.backward()
    optimizer.step()
    schedule.step()
    if step % 250 == 0:
        error = (vertices - true).norm(dim=1).mean().item()
        print(f"step {step}: vertices are {error:.6f} off, colours {(colors - true_colors).abs().mean().item():.6f}")
print(f"{time.time() - begun:.1f} s for pictures of {args.size}² pixels")

# A picture that it saw, and the cube at first, at last and as it is, from one side.
side = start @ st.rigid_motion(torch.tensor([0.0, 0.0, 0.0, 0.5, 0.6, 0.0]))
sharp = dataclasses.replace(settings, width=240, height=240, sigma=1e-6, gamma=1e-4)
with torch.no_grad():
    seen = draw(true, true_colors, side)[0].numpy().repeat(240 // args.size, 0).repeat(240 // args.size, 1)
    shown = [draw(*one, side, sharp)[0].numpy() for one in ((first, colors), (vertices, colors), (true, true_colors))]
row = np.hstack([np.pad(seen, ((0, 240 - len(seen)), (0, 240 - len(seen)), (0, 0))), *shown])
Image.fromarray((255 * np.clip(row, 0, 1)).astype(np.uint8)).save("cube.png")
