"""Images and gradients on numpy arrays."""

import copy
import dataclasses
import inspect
import os
import pathlib
import pickle
import platform
import subprocess
import sys
import threading

import numpy as np
import pytest

import softras
from softras import errors

IMAGES = ("color", "silhouette", "depth", "normal")


def test_images_are_those_of_the_reference(bumpy, cameras, settings):
    frame = softras.render(bumpy, cameras, settings, softras.Lights.official())
    exact = softras.reference.render(bumpy, cameras, settings, softras.Lights.official())
    assert frame.color.shape == (2, 32, 40, 3) and frame.silhouette.shape == (2, 32, 40)
    assert frame.color.dtype == np.float32 and frame.silhouette.max() > 0.99
    for name in IMAGES:
        np.testing.assert_allclose(getattr(frame, name), exact[name], atol=1e-4)
    assert frame.color is frame.color


def test_gradients_are_those_of_the_reference(bumpy, cameras, settings):
    lights = softras.Lights.official()
    frame = softras.render(bumpy, cameras, settings, lights, save=True)
    random = np.random.default_rng(2)
    upstream = {name: random.standard_normal(getattr(frame, name).shape).astype(np.float32) for name in IMAGES}
    by = ("positions", "colors", "cameras", "lights", "background", "scalars")
    found = frame.backward(by=by, **upstream)
    exact = softras.reference.gradient(bumpy, cameras, settings, lights, **upstream)
    pairs = {
        "positions": (found.meshes[0].positions, exact.meshes[0].positions),
        "colors": (found.meshes[0].colors, exact.meshes[0].colors),
        **{name: (getattr(found, name), getattr(exact, name)) for name in ("twists", "projections", "ambient_color")},
        **{name: (getattr(found, name), getattr(exact, name)) for name in ("light_directions", "background", "gamma")},
    }
    for name, (ours, theirs) in pairs.items():
        assert np.linalg.norm(np.subtract(ours, theirs)) < 2e-3 * np.linalg.norm(theirs), name
    assert found.meshes[0].uvs is None and frame.backward(silhouette=upstream["silhouette"]).twists is None


def test_a_batch_of_different_meshes(bumpy, cameras, settings):
    fish = softras.shapes.fish()
    frame = softras.render([bumpy, fish], cameras, settings, save=True)
    alone = softras.render(fish, cameras[1], settings, save=True)
    np.testing.assert_array_equal(frame.color[1], alone.color[0])
    upstream = np.ones_like(alone.color)
    found = alone.backward(color=upstream, by=("texels", "uvs", "positions")).meshes[0]
    assert found.textures[0].shape == fish.textures[0].shape and found.uvs.shape == fish.uvs.shape
    # Gradients have the same bits for the same inputs, and what they are by is one of them.
    found = alone.backward(color=upstream, by=("positions", "colors")).meshes[0]
    frame = softras.render([bumpy, fish], cameras, settings, save=True)
    both = frame.backward(color=np.stack([0 * upstream[0], upstream[0]]), by=("positions", "colors")).meshes
    assert both[0].positions.shape == bumpy.positions.shape and not both[0].positions.any()
    np.testing.assert_array_equal(both[1].positions, found.positions)


def test_several_frames_are_alive(bumpy, cameras, settings):
    other = softras.shapes.torus()
    frames = [softras.render(mesh, cameras, settings, save=True) for mesh in (bumpy, other, bumpy)]
    upstream = np.ones_like(frames[0].silhouette)
    found = [frame.backward(silhouette=upstream).meshes[0].positions for frame in frames]
    np.testing.assert_array_equal(found[0], found[2])
    alone = softras.render(other, cameras, settings, save=True).backward(silhouette=upstream)
    np.testing.assert_array_equal(found[1], alone.meshes[0].positions)
    assert found[1].shape == other.positions.shape


def test_arrays_of_any_kind_are_taken(bumpy, cameras, settings):
    frame = softras.render(bumpy, cameras, settings)
    positions = np.asfortranarray(bumpy.positions.astype(np.float64))
    for triangles in (bumpy.triangles.astype(np.int64), bumpy.triangles.astype(np.int32), bumpy.triangles.tolist()):
        same = softras.Mesh(positions, triangles, colors=bumpy.colors[::-1][::-1])
        np.testing.assert_array_equal(softras.render(same, cameras, settings).color, frame.color)


