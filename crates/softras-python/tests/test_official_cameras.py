"""The official outputs through every camera mode of softras.soft_renderer.

The recorded cases begin on the screen. Here their corners are taken back into the world by each camera's inverse, in double
precision, and `SoftRenderer` has to bring the official image and gradient back from there.
"""

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="torch is not installed: test.sh --with torch adds it")
import softras.soft_renderer as sr  # noqa: E402

CASES = ["tiny_s0.001_g0.01", "tiny_mode_barycentric", "tiny_mode_batch2", "sphere_s0.0001_g0.0001", "spot_s0.0001_g0.0001"]
EYE, DIRECTION = np.array([0.7, 1.1, -2.3]), np.array([-0.2, -0.35, 0.9])
MATRIX = np.array([[300.0, 0, 250], [0, 310, 262], [0, 0, 1]])
DISTORTION = np.array([2e-7, -1e-13, 1e-5, -2e-5, 1e-20])
SIZE = 512


def axes(forward):
    """The rows x, y and z of a view: z along `forward`, y up."""
    z = forward / np.linalg.norm(forward)
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z])


def from_view(corners, forward, perspective):
    """World coordinates of what a camera at EYE with half an angle of 25 degrees, or a scale of 0.8, sees on the screen."""
    x, y, z = np.moveaxis(corners, -1, 0)
    size = z * np.tan(np.radians(25.0)) if perspective else 1 / 0.8
    return np.stack([x * size, y * size, z], -1) @ axes(forward) + EYE


def from_pixels(corners, distortion):
    """World coordinates of what the matrix of `projection` brings to the screen."""
    k1, k2, p1, p2, k3 = distortion
    x, y, z = np.moveaxis(corners, -1, 0)
    seen = np.stack([(x + 1) * SIZE / 2, (y + 1) * SIZE / 2])
    a, b = seen
    # The distortion is small: what it adds is subtracted until nothing changes.
    for _ in range(50):
        r = a * a + b * b
        radial = 1 + k1 * r + k2 * r**2 + k3 * r**3
        a = (seen[0] - 2 * p1 * a * b - p2 * (r + 2 * a * a)) / radial
        b = (seen[1] - p1 * (r + 2 * b * b) - 2 * p2 * a * b) / radial
    view = np.stack([a * (z + 1e-5), b * (z + 1e-5), z], -1) @ np.linalg.inv(MATRIX).T
    return view @ axes(DIRECTION) + EYE


def projection(distortion):
    turn = axes(DIRECTION)
    matrix = torch.tensor(MATRIX @ np.hstack([turn, -turn @ EYE[:, None]]))[None]
    return {"P": matrix, "dist_coeffs": torch.tensor(distortion)[None], "orig_size": SIZE}


VIEW = {"eye": EYE.tolist(), "viewing_angle": 25.0, "viewing_scale": 0.8}
MODES = {
    "look_at": (VIEW, lambda corners: from_view(corners, -EYE, True)),
    "look_at, orthogonal": ({**VIEW, "perspective": False}, lambda corners: from_view(corners, -EYE, False)),
    "look": ({**VIEW, "camera_direction": DIRECTION.tolist()}, lambda corners: from_view(corners, DIRECTION, True)),
    "look, orthogonal": (
        {**VIEW, "camera_direction": DIRECTION.tolist(), "perspective": False},
        lambda corners: from_view(corners, DIRECTION, False),
    ),
    "projection": (projection(0 * DISTORTION), lambda corners: from_pixels(corners, 0 * DISTORTION)),
    "projection, distorted": (projection(DISTORTION), lambda corners: from_pixels(corners, DISTORTION)),
}


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", CASES)
def test_every_camera_mode_gives_the_recorded_image(recorded, name, mode):
    data = np.load(recorded / f"{name}.npz")
    batch, count = data["face_vertices"].shape[:2]
    camera, into_world = MODES[mode]
    if mode.startswith("projection"):
        camera = {**camera, **{key: torch.cat([camera[key]] * batch) for key in ("P", "dist_coeffs")}}
    options = {key[4:]: data[key].tolist() for key in data.files if key.startswith("opt_")}
    light = {"light_intensity_ambient": 1.0, "light_intensity_directionals": 0.0}
    renderer = sr.SoftRenderer(camera_mode=mode.split(",")[0], **camera, **light, **options)
    world = into_world(data["face_vertices"].astype(np.float64)).reshape(batch, 3 * count, 3)
    vertices = torch.from_numpy(world).requires_grad_()
    faces = torch.arange(3 * count).reshape(1, count, 3).repeat(batch, 1, 1)
    colors = torch.from_numpy(data["textures"]).reshape(batch, 3 * count, 3)
    mesh = sr.Mesh(vertices, faces, colors, texture_type="vertex")
    screen = renderer.transform(sr.Mesh(vertices, faces)).vertices
    np.testing.assert_allclose(screen.detach().reshape(data["face_vertices"].shape), data["face_vertices"], atol=1e-6)
    image = renderer.render_mesh(mesh)
    within = (np.abs(image.detach().numpy() - data["soft_colors"]) <= 2e-4).mean()
    assert within >= 0.995, f"{within:.4%} of the values are within 2e-4"
    (gradient,) = torch.autograd.grad(image, vertices, torch.from_numpy(data["grad_soft_colors"]))
    (expected,) = torch.autograd.grad(screen, vertices, torch.from_numpy(data["grad_face_vertices"]).reshape(screen.shape))
    assert (gradient - expected).norm() < 2e-2 * expected.norm()
