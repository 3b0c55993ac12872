"""Fits, poses and measures."""

import os
import signal
import threading
import time

import numpy as np
import pytest

import softras


def views(count):
    return [softras.Camera.from_angles(4.0, 25.0, 360.0 * i / count, fov_y=0.6) for i in range(count)]


@pytest.fixture(scope="module")
def cube_views():
    settings = softras.Settings(width=48, height=48).with_depths_of(softras.shapes.cube(), views(6), 0.5)
    return softras.render(softras.shapes.cube(), views(6), settings)


def test_a_sphere_becomes_a_cube(cube_views):
    seen = []
    result = softras.fit(
        softras.shapes.icosphere(3),
        views(6),
        silhouette=cube_views.silhouette,
        steps=80,
        rate=(0.04, 0.007),
        sigma=(3e-4, 3e-5),
        progress=lambda step, loss: seen.append((step, loss)),
    )
    losses = result.losses["loss"]
    assert losses.shape == (80,) and losses[-1] < 0.3 * losses[0]
    settings = softras.Settings(width=48, height=48).with_depths_of(softras.shapes.cube(), views(6), 0.5)
    silhouette = softras.render(result.mesh, views(6), settings).silhouette
    assert (softras.mask_iou(silhouette, cube_views.silhouette) > 0.88).all()
    assert seen[-1] == (80, losses[-1]) and 0 <= result.step < 80 and "loss" in repr(result)


def test_colors_are_fitted_too(cube_views):
    gray = softras.shapes.icosphere(2)
    gray = gray.with_look(colors=np.full_like(gray.positions, 0.5))
    given = {"silhouette": cube_views.silhouette, "color": cube_views.color, "steps": 5}
    result = softras.fit(gray, views(6), **given)
    assert (result.last.colors != 0.5).any() and result.losses["color"][-1] < result.losses["color"][0]


def test_a_mesh_of_one_colour_is_fitted_by_vertices():
    target = softras.shapes.icosphere(1)
    colors = np.where(target.positions[:, :1] > 0, [1.0, 0.0, 0.0], [0.0, 0.0, 1.0])
    cameras = [softras.Camera.from_angles(3.0, 20.0, angle, fov_y=0.8) for angle in (0.0, 120.0, 240.0)]
    settings = softras.Settings(width=24, height=24, sigma=1e-4, background="composite").with_depths_of(target, cameras)
    images = softras.render(target.with_look(colors=colors), cameras, settings)
    given = {"silhouette": images.silhouette, "color": images.color, "settings": settings, "steps": 10}
    plain = softras.Mesh(target.positions, target.triangles)
    assert softras.fit(plain, cameras, **given).mesh.colors.shape == (len(target.positions), 3)
    assert softras.fit(plain, cameras, fit_colors="one", **given).mesh.colors.shape == (3,)


def test_a_step_of_some_of_the_views(cube_views):
    def losses(count):
        given = {"silhouette": cube_views.silhouette, "steps": 3, "rate": (1e-9, 1e-9), "views_per_step": count}
        return softras.fit(softras.shapes.icosphere(2), views(6), sigma=(1e-4, 1e-4), **given).losses["silhouette"]

    every, some = losses(0), losses(2)
    # Three steps of two views each have compared all six.
    np.testing.assert_allclose(np.mean(some), np.mean(every), rtol=1e-4)
    assert np.ptp(some) > 1e-4


def test_masks_are_decoded_or_refused(cube_views):
    ball, camera = softras.shapes.icosphere(2), views(6)
    mask = cube_views.silhouette > 0.5
    settings = softras.Settings(width=48, height=48).with_depths_of(softras.shapes.cube(), camera, 0.5)

    def losses(mask, color=None):
        return softras.deform(ball, camera, silhouette=mask, color=color, settings=settings, steps=2).losses["loss"]

    expected = losses(mask.astype(float))
    for kind in (mask, mask.astype(np.int64), mask.astype(np.uint8), 255 * mask.astype(np.uint8), 65535 * mask.astype(np.uint16)):
        np.testing.assert_array_equal(losses(kind), expected)
    given = {"silhouette": cube_views.silhouette[:1], "color": cube_views.color[:1]}
    for bad in (255.0 * mask, 255 * mask.astype(int), 255 * mask.astype(np.uint16), 2 * mask.astype(np.uint8), -1.0 * mask, mask * np.nan):
        calls = [
            lambda: losses(bad),
            lambda: softras.Views(camera, silhouette=bad).fit(steps=1),
            lambda: softras.pose(ball, camera[0], **{**given, "silhouette": bad[:1]}),
            lambda: softras.mask_iou(bad, mask),
            lambda: softras.blurred_mask(bad, 1e-3),
        ]
        for call in calls:
            with pytest.raises(softras.errors.InputError, match="give bools, floats from 0 to 1"):
                call()
    picture = (255 * cube_views.color.clip(0, 1)).astype(np.uint8)
    linear = np.where(picture > 10.31, ((picture / 255 + 0.055) / 1.055) ** 2.4, picture / 255 / 12.92)
    np.testing.assert_allclose(losses(mask, picture), losses(mask, linear), rtol=1e-6)
    for bad in (255.0 * picture, picture.astype(int), picture > 3):
        with pytest.raises(softras.errors.InputError, match="color: .* give floats of linear light"):
            losses(mask, bad)


def endless_fit(cube_views, **given):
    softras.fit(softras.shapes.icosphere(3), views(6), silhouette=cube_views.silhouette, steps=1_000_000, **given)