def test_every_mode_renders(bumpy, cameras, settings):
    plain = softras.render(bumpy, cameras, settings)
    modes = [
        {"color": "hard"},
        {"silhouette": "sum"},
        {"silhouette": "hard"},
        {"distance": "barycentric"},
        {"distance": "hard"},
        {"background": "composite"},
        {"interpolation": "perspective"},
        {"support": "guaranteed", "gamma": 0.05},
        {"parity": "official"},
    ]
    for mode in modes:
        changed = dataclasses.replace(settings, **mode)
        frame, exact = (render(bumpy, cameras, changed) for render in (softras.render, softras.reference.render))
        for name, image in exact.items():
            # A pixel on the border of a hard mode may fall to either side.
            assert (np.abs(getattr(frame, name) - image) > 1e-3).mean() < 2e-3, (mode, name)
        assert any((getattr(frame, name) != getattr(plain, name)).any() for name in IMAGES), mode
    depth = softras.render(bumpy, cameras, dataclasses.replace(settings, outputs=("depth",)))
    assert depth.color is None and (depth.depth == plain.depth).all()
    front = softras.render(bumpy, cameras, dataclasses.replace(settings, faces="front")).depth
    away = dataclasses.replace(settings, faces="front", front_face="clockwise")
    assert (softras.render(bumpy, cameras, away).depth != front).any()


def test_cameras_of_other_conventions_are_the_same_camera(bumpy, settings):
    width, height = settings.width, settings.height
    fov_y, near, far = 0.8, 0.5, 20.0
    own = softras.Camera.from_angles(3.5, 20.0, 10.0, fov_y=fov_y)
    view = np.vstack([own.view, [0.0, 0.0, 0.0, 1.0]])
    f = height / 2 / np.tan(fov_y / 2)
    opencv = np.diag([1.0, -1.0, 1.0, 1.0]) @ view
    opengl = np.diag([1.0, 1.0, -1.0, 1.0]) @ view
    pytorch3d = np.diag([-1.0, 1.0, 1.0, 1.0]) @ view
    k = [[f, 0.0, width / 2 - 0.5], [0.0, f, height / 2 - 0.5], [0.0, 0.0, 1.0]]
    a, b = (far + near) / (near - far), 2 * far * near / (near - far)
    clip = [[2 * f / width, 0, 0, 0], [0, 2 * f / height, 0, 0], [0, 0, a, b], [0, 0, -1, 0]]
    same = [
        softras.Camera.from_matrix(own.view, **own.projection),
        softras.Camera.from_opencv(k, opencv[:3, :3], opencv[:3, 3]),
        softras.Camera.from_opengl(opengl, clip, (width, height)),
        softras.Camera.from_pytorch3d(pytorch3d[:3, :3].T, pytorch3d[:3, 3], fov_y=fov_y),
    ]
    expected = softras.render(bumpy, own, settings).color
    for camera in same:
        assert np.abs(softras.render(bumpy, camera, settings).color - expected).max() < 1e-4, camera
    mirror, mirrors = np.diag([-1.0, 1.0, 1.0]), []
    for foreign in (opencv, opengl):
        mirrors.append(lambda foreign=foreign: softras.Camera.from_matrix(foreign, fov_y=fov_y))
    mirrors.append(lambda: softras.Camera.from_opencv(k, mirror @ opencv[:3, :3], opencv[:3, 3]))
    mirrors.append(lambda: softras.Camera.from_opengl(np.diag([-1.0, 1.0, 1.0, 1.0]) @ opengl, clip, (width, height)))
    mirrors.append(lambda: softras.Camera.from_pytorch3d(pytorch3d[:3, :3].T @ mirror, pytorch3d[:3, 3], fov_y=fov_y))
    for call in mirrors:
        with pytest.raises(softras.errors.CameraError, match="from_opencv, from_opengl or from_pytorch3d"):
            call()
    for bad in (np.zeros((3, 3)), np.diag([1.0, 1.0, 0.0]), 2.0 * np.eye(3), np.eye(3) + np.eye(3, k=1), np.full((3, 3), np.nan)):
        doors = [
            lambda: softras.Camera.from_matrix(np.c_[bad @ own.view[:, :3], [0, 0, 3]], fov_y=fov_y),
            lambda: softras.Camera.from_opencv(k, bad, [0, 0, 3]),
            lambda: softras.Camera.from_pytorch3d(bad, [0, 0, 3], fov_y=fov_y),
            lambda: softras.Camera.from_opengl(np.block([[bad, np.ones((3, 1))], [np.zeros((1, 3)), 1]]), clip, (width, height)),
        ]
        for door in doors:
            with pytest.raises(softras.errors.CameraError):
                door()
    assert softras.Camera.from_angles(3, 90, 0, fov_y=fov_y).view[2, 3] == 3
    with pytest.raises(softras.errors.CameraError, match="give another up"):
        softras.Camera.look_at((0, 3, 0), (0, 0, 0), fov_y=fov_y)
    assert softras.Camera.from_matrix(opencv, fov_y=fov_y, mirrored=True).view.shape == (3, 4)
    with pytest.raises(softras.errors.InputError, match="skew"):
        softras.Camera.from_opencv([[1, 2, 3], [0, 1, 0], [0, 0, 1]], np.eye(3), np.zeros(3))


