"""Vertex colours by gradient descent, with numpy alone. Writes colors.png."""

import numpy as np
from PIL import Image

import softras

torus = softras.shapes.torus()
cameras = [softras.Camera.from_angles(2.8, 30.0, azimuth, fov_y=0.9) for azimuth in (0.0, 90.0, 180.0, 270.0)]
settings = softras.Settings(width=128, height=128, sigma=1e-5, gamma=1e-3).with_depths_of(torus, cameras)
target = softras.render(torus, cameras, settings).color

colors = np.full_like(torus.positions, 0.5)
for step in range(60):
    frame = softras.render(torus.with_look(colors=colors), cameras, settings, save=True)
    difference = frame.color - target
    gradients = frame.backward(color=2 * difference, by="colors")
    # A vertex's gradient, and so its step, grows with the number of pixels that show its colour.
    colors -= 0.02 * gradients.meshes[0].colors
    if step % 20 == 0:
        print(f"step {step}: loss {np.square(difference).mean():.6f}")

print(f"at last: loss {np.square(difference).mean():.6f}")
rows = [np.hstack(target), np.hstack(frame.color)]
Image.fromarray((255 * np.clip(np.vstack(rows), 0, 1)).astype(np.uint8)).save("colors.png")
