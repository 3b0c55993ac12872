"""How an object lies: the rotation and translation of a mesh from one picture, by the library's own search. Writes pose.png."""

import dataclasses

import numpy as np
from PIL import Image

import softras

fish = softras.shapes.fish()
camera = softras.Camera.look_at((0, 0, 3.4), (0, 0, 0), fov_y=0.7)

# The picture: the fish turned by 130 degrees and moved.
axis, angle = np.array([0.3, 0.9, 0.1]) / np.linalg.norm([0.3, 0.9, 0.1]), np.radians(130)
cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
turn = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
lying = fish.with_positions(fish.positions @ turn.T + [0.1, -0.05, 0.0])
settings = softras.Settings(width=64, height=64, sigma=1e-6).with_depths_of([fish, lying], [camera, camera])
seen = softras.render(lying, camera, settings)

found = softras.pose(fish, camera, seen.color, seen.silhouette, starts=24)
off = np.linalg.norm(found.applied(fish).positions - lying.positions, axis=1).mean()
print(f"off by {found.degrees_to(turn):.2f} degrees and {off:.4f} of a fish 2 long; loss {found.loss:.5f}")

# The fish as it was loaded, as it was found, and as it lies.
sharp = dataclasses.replace(settings, width=240, height=240)
views = [softras.render(mesh, camera, sharp).color[0] for mesh in (fish, found.applied(fish), lying)]
Image.fromarray((255 * np.clip(np.hstack(views), 0, 1)).astype(np.uint8)).save("pose.png")
