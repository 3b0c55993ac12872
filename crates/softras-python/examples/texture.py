"""A texture from pictures: a grey fish gets its colours back. Writes textured.obj and texture.png."""

import numpy as np
import torch
from PIL import Image

import softras
import softras.torch as st

fish = softras.shapes.fish()
cameras = [softras.Camera.from_angles(2.6, 35.0 * (-1) ** i, 45.0 * i, fov_y=0.8) for i in range(8)]
settings = softras.Settings(
    width=160, height=160, sigma=1e-5, gamma=1e-3, outputs=("color",), interpolation="perspective"
).with_depths_of(fish, cameras)
target = torch.tensor(softras.render(fish, cameras, settings).color)

# Logits, so that colours stay within [0, 1].
logits = torch.zeros(256, 256, 3, requires_grad=True)
vertices, uvs = torch.tensor(fish.positions), torch.tensor(fish.uvs)
optimizer = torch.optim.Adam([logits], lr=0.1)
for step in range(100):
    images = st.render(
        vertices,
        fish.triangles.astype(np.int64),
        cameras,
        textures=torch.sigmoid(logits),
        uvs=uvs,
        uv_faces=fish.uv_triangles,
        settings=settings,
    )
    loss = (images.color - target).abs().mean()
    optimizer.zero_grad()
    loss.backward()
    optimizer.step()
    if step % 20 == 0:
        print(f"step {step}: mean difference {loss.item():.4f}")

print(f"at last: mean difference {loss.item():.4f}")
fish.with_look(textures=torch.sigmoid(logits).detach(), uvs=uvs, uv_triangles=fish.uv_triangles).save("textured.obj")
rows = [np.hstack(target[:4]), np.hstack(images.color[:4].detach())]
Image.fromarray((255 * np.clip(np.vstack(rows), 0, 1)).astype(np.uint8)).save("texture.png")