def square(**look):
    """A square of two triangles, each corner with its UV."""
    positions, triangles = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], [[0, 1, 2], [0, 2, 3]]
    if "textures" in look:
        look["uvs"] = [[0, 0], [1, 0], [1, 1], [0, 1]]
    return softras.Mesh(positions, triangles, **look)


def texel(picture):
    return square(textures=picture).textures[0][0, 0]


def test_pictures_are_textures_in_srgb():
    image = pytest.importorskip("PIL.Image").new("RGB", (4, 2), (128, 0, 255))
    for picture in (image, np.asarray(image), [image.convert("RGBA")]):
        assert np.allclose(texel(picture)[:3], [0.21586, 0.0, 1.0], atol=1e-5)
    made = sys.modules["PIL.Image"]
    wide, light = np.full((2, 4), 32896, np.uint16), np.full((2, 4), 0.25, np.float32)
    assert np.allclose(texel(made.fromarray(wide)), 0.21586, atol=1e-5) and np.allclose(texel(made.fromarray(light)), 0.25)
    palette = made.new("P", (4, 2), 0)
    palette.info["transparency"] = 0
    assert texel(palette)[3] == 0
    with pytest.raises(errors.InputError, match="mode I"):
        texel(made.fromarray(wide.astype(np.int32)))


def test_every_array_is_decoded_by_one_rule_or_refused(bumpy, cameras):
    shapes = {"colors": (4, 3), "one colour": (3,), "surface": (2, 1, 3), "texture": (2, 4, 3), "background": (3,)}

    def seen(where, kind, value):
        array = np.full(shapes[where], value, kind)
        if where == "background":
            return softras.render(bumpy, cameras[0], softras.Settings(width=4, height=4, background_color=array)).color[0, 0, 0, 0]
        mesh = square(**{{"texture": "textures", "one colour": "colors"}.get(where, where): array})
        return np.ravel(mesh.textures[0] if where == "texture" else mesh.surface if where == "surface" else mesh.colors)[0]

    for where in shapes:
        for kind, value in (("u1", 128), ("u2", 32896), ("f2", 0.21586), ("f4", 0.21586), ("f8", 0.21586)):
            assert abs(seen(where, kind, value) - 0.21586) < 1e-4, (where, kind)
        assert seen(where, "i8", 1) == 1
        for kind, value in (("i8", 128), ("i4", 2), ("u2", 255), ("?", 1), ("f4", 255), ("f4", np.nan), ("c8", 0.5), ("U3", 1)):
            with pytest.raises(errors.InputError, match="give floats of linear light"):
                seen(where, kind, value)
    assert square(colors=[1, 0, 0]).colors.tolist() == [1, 0, 0]
    positions = bumpy.positions.astype(int)
    places = [
        lambda: softras.Mesh(positions, bumpy.triangles),
        lambda: bumpy.with_positions(positions),
        lambda: bumpy.with_normals(positions),
        lambda: square(textures=np.ones((2, 2, 3))).with_look(textures=np.ones((2, 2, 3)), uvs=np.eye(4, 2, dtype=int)),
        lambda: softras.Views(cameras, depth=np.ones((2, 4, 4), np.uint16), silhouette=np.ones((2, 4, 4))).fit(steps=1),
    ]
    for place in places:
        with pytest.raises(errors.InputError, match="give floats"):
            place()