def endless_pose(cube_views, **given):
    one = {"color": cube_views.color[:1], "silhouette": cube_views.silhouette[:1]}
    softras.pose(softras.shapes.cube(), views(6)[0], **one, starts=2, steps=1_000_000, **given)


@pytest.fixture
def heeds_ctrl_c():
    """A shell has its background jobs ignore the signal, and Python leaves it so: the work would never end."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.skipif(not hasattr(signal, "pthread_kill"), reason="this system cannot send the signal")
@pytest.mark.parametrize("endless", [endless_fit, endless_pose])
def test_ctrl_c_ends_it(heeds_ctrl_c, cube_views, endless):
    main, before = threading.main_thread().ident, softras.render(softras.shapes.cube(), views(2)).color
    timer = threading.Timer(0.5, lambda: signal.pthread_kill(main, signal.SIGINT))
    timer.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            endless(cube_views)
    finally:
        timer.join()
    np.testing.assert_array_equal(softras.render(softras.shapes.cube(), views(2)).color, before)


@pytest.mark.parametrize("endless", [endless_fit, endless_pose])
def test_progress_tells_steps_and_losses(cube_views, endless):
    seen = []

    def enough(step, loss):
        seen.append((step, loss))
        if step >= 20:
            raise LookupError("enough")

    with pytest.raises(LookupError):
        endless(cube_views, progress=enough)
    steps, losses = zip(*seen)
    assert list(steps) == sorted(set(steps)) and steps[-1] == 20 and np.isfinite(losses).all()
    # The renderer goes on.
    assert softras.render(softras.shapes.cube(), views(2)).silhouette.any()


def test_a_pose_is_found():
    cube, camera = softras.shapes.cube(), softras.Camera.look_at((0, 0, 5), (0, 0, 0), fov_y=0.5)
    a = 0.7
    turn = np.array([[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]])
    truth = cube.with_positions(cube.positions @ turn.T + [0.1, 0.0, 0.0])
    seen = softras.render(truth, camera, softras.Settings(width=32, height=32, sigma=1e-6))
    found = softras.pose(cube, camera, seen.color, seen.silhouette, starts=8, steps=100)
    assert found.degrees_to(turn) < 3.0 and np.abs(found.translation - [0.1, 0, 0]).max() < 0.06
    np.testing.assert_allclose(found.applied(cube).positions, truth.positions, atol=0.1)
    better = softras.pose(cube, camera, seen.color, seen.silhouette, start=(found.rotation, found.translation), steps=60)
    assert better.degrees_to(turn) < 3.0


def test_a_pose_is_found_where_the_mesh_was_thin():
    # Turned by a quarter, it reaches much farther towards the camera.
    cube, camera = softras.shapes.cube(), softras.Camera.look_at((0, 0, 5), (0, 0, 0), fov_y=0.5)
    plank = cube.with_positions(cube.positions * [1.6, 0.5, 0.3])
    turn = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    seen = softras.render(plank.with_positions(plank.positions @ turn.T), camera, softras.Settings(width=32, height=32))
    off = np.radians(12.0)
    near = turn @ np.array([[np.cos(off), 0, np.sin(off)], [0, 1, 0], [-np.sin(off), 0, np.cos(off)]])
    found = softras.pose(plank, camera, seen.color, seen.silhouette, start=(near, np.zeros(3)), steps=80)
    assert found.degrees_to(turn) < 3.0


def test_measures():
    cube, sphere = softras.shapes.cube(), softras.shapes.icosphere(2)
    assert softras.iou(cube, cube) == 1.0 and 0.4 < softras.iou(cube, sphere) < 0.8
    voxels = softras.voxelize(cube.with_positions(cube.positions * [1.0, 0.5, 0.25]), 8, (-1, -1, -1), 2.0)
    assert voxels.dtype == bool and [voxels.any(axis).sum() for axis in ((1, 2), (0, 2), (0, 1))] == [4, 2, 2]
    assert softras.is_closed(cube) and not softras.is_closed(softras.Mesh(cube.positions, cube.triangles[1:]))
    mask = np.zeros((1, 8, 8), np.float32)
    mask[:, 2:6, 2:6] = 1.0
    assert softras.mask_iou(mask, mask).tolist() == [1.0]
    soft = softras.blurred_mask(mask, 1e-2)
    assert soft.shape == mask.shape and 0.0 < soft[0, 1, 4] < soft[0, 2, 4]
    assert len(softras.remesh(sphere, 0.15).triangles) > len(sphere.triangles)


def test_a_check_finds_the_device_right(renderer):
    found = softras.check(renderer)
    assert len(found) > 3 and all(one.passes and one.repeats for one in found), found
    assert any("positions" in one.gradients for one in found) and any("depth" in one.images for one in found)


def test_remeshing_stops_at_ctrl_c(heeds_ctrl_c):
    ball, before = softras.shapes.icosphere(3), len(os.listdir("/proc/self/task"))
    timer = threading.Timer(0.3, signal.raise_signal, [signal.SIGINT])
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        softras.remesh(ball, 0.004)
    timer.join()
    # The work ends too: its thread is gone.
    end = time.monotonic() + 60
    while len(os.listdir("/proc/self/task")) > before and time.monotonic() < end:
        time.sleep(0.1)
    assert len(os.listdir("/proc/self/task")) <= before
    assert len(softras.remesh(ball, 0.3).triangles) < len(ball.triangles)
