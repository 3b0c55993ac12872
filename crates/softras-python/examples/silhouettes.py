"""A mesh from silhouettes: a sphere becomes a fish. Writes fitted.obj and silhouettes.png."""

import dataclasses

import numpy as np
import torch
from PIL import Image

import softras
import softras.torch as st

# The targets, which would be photographs' masks: a fish from twelve sides.
cameras = [softras.Camera.from_angles(3.0, 30.0 * (-1) ** i, 30.0 * i, fov_y=0.8) for i in range(12)]
settings = softras.Settings(width=96, height=96, sigma=1e-4, outputs=("silhouette",))
target = torch.tensor(softras.render(softras.shapes.fish(), cameras, settings).silhouette)

sphere = softras.shapes.icosphere(3)
faces = torch.tensor(sphere.triangles.astype(np.int64))
vertices = torch.tensor(0.7 * sphere.positions, requires_grad=True)
optimizer = torch.optim.Adam([vertices], lr=0.01)
for step in range(300):
    silhouette = st.render(vertices, faces, cameras, settings=settings).silhouette
    loss = st.iou_loss(silhouette, target) + 0.03 * st.laplacian_loss(vertices, faces)
    optimizer.zero_grad()
    loss.backward()
    optimizer.step()
    if step % 50 == 0:
        print(f"step {step}: loss {loss.item():.4f}")

fitted = softras.Mesh(vertices.detach(), faces, colors=[1.0, 0.8, 0.6])
fitted.save("fitted.obj")
ious = softras.mask_iou(softras.render(fitted, cameras, settings).silhouette, target)
print(f"IoU of the silhouettes: {ious.mean():.3f}")

# Above four of the masks, below the fitted mesh from there.
light = softras.DirectionalLight((0.3, 0.8, -0.6), intensity=0.8)
lights = softras.Lights(ambient_intensity=0.3, directional=(light,), shading="smooth")
sharp = dataclasses.replace(settings, sigma=1e-6, outputs=("color",)).with_depths_of(fitted, cameras)
shaded = softras.render(fitted, cameras[:4], sharp, lights).color
rows = [np.hstack(np.repeat(target[:4, ..., None], 3, -1)), np.hstack(shaded)]
Image.fromarray((255 * np.clip(np.vstack(rows), 0, 1)).astype(np.uint8)).save("silhouettes.png")