def test_errors_are_typed_and_tell_the_fix(bumpy, cameras, settings):
    cases = [
        (errors.MeshError, "vertex index 1", lambda: softras.Mesh([[0, 0, 0]], [[0, 1, 0]])),
        (errors.MeshError, "vertex 0", lambda: softras.Mesh([[0, 0, np.nan]], [[0, 0, 0]])),
        (errors.InputError, "[rows, 3]", lambda: softras.Mesh([[0, 0]], [[0, 0, 0]])),
        (errors.InputError, "integer", lambda: softras.Mesh([[0, 0, 0]], [[0.5, 0, 0]])),
        (errors.InputError, "hold -1", lambda: softras.Mesh([[0, 0, 0]], [[-1, 0, 0]])),
        (errors.InputError, "'colour'", lambda: softras.Mesh([[0, 0, 0]], [[0, 0, 0]], colour=1)),
        (errors.CameraError, "fov_y", lambda: softras.Camera.from_angles(3, 0, 0, fov_y=9.0)),
        (errors.InputError, "one projection", lambda: softras.Camera.from_angles(3, 0, 0)),
        (errors.SettingsError, "sigma", lambda: softras.render(bumpy, cameras, softras.Settings(sigma=-1.0))),
        (errors.InputError, '"softmax"', lambda: softras.render(bumpy, cameras, softras.Settings(color="soft"))),
        (errors.SceneError, "cameras", lambda: softras.render([bumpy] * 3, cameras, settings)),
        (errors.LightError, "direction", lambda: lit(softras.DirectionalLight((0.0, 0.0, 0.0)))),
        (errors.IoError, "nowhere.obj", lambda: softras.load("nowhere.obj")),
        (errors.BackwardError, "save=True", lambda: softras.render(bumpy, cameras).backward(color=0)),
        (errors.BackwardError, "shape", lambda: saved().backward(color=np.zeros((1, 2, 3, 3)))),
        (errors.BackwardError, "no image", lambda: saved().backward()),
        (errors.InputError, "colour", lambda: saved().backward(colour=np.zeros(1))),
        (errors.InputError, "vertices", lambda: saved().backward(color=np.zeros((1, 1, 1, 3)), by="vertices")),
        (errors.FitError, "image", lambda: softras.fit(bumpy, cameras, steps=1)),
        (errors.NoDeviceError, "no such device", lambda: softras.Renderer("no such device")),
    ]

    def lit(light):
        return softras.render(bumpy, cameras, settings, softras.Lights(directional=(light,)))

    def saved():
        return softras.render(bumpy, cameras, settings, save=True)

    before = softras.render(bumpy, cameras, settings).color
    for kind, text, call in cases:
        with pytest.raises(kind) as caught:
            call()
        assert text in str(caught.value) and isinstance(caught.value, softras.Error), str(caught.value)
        # The renderer still renders.
        np.testing.assert_array_equal(softras.render(bumpy, cameras, settings).color, before)


def test_a_missing_driver_names_the_package():
    code = "import softras\ntry:\n    softras.Renderer()\nexcept softras.errors.NoDeviceError as error:\n    print(error)"
    # Without any driver manifest the loader finds no device.
    environment = {**os.environ, "VK_DRIVER_FILES": "/nonexistent.json", "VK_ICD_FILENAMES": "/nonexistent.json"}
    result = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=120)
    assert "mesa-vulkan-drivers" in result.stdout, result.stdout + result.stderr
    if sys.platform == "linux" and platform.machine() == "x86_64":
        assert 0 < result.stdout.index("softras-lavapipe (softras[cpu])") < result.stdout.index("mesa-vulkan-drivers"), result.stdout


def test_a_packaged_driver_takes_the_place_of_a_missing_one(tmp_path):
    device = softras.default_renderer().device
    maps = pathlib.Path("/proc/self/maps")
    files = {line[line.index("/") :] for line in maps.read_text().splitlines() if "/libvulkan_lvp" in line} if maps.exists() else ()
    if not files:
        pytest.skip("the device's driver is not lavapipe")

    def opened(driver):
        (tmp_path / "softras_lavapipe.py").write_text(f"DRIVER = {str(driver)!r}\n")
        code = "import softras\nprint(softras.devices()[0].file, softras.Renderer().device, sep='\\n')"
        environment = {**os.environ, "PYTHONPATH": str(tmp_path), "VK_DRIVER_FILES": "/none.json", "VK_ICD_FILENAMES": "/none.json"}
        return subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=120)

    (driver,) = files
    assert opened(driver).stdout.splitlines() == [driver, device]
    text = tmp_path / "text.so"
    text.write_text("no driver")
    error = opened(text).stderr
    assert "softras.errors.FileError" in error and f"{text}: it is no shared library" in error


