"""Where a camera stood: its view matrix from one picture. Writes camera.png."""

import dataclasses

import numpy as np
import torch
from PIL import Image

import softras
import softras.torch as st

fish = softras.shapes.fish()
true = softras.Camera.look_at((1.2, 0.9, 2.6), (0.1, 0.0, 0.0), fov_y=0.75)
settings = softras.Settings(width=128, height=128, sigma=1e-3, gamma=1e-2, near=1.0, far=6.0, background="composite")
target = torch.tensor(softras.render(fish, true, settings).color)

# The start: another place. A motion ξ = (translation, rotation) in view space is found.
start = softras.Camera.look_at((0.6, 0.5, 2.9), (0.0, 0.1, 0.0), fov_y=0.75)
view = torch.tensor(np.vstack([start.view, [0, 0, 0, 1]]))
motion = torch.zeros(6, dtype=torch.float64, requires_grad=True)
optimizer = torch.optim.Adam([motion], lr=0.02)
vertices = torch.tensor(fish.positions)
for step in range(200):
    moved = (st.rigid_motion(motion) @ view)[None]
    image = st.render(vertices, fish, start, views=moved, settings=settings).color
    loss = (image - target).square().mean()
    optimizer.zero_grad()
    loss.backward()
    optimizer.step()
    if step % 50 == 0:
        print(f"step {step}: loss {loss.item():.6f}")

found = moved[0].detach().numpy()
eyes = [-view[:3, :3].T @ view[:3, 3] for view in (found, true.view)]
print(f"at last: loss {loss.item():.6f}; the eye is {np.linalg.norm(eyes[0] - eyes[1]):.3f} from the true one")

# From where the search began, from where it ended, and from the true place.
ways = [start, softras.Camera.from_matrix(found, fov_y=0.75), true]
sharp = dataclasses.replace(settings, width=240, height=240, sigma=1e-6, gamma=1e-4)
row = np.hstack([softras.render(fish, camera, sharp).color[0] for camera in ways])
Image.fromarray((255 * np.clip(row, 0, 1)).astype(np.uint8)).save("camera.png")
