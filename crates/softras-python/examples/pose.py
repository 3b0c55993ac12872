"""How an object lies: the rotation and translation of a mesh from one picture, by the library's own search. Writes pose.png."""

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
settings = softras.Settings(width=64, height=64, sigma=1e-6, gamma=1e-4, near=2.0, far=5.0)
seen = softras.render(lying, camera, settings)

found = softras.pose(fish, camera, seen.color, seen.silhouette, starts=24)
print(f"off by {found.degrees_to(turn):.2f} degrees; moved by {np.round(found.translation, 3)}, loss {found.loss:.5f}")
views = [softras.render(mesh, camera, settings).color[0] for mesh in (fish, found.applied(fish), lying)]
Image.fromarray((255 * np.clip(np.hstack(views), 0, 1)).astype(np.uint8)).resize((576, 192), 0).save("pose.png")