def test_files_keep_a_mesh(tmp_path, bumpy):
    for mesh in (bumpy, softras.shapes.cube(), softras.shapes.fish()):
        files = mesh.save(tmp_path / "mesh.obj")
        read = softras.load(tmp_path / "mesh.obj")
        np.testing.assert_array_equal(read.positions, mesh.positions)
        np.testing.assert_array_equal(read.triangles, mesh.triangles)
        assert all(path.exists() for path in files) and repr(read) == repr(mesh)
    # A number means one light in any format and look.
    looks = [{"colors": [0.5] * 3}, {"colors": np.full((4, 3), 0.5)}, {"textures": np.full((4, 4, 3), 0.5)}]
    for mesh in [square(**look) for look in looks]:
        view = {"size": 16, "unlit": True, "elevation": 0, "azimuth": 180}
        expected = int(softras.view(mesh, **view)[8, 8, 0])
        for ending in ("obj", "ply", "glb"):
            mesh.save(tmp_path / f"grey.{ending}")
            read = softras.load(tmp_path / f"grey.{ending}")
            for seen in (tmp_path / f"grey.{ending}", read):
                assert abs(int(softras.view(seen, **view)[8, 8, 0]) - expected) < 2, (mesh, seen)
    ply = tmp_path / "mesh.ply"
    ply.write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    )
    assert softras.load(ply).triangles.tolist() == [[0, 1, 2]]
    bumpy.save(tmp_path / "other.PLY")
    np.testing.assert_array_equal(softras.load(tmp_path / "other.PLY").positions, bumpy.positions)
    with pytest.raises(errors.FileError, match=".obj, .ply or .glb"):
        bumpy.save(tmp_path / "other.stl")
    assert not (tmp_path / "other.stl").exists()


def test_pickles_are_equal(tmp_path, bumpy, cameras, settings):
    made = softras.Camera.official(np.eye(3, 4), original_size=64.0), softras.Camera.screen(), *cameras
    # Without perspective a scale that differs by axis is in the view.
    clip = np.diag([0.5, 2.0, -0.1, 1.0])
    made += softras.Camera.from_opengl(np.eye(4), clip, (8, 8)), softras.Camera.from_matrix(np.eye(4), fov_y=0.5, mirrored=True)
    for camera in made:
        again = pickle.loads(pickle.dumps(camera))
        np.testing.assert_array_equal(again.view, camera.view)
        assert again.projection == camera.projection
    textures = [np.full((4, 4, 4), 0.5), np.ones((2, 3, 3))]
    mixed = square(textures=textures, texture_of_triangle=[0, 1], wrap=["repeat", "clamp"])
    assert mixed.wrap == ["repeat", "clamp"] and softras.shapes.fish().wrap == "repeat"
    with pytest.raises(errors.InputError, match="3 names for 2"):
        square(textures=textures, wrap=["clamp"] * 3)
    # A file may have notes, and colours that are brighter than those of arrays.
    ply = "ply\nformat ascii 1.0\nelement vertex 3\n" + "".join(f"property float {n}\n" for n in ("x", "y", "z", "red", "green", "blue", "odd"))
    (tmp_path / "lamp.ply").write_text(
        ply + "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0 900 1 1 7\n1 0 0 1 1 1 7\n0 1 0 1 1 1 7\n3 0 1 2\n"
    )
    parts = ("positions", "triangles", "colors", "surface", "uvs", "uv_triangles", "texture_of_triangle", "normals", "wrap", "notes")
    named = bumpy.with_normals(bumpy.positions), softras.shapes.cube(), softras.shapes.fish(), mixed, softras.load(tmp_path / "lamp.ply")
    for mesh in named:
        for again in (pickle.loads(pickle.dumps(mesh)), copy.copy(mesh), copy.deepcopy(mesh)):
            for part in parts:
                np.testing.assert_array_equal(getattr(again, part), getattr(mesh, part), err_msg=part)
            for texture, own in zip(again.textures or [], mesh.textures or []):
                np.testing.assert_array_equal(texture, own)
    views = softras.Views(cameras, silhouette=np.ones((2, 4, 4)))
    again = pickle.loads(pickle.dumps(views))
    assert (again.silhouette == views.silhouette).all() and (again.cameras[1].view == cameras[1].view).all()
    for plain in (settings, softras.Lights.official()):
        assert pickle.loads(pickle.dumps(plain)) == copy.deepcopy(plain) == plain


def test_a_mesh_may_have_normals(bumpy, cameras, settings):
    lights = dataclasses.replace(softras.Lights.official(), shading="smooth")
    given = 2 * bumpy.positions
    given[0] = 0
    mesh = bumpy.with_normals(given)
    unit = given / np.maximum(np.linalg.norm(given, axis=1, keepdims=True), 1e-9)
    np.testing.assert_allclose(mesh.normals, unit, atol=1e-6)
    plain, own = (softras.render(one, cameras, settings, lights).color for one in (bumpy, mesh))
    assert np.abs(plain - own).max() > 0.02
    np.testing.assert_allclose(own, softras.reference.render(mesh, cameras, settings, lights)["color"], atol=2e-4)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(mesh)).normals, mesh.normals)
    # Normals of another shape would be wrong.
    for without in (bumpy, mesh.with_normals(None), mesh.with_positions(mesh.positions)):
        assert without.normals is None
    with pytest.raises(errors.MeshError, match="2 normals"):
        mesh.with_normals(np.ones((2, 3)))


def test_a_mesh_may_have_features(bumpy, cameras, settings):
    settings = dataclasses.replace(settings, background_color=(0.0, 0.0, 0.0), outputs=("color", "features"))
    given = np.concatenate([bumpy.colors, 2 * bumpy.positions[:, :1]], 1)
    mesh = bumpy.with_features(given)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(mesh)).features, given)
    frame = softras.render(mesh, cameras, settings, save=True)
    assert frame.features.shape == (2, 32, 40, 4)
    np.testing.assert_array_equal(frame.features[..., :3], frame.color)
    upstream = np.random.default_rng(4).standard_normal(frame.features.shape).astype(np.float32)
    found = frame.backward(features=upstream, by=("positions", "features")).meshes[0]
    color = frame.backward(color=upstream[..., :3], by="colors").meshes[0].colors
    np.testing.assert_allclose(found.features[:, :3], color, rtol=1e-5, atol=1e-5)
    assert found.positions.shape == mesh.positions.shape and found.colors is None
    one = softras.render(mesh.with_features(given[:, 3:]), cameras, settings).features
    np.testing.assert_array_equal(one, frame.features[..., 3:])
    assert bumpy.features is None and mesh.with_features(None).features is None
    with pytest.raises(errors.SceneError, match="the meshes have 0 at"):
        softras.render(bumpy, cameras, settings)
    with pytest.raises(errors.MeshError, match="40 features"):
        bumpy.with_features(np.ones((len(given), 40)))
    with pytest.raises(errors.BackwardError, match="features gradient has shape"):
        frame.backward(features=upstream[:1])


def test_threads_have_their_own_renderers(bumpy, cameras, settings):
    expected = softras.render(bumpy, cameras, settings, save=True).color
    found = {}
    # Opened one after the other: validation layers do not stand opening while another thread renders.
    renderers = [softras.Renderer() for _ in range(2)]

    def work(i):
        for _ in range(5):
            frame = renderers[i].render(bumpy, cameras, settings, save=True)
            frame.backward(color=np.ones_like(frame.color))
        found[i] = frame.color

    threads = [threading.Thread(target=work, args=(i,)) for i in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for color in found.values():
        np.testing.assert_array_equal(color, expected)
    assert len(found) == 2


def test_other_threads_run_while_one_renders(bumpy, cameras, settings):
    count, done = 0, threading.Event()

    def render():
        for _ in range(3):
            softras.render(bumpy, cameras * 4, dataclasses.replace(settings, width=256, height=256))
        done.set()

    thread = threading.Thread(target=render)
    thread.start()
    while not done.wait(0.001):
        count += 1
    thread.join()
    assert count > 3


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
def test_a_forked_process_is_refused_and_opens_its_own():
    code = """
import os, softras
renderer, mesh = softras.default_renderer(), softras.shapes.cube()
camera = softras.Camera.from_angles(3, 20, 30, fov_y=0.8)
settings = softras.Settings(width=16, height=16)
expected = softras.render(mesh, camera, settings).color
if os.fork() == 0:
    try:
        renderer.render(mesh, camera, settings)
    except softras.errors.ForkError as error:
        print("spawn" in str(error), (softras.render(mesh, camera, settings).color == expected).all(), flush=True)
    del renderer
    os._exit(0)
os.wait()
"""
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert result.stdout.split() == ["True", "True"], result.stdout + result.stderr


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
def test_a_process_that_was_forked_fits_as_its_parent_did():
    code = """
import os, softras
mesh = softras.shapes.torus()
cameras = [softras.Camera.from_angles(3, 20, 40 * i, fov_y=0.8) for i in range(9)]
settings = softras.Settings(width=32, height=32, sigma=1e-6, background="composite").with_depths_of(mesh, cameras)
def task():
    seen = softras.render(mesh, cameras, settings)
    views = softras.Views(cameras, silhouette=seen.silhouette, color=seen.color)
    exact = softras.reference.render(mesh, cameras[:1], settings)
    checks = [check.passes for check in softras.check()]
    return softras.fit(views, color=True, steps=2).mesh.positions.tobytes(), exact["color"].tobytes(), checks
expected = task()
if os.fork() == 0:
    print(task() == expected, flush=True)
    os._exit(0)
os.wait()
"""
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert result.stdout.split() == ["True"], result.stdout + result.stderr


def test_settings_help_themselves(bumpy, cameras):
    settings = softras.Settings(height=128).with_blur_pixels(4.0)
    assert abs(settings.blur_pixels() - 4.0) < 1e-9
    near = settings.with_depths_of(bumpy, cameras)
    assert 1.5 < near.near < 3.0 and 4.0 < near.far < 6.0
    assert softras.Settings.official(width=8).parity == "official"


def test_everything_tells_what_it_is(bumpy, cameras, settings):
    frame = softras.render(bumpy, cameras, settings, save=True)
    gradients = frame.backward(color=np.zeros_like(frame.color))
    for thing in (bumpy, cameras[0], frame, gradients, gradients.meshes[0], softras.default_renderer()):
        assert repr(thing).startswith(f"softras.{type(thing).__name__}(")


def test_fragments_tell_the_triangle_and_the_point_of_each_pixel(bumpy, cameras, settings):
    found = softras.fragments(bumpy, cameras, settings)
    assert found.triangle.dtype == np.int32 and found.triangle.shape == found.depth.shape == (2, 32, 40)
    shown = found.triangle >= 0
    assert shown.any() and not shown.all() and not found.depth[~shown].any() and not found.barycentrics[~shown].any()
    # The point that is seen lies at its depth.
    points = (found.barycentrics[..., None] * bumpy.positions[bumpy.triangles[found.triangle]]).sum(-2)
    for camera, point, depth, seen in zip(cameras, points, found.depth, shown):
        view = point @ camera.view[2, :3] + camera.view[2, 3]
        assert np.abs(view - depth)[seen].max() < 1e-5
    hard = dataclasses.replace(settings, color="hard", sigma=1e-12, outputs=("depth",))
    assert np.abs(softras.render(bumpy, cameras, hard).depth - found.depth).max() < 1e-4


def test_wrong_arguments_are_named(bumpy, cameras):
    calls = [
        ("positions is None", lambda: softras.Mesh(None, bumpy.triangles)),
        (r"softras.Settings\(\*\*fields\)", lambda: softras.render(bumpy, cameras, {"width": 8})),
        (r"softras.Lights\(\*\*fields\)", lambda: softras.render(bumpy, cameras, None, {"shading": "flat"})),
        ("'colour'", lambda: bumpy.with_look(colour=[1, 1, 1])),
    ]
    for text, call in calls:
        with pytest.raises(softras.errors.InputError, match=text):
            call()
    assert "texture_of_triangle=None" in str(inspect.signature(softras.Mesh))


def test_other_endings_are_no_mesh_files(bumpy, tmp_path):
    with pytest.raises(softras.errors.FileError, match="ends in .obj"):
        bumpy.save(tmp_path / "ball.xyz")
